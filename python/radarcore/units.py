"""Constants and conversions of units."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SPEED_OF_LIGHT = 299_792_458.0
"""Speed of light in vacuum [m/s]."""

BOLTZMANN = 1.380649e-23
"""Boltzmann constant [J/K]."""

NOISE_TEMPERATURE = 290.0
"""Reference temperature of noise figures [K] (IEEE)."""


def power_from_db(level_db: float) -> float:
    """Power ratio of a level in dB."""
    return float(10.0 ** (level_db / 10.0))


def power_from_dbm(level_dbm: float) -> float:
    """Power [W] of a level in dBm."""
    return 1e-3 * power_from_db(level_dbm)


def db_from_amplitude(amplitude: ArrayLike, floor_db: float = -400.0) -> NDArray[np.float64]:
    """Level in dB of an amplitude (20 log10), never below `floor_db`: zeros do not become -inf."""
    magnitude = np.abs(np.asarray(amplitude))
    level: NDArray[np.float64] = 20.0 * np.log10(np.maximum(magnitude, 10.0 ** (floor_db / 20.0)))
    return level
