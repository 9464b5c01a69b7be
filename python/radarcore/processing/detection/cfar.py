"""Constant false-alarm rate detection (CFAR)."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check

METHODS = ("ca", "os")
"""Cell averaging, ordered statistic."""

_FEW_CELLS = 4
"""Guard cells of a main lobe: so few may cover a whole map."""

DEFAULT_RANK = 0.75
"""Rank of the ordered statistic, as a part of the training cells (Rohling 1983: three quarters)."""


def cfar(
    power: ArrayLike,
    *,
    guard: int | Sequence[int],
    training: int | Sequence[int],
    false_alarm_rate: float,
    method: str = "ca",
    rank: int | None = None,
    num_looks: int = 1,
    axes: int | Sequence[int] | None = None,
) -> NDArray[np.bool_]:
    """Detect cells above a threshold over the noise around them, at a constant false-alarm rate.

    Training cells lie within ``guard + training`` cells on each side but outside of the inner window of `guard` cells.
    Along two axes both windows are rectangles. Windows are cut at the edges of the map; the threshold factor is exact
    for the remaining training cells, so the rate is the same everywhere. A cell without training cells is not
    detected.

    The factors assume independent cells. Neighbours in a windowed spectrum are correlated: `guard` must then cover the
    main lobe (2 cells with a Hann window without padding), and the effective number of training cells is smaller.
    `detect` takes both into account.

    Parameters
    ----------
    power : (...) array_like
        Power of every cell, 0 or above, not in dB. float32 and float64 are kept.
    guard, training : int or sequence of int
        Cells on each side; one number, or one per axis.
    false_alarm_rate : float
        Probability that a cell of noise is detected, between 0 and 1.
    method : "ca" or "os"
        Threshold over the mean of the training cells (cell averaging), or over the `rank`-th smallest (ordered
        statistic). The mean loses less in homogeneous noise. The ordered statistic tolerates other echoes and clutter
        edges among its cells.
    rank : int, optional
        For "os": from 1 to the number of training cells of a whole window, reduced in proportion where the window is
        cut. Default: three quarters.
    num_looks : int
        Independent powers added up in every cell, such as channels: their sum is gamma-distributed.
    axes : int or sequence of int, optional
        One or two axes of the windows; other axes are separate maps. Default: the last two, or the only one.

    Returns
    -------
    mask : (...) bool
        True for a detected cell, in the shape of `power`.

    Raises
    ------
    ValueError, TypeError
        For power that is negative or NaN, and for numbers out of range.

    See Also
    --------
    detect : Detections of a frame, measured.
    processing.noise_level : Noise of a whole map.
    range_doppler : Spectrum, as abs(...)**2 an input.

    Examples
    --------
    >>> power = [1.0, 1.2, 0.8, 1.1, 90.0, 0.9, 1.0, 1.3, 0.7]
    >>> rc.cfar(power, guard=1, training=3, false_alarm_rate=1e-3).nonzero()[0].tolist()
    [4]
    """
    # Check all arguments before any work.
    cells = checked_power(power)
    axes_ = _axes(axes, cells.ndim)
    guards = per_axis("guard", guard, len(axes_), 0)
    trainings = per_axis("training", training, len(axes_), 0)
    if not any(trainings):
        raise ValueError(f"training: expected at least one cell on a side, got {training!r}")
    rate = checked_rate(false_alarm_rate)
    check.choice("method", method, METHODS)
    looks = check.count("num_looks", num_looks)
    full = window_size(guards, trainings)
    if rank is not None:
        if method != "os":
            raise ValueError(f"rank: expected none with method {method!r}, got {rank!r}")
        if check.count("rank", rank) > full:
            raise ValueError(f"rank: expected at most {full}, the training cells of a whole window, got {rank}")
    if cells.size == 0:
        return np.zeros(cells.shape, dtype=bool)
    moved = np.moveaxis(cells, axes_, range(-len(axes_), 0))
    if len(axes_) == 1:
        moved, guards, trainings = moved[..., None, :], (0, *guards), (0, *trainings)

    # The threshold is a factor per number of training cells.
    counts = training_counts(moved.shape[-2:], guards, trainings)
    require_training(counts, guards)
    if method == "ca":
        with np.errstate(invalid="ignore"):  # infinity times 0 where there are no training cells
            means = training_sums(moved, guards, trainings) / np.maximum(counts, 1)
            threshold = averaging_factor(counts, rate, looks) * means
        mask = moved > threshold
    else:
        ranks = scaled_ranks(counts, (DEFAULT_RANK * full if rank is None else rank) / full)
        factors = tabulated(counts, lambda n: ordered_factor(n, float(ranks[counts == n][0]), rate, looks))
        mask = exceeds_ordered(moved, guards, trainings, factors, ranks)
    if len(axes_) == 1:
        mask = mask[..., 0, :]
    return np.ascontiguousarray(np.moveaxis(mask, range(-len(axes_), 0), axes_))


def checked_power(power: ArrayLike) -> NDArray[Any]:
    """Power as an array of float32 or float64, not negative, not NaN."""
    cells = np.asarray(power)
    if cells.dtype.kind not in "fiu":
        raise TypeError(f"power: expected real numbers, got {cells.dtype} (power of a spectrum: abs(spectrum)**2)")
    if cells.dtype not in (np.float32, np.float64):
        cells = cells.astype(np.float64)
    if cells.ndim == 0:
        raise ValueError("power: expected at least one axis, got a number")
    if not (cells >= 0.0).all():
        at = tuple(map(int, np.argwhere(~(cells >= 0.0))[0]))
        raise ValueError(f"power: expected 0 or above (not dB), got {cells[at]} at index {at}")
    return cells


def checked_rate(false_alarm_rate: object) -> float:
    """A probability above 0 and below 1."""
    rate = check.positive("false_alarm_rate", false_alarm_rate)
    if rate >= 1.0:
        raise ValueError(f"false_alarm_rate: expected a probability below 1, got {false_alarm_rate!r}")
    return rate


def per_axis(name: str, value: int | Sequence[int], number: int, minimum: int) -> tuple[int, ...]:
    """Counts, one per axis."""
    if not isinstance(value, Iterable):
        return (check.count(name, value, minimum),) * number
    if len(value) != number:
        raise ValueError(f"{name}: expected one number, or one per axis ({number}), got {value!r}")
    return tuple(check.count(f"{name}[{i}]", each, minimum) for i, each in enumerate(value))


def window_size(guards: tuple[int, ...], trainings: tuple[int, ...]) -> int:
    """Training cells of a window that is not cut."""
    outer = np.prod([2 * (g + t) + 1 for g, t in zip(guards, trainings, strict=True)])
    return int(outer - np.prod([2 * g + 1 for g in guards]))


def training_counts(shape: Sequence[int], guards: Sequence[int], trainings: Sequence[int]) -> NDArray[np.intp]:
    """Training cells of every cell of a map, (row, column)."""
    inner, outer = (
        [_window_lengths(length, reach) for length, reach in zip(shape, reaches, strict=True)]
        for reaches in (guards, [g + t for g, t in zip(guards, trainings, strict=True)])
    )
    return np.asarray(np.outer(*outer) - np.outer(*inner))


def require_training(counts: NDArray[np.intp], guards: Sequence[int]) -> None:
    """Raise ValueError if the guard cells cover a whole map, (row, column), because no cell could be detected.

    Few guard cells may: a main lobe can be as wide as a tiny map.
    """
    if max(guards) > _FEW_CELLS and not counts.any():
        raise ValueError(f"guard: expected fewer cells than the map of {counts.shape} has, got {max(guards)}")


def training_sums(power: NDArray[Any], guards: Sequence[int], trainings: Sequence[int]) -> NDArray[Any]:
    """Sums of the training cells, (..., row, column); 0 without any.

    Adds the rows beside the guard cells over all columns, and the rows of the guard cells over the columns beside. A
    difference of two window sums would keep the rounding error of a strong echo in the middle.
    """
    rows, columns = power.shape[-2:]
    top, left = (g + t for g, t in zip(guards, trainings, strict=True))
    padded = np.zeros((*power.shape[:-2], rows + 2 * top, columns + 2 * left), power.dtype)
    inside = (..., slice(top, top + rows), slice(left, left + columns))
    padded[inside] = power

    # In maps laid end to end, neighbours are at fixed offsets.
    flat, width = padded.ravel(), columns + 2 * left
    beside = _sum_at(flat, 1, guards[1] + 1, left)
    across = beside + _sum_at(flat, 1, 0, guards[1], left)
    sums = _sum_at(across, width, guards[0] + 1, top) + _sum_at(beside, width, 0, guards[0], top)
    flat[width * top + left : len(flat) - width * top - left] = sums
    return np.asarray(padded[inside])


def _sum_at(values: NDArray[Any], step: int, nearest: int, farthest: int, reach: int | None = None) -> NDArray[Any]:
    """Sums of the values `nearest` to `farthest` steps away, where values up to `reach` steps away exist."""
    margin = step * (farthest if reach is None else reach)
    number = len(values) - 2 * margin
    if farthest < nearest:
        return np.zeros(number, values.dtype)
    runs = _runs(values, step, farthest - nearest + 1 if nearest else 2 * farthest + 1)
    sums = runs[margin - farthest * step :][:number]
    return np.asarray(sums + runs[margin + nearest * step :][:number]) if nearest else sums


def _runs(values: NDArray[Any], step: int, length: int) -> NDArray[Any]:
    """Sums of `length` values at intervals of `step`, from every value on, as two half sums and an odd value."""
    if length == 1:
        return values
    half, ahead = _runs(values, step, length // 2), step * (length // 2)
    sums = np.asarray(half[:-ahead] + half[ahead:])
    return np.asarray(sums[:-step] + values[step * (length - 1) :]) if length % 2 else sums


def exceeds_ordered(
    power: NDArray[Any],
    guards: Sequence[int],
    trainings: Sequence[int],
    factors: NDArray[np.float64],
    ranks: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """True where a cell is above `factors` times the `ranks`-th smallest of its training cells, (..., row, column).

    The test counts training cells below the cell divided by its factor: this needs no sorting and no memory for
    the windows.
    """
    rows, columns = power.shape[-2:]
    limit = (power / factors).astype(power.dtype)
    below = np.zeros(power.shape, dtype=np.int32)
    reach = [g + t for g, t in zip(guards, trainings, strict=True)]
    for i, j in product(range(-reach[0], reach[0] + 1), range(-reach[1], reach[1] + 1)):
        if (abs(i) <= guards[0] and abs(j) <= guards[1]) or abs(i) >= rows or abs(j) >= columns:
            continue
        here = (..., slice(max(0, -i), rows - max(0, i)), slice(max(0, -j), columns - max(0, j)))
        there = (..., slice(max(0, i), rows + min(0, i)), slice(max(0, j), columns + min(0, j)))
        below[here] += power[there] < limit[here]
    return np.asarray((below >= ranks) & np.isfinite(factors))


def scaled_ranks(counts: NDArray[np.intp], share: float) -> NDArray[np.float64]:
    """Ranks in proportion to the numbers of cells, from 1."""
    return np.clip(np.round(share * counts), 1, np.maximum(counts, 1)).astype(np.float64)


def tabulated(counts: NDArray[np.intp], factor: Any) -> NDArray[np.float64]:
    """Factor by the number of training cells, computed once per number; inf without cells."""
    numbers, inverse = np.unique(counts, return_inverse=True)
    table = np.array([factor(float(n)) if n > 0 else np.inf for n in numbers])
    return np.asarray(table[inverse].reshape(counts.shape))


def _axes(axes: int | Sequence[int] | None, num_dimensions: int) -> tuple[int, ...]:
    if axes is None:
        return tuple(range(num_dimensions))[-2:]
    given = axes if isinstance(axes, Iterable) else [axes]
    try:
        found = tuple(check.index("axes", operator.index(axis), num_dimensions) for axis in given)
    except TypeError:
        raise TypeError(f"axes: expected one or two integers, got {axes!r}") from None
    if len(found) not in (1, 2) or len(set(found)) != len(found):
        raise ValueError(f"axes: expected one or two different axes, got {axes!r}")
    return found


def _window_lengths(length: int, reach: int) -> NDArray[np.intp]:
    """Cells within `reach` of every cell of an axis."""
    at = np.arange(length)
    return np.minimum(at, reach) + np.minimum(at[::-1], reach) + 1


_NODES = 1000
"""Nodes of the integral over the background's distribution; 300 differ from it by less than 1e-12."""

_TAIL = 1e-20
"""Truncated tail of the background's density, relative to its largest value and to the false-alarm rate."""


def averaging_factor(num_cells: ArrayLike, false_alarm_rate: float, num_looks: float = 1.0) -> NDArray[np.float64]:
    """Threshold over the mean of training cells; inf where there are none.

    The power of a cell is gamma-distributed with shape `num_looks`, and the sum of n cells with shape ``n num_looks``.
    The share of one in the total is beta-distributed. For one look the factor is
    ``n (false_alarm_rate**(-1 / n) - 1)`` (Gandhi and Kassam, Analysis of CFAR processors in nonhomogeneous
    background, 1988, eq. 13).

    Parameters
    ----------
    num_cells : array_like
        Training cells; for correlated cells, the effective number of independent cells.
    false_alarm_rate : float
        Probability that a cell of noise is above the threshold.
    num_looks : float
        Independent exponentially distributed powers added in every cell.

    Returns
    -------
    factor : ndarray of float64, of the shape of `num_cells`
    """
    from scipy.special import betaincinv  # here: importing radarcore imports numpy and nothing heavier

    cells = np.asarray(num_cells, dtype=np.float64)
    some = np.maximum(cells, 1e-3)  # below, the factor overflows
    # The share of the training cells falls below `share` with the false-alarm rate.
    share = betaincinv(some * num_looks, num_looks, false_alarm_rate)
    with np.errstate(divide="ignore"):
        return np.where(cells > 0.0, some * (1.0 - share) / share, np.inf)


@lru_cache(maxsize=4096)
def ordered_factor(num_cells: float, rank: float, false_alarm_rate: float, num_looks: float = 1.0) -> float:
    """Threshold over the `rank`-th smallest of the training cells.

    For one look the false-alarm rate is the product over i < rank of ``(n - i) / (n - i + factor)`` (Rohling, Radar
    CFAR thresholding in clutter and multiple target situations, 1983, eq. 37), written with gamma functions. For more
    looks the rate is the probability to exceed `factor` times the ordered cell, averaged over the cell's distribution.
    Numbers of cells and ranks may be fractional. Other arguments as in `averaging_factor`.
    """
    from scipy.optimize import brentq
    from scipy.special import gammaincc

    power, weights = _ordered_density(float(num_cells), float(rank), float(num_looks), false_alarm_rate)

    def rate(factor: float) -> float:
        return float(np.log(np.maximum(weights @ gammaincc(num_looks, factor * power), 1e-300)))

    wanted, highest = np.log(false_alarm_rate), 2.0
    while rate(highest) > wanted:
        highest *= 2.0
    return float(brentq(lambda factor: rate(factor) - wanted, 0.0, highest, xtol=1e-13 * highest, rtol=1e-13))


def _ordered_density(
    n: float, k: float, looks: float, false_alarm_rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nodes and weights (sum 1) for averages over the k-th smallest of n gamma-distributed powers.

    Over the logarithm of the power the density decays exponentially on both sides, so that equal steps converge faster
    than any power of their number.
    """
    from scipy.special import gammainc, gammaincc, gammaln

    def log_density(log_power: NDArray[np.float64]) -> NDArray[np.float64]:
        power = np.exp(log_power)
        with np.errstate(divide="ignore"):
            below, above = np.log(gammainc(looks, power)), np.log(gammaincc(looks, power))
        above = np.where(np.isfinite(above), above, (looks - 1.0) * log_power - power - gammaln(looks))
        below = np.where(np.isfinite(below), below, looks * log_power - gammaln(looks + 1.0))
        return np.asarray((k - 1.0) * below + (n - k) * above + looks * log_power - power)

    # The density on a coarse grid, then on a fine one where it is not negligible.
    grid = np.linspace(-300.0, np.log(looks) + 7.0, 8 * _NODES)
    density = log_density(grid)
    counts = np.flatnonzero(density > density.max() + np.log(_TAIL) + np.log(false_alarm_rate))
    grid = np.linspace(grid[max(counts[0] - 1, 0)], grid[min(counts[-1] + 1, len(grid) - 1)], _NODES)
    density = log_density(grid)
    weights = np.exp(density - density.max())
    return np.exp(grid), weights / weights.sum()
