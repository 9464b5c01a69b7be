"""Whether something is where the antennas are: a scene that cannot be meant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radarcore.body import Body
from radarcore.scenefile import Simulation

# Nothing may be closer to an antenna than this when the run begins [m].
_CLEARANCE = 1e-3


def check_antennas(simulation: Simulation) -> None:
    """Refuse a surface or a point at an antenna when the run begins.

    A closed body around the sensor, such as a room or a housing, is legitimate: only surfaces count.
    """
    scene = simulation.scene
    antennas = np.concatenate([simulation.radar.tx, simulation.radar.rx])
    place = scene._place(np.array([simulation.run.start]), simulation.radar_motion, np.zeros(3))
    for pose, number in zip(place.poses[0], scene._mesh_numbers, strict=True):
        body = scene.bodies[number]
        assert isinstance(body, Body)  # the scene says so
        corners = body.mesh.vertices[body.mesh.triangles] @ pose[:, :3].T + pose[:, 3]
        _check_gap(min(_distance_to_triangles(antenna, corners) for antenna in antennas), scene.names[number])
    for point, number in zip(place.points[0], scene._point_numbers, strict=True):
        _check_gap(float(np.linalg.norm(point - antennas, axis=1).min()), scene.names[number])


def _check_gap(gap: float, name: str) -> None:
    if gap < _CLEARANCE:
        raise ValueError(
            f"pose: expected all antennas at least {1e3 * _CLEARANCE:g} mm from every surface when the run begins, "
            f"got {1e3 * gap:.2g} mm to {name!r}"
        )


def _distance_to_triangles(point: NDArray[np.float64], corners: NDArray[np.float64]) -> float:
    """Smallest distance of a point to triangles (n, 3, 3), none of them degenerate; inf without any."""
    from_point = corners - point
    edges = np.roll(from_point, -1, axis=1) - from_point

    # To the nearest point of every edge.
    along = np.clip(-(from_point * edges).sum(axis=-1) / (edges * edges).sum(axis=-1), 0.0, 1.0)
    to_edges = np.linalg.norm(from_point + along[..., None] * edges, axis=-1)

    # To the planes whose foot point lies inside the triangle.
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    heights = (from_point[:, 0] * normals).sum(axis=-1)
    feet = heights[:, None] * normals
    sides = (np.cross(edges, feet[:, None] - from_point) * normals[:, None]).sum(axis=-1)
    to_planes = np.abs(heights[(sides >= 0.0).all(axis=1)])
    return float(min(to_edges.min(initial=np.inf), to_planes.min(initial=np.inf)))
