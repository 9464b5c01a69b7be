"""Directions in a sensor frame (x forward, y left, z up): unit vectors, and azimuth and elevation [rad]."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def unit_vectors(azimuth: ArrayLike, elevation: ArrayLike = 0.0) -> NDArray[np.float64]:
    """Unit vectors (..., 3) at angles [rad], positive to the left and up, broadcast together."""
    az, el = np.asarray(azimuth, np.float64), np.asarray(elevation, np.float64)
    across = np.cos(el)
    x = across * np.cos(az)
    vectors = np.empty((*x.shape, 3))
    vectors[..., 0], vectors[..., 1], vectors[..., 2] = x, across * np.sin(az), np.sin(el)
    return vectors


def angles(vectors: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Azimuth and elevation [rad] of vectors (..., 3) of any length, positive to the left and up."""
    x, y, z = (vectors[..., axis] for axis in range(3))
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
