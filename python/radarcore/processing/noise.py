"""Level of the noise in a map of powers: from the receiver, where that is known, or from the map itself."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.constant_false_alarm import checked_power
from radarcore.processing.windows import Window, window_weights
from radarcore.radar.radar import Radar

ROUNDING = 1e-12
"""Smallest noise of a cell over the power that the cube would have in a cell as a single echo: float32, of 24 bits,
errs by less."""

LEAST_NOISE = float(np.finfo(np.float32).tiny)
"""Smallest noise of a cell at all."""


def noise_level(power: ArrayLike, *, num_looks: int = 1) -> float:
    """Noise power of the cells of a map: their mean, if half of them have no echo.

    The median over its value for a mean of 1: echoes, as few or as strong as they are, hardly move it. Cells need not
    be independent.

    Parameters
    ----------
    power : (...) array_like
        Power of every cell, 0 or above, not in dB.
    num_looks : int
        Independent powers added up in every cell, such as channels: their sum is gamma-distributed.

    Returns
    -------
    level : float
        In the unit of `power`, of the sum of all looks; 0 for a map without cells.
    """
    cells = checked_power(power)
    looks = check.count("num_looks", num_looks)
    return float(np.median(cells)) / median_of_unit_mean(looks) if cells.size else 0.0


@lru_cache(maxsize=64)
def median_of_unit_mean(num_looks: int) -> float:
    """Median of a gamma-distributed power of mean 1 (one look: ln 2)."""
    from scipy.special import gammaincinv  # here: importing radarcore imports numpy and nothing heavier

    return float(gammaincinv(num_looks, 0.5)) / num_looks


def receiver_noise(radar: Radar, *, window: Window = "hann", doppler_window: Window = "hann") -> float | None:
    """Mean noise power of a cell of ``abs(range_doppler(...))**2`` of one channel by the radar's own receiver.

    None without a receiver, or without a noise figure. Only for samples in the unit of the simulation, square roots of
    watts: those of a real board are in parts of its full scale.
    """
    if not isinstance(radar, Radar):
        raise TypeError(f"radar: expected Radar, got {type(radar).__name__}")
    if radar.receiver is None or radar.receiver.noise_figure_db is None:
        return None
    wf = radar.waveform
    fast = window_weights("window", window, wf.num_samples)
    slow = window_weights("doppler_window", doppler_window, wf.num_chirps)
    return radar.receiver.noise_variance(wf.sample_rate) * float(np.sum(fast**2) * np.sum(slow**2))


def rounding_noise(cube: NDArray[Any], fast_weights: NDArray[np.float64], slow_weights: NDArray[np.float64]) -> float:
    """Smallest noise that a cell of the windowed transforms can have: rounding of the samples.

    Relative to the power of a frame that is a single echo, whose samples the windows add up coherently.
    """
    return max(rounding_per_energy(fast_weights, slow_weights) * float(np.vdot(cube, cube).real), LEAST_NOISE)


def rounding_per_energy(fast_weights: NDArray[np.float64], slow_weights: NDArray[np.float64]) -> float:
    """`rounding_noise` over the sum of the squared samples."""
    fast, slow = (float(weights.sum()) ** 2 / len(weights) for weights in (fast_weights, slow_weights))
    return ROUNDING * fast * slow
