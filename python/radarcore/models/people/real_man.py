"""A real man, by the meshes and joints of `robots.human_links`: segments, scaled to a height."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from radarcore.models.people.figure import SEGMENTS, Floats, Skeleton, Support
from radarcore.models.robots.links import human_joints, human_links

# Segments that the links of the real man belong to; the mesh of the neck is part of his head's link.
_SEGMENTS_OF_LINKS = {
    "middle_pelvis": "pelvis",
    "middle_abdomen": "trunk",
    "middle_thorax": "trunk",
    "middle_head": "head",
    "upperleg": "thigh",
    "lowerleg": "shank",
    "foot": "foot",
    "upperarm": "upper_arm",
    "lowerarm": "forearm",
    "hand": "hand",
}


def _segment_of(link: str) -> str:
    """Segment of a mesh of the real man, by its name ``link/mesh``."""
    body, _, mesh = link.partition("/")
    if mesh == "neck_mesh":
        return "neck"
    side = body.split("_")[0] + "_" if body.startswith(("left_", "right_")) else ""
    return side + _SEGMENTS_OF_LINKS[body.removeprefix(side)]


@cache
def real_man() -> tuple[dict[str, Floats], dict[str, tuple[Floats, NDArray[np.int64]]]]:
    """Origins (3,) and meshes of the segments of the real man, standing upright on the floor [m]."""
    origins = human_joints()
    rest: dict[str, Floats] = {}
    meshes: dict[str, list[tuple[Floats, NDArray[np.int64]]]] = {segment: [] for segment in SEGMENTS}
    for link in human_links():
        segment = _segment_of(link.name)
        rest.setdefault(segment, origins[link.name.split("/")[0]])
        before = sum(len(vertices) for vertices, _ in meshes[segment])
        placed = link.vertices @ link.pose[:3, :3].T + link.pose[:3, 3]
        meshes[segment].append((placed, link.triangles + before))
    return rest, {
        segment: (np.concatenate([v for v, _ in parts]), np.concatenate([rows for _, rows in parts]))
        for segment, parts in meshes.items()
    }


def real_skeleton(rest: dict[str, Floats], scale: float) -> Skeleton:
    """Joints of the real man from the origins of his segments."""
    hips, waist = 0.5 * (rest["left_thigh"] + rest["right_thigh"]), rest["trunk"]
    return Skeleton(
        waist=scale * (waist - hips),
        hip=scale * (rest["left_thigh"] - hips),
        knee=scale * (rest["left_shank"] - rest["left_thigh"]),
        ankle=scale * (rest["left_foot"] - rest["left_shank"]),
        neck=scale * (rest["neck"] - waist),
        head=scale * (rest["head"] - waist),
        shoulder=scale * (rest["left_upper_arm"] - waist),
        elbow=scale * (rest["left_forearm"] - rest["left_upper_arm"]),
        wrist=scale * (rest["left_hand"] - rest["left_forearm"]),
    )


def support(points: Floats) -> Support:
    """Smallest product of directions with points (m, 3)."""
    from scipy.spatial import ConvexHull

    corners = points[ConvexHull(points).vertices]
    return lambda down: np.asarray((down @ corners.T).min(axis=-1))
