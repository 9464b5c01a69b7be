"""Beam of an array: the directions in which any pair of antennas has a two-way gain of interest."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from radarcore.direction import angles
from radarcore.radar.pattern import Pattern, TabulatedPattern

DEPTH_DB = 20.0
"""Two-way gain below the largest of all pairs, down to which directions are in the beam [dB]."""

WIDEST_DEG = 150.0
"""Widest field of view that follows from patterns [degrees]."""

_WIDEST_OF_A_PLANE_DEG = 110.0
"""Field of view above which side planes cover directions to the sides, see `field_of_view_deg`."""

_NODES = np.concatenate([[0.0], np.geomspace(0.01, 0.4, 24), np.arange(0.5, 90.1, 0.5)])
"""Angles at which patterns are sampled [degrees]: narrow beams lie about the axis, or are tables."""

Patterns = tuple[Pattern, ...]


def field_of_view_deg(tx_patterns: Sequence[Pattern], rx_patterns: Sequence[Pattern]) -> tuple[float, float]:
    """Horizontal and vertical angle of the smallest centred field of view that holds the beam [degrees], at most 150.

    The horizontal angle follows from y/x, the vertical one from z/x, or from z/max(x, abs(y)) if the horizontal angle
    is above 110 degrees, as on the sides of a box about the sensor.
    """
    return _beam(*_distinct(tx_patterns, rx_patterns))[1]


def is_in_beam(
    tx_patterns: Sequence[Pattern], rx_patterns: Sequence[Pattern], directions: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """True for directions (..., 3) of the sensor frame, of any length, in the beam and in some field of view."""
    distinct = _distinct(tx_patterns, rx_patterns)
    x, y, z = np.moveaxis(directions, -1, 0)
    widest = np.tan(np.deg2rad(0.5 * WIDEST_DEG))
    can_be_seen = (np.abs(y) <= widest * x) & (np.abs(z) <= widest * np.maximum(x, np.abs(y))) & (x > 0.0)
    gain = _gain(*distinct, *angles(directions))
    in_beam: NDArray[np.bool_] = can_be_seen & (gain >= _beam(*distinct)[0])
    return in_beam


def _distinct(tx_patterns: Sequence[Pattern], rx_patterns: Sequence[Pattern]) -> tuple[Patterns, Patterns]:
    return tuple(dict.fromkeys(tx_patterns)), tuple(dict.fromkeys(rx_patterns))


def _gain(
    tx_patterns: Patterns, rx_patterns: Patterns, azimuth: NDArray[np.float64], elevation: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Two-way gain of the pair that has the most."""
    sent, received = (
        np.max([pattern.gain(azimuth, elevation) for pattern in patterns], axis=0)
        for patterns in (tx_patterns, rx_patterns)
    )
    both: NDArray[np.float64] = sent * received
    return both


@lru_cache(maxsize=64)
def _beam(tx_patterns: Patterns, rx_patterns: Patterns) -> tuple[float, tuple[float, float]]:
    """Least two-way gain within the beam, and `field_of_view_deg`."""
    # The front half of the sphere, at the angles of tables too.
    azimuth, elevation = (
        np.unique(np.concatenate([np.deg2rad(_NODES), -np.deg2rad(_NODES), *tables]))
        for tables in (
            [getattr(pattern, name) for pattern in tx_patterns + rx_patterns if isinstance(pattern, TabulatedPattern)]
            for name in ("azimuth", "elevation")
        )
    )
    azimuth = azimuth[np.abs(azimuth) <= 0.5 * np.pi]
    gain = _gain(tx_patterns, rx_patterns, azimuth[:, None], elevation[None, :])
    least = float(10.0 ** (-0.1 * DEPTH_DB) * gain.max())

    # Up to the next angle beyond those within the beam.
    within = gain >= least
    within[1:] |= within[:-1]
    within[:-1] |= within[1:]
    within[:, 1:] |= within[:, :-1]
    within[:, :-1] |= within[:, 1:]
    rows, columns = np.nonzero(within)
    az, el = np.abs(azimuth[rows]), np.abs(elevation[columns])
    horizontal = min(2.0 * float(np.rad2deg(az.max())), WIDEST_DEG)
    forward = np.cos(az) if horizontal <= _WIDEST_OF_A_PLANE_DEG else np.maximum(np.cos(az), np.sin(az))
    vertical = min(2.0 * float(np.rad2deg(np.arctan2(np.sin(el), forward * np.cos(el)).max())), WIDEST_DEG)
    return least, (horizontal, vertical)
