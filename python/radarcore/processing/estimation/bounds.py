"""Cramér-Rao bounds of range and velocity for every velocity estimator.

The phase is known up to a constant, ``psi(theta) + const``. With the centred gradients c of psi, white noise and a
signal-to-noise ratio per sample `snr`, the covariance of an unbiased estimate is at least

    ``inv(num_channels * kappa * snr * sum(c c^T))``,  kappa = 2 for I/Q samples, 1 for real ones

(Rife, Boorstyn, Single-Tone Parameter Estimation from Discrete-Time Observations, IEEE Trans. IT 1974). For least
squares with the weights w of a window, ``inv(sum(w c c^T)) sum(w^2 c c^T) inv(sum(w c c^T))`` replaces
``inv(sum(c c^T))``.

Consider M chirps of N samples on K channels, with the carrier f in the middle of the chirp. The variances of fast and
slow time are ``var(t) = (N^2 - 1) / (12 fs^2)`` and ``var(T)``. The variance of the velocity is
``(c / 4 pi)^2 / (K kappa snr N M info)`` with

    ``info = f^2 var(T) + slope^2 var(t) var(T) + slope^2 var(t^2)``:

Doppler phase from chirp to chirp, range migration from chirp to chirp, and change of the frequency within a chirp.
`doppler_bound` uses all three terms; the first is the largest. `chirp_rate_bound` uses only the last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.spectra.windows import Window, window_weights
from radarcore.radar.waveform import Waveform, require_range
from radarcore.units import SPEED_OF_LIGHT


@dataclass(frozen=True, eq=False)
class CramerRaoBound:
    """Least standard deviations of unbiased estimates, in the shape of the signal-to-noise ratio.

    Attributes
    ----------
    range : (...) float64
        For the range at the middle of the frame [m].
    velocity : (...) float64
        For the range rate [m/s].

    See Also
    --------
    doppler_bound : Bound of all samples of a frame.
    up_down_bound : Bound of a pair of chirps.

    Examples
    --------
    >>> waveform = rc.bgt60tr13c(num_chirps=64).waveform
    >>> bound = rc.processing.doppler_bound(waveform, snr_db=[-10.0, 10.0])
    >>> print(f"{bound.range[0] / bound.range[1]:.1f}")
    10.0
    """

    range: NDArray[np.float64]
    velocity: NDArray[np.float64]


def doppler_bound(
    waveform: Waveform,
    snr_db: ArrayLike,
    *,
    is_real: bool = False,
    num_channels: int = 1,
    window: Window = None,
    doppler_window: Window = None,
) -> CramerRaoBound:
    """Bound for one target from all samples of a frame, which `doppler_velocity` reaches.

    Parameters
    ----------
    waveform : Waveform
        With a ramp and at least two chirps.
    snr_db : array_like
        Signal-to-noise ratio of the echo per sample [dB].
    is_real : bool
        Real samples: 3 dB worse than I/Q samples of the same ratio.
    num_channels : int
        Channels with common range and velocity, each with its own amplitude and phase.
    window, doppler_window : str, tuple or None
        Windows of the estimate over fast and slow time, which the bound includes. Default: none, as in
        `doppler_velocity`, which is the most accurate for a single echo in noise.

    Returns
    -------
    bound : CramerRaoBound

    See Also
    --------
    doppler_velocity : The corresponding estimate.
    processing.chirp_rate_bound : Without Doppler ambiguity.

    Examples
    --------
    >>> waveform = rc.bgt60tr13c(num_chirps=64).waveform
    >>> bound = rc.processing.doppler_bound(waveform, snr_db=0.0)
    >>> print(f"{1e3 * bound.range:.1f} mm, {1e3 * bound.velocity:.1f} mm/s")
    0.7 mm, 0.6 mm/s
    """
    require_range(waveform)
    if waveform.num_chirps < 2:
        raise ValueError(f"waveform: expected at least 2 chirps, got {waveform.num_chirps}")
    weights = sample_weights(waveform, window, doppler_window)
    gradients = range_and_velocity_gradients(waveform)
    covariance = _covariance(gradients, weights, per_chirp=False)
    return _bound(covariance, snr_db, is_real, num_channels)


def up_down_bound(
    up: Waveform,
    down: Waveform,
    snr_db: ArrayLike,
    *,
    down_delay: float | None = None,
    is_real: bool = False,
    num_channels: int = 1,
    window: Window = None,
) -> CramerRaoBound:
    """Bound of `up_down_velocity` from the beat frequencies of one or several up- and down-chirps.

    For one pair of simultaneous chirps of opposite slopes, ``std(velocity) = sqrt(2) c / (4 f) std(frequency)`` and
    ``std(range) = sqrt(2) c / (4 slope) std(frequency)``.

    Parameters
    ----------
    up, down : Waveform
        Slopes of opposite sign.
    snr_db : array_like
        Signal-to-noise ratio of the echo per sample [dB].
    down_delay : float, optional
        Time from the start of frame `up` to the start of frame `down` [s]. Default: ``up.frame_interval``, or 0 if
        their first chirps have different offsets, as in sub-sequences of one frame.
    is_real, num_channels, window
        As in `doppler_bound`; a Hann window makes the bound 1.53 times larger. Default: none, the most accurate.

    Returns
    -------
    bound : CramerRaoBound
        Range at the mean of both frames' middles.

    See Also
    --------
    up_down_velocity : The corresponding estimate.
    doppler_bound : For many chirps of one slope.

    Examples
    --------
    >>> up = rc.Waveform(start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=128, num_chirps=1)
    >>> down = up.replace(start_frequency=63e9, slope=-50e12)
    >>> bound = rc.processing.up_down_bound(up, down, snr_db=20.0)
    >>> print(f"{1e3 * bound.range:.1f} mm, {bound.velocity:.2f} m/s")
    0.1 mm, 0.10 m/s
    """
    solve = up_down_equations(up, down, down_delay)
    variances = [_beat_covariance(wf, window)[0, 0] for wf in (up, down)]
    inverse = np.linalg.inv(solve)
    return _bound(inverse @ np.diag(variances) @ inverse.T, snr_db, is_real, num_channels)


def chirp_rate_bound(
    waveform: Waveform,
    snr_db: ArrayLike,
    *,
    is_real: bool = False,
    num_channels: int = 1,
    window: Window = None,
) -> CramerRaoBound:
    """Bound of `chirp_rate_velocity`, from the change of the frequency within the chirps alone.

    For one chirp of I/Q samples
    ``std(velocity) = c / (4 abs(slope)) sqrt(90 / (pi^2 snr N (N^2 - 1) (N^2 - 4))) sample_rate^2``.

    Parameters
    ----------
    waveform : Waveform
        With a ramp of at least three samples.
    snr_db : array_like
        Signal-to-noise ratio of the echo per sample [dB].
    is_real, num_channels, window
        As in `doppler_bound`; a Hann window makes the bound 1.53 times larger. Default: none, the most accurate.

    Returns
    -------
    bound : CramerRaoBound
        The range includes the error of the velocity, because the estimate subtracts ``velocity * f / slope``.

    See Also
    --------
    chirp_rate_velocity : The corresponding estimate.
    doppler_bound : From the phase over all chirps.

    Examples
    --------
    >>> waveform = rc.bgt60tr13c(num_chirps=64).waveform
    >>> bound = rc.processing.chirp_rate_bound(waveform, snr_db=20.0)
    >>> print(f"{bound.velocity:.0f} m/s")  # these chirps are short and narrow
    4 m/s
    """
    require_range(waveform)
    if waveform.num_samples < 3:
        raise ValueError(f"waveform: expected at least 3 samples per chirp, got {waveform.num_samples}")
    covariance = _beat_covariance(waveform, window)[np.ix_([0, 2], [0, 2])]
    per_velocity = 4.0 * waveform.slope / SPEED_OF_LIGHT
    per_range = 2.0 * waveform.slope / SPEED_OF_LIGHT
    to_estimates = np.array(
        [[1.0 / per_range, -beat_carrier(waveform) / (waveform.slope * per_velocity)], [0.0, 1.0 / per_velocity]]
    )
    return _bound(to_estimates @ covariance @ to_estimates.T, snr_db, is_real, num_channels)


def middle_of_chirp(waveform: Waveform) -> float:
    """Middle of the samples after the start of the ramp [s]."""
    return waveform.adc_delay + 0.5 * (waveform.num_samples - 1) / waveform.sample_rate


def carrier(waveform: Waveform) -> float:
    """Frequency at the middle of the samples [Hz]."""
    return waveform.start_frequency + waveform.slope * middle_of_chirp(waveform)


def times_from_middle(waveform: Waveform) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Slow time (chirp, 1) and fast time (1, sample), whose sum is 0 at the middle of the frame [s]."""
    middle = middle_of_chirp(waveform)
    fast = waveform.sample_times - middle
    slow = waveform.chirp_times - (waveform.middle - middle)
    return slow[:, None], fast[None, :]


def beat_times(waveform: Waveform) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Slow time (chirp, 1) from the mean of all chirps and fast time (1, sample) from the middle of the samples [s]."""
    slow, fast = times_from_middle(waveform)
    return slow - slow.mean(), fast


def beat_carrier(waveform: Waveform) -> float:
    """Frequency f in the mean beat frequency of all chirps, ``2/c (slope range + f velocity)`` [Hz].

    The range refers to the middle of the frame; f includes the motion from there to the mean chirp.
    """
    return carrier(waveform) + waveform.slope * float(times_from_middle(waveform)[0].mean())


def range_and_velocity_gradients(waveform: Waveform) -> NDArray[np.float64]:
    """Derivatives of eq. (1)'s phase by range at the middle of the frame and by velocity, (2, chirp, sample) [rad].

    Neglects ``slope * delay**2 / 2``, a millionth of the carrier's phase.
    """
    slow, fast = times_from_middle(waveform)
    by_range = 4.0 * np.pi / SPEED_OF_LIGHT * (carrier(waveform) + waveform.slope * fast) + 0.0 * slow
    return np.stack([by_range, by_range * (slow + fast)])


def beat_gradients(waveform: Waveform) -> NDArray[np.float64]:
    """Derivatives of a chirp's phase by the mean beat frequency [Hz] and its changes [Hz/s].

    (3, chirp, sample) [rad]: by the frequency, its change from chirp to chirp, and its change within a chirp.
    """
    slow, fast = beat_times(waveform)
    return 2.0 * np.pi * np.stack([fast + 0.0 * slow, slow * fast, 0.5 * fast**2 + 0.0 * slow])


def up_down_equations(up: Waveform, down: Waveform, down_delay: float | None) -> NDArray[np.float64]:
    """Beat frequencies (up, down) per unit of range (first column) and of velocity (second), (2, 2)."""
    for name, wf in (("up", up), ("down", down)):
        require_range(wf)
        if wf.num_samples < 2:
            raise ValueError(f"{name}: expected at least 2 samples per chirp, got {wf.num_samples}")
    if np.sign(up.slope) == np.sign(down.slope):
        raise ValueError(f"down: expected a slope of the other sign than up's {up.slope:g} Hz/s, got {down.slope:g}")
    if down_delay is not None:
        delay = check.number("down_delay", down_delay, "s")
    else:
        delay = up.frame_interval if up.chirp_times[0] == down.chirp_times[0] else 0.0
    half = 0.5 * (delay + down.middle - up.middle)  # between the middles
    rows = [
        [wf.slope, beat_carrier(wf) + wf.slope * time]  # the range has moved by velocity * time
        for wf, time in ((up, -half), (down, half))
    ]
    return 2.0 / SPEED_OF_LIGHT * np.array(rows)


def _beat_covariance(waveform: Waveform, window: Window) -> NDArray[np.float64]:
    """Covariance of the beat frequency and its changes at unit information; inf for unobservable ones."""
    observable = np.flatnonzero([True, waveform.num_chirps > 1, waveform.num_samples > 2])
    covariance = np.full((3, 3), np.inf)
    gradients = beat_gradients(waveform)[observable]
    weights = sample_weights(waveform, window, None)
    covariance[np.ix_(observable, observable)] = _covariance(gradients, weights, per_chirp=True)
    return covariance


def _covariance(
    gradients: NDArray[np.float64], weights: NDArray[np.float64], *, per_chirp: bool
) -> NDArray[np.float64]:
    """Covariance of parameters (p, p) at unit information per sample, from gradients (p, chirp, sample)."""
    axes = (-1,) if per_chirp else (-2, -1)  # samples with a common phase
    mean = (weights * gradients).sum(axis=axes, keepdims=True) / weights.sum(axis=axes, keepdims=True)
    # Scaled for well-conditioned matrices: frequencies and their changes differ by many powers of ten.
    centred = (gradients - mean).reshape(len(gradients), -1)
    size = np.sqrt((centred**2).mean(axis=1))
    centred /= size[:, None]
    flat = weights.ravel()
    inverse = np.linalg.inv(np.einsum("pn,qn->pq", flat * centred, centred))
    scaled: NDArray[np.float64] = inverse @ np.einsum("pn,qn->pq", flat**2 * centred, centred) @ inverse
    return scaled / np.outer(size, size)


def sample_weights(waveform: Waveform, window: Window, doppler_window: Window) -> NDArray[np.float64]:
    """Weights of least squares, (chirp, sample)."""
    fast = window_weights("window", window, waveform.num_samples)
    return np.outer(window_weights("doppler_window", doppler_window, waveform.num_chirps), fast)


def _bound(covariance: NDArray[np.float64], snr_db: ArrayLike, is_real: bool, num_channels: int) -> CramerRaoBound:
    """Deviations from the covariance at unit information; information is the inverse phase variance of a sample."""
    per_sample = (1.0 if is_real else 2.0) * check.count("num_channels", num_channels)
    information = per_sample * 10.0 ** (0.1 * check.numbers("snr_db", snr_db))
    with np.errstate(divide="ignore"):  # no signal: infinite
        return CramerRaoBound(*(np.asarray(np.sqrt(covariance[i, i] / information)) for i in (0, 1)))
