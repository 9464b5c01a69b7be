"""Corners of meshes that return the radar's wave after several reflections."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.edges import position_hashes, sides_by_edge
from radarcore.geometry.mesh import bounds_of

_Floats = NDArray[np.float64]
_Triangles = NDArray[np.uint32]

_SMALLEST_FACE = 1.0
"""Area of the smallest triangle of a corner [square wavelengths]; smaller ones belong to curved surfaces or scatter."""

_RIGHT_ANGLE = np.sin(np.deg2rad(3.0))
"""Largest cosine between the normals of walls at a right angle."""

_SAME_PLACE = 1e-6
"""Distance below which vertices are one [m]."""

_MOST_SHARED = 8
"""Largest number of triangles at an edge that are compared pair by pair."""


def corner_points(vertices: _Floats, triangles: _Triangles, sensor: _Floats, wavelength: float) -> _Floats:
    """Points (n, 3) at which a mesh returns the wave of a sensor by two or three walls at right angles [m].

    Seen from the sensor, (3,) in the mesh's coordinates, both walls at an edge face it and each other, and the
    perpendicular from it meets the edge; or edges of such walls meet at a vertex. None for a sensor within the bounding
    box: every room has corners.
    """
    if len(triangles) == 0:
        return np.empty((0, 3))
    low, high = bounds_of(vertices)
    if ((sensor > low) & (sensor < high)).all():
        return np.empty((0, 3))
    large = _double_areas(vertices, triangles) >= 2.0 * _SMALLEST_FACE * wavelength**2
    if np.count_nonzero(large) < 2:
        return np.empty((0, 3))
    faces = vertices[triangles[large]]
    # Normals towards the sensor.
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    normals *= np.where(np.einsum("ij,ij->i", normals, sensor - faces[:, 0]) < 0.0, -1.0, 1.0)[:, None]

    # Edges that two triangles share, by the places of their ends.
    hashes = position_hashes(np.round(faces.reshape(-1, 3) / _SAME_PLACE))
    _, example, numbers = np.unique(hashes, return_index=True, return_inverse=True)
    corners = numbers.reshape(-1, 3)
    order, edge = sides_by_edge(corners)
    shared = [np.flatnonzero(edge[step:] == edge[:-step]) for step in range(1, _MOST_SHARED)]
    edge = edge[np.concatenate(shared)]
    first, first_side = np.divmod(order[np.concatenate(shared)], 3)
    second, second_side = np.divmod(order[np.concatenate([at + k for k, at in enumerate(shared, 1)])], 3)

    start, end = faces[first, first_side], faces[first, (first_side + 1) % 3]
    one, other = normals[first], normals[second]
    is_right = np.abs(np.vecdot(one, other)) <= _RIGHT_ANGLE
    faces_other = np.vecdot(one, faces[second, (second_side + 2) % 3] - start) > 0.0
    is_faced = np.vecdot(other, faces[first, (first_side + 2) % 3] - start) > 0.0
    found = np.flatnonzero(is_right & faces_other & is_faced)
    found = found[np.unique(edge[found], return_index=True)[1]]
    start, end = start[found], end[found]
    ends = corners[first[found, None], (first_side[found, None] + [0, 1]) % 3]

    along = end - start
    share = np.vecdot(sensor - start, along) / np.vecdot(along, along)
    met = (share >= 0.0) & (share <= 1.0)
    feet = start[met] + share[met, None] * along[met]
    shared_ends, counts = np.unique(ends, return_counts=True)
    return np.concatenate([feet, faces.reshape(-1, 3)[example[shared_ends[counts > 1]]]])


def _double_areas(vertices: _Floats, triangles: _Triangles) -> _Floats:
    """Twice the areas of triangles [m^2]; axis by axis, as meshes may have a million of them."""
    axes = np.ascontiguousarray(vertices.T)
    first, second, third = np.ascontiguousarray(triangles.T)
    ax, ay, az = (axis[second] - axis[first] for axis in axes)
    bx, by, bz = (axis[third] - axis[first] for axis in axes)
    areas: _Floats = np.sqrt((ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2)
    return areas
