"""Antennas of a radar as they are given: positions, patterns, polarisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.radar.pattern import Pattern

_FARTHEST_ANTENNA = 1e6
"""Largest coordinate of an antenna in the sensor frame [m]."""

POLARIZATIONS = {"vertical": (0.0, 0.0, 1.0), "horizontal": (0.0, 1.0, 0.0)}
"""Directions of the field by name, in the sensor frame."""


def polarization(value: object) -> str | tuple[float, float, float] | None:
    """Polarisation that was given by name or as a unit vector."""
    if value is None:
        return None
    if isinstance(value, str):
        if value not in POLARIZATIONS:
            raise ValueError(f"polarization: expected 'vertical', 'horizontal' or a unit vector, got {value!r}")
        return value
    vector = check.array("polarization", value, (3,))  # type: ignore[arg-type]  # what is no array is refused there
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) > 1e-3:
        raise ValueError(f"polarization: expected a unit vector, got one of length {length:g}")
    x, y, z = (vector / length).tolist()
    return x, y, z


def patterns(name: str, value: Sequence[Pattern] | None, default: Pattern, number: int) -> tuple[Pattern, ...]:
    """Patterns, one per element."""
    if value is None:
        return (default,) * number
    if not isinstance(value, Sequence):
        raise TypeError(f"{name}: expected a sequence of patterns, one per element, got {type(value).__name__}")
    if len(value) != number:
        raise ValueError(f"{name}: expected {number} patterns, one per element, got {len(value)}")
    for i, pattern in enumerate(value):
        if not isinstance(pattern, Pattern):
            raise TypeError(f"{name}[{i}]: expected {Pattern}, got {type(pattern).__name__}")
    return tuple(value)


def positions(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Positions of at least one antenna, (n, 3) [m]."""
    given = check.array(name, value, (None, 3))
    if len(given) == 0:
        raise ValueError(f"{name}: expected at least one antenna position, got none")
    if (farthest := float(np.abs(given).max())) > _FARTHEST_ANTENNA:
        raise ValueError(f"{name}: expected coordinates within {_FARTHEST_ANTENNA:g} m, got {farthest:g}")
    return check.frozen(given)
