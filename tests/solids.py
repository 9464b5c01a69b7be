"""Areas and volumes of triangle meshes, and whether they are closed."""

from __future__ import annotations

import numpy as np

CUBE_VERTICES = "".join(f"v {x} {y} {z}\n" for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
"""Vertices of a cube of edge 1 in an OBJ file: those at z = 0 round it, then those at z = 1."""


def corners(mesh):
    return tuple(mesh.vertices[index] for index in mesh.triangles.T)


def directed_edges(mesh):
    return mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)


def area_vectors(mesh):
    a, b, c = corners(mesh)
    return 0.5 * np.cross(b - a, c - a)


def volume(mesh):
    return np.sum(corners(mesh)[0] * area_vectors(mesh)) / 3.0


def is_closed(mesh):
    """Every edge belongs to exactly two faces that run through it in opposite directions."""
    edges = directed_edges(mesh).astype(np.int64)
    there, back = (np.sort(a * len(mesh.vertices) + b) for a, b in (edges.T, edges.T[::-1]))
    return bool((np.diff(there) > 0).all() and np.array_equal(there, back))
