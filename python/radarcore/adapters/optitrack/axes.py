"""Axes of Motive, in which y is up, and of radarcore, in which z is up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radarcore import check

Array = NDArray[np.float64]

AXES = ("z_up", "z_up_world", "unchanged")
"""Ways to turn Motive's axes.

``"z_up"``: world and body axes alike, (x, -z, y) for (x, y, z); a body that Motive says is not turned is not turned.
``"z_up_world"``: the world's axes alone; bodies keep their own axes in Motive.
``"unchanged"``: as they came, as of a stream whose up axis is set to z.
"""

_HALF = np.sqrt(0.5)


def positions_of(positions: Array, axes: str) -> Array:
    """Positions (..., 3) of Motive, in the world of radarcore."""
    if check.choice("axes", axes, AXES) == "unchanged":
        return positions
    x, y, z = np.moveaxis(positions, -1, 0)
    return np.stack([x, -z, y], axis=-1)


def quaternions_of(quaternions: Array, axes: str) -> Array:
    """Quaternions (..., 4), order (w, x, y, z), of bodies in Motive, in the world of radarcore."""
    if check.choice("axes", axes, AXES) == "unchanged":
        return quaternions
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    if axes == "z_up":  # q_R q q_R^-1, where q_R turns by 90 degrees about x: the rotation vector is turned
        return np.stack([w, x, -z, y], axis=-1)
    turned: Array = _HALF * np.stack([w - x, w + x, y - z, y + z], axis=-1)  # q_R q
    return turned


def motive_positions(positions: Array, axes: str) -> Array:
    """Positions (..., 3) in the world of radarcore, in that of Motive: inverse of `positions_of`."""
    if check.choice("axes", axes, AXES) == "unchanged":
        return positions
    x, y, z = np.moveaxis(positions, -1, 0)
    return np.stack([x, z, -y], axis=-1)


def motive_quaternions(quaternions: Array, axes: str) -> Array:
    """Quaternions (..., 4), order (w, x, y, z), of radarcore's poses, as Motive has them."""
    if check.choice("axes", axes, AXES) == "unchanged":
        return quaternions
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    if axes == "z_up":
        return np.stack([w, x, z, -y], axis=-1)
    turned: Array = _HALF * np.stack([w + x, x - w, y + z, z - y], axis=-1)
    return turned
