"""Clearance of the antennas from the surfaces of a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar
from radarcore.scene.scene import Scene

# A body whose bounds have a longer diagonal may be a room around the sensor [m].
_ROOM = 2.0
# Smallest distance of a surface or point from an antenna at the start of a run [m].
_CLEARANCE = 1e-3


def check_antennas(
    scene: Scene, poses: NDArray[np.float64], radar: Radar, time: float, *, name: str = "radar_motion"
) -> None:
    """Refuse a surface or a point at an antenna when a run begins, at a time [s]; `name` is what places the radar.

    Nor may the antennas be inside a body, unless it is large enough to be a room around them. `poses`, those of the
    bodies with meshes and of the sensor at that time, (body + 1, 3, 4), to the world.
    """
    antennas = np.concatenate([radar.tx, radar.rx])
    parts, sensor = scene.parts, poses[-1]
    world = antennas @ sensor[:, :3].T + sensor[:, 3]
    for mesh, number in enumerate(parts.mesh_numbers):
        pose = poses[mesh]
        local = (world - pose[:, 3]) @ pose[:, :3]
        # Few antennas are near the box around a body, and few triangles near these antennas.
        low, high = parts.bounds_at(mesh, time)
        near = local[((local > low - _CLEARANCE) & (local < high + _CLEARANCE)).all(axis=1)]
        if len(near) == 0:
            continue
        corners = parts.vertices_at(mesh, time)[parts.meshed[mesh].mesh.triangles]
        lowest, highest = corners.min(axis=1) - _CLEARANCE, corners.max(axis=1) + _CLEARANCE
        for antenna in near:
            beside = corners[((antenna > lowest) & (antenna < highest)).all(axis=1)]
            _check_gap(_distance_to_triangles(antenna, beside), name, scene.names[number])
        if np.linalg.norm(high - low) < _ROOM and any(_is_inside(antenna, corners) for antenna in near):
            raise ValueError(
                f"{name}: expected the antennas outside of every body smaller than {_ROOM:g} m when the run begins, "
                f"got them inside {scene.names[number]!r}"
            )
    points = parts.positions + time * parts.velocities
    for point, number in zip(points, parts.point_numbers, strict=True):
        _check_gap(float(np.linalg.norm(point - world, axis=1).min()), name, scene.names[number])


def _check_gap(gap: float, name: str, body: str) -> None:
    if gap < _CLEARANCE:
        raise ValueError(
            f"{name}: expected all antennas at least {1e3 * _CLEARANCE:g} mm from every surface when the run begins, "
            f"got {1e3 * gap:.2g} mm to {body!r}"
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
