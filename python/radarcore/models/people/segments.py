"""Skeletons and shapes of the segments of people: spheroids from anthropometry, and the meshes of a real man.

Segment lengths are fractions of the body height and volumes come from masses and densities: R. Drillis, R. Contini,
"Body segment parameters" (1966), and W. T. Dempster, "Space requirements of the seated operator" (1955), both as in
D. A. Winter, "Biomechanics and Motor Control of Human Movement".
"""

from __future__ import annotations

from functools import cache
from math import pi, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from radarcore.geometry.mesh import Mesh, merged_mesh
from radarcore.geometry.pose import Pose
from radarcore.models.people.figure import SEGMENTS, Floats, Skeleton, Support
from radarcore.models.robots import urdf
from radarcore.models.robots.arm import RobotArm
from radarcore.models.robots.named import data_file


class Spheroid(NamedTuple):
    """Shape of a segment in its own coordinates."""

    center: Floats
    semi_axes: Floats

    def lowest(self, down: Floats) -> Floats:
        """Smallest product of directions (n, 3) with points of the spheroid, (n,)."""
        return np.asarray(down @ self.center - np.linalg.norm(down * self.semi_axes, axis=-1))


def skeleton(height: float) -> Skeleton:
    """Joints by body height, Drillis and Contini."""
    _, y, z = height * np.eye(3)
    return Skeleton(
        waist=0.0 * z,
        hip=0.0955 * y,
        knee=-0.245 * z,
        ankle=-0.246 * z,
        neck=0.288 * z,
        head=0.340 * z,
        shoulder=0.1295 * y + 0.288 * z,
        elbow=-0.186 * z,
        wrist=-0.146 * z,
    )


def spheroids(height: float, mass: float) -> dict[str, Spheroid]:
    """Spheroids by kind of segment: lengths by body height, volumes by mass over density."""

    def volume(fraction: float, density: float) -> float:
        return fraction * mass / density

    def along_z(upper: float, lower: float, volume: float, half_width: float | None = None) -> Spheroid:
        """Spheroid between two heights, of revolution without `half_width` (lengths relative to body height)."""
        half_length = 0.5 * (upper - lower) * height
        section = volume / (4.0 / 3.0 * pi * half_length)
        across = sqrt(section) if half_width is None else half_width * height
        center = np.array([0.0, 0.0, 0.5 * (upper + lower) * height])
        return Spheroid(center, np.array([section / across, across, half_length]))

    # Wider than deep: between the breadths of chest (0.174) and shoulders (0.259).
    trunk = along_z(0.288, 0.0, volume(0.355, 1030.0), half_width=0.108)
    # The pelvis has the width between the hips and the depth of the trunk. Its volume gives 0.13 of the body's height.
    depth, breadth = trunk.semi_axes[0], 0.0955 * height
    pelvis_height = volume(0.142, 1030.0) / (4.0 / 3.0 * pi * depth * breadth)
    # The foot extends from the heel, a quarter of its length behind the ankle, to the toe, and upward from the sole.
    length, breadth_foot = 0.5 * 0.152 * height, 0.5 * 0.055 * height
    foot_height = volume(0.0145, 1100.0) / (4.0 / 3.0 * pi * length * breadth_foot)
    return {
        "pelvis": Spheroid(np.zeros(3), np.array([depth, breadth, pelvis_height])),
        "trunk": trunk,
        # The neck has a fifth of the mass of head and neck; half of its length overlaps head and trunk.
        "neck": along_z(0.078, -0.026, volume(0.2 * 0.081, 1110.0)),
        "head": along_z(0.130, 0.0, volume(0.8 * 0.081, 1110.0)),
        "thigh": along_z(0.0, -0.245, volume(0.100, 1050.0)),
        "shank": along_z(0.0, -0.246, volume(0.0465, 1090.0)),
        "foot": Spheroid(
            np.array([0.5 * length, 0.0, foot_height - 0.039 * height]),
            np.array([length, breadth_foot, foot_height]),
        ),
        "upper_arm": along_z(0.0, -0.186, volume(0.028, 1070.0)),
        "forearm": along_z(0.0, -0.146, volume(0.016, 1130.0)),
        "hand": along_z(0.0, -0.108, volume(0.006, 1160.0)),
    }


HUMAN = "human_description/robots/human.urdf"
"""The man's file in the package."""

# Segment of each link of the real man; the neck's mesh belongs to the head's link.
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
"""Rotation from the axes of the file (ISB: x forward, y up, z right) to x forward, y left, z up."""


def _segment_of(link: str, mesh: str) -> str:
    """Segment of a mesh of the real man, from the names of its link and its file."""
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
    """Smallest product of directions with the points (m, 3)."""
    from scipy.spatial import ConvexHull

    corners = points[ConvexHull(points).vertices]
    return lambda down: np.asarray((down @ corners.T).min(axis=-1))
