"""Clock offset between two records of the same motion, such as a radar's track and motion capture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.products import real_inner

Array = NDArray[np.float64]

_SMOOTHING_STEPS = 2.0
"""Standard deviation of the smoothing kernel, in steps of the slower record; slopes then hide the sampling."""

_REACH = 4.0
"""Half width of the smoothing kernel, in standard deviations."""

_GRID = 0.2
"""Step of the common grid, in standard deviations of the kernel."""

_BLOCK = 400_000
"""Samples in the windows of one block of grid points: some 20 MB."""

_SPARSEST = 100.0
"""Largest number of grid points per sample: records with longer gaps mix times of several clocks."""

_SHORTEST_OVERLAP = 20.0
"""Least common time, in standard deviations of the kernel, and ..."""
_LEAST_SHARE = 1.0 / 3.0
"""... as a share of the shorter record: fewer samples may agree by chance."""

_SLOW = 10.0
"""Period [s]; slower changes of the difference have other causes than the offset."""
_MOST_FITS = 8
_FARTHEST = 2.0
"""Distance of the fitted offset from the peak of the correlation, in standard deviations of the kernel."""
_CORRELATED = 8.0
"""Time over which residuals are correlated, in standard deviations of the kernel."""

_LEAST_CORRELATION = 0.5
"""Least correlation of two records of the same motion."""

_RIVAL = 1.5
"""Least misfit of any other offset, relative to the best one ..."""
_MISFIT_FLOOR = 1e-3
"""... after addition of this to both: the ends of the records cause smaller differences."""


@dataclass(frozen=True)
class ClockOffset:
    """Offset between two clocks.

    Attributes
    ----------
    offset : float
        Time of clock a minus time of clock b [s].
    deviation : float
        Standard deviation of the offset [s], from the residuals between both records.
    correlation : float
        Correlation of the smoothed slopes of both records at this offset, at most 1.

    See Also
    --------
    processing.clock_offset : Makes one.

    Examples
    --------
    >>> times = np.arange(0.0, 10.0, 0.05)
    >>> walk = np.cos(times**1.5)
    >>> offset = rc.processing.clock_offset(times, walk, times - 0.4, walk, max_offset=1.0)
    >>> round(offset.offset, 3), round(offset.correlation, 3)
    (0.4, 1.0)
    """

    offset: float
    deviation: float
    correlation: float


@dataclass(frozen=True)
class _Smooth:
    """Smoothed values and slopes on a uniform grid, zero where unknown."""

    start: float
    values: Array
    slopes: Array
    is_known: Array
    """1 or 0."""


def clock_offset(
    times_a: ArrayLike,
    values_a: ArrayLike,
    times_b: ArrayLike,
    values_b: ArrayLike,
    *,
    max_offset: float,
    around: float = 0.0,
    smoothing: float | None = None,
) -> ClockOffset:
    """Clock offset between two records of the same motion, by cross-correlation of their slopes.

    The records may differ in rate, gaps, noise, scale and a constant. Lines are fitted under a moving Gaussian window,
    and their slopes are correlated for every offset. From the peak, a fit of the smoothed values of one record to the
    other refines the offset.

    Parameters
    ----------
    times_a, times_b : (n,), (m,) array_like
        Increasing times of each clock [s].
    values_a, values_b : (n,), (m,) array_like
        Such as the distance of a person from the radar; NaN where unknown.
    max_offset : float
        Largest deviation of the offset from `around` [s].
    around : float
        Expected offset [s], for example between clocks with different epochs.
    smoothing : float, optional
        Standard deviation of the window [s]. Default: two steps of the slower record.

    Raises
    ------
    ValueError
        If the offset is not observable: values are constant, vary differently, repeat so that several offsets fit
        equally well, overlap too little, or fit best at the largest offset.

    See Also
    --------
    processing.ClockOffset : The result.
    compare : Estimates it between recordings and truth, with ``offset="auto"``.

    Examples
    --------
    >>> times = np.arange(0.0, 10.0, 0.05)
    >>> walk = np.cos(times**1.5)  # seen by both; the second clock is 0.4 s behind
    >>> round(rc.processing.clock_offset(times, walk, times - 0.4, walk, max_offset=1.0).offset, 3)
    0.4
    """
    limit = check.positive("max_offset", max_offset, "s")
    a, b = _record("a", times_a, values_a), _record("b", times_b, values_b)
    steps = [float(np.median(np.diff(times))) for times, _ in (a, b)]
    width = _SMOOTHING_STEPS * max(steps) if smoothing is None else check.positive("smoothing", smoothing, "s")
    if width < 0.5 * max(steps):
        raise ValueError(f"smoothing: expected at least {0.5 * max(steps):g} s, half a step, got {width:g} s")
    step = _GRID * width
    first, second = (_smoothed(name, *record, width, step) for name, record in (("a", a), ("b", b)))

    # Offsets at whole steps from the offset between the first samples.
    base = first.start - second.start
    center = check.number("around", around, "s")
    least, most = np.floor((center - limit - base) / step), np.ceil((center + limit - base) / step)
    lags = np.arange(max(least, -len(second.values)), min(most, len(first.values)) + 1).astype(int)
    correlation = _correlations(first, second, lags, _SHORTEST_OVERLAP * width / step)
    if np.isnan(correlation).all():
        raise ValueError(f"max_offset: expected records that overlap within {limit:g} s, got none for long enough")
    best = int(np.nanargmax(correlation))
    _check_peak(correlation, best, base + step * lags, center, limit)
    lag, deviation = _fitted(first, second, int(lags[best]), step, width)
    return ClockOffset(float(base + step * lag), step * deviation, float(correlation[best]))


def _record(name: str, times: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    """Known values and their times."""
    when = check.increasing(f"times_{name}", times)
    what = check.numbers(f"values_{name}", values, when.shape)
    if np.isinf(what).any():
        raise ValueError(f"values_{name}: expected finite numbers or NaN, got inf")
    is_known = ~np.isnan(what)
    if is_known.sum() < 4:
        raise ValueError(f"values_{name}: expected at least 4 that are not NaN, got {int(is_known.sum())}")
    return when[is_known], what[is_known] - np.mean(what[is_known])


def _smoothed(name: str, times: Array, values: Array, width: float, step: float) -> _Smooth:
    """Slopes of lines fitted to the values under a Gaussian window that moves over a grid."""
    num_points = (times[-1] - times[0]) / step
    if num_points > _SPARSEST * len(times):
        k = int(np.diff(times).argmax())
        raise ValueError(
            f"times_{name}: expected times of one record, got {len(times)} samples over {times[-1] - times[0]:g} s, "
            f"with nothing between {times[k]:g} and {times[k + 1]:g} s"
        )
    grid = times[0] + step * np.arange(int(num_points) + 1)
    most = np.searchsorted(times, times + 2.0 * _REACH * width, side="right") - np.arange(len(times))  # in a window
    blocks = np.array_split(grid, 1 + len(grid) * int(most.max()) // _BLOCK)
    total, middle, moment, mean, product = np.hstack([_moments(times, values, block, width) for block in blocks])
    # At ends and gaps the samples lie on one side of the window, and the slope belongs to another time.
    typical = width * np.sqrt(2.0 * np.pi) / np.median(np.diff(times))
    is_known = (total > 0.7 * typical) & (np.abs(middle) < 0.1 * width)
    slopes = np.where(is_known, product / np.where(moment > 0.0, moment, 1.0), 0.0)
    if is_known.sum() < 3:
        raise ValueError(
            f"times_{name}: expected stretches longer than {2.0 * _REACH * width:g} s without gaps, got none"
        )
    # Rounding errors of constant values are not motion.
    if np.ptp(slopes[is_known]) <= 1e-9 * np.abs(values).max() / width:
        raise ValueError(f"values_{name}: expected values whose slope varies, got a constant slope")
    smooth = np.where(is_known, mean - slopes * middle, 0.0)
    return _Smooth(float(times[0]), smooth, slopes, is_known.astype(np.float64))


def _moments(times: Array, values: Array, grid: Array, width: float) -> Array:
    """Weight, mean and variance of times, mean of values and covariance in the window at each grid point, (5, n)."""
    reach = _REACH * width
    begin, end = np.searchsorted(times, grid - reach), np.searchsorted(times, grid + reach, side="right")
    near = begin[:, None] + np.arange(max(int((end - begin).max()), 1))
    is_near = near < end[:, None]
    near = np.minimum(near, len(times) - 1)
    away, value = times[near] - grid[:, None], values[near]
    weight = np.where(is_near, np.exp(-0.5 * np.square(away / width)), 0.0)
    total = np.maximum(weight.sum(axis=1), np.finfo(float).tiny)
    middle, mean = ((weight * one).sum(axis=1) / total for one in (away, value))
    away = away - middle[:, None]
    moment, product = ((weight * away * one).sum(axis=1) / total for one in (away, value))
    return np.stack([total, middle, moment, mean, product])


def _correlations(a: _Smooth, b: _Smooth, lags: NDArray[np.int_], shortest: float) -> Array:
    """Correlation coefficient per lag over the common known samples; NaN for too few."""
    size = len(a.slopes) + len(b.slopes)

    def sums(x: Array, y: Array) -> Array:
        """Sums of ``x[k + lag] y[k]``, zero where they do not overlap."""
        product = np.fft.irfft(np.fft.rfft(x, size) * np.conj(np.fft.rfft(y, size)), size)
        is_within = (lags < len(x)) & (lags > -len(y))
        return np.where(is_within, product[np.where(is_within, lags, 0)], 0.0)

    # Normalised slopes.
    u, v = (one.slopes / np.sqrt(np.square(one.slopes).sum() / one.is_known.sum()) for one in (a, b))
    number = np.round(sums(a.is_known, b.is_known))
    count = np.maximum(number, 1.0)
    mean_u, mean_v = sums(u, b.is_known) / count, sums(a.is_known, v) / count
    variance_u = sums(u * u, b.is_known) / count - mean_u**2
    variance_v = sums(a.is_known, v * v) / count - mean_v**2
    covariance = sums(u, v) / count - mean_u * mean_v
    least = max(shortest, _LEAST_SHARE * min(a.is_known.sum(), b.is_known.sum()))
    is_enough = (number >= least) & (np.minimum(variance_u, variance_v) > 1e-9)
    return np.where(is_enough, covariance / np.sqrt(np.where(is_enough, variance_u * variance_v, 1.0)), np.nan)


def _check_peak(correlation: Array, best: int, offsets: Array, center: float, limit: float) -> None:
    """Raise ValueError for peaks that do not determine the offset."""
    highest = correlation[best]
    if highest < _LEAST_CORRELATION:
        raise ValueError(
            f"values_b: expected the motion of values_a, got a correlation of {highest:.2f} at most within {limit:g} s"
        )
    around = correlation[max(best - 1, 0) : best + 2]
    if len(around) < 3 or np.isnan(around).any() or abs(offsets[best] - center) > limit:
        raise ValueError(
            f"max_offset: expected the best offset within {limit:g} s and the overlap, got it at the end, "
            f"{offsets[best]:.3g} s: allow more, or give longer records"
        )
    others = np.where(np.isnan(correlation), -np.inf, correlation)
    rival = rival_peak(others, best)
    if rival is None:
        return
    misfit, other = (1.0 - value + _MISFIT_FLOOR for value in (highest, others[rival]))
    if other < _RIVAL * misfit:
        raise ValueError(
            f"values_a: expected a motion that fits at one offset only, got two, {offsets[best]:.3g} and "
            f"{offsets[rival]:.3g} s (correlations {highest:.3f} and {others[rival]:.3f}); give a smaller max_offset "
            f"or a motion that does not repeat itself"
        )


def rival_peak(values: Array, best: int) -> int | None:
    """Index of the highest value outside of the slopes of a peak; None without such a value.

    Parameters
    ----------
    values : (n,) float64
        Without NaN.
    best : int
        Index of the peak.
    """
    # The slopes of the peak end at the first minimum on each side.
    before = np.flatnonzero(values[:best] > values[1 : best + 1])
    after = np.flatnonzero(values[best + 1 :] > values[best:-1])
    left = int(before[-1]) + 1 if before.size else 0
    right = best + int(after[0]) + 1 if after.size else len(values)
    beyond = np.concatenate([np.arange(left), np.arange(right, len(values))])
    return int(beyond[values[beyond].argmax()]) if beyond.size else None


def _fitted(a: _Smooth, b: _Smooth, peak: int, step: float, width: float) -> tuple[float, float]:
    """Lag with the best agreement of both values, up to a scale and slow changes, and its standard deviation.

    The values have white noise, unlike the slopes: the peak of the slopes' correlation is five times as uncertain.
    """
    whole = peak
    for _ in range(_MOST_FITS):
        begin, end = max(whole, 0), min(len(a.values), len(b.values) + whole)
        here, there = slice(begin, end), slice(begin - whole, end - whole)
        is_known = (a.is_known[here] * b.is_known[there]) > 0.0
        # Values of a as a sum of scaled values of b, slopes of b times the residual lag, and slow changes.
        phase = np.linspace(0.0, np.pi, end - begin)[is_known]
        num_slow = int(2.0 * step * (end - begin) / _SLOW)
        slow = np.cos(phase[:, None] * np.arange(num_slow + 1))
        basis = np.column_stack([b.values[there][is_known], step * b.slopes[there][is_known], slow])
        found = _least_squares(basis, a.values[here][is_known])
        rest = -found[1] / found[0] if found[0] > 0.0 else np.inf
        if abs(whole + rest - peak) > _FARTHEST / _GRID:
            raise ValueError(
                "values_b: expected the motion of values_a, got values that agree at another offset than their slopes"
            )
        if abs(rest) <= 1.0:
            break
        whole += round(rest)
    # Contribution of each sample's residual to the lag; neighbours are correlated over the window.
    residual = a.values[here][is_known] - basis @ found
    others = np.delete(basis, 1, axis=1)
    slope = basis[:, 1] - others @ _least_squares(others, basis[:, 1])
    parts = np.zeros(end - begin)
    parts[is_known] = slope * residual / (found[0] * real_inner(slope, slope))
    reach = min(round(_CORRELATED * width / step), len(parts) - 1)
    # Newey & West, "A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent covariance
    # matrix": weights that fall with the distance.
    sums = [(1.0 - k / (reach + 1)) * real_inner(parts[k:], parts[:-k]) for k in range(1, reach + 1)]
    return whole + rest, float(np.sqrt(real_inner(parts, parts) + 2.0 * sum(sums)))


def _least_squares(basis: Array, values: Array) -> Array:
    """Coefficients of the columns of a basis by least squares (normal equations)."""
    scale = np.sqrt(np.square(basis).sum(axis=0))
    scaled = basis / np.where(scale > 0.0, scale, 1.0)
    gram, moments = (np.einsum("nk,n...->k...", scaled, other) for other in (scaled, values))
    return np.asarray(np.linalg.lstsq(gram, moments)[0] / np.where(scale > 0.0, scale, 1.0))
