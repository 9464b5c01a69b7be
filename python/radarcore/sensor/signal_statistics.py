"""Statistics of the samples and times of a board: noise and leakage in codes of its ADC, and the pace of its frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.recording.frame import NUM_CODES

_WARM_UP = 8
"""Chirps of a frame until they are alike: the first differ by a few tenths of a code."""

_SETTLING = 16
"""Samples of a chirp after which the noise of its start has gone."""


def chirp_noise(codes: ArrayLike) -> NDArray[np.float64]:
    """Noise from one chirp to the next of each receiver [codes], whatever stands still in front of it.

    Parameters
    ----------
    codes : (frame, rx, chirp, sample)
        Frames are compared with each other where they have fewer than three chirps; the first chirps of a frame and
        the first samples of a chirp are left out where enough remain.

    Returns
    -------
    noise : (rx,) float64
        Standard deviation.
    """
    values = np.asarray(codes, np.float64)
    num_frames, num_rx, num_chirps, num_samples = values.shape
    if num_samples > 2 * _SETTLING:
        values = values[..., _SETTLING:]
    if num_chirps < 3:
        values = values.transpose(1, 0, 2, 3).reshape(1, num_rx, num_frames * num_chirps, -1)
    else:
        values = values[:, :, min(_WARM_UP, num_chirps - 2) :]
    steps = np.diff(values, axis=2)
    noise: NDArray[np.float64] = np.sqrt(0.5 * np.mean(steps * steps, axis=(0, 2, 3)))
    return noise


def leakage(on: ArrayLike, off: ArrayLike) -> NDArray[np.float64]:
    """Leakage of the transmitter into each receiver [codes]: change of the mean chirp, peak to peak.

    Parameters
    ----------
    on, off : (frame, rx, chirp, sample)
        Codes with the transmitter on and off.

    Returns
    -------
    leakage : (rx,) float64
    """
    with_tx, without = (np.asarray(codes, np.float64).mean(axis=(0, 2)) for codes in (on, off))
    change: NDArray[np.float64] = np.ptp(with_tx - without, axis=-1)
    return change


def clipped(codes: ArrayLike) -> float:
    """Part of the samples that are at an end of the ADC's range."""
    values = np.asarray(codes)
    return float(np.mean((values <= 0) | (values >= NUM_CODES - 1)))


def pace_of(indices: Sequence[int], times: Sequence[float]) -> tuple[float, float]:
    """Pace of frames from their numbers and times [s], two or more.

    Returns
    -------
    interval : float
        From one frame to the next [s]: the median of pairs that are far apart, which some late frames do not move.
    jitter : float
        Deviation from that pace that one frame of twenty has [s].
    """
    number, time = np.asarray(indices, np.float64), np.asarray(times, np.float64)
    steps = number[:, None] - number
    is_far = steps >= 0.5 * steps.max()
    interval = float(np.median((time[:, None] - time)[is_far] / steps[is_far]))
    rest = time - interval * number
    return interval, float(np.percentile(np.abs(rest - np.median(rest)), 95.0))
