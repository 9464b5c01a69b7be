"""A real man, by the joints and meshes of the package example-robot-data: segments, scaled to a height."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from radarcore.geometry.mesh import Mesh, merged_mesh
from radarcore.geometry.pose import Pose
from radarcore.models.people.figure import SEGMENTS, Floats, Skeleton, Support
from radarcore.models.robots import urdf
from radarcore.models.robots.arm import RobotArm
from radarcore.models.robots.named import data_file

HUMAN = "human_description/robots/human.urdf"
"""The man's file in the package."""

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


_UPRIGHT = Pose(rotation=[[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From the axes of the file (ISB: x forward, y up, z right) to x forward, y left, z up."""


def _segment_of(link: str, mesh: str) -> str:
    """Segment of a mesh of the real man, by the names of its link and of its file."""
    if mesh == "neck_mesh":
        return "neck"
    side = link.split("_")[0] + "_" if link.startswith(("left_", "right_")) else ""
    return side + _SEGMENTS_OF_LINKS[link.removeprefix(side)]


@cache
def real_man() -> tuple[dict[str, Floats], dict[str, Mesh]]:
    """Origins (3,) and meshes of the segments of the real man, standing upright on the floor [m]."""
    model = urdf.read(data_file(HUMAN), geometry="visual")
    tree = RobotArm(model.joints, dict.fromkeys(model.links))
    origins: dict[str, Floats] = {}
    placed: dict[str, list[tuple[Mesh, Pose]]] = {segment: [] for segment in SEGMENTS}
    for link, parts in model.links.items():
        pose = _UPRIGHT @ tree.link_pose(link, {})
        for part in parts:
            segment = _segment_of(link, Path(str(part.source)).stem)
            origins.setdefault(segment, pose.position)
            placed[segment].append((part.mesh(), pose @ part.origin))
    lowest = min(pose.apply(mesh.vertices)[:, 2].min() for each in placed.values() for mesh, pose in each)
    up = Pose([0.0, 0.0, -lowest])
    return (
        {segment: up.apply(origin) for segment, origin in origins.items()},
        {segment: merged_mesh([(mesh, up @ pose) for mesh, pose in each]) for segment, each in placed.items()},
    )


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
