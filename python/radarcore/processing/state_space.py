"""States of targets and what a radar measures of them: range and range rate, with angles or without.

Targets that have no angles move in one dimension: state (range, velocity). Those with an azimuth move in the plane,
those with an elevation too in space: state (position, velocity), in the coordinates of a sensor at rest. In d
dimensions the first d + 1 of range, velocity, azimuth and elevation are measured.
"""

from __future__ import annotations

import numpy as np

from radarcore import _core
from radarcore.processing.kalman import Array

SHORTEST_RANGE = 1e-3
"""Nearer than this [m] there is no direction."""


def polar(state: Array, covariance: Array) -> tuple[Array, Array]:
    """Range, velocity, azimuth and elevation of targets (target, 4) with their covariance (target, 4, 4).

    The means of range and velocity are to second order, the covariance with what that adds. NaN for angles that are not
    told.
    """
    expected, known = _core.expected(np.ascontiguousarray(state), np.ascontiguousarray(covariance))
    number, told = expected.shape
    value, spread = np.full((number, 4), np.nan), np.full((number, 4, 4), np.nan)
    value[:, :told], spread[:, :told, :told] = expected, known
    return value, spread


def cartesian(state: Array) -> tuple[Array, Array]:
    """Places of targets and their rates, (target, 3) each; NaN without angles, 0 along z without an elevation."""
    number, d = len(state), state.shape[1] // 2
    position, motion = np.full((2, number, 3), np.nan if d == 1 else 0.0)
    if d > 1:
        position[:, :d], motion[:, :d] = state[:, :d], state[:, d:]
    return position, motion


def directions(azimuth: Array, elevation: Array) -> Array:
    """Unit vectors (..., 3) towards angles [rad]: x ahead, y to the left, z up."""
    across = np.cos(elevation)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)], axis=-1)


def points_at(values: Array) -> Array:
    """Points [m] at ranges, velocities, azimuths and perhaps elevations (target, 3 or 4): in the plane, or in space.

    An elevation that is not told counts as 0.
    """
    across = values[:, 0]
    if values.shape[1] > 3:
        elevation = np.where(np.isnan(values[:, 3]), 0.0, values[:, 3])
        up, across = across * np.sin(elevation), across * np.cos(elevation)
        return np.array([across * np.cos(values[:, 2]), across * np.sin(values[:, 2]), up]).T
    return np.array([across * np.cos(values[:, 2]), across * np.sin(values[:, 2])]).T
