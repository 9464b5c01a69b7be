"""Noise level of a map of powers, from the receiver if it is known or from the map itself."""

from __future__ import annotations

from functools import lru_cache
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.detection.cfar import checked_power
from radarcore.products import real_inner
from radarcore.radar.receiver import is_plain
from radarcore.recording.frame import Frame, unit_of
from radarcore.recording.recording import Recording

_LEAST_ROWS, _LEAST_COLUMNS = 8, 16
"""Smallest map whose rows have levels to compare."""

_EMPTY = 0.25
"""Rows are filtered out below this part of the level that a fifth of the rows exceed. In pure noise one row of a
thousand with few cells has such a low median."""

ROUNDING = 1e-12
"""Smallest noise of a cell, relative to its power if the cube were a single echo: float32 (24 bits) errs by less."""

LEAST_NOISE = float(np.finfo(np.float32).tiny)
"""Smallest noise of a cell at all."""


def noise_level(power: ArrayLike, *, num_looks: int = 1) -> float:
    """Mean noise power of the cells of a map; at least half of them must be free of echoes.

    The median, divided by its value for noise of mean 1: a few strong echoes hardly change it. Cells need not be
    independent.

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

    See Also
    --------
    cfar : Cells above the noise around them.

    Examples
    --------
    >>> power = np.random.default_rng(1).exponential(2.0, 10_000)
    >>> power[:20] = 1e6  # echoes
    >>> print(f"{rc.processing.noise_level(power):.1f}")
    2.0
    """
    cells = checked_power(power)
    looks = check.count("num_looks", num_looks)
    if cells.size == 0:
        return 0.0
    middle = cells.size // 2
    ordered = np.partition(cells, middle, axis=None)  # quicker than np.median
    lower = ordered[middle] if cells.size % 2 else ordered[:middle].max()
    return float(0.5 * (lower + ordered[middle])) / median_of_unit_mean(looks)


def filtered_rows(power: NDArray[Any]) -> NDArray[np.bool_]:
    """True for rows (velocities) whose noise a filter such as `remove_static` removed, (row,).

    Their median is far below the 80th percentile of all medians. Maps too small for this comparison give False.
    """
    if len(power) < _LEAST_ROWS or power.shape[1] < _LEAST_COLUMNS:
        return np.zeros(len(power), dtype=bool)
    middle = power.shape[1] // 2
    medians = np.partition(power, middle, axis=1)[:, middle]  # several times quicker than np.median
    is_empty: NDArray[np.bool_] = medians < _EMPTY * np.sort(medians)[len(power) * 4 // 5]
    return is_empty


@lru_cache(maxsize=64)
def median_of_unit_mean(num_looks: int) -> float:
    """Median of a gamma-distributed power of mean 1 (one look: ln 2)."""
    from scipy.special import gammaincinv  # here: importing radarcore imports numpy and nothing heavier

    return float(gammaincinv(num_looks, 0.5)) / num_looks


def known_noise(frame: Frame | Recording, *weights: NDArray[Any]) -> float | None:
    """Mean power of the receiver's noise in a cell of one channel; None if it is unknown.

    White noise of variance s^2 has the power ``s^2 sum(w^2)`` in every cell of a transform with weights w; each
    additional axis contributes its factor ``sum(w^2)``. The power is known for simulated samples in sqrt(W) from a
    receiver with a noise figure and no other effects.

    Parameters
    ----------
    frame : Frame or Recording
    weights : (length,) arrays
        Window over each transformed axis.
    """
    receiver = frame.radar.receiver
    unit = unit_of(frame) if isinstance(frame, Frame) else frame.source.get("cube_unit")
    if receiver is None or not is_plain(receiver) or unit is not None:
        return None
    variance = receiver.noise_variance(frame.radar.waveform.sample_rate)
    return variance * float(np.prod([np.square(w).sum() for w in weights])) or None


def noise_of_picture(frame: Frame | Recording, power: NDArray[Any], known: float | None) -> float | None:
    """Noise of a cell of a picture: known, or the median power of a measurement; None of ideal samples.

    Parameters
    ----------
    frame : Frame or Recording
    power : array
        All cells of the picture.
    known : float or None
        As of `known_noise`, of a cell of the picture.
    """
    unit = unit_of(frame) if isinstance(frame, Frame) else frame.source.get("cube_unit")
    shown = power[np.isfinite(power) & (power > 0.0)]
    return known if known is not None or unit is None or shown.size == 0 else float(np.median(shown))


def rounding_noise(cube: NDArray[Any], fast_weights: NDArray[np.float64], slow_weights: NDArray[np.float64]) -> float:
    """Smallest noise of a cell of the windowed transforms: rounding of the samples.

    The reference is a frame with a single echo, whose samples add up coherently.
    """
    return max(rounding_per_energy(fast_weights, slow_weights) * real_inner(cube, cube), LEAST_NOISE)


def rounding_per_energy(*weights: NDArray[np.float64]) -> float:
    """`rounding_noise` relative to the sum of the squared samples."""
    return ROUNDING * prod(float(each.sum()) ** 2 / len(each) for each in weights)
