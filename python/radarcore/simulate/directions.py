"""Angles of directions in a sensor frame, as antenna patterns take them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def angles(directions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Azimuth and elevation [rad] of vectors (..., 3) of any length in a sensor frame, positive to the left and up."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
