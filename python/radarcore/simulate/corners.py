"""Corners of meshes that return the radar's wave after several reflections."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.mesh import bounds_of

_Floats = NDArray[np.float64]
_Triangles = NDArray[np.uint32]

_SMALLEST_FACE = 1.0
"""Area of the smallest triangle of a corner [square wavelengths]; smaller ones belong to curved surfaces or scatter."""

_RIGHT_ANGLE = np.sin(np.deg2rad(3.0))
"""Largest cosine between the normals of walls at a right angle."""

_SAME_PLACE = 1e-6
"""Distance below which vertices are one [m]."""


def corner_points(
    vertices: _Floats,
    triangles: _Triangles,
    at_creases: Callable[[], NDArray[np.uint32]],
    sensor: _Floats,
    wavelength: float,
) -> _Floats:
    """Points (n, 3) at which a mesh returns the wave of a sensor by two or three walls at right angles [m].

    Seen from the sensor, (3,) in the mesh's coordinates, both walls at an edge face it and each other, and the
    perpendicular from it meets the edge; or edges of such walls meet at a vertex. None for a sensor within the bounding
    box: every room has corners. `at_creases` numbers the triangles that meet another one at a large angle; it is asked
    only where some are large enough, as it takes ten times as long as their areas.
    """
    if len(triangles) == 0:
        return np.empty((0, 3))
    low, high = bounds_of(vertices)
    if ((sensor > low) & (sensor < high)).all():
        return np.empty((0, 3))
    large = _double_areas(vertices, triangles) >= 2.0 * _SMALLEST_FACE * wavelength**2
    if np.count_nonzero(large) < 2:
        return np.empty((0, 3))
    numbers = at_creases()
    faces = vertices[triangles[numbers[large[numbers]]]]
    if len(faces) < 2:
        return np.empty((0, 3))
    # Normals towards the sensor.
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    normals *= np.where(np.einsum("ij,ij->i", normals, sensor - faces[:, 0]) < 0.0, -1.0, 1.0)[:, None]

    # Edges that two triangles share, by the places of their ends.
    places, ids = np.unique(np.round(faces.reshape(-1, 3) / _SAME_PLACE), axis=0, return_inverse=True)
    ids = ids.reshape(-1, 3)
    ends = np.sort(np.concatenate([ids[:, [0, 1]], ids[:, [1, 2]], ids[:, [2, 0]]]), axis=1)
    owners = np.tile(np.arange(len(faces)), 3)
    opposite = np.concatenate([faces[:, 2], faces[:, 0], faces[:, 1]])
    order = np.lexsort(ends.T)
    first, second = order[:-1], order[1:]
    shared = (ends[first] == ends[second]).all(axis=1)
    first, second = first[shared], second[shared]

    start, end = (places[ends[first, side]] * _SAME_PLACE for side in (0, 1))
    one, other = normals[owners[first]], normals[owners[second]]
    is_right = np.abs(np.einsum("ij,ij->i", one, other)) <= _RIGHT_ANGLE
    faces_other = np.einsum("ij,ij->i", one, opposite[second] - start) > 0.0
    is_faced = np.einsum("ij,ij->i", other, opposite[first] - start) > 0.0
    found = is_right & faces_other & is_faced
    start, end, ends = start[found], end[found], ends[first[found]]

    along = end - start
    share = np.einsum("ij,ij->i", sensor - start, along) / np.einsum("ij,ij->i", along, along)
    met = (share >= 0.0) & (share <= 1.0)
    feet = start[met] + share[met, None] * along[met]
    shared_ends, counts = np.unique(ends, return_counts=True)
    return np.concatenate([feet, places[shared_ends[counts > 1]] * _SAME_PLACE])


def _double_areas(vertices: _Floats, triangles: _Triangles) -> _Floats:
    """Twice the areas of triangles [m^2]; axis by axis, as meshes may have a million of them."""
    axes = np.ascontiguousarray(vertices.T)
    first, second, third = np.ascontiguousarray(triangles.T)
    ax, ay, az = (axis[second] - axis[first] for axis in axes)
    bx, by, bz = (axis[third] - axis[first] for axis in axes)
    areas: _Floats = np.sqrt((ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2)
    return areas
