"""Edges of triangle meshes, and hashes of positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]

_FACTORS = np.array([0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)
"""Odd multipliers for hashes (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014)."""


def position_hashes(positions: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Hashes of positions (n, 3), equal for equal ones; 0.0 and -0.0 are equal."""
    return _mixed((_mixed((positions + 0.0).view(np.uint64)) * _FACTORS).sum(axis=1, dtype=np.uint64))


def _mixed(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Values with every bit mixed into all others."""
    for factor in _FACTORS[1:]:
        values = (values ^ (values >> np.uint64(30))) * factor
    return values ^ (values >> np.uint64(31))


def sides_by_edge(corners: Indices) -> tuple[Indices, Indices]:
    """Sides of triangles in the order of their edges, and the number of the edge of each, (3 triangle,) both.

    `corners` (triangle, 3) are numbers of positions. Side ``3 t + k`` runs from corner k of triangle t to the next one.
    """
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    key = np.minimum(starts, ends) * (corners.max(initial=0) + 1) + np.maximum(starts, ends)
    order = key.argsort(kind="stable")
    key = key[order]
    return order, np.concatenate([[0], np.cumsum(key[1:] != key[:-1])])[: len(key)]
