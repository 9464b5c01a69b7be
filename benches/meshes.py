"""The room and the sphere of benches/common/mod.rs, for the benches in Python."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Triangles = tuple[Points, NDArray[np.uint32]]
"""Vertices (n, 3) and triangles (m, 3)."""


def room(num_triangles: int) -> Triangles:
    """A room of 6 x 5 x 2.8 m with bumpy walls and four spheres, about `num_triangles` in all.

    The origin is inside the room, half a metre from the wall behind it; the spheres are in front, along +x.
    """
    # Walls take half of the triangles, 12 (2 m)^2, and every sphere an eighth, 12 m^2.
    m = max(1, round(np.sqrt(num_triangles / 96)))

    def wall(points: Points) -> Points:
        walls = np.array([2.5, 0.0, 0.4]) + points * np.array([3.0, 2.5, 1.4])
        bumps = 0.02 * np.sin(walls * np.array([7.0, 9.0, 11.0])).sum(axis=1, keepdims=True)
        return walls - bumps * points

    places = [(1.5, 0.4, 0.0), (2.5, -0.7, 0.3), (3.5, 0.9, -0.3), (4.5, -0.2, 0.6)]
    return joined([box_grid(2 * m, wall), *(ball(m, 0.3, place) for place in places)])


def sphere(radius: float, num_triangles: int, center: tuple[float, float, float]) -> Triangles:
    """A sphere of about `num_triangles`."""
    return ball(max(1, round(np.sqrt(num_triangles / 12))), radius, center)


def ball(n: int, radius: float, center: tuple[float, float, float]) -> Triangles:
    return box_grid(n, lambda p: np.array(center) + radius * p / np.linalg.norm(p, axis=1, keepdims=True))


def box_grid(n: int, mapped: Callable[[Points], Points]) -> Triangles:
    """The faces of the cube from -1 to 1, `n` by `n` squares each, cut into triangles and mapped: 12 n^2 triangles."""
    ticks = 2.0 * np.arange(n + 1) / n - 1.0
    first = (n + 1) * np.arange(n)[:, None] + np.arange(n)
    a, b, c, d = first, first + n + 1, first + n + 2, first + 1
    faces = []
    for axis in range(3):
        for side in (1.0, -1.0):
            points = np.full((n + 1, n + 1, 3), side)
            points[..., (axis + 1) % 3] = ticks[:, None]
            points[..., (axis + 2) % 3] = ticks
            # Anticlockwise seen from outside.
            corners = [a, b, c, a, c, d] if side > 0.0 else [a, c, b, a, d, c]
            faces.append((mapped(points.reshape(-1, 3)), np.stack(corners, axis=-1).reshape(-1, 3).astype(np.uint32)))
    return joined(faces)


def joined(meshes: list[Triangles]) -> Triangles:
    """Meshes as one."""
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes[:-1])]).astype(np.uint32)
    triangles = [rows + first for (_, rows), first in zip(meshes, firsts, strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(triangles)
