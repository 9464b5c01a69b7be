"""Point of a surface that is nearest to a place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]


def nearest_points(places: _Floats, corners: _Floats) -> _Floats:
    """The nearest points of triangles to some places, (place, 3) [m].

    Parameters
    ----------
    places : (place, 3) float64
        In the coordinates of the triangles [m].
    corners : (triangle, 3, 3) float64
        Corners of each, at least one triangle, none degenerate [m].
    """
    from scipy.spatial import cKDTree  # here: importing radarcore imports numpy and nothing heavier

    if len(corners) == 0:
        raise ValueError("truth: expected a body with triangles, got an empty mesh")
    # A triangle can only have the nearest point if its centre is not farther than the nearest corner and its own reach.
    centres = corners.mean(axis=1)
    reach = float(np.linalg.norm(corners - centres[:, None], axis=-1).max())
    tree = cKDTree(centres)
    limits = cKDTree(corners.reshape(-1, 3)).query(places)[0] + reach
    candidates = tree.query_ball_point(places, limits * (1.0 + 1e-9))
    return np.array(
        [_nearest_point(place, corners[near]) for place, near in zip(places, candidates, strict=True)]
    ).reshape(-1, 3)


def _nearest_point(place: _Floats, corners: _Floats) -> _Floats:
    """The point of triangles (triangle, 3, 3) nearest to a place: on an edge, or inside of one of them."""
    edges = np.roll(corners, -1, axis=1) - corners
    along = np.clip(((place - corners) * edges).sum(axis=-1) / (edges * edges).sum(axis=-1), 0.0, 1.0)
    on_edges = corners + along[..., None] * edges
    gaps = np.square(on_edges - place).sum(axis=-1)
    triangle, edge = np.unravel_index(int(gaps.argmin()), gaps.shape)

    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    heights = ((place - corners[:, 0]) * normals).sum(axis=-1)
    feet = place - heights[:, None] * normals
    sides = (np.cross(edges, feet[:, None] - corners) * normals[:, None]).sum(axis=-1)
    inside = np.where((sides >= 0.0).all(axis=1), np.square(heights), np.inf)
    foot = int(inside.argmin())
    nearest: _Floats = feet[foot] if inside[foot] < gaps[triangle, edge] else on_edges[triangle, edge]
    return nearest
