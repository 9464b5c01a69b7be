"""Clearance of the antennas from the surfaces of a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.pose import relative_poses
from radarcore.motion.protocol import Motion, poses_at
from radarcore.radar.radar import Radar
from radarcore.scene.body import Body
from radarcore.scene.scene import Scene

# A body whose bounds have a longer diagonal may be a room around the sensor [m].
_ROOM = 2.0
# Smallest distance of a surface or point from an antenna at the start of a run [m].
_CLEARANCE = 1e-3


def check_antennas(scene: Scene, motion: Motion, radar: Radar, time: float) -> None:
    """Refuse a surface or a point at an antenna when the run begins, at a time [s].

    Nor may the antennas be inside a body, unless it is large enough to be a room around them.
    """
    antennas = np.concatenate([radar.tx, radar.rx])
    parts, sensor = scene.parts, poses_at(motion, [time])[0]
    poses = np.array([poses_at(body.motion, [time])[0] for body in parts.meshed]).reshape(-1, 3, 4)
    for pose, number in zip(relative_poses(poses, sensor), parts.mesh_numbers, strict=True):
        body = scene.bodies[number]
        assert isinstance(body, Body)  # by its number
        corners = body.mesh.vertices[body.mesh.triangles] @ pose[:, :3].T + pose[:, 3]
        _check_gap(min(_distance_to_triangles(antenna, corners) for antenna in antennas), scene.names[number])
        size = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0))) if len(corners) > 0 else 0.0
        if size < _ROOM and any(_is_inside(antenna, corners) for antenna in antennas):
            raise ValueError(
                f"pose: expected the antennas outside of every body smaller than {_ROOM:g} m when the run begins, "
                f"got them inside {scene.names[number]!r}"
            )
    points = (parts.positions + time * parts.velocities - sensor[:, 3]) @ sensor[:, :3]
    for point, number in zip(points, parts.point_numbers, strict=True):
        _check_gap(float(np.linalg.norm(point - antennas, axis=1).min()), scene.names[number])


def _check_gap(gap: float, name: str) -> None:
    if gap < _CLEARANCE:
        raise ValueError(
            f"pose: expected all antennas at least {1e3 * _CLEARANCE:g} mm from every surface when the run begins, "
            f"got {1e3 * gap:.2g} mm to {name!r}"
        )


def _is_inside(point: NDArray[np.float64], corners: NDArray[np.float64]) -> bool:
    """True when closed triangles (n, 3, 3) enclose a point: the solid angles add up to 4 pi, not to zero.

    Van Oosterom, Strackee, The solid angle of a plane triangle, IEEE Trans. Biomed. Eng. 30 (1983).
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(-1)
    cosines = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return bool(abs(np.arctan2(volume, cosines).sum()) > np.pi)


def _distance_to_triangles(point: NDArray[np.float64], corners: NDArray[np.float64]) -> float:
    """Smallest distance of a point to triangles (n, 3, 3), none of them degenerate; inf without any."""
    from_point = corners - point
    edges = np.roll(from_point, -1, axis=1) - from_point

    # Distance to the nearest point of every edge.
    along = np.clip(-(from_point * edges).sum(axis=-1) / (edges * edges).sum(axis=-1), 0.0, 1.0)
    to_edges = np.linalg.norm(from_point + along[..., None] * edges, axis=-1)

    # Distance to the planes whose foot point lies inside the triangle.
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    heights = (from_point[:, 0] * normals).sum(axis=-1)
    feet = heights[:, None] * normals
    sides = (np.cross(edges, feet[:, None] - from_point) * normals[:, None]).sum(axis=-1)
    to_planes = np.abs(heights[(sides >= 0.0).all(axis=1)])
    return float(min(to_edges.min(initial=np.inf), to_planes.min(initial=np.inf)))
