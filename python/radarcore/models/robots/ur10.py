"""The UR10: kinematics, and shapes measured on the collision meshes of its ROS package."""

from __future__ import annotations

from math import pi

import numpy as np

from radarcore.geometry.mesh import Mesh, merged_mesh
from radarcore.geometry.pose import Pose
from radarcore.geometry.shapes import cylinder, sphere
from radarcore.models.robots.joint import Joint

# Joint: largest rate [rad/s], largest angle [rad], parent, child, xyz [m], pitch [rad], axis.
# From ur_description/urdf/ur10_robot.urdf of example-robot-data 6.0.0 (ros-industrial, BSD).
_X, _Y, _Z = np.eye(3)
_JOINTS = (
    ("shoulder_pan_joint", 2.16, 2.0 * pi, "base_link", "shoulder_link", (0.0, 0.0, 0.1273), 0.0, _Z),
    ("shoulder_lift_joint", 2.16, 2.0 * pi, "shoulder_link", "upper_arm_link", (0.0, 0.220941, 0.0), 0.5 * pi, _Y),
    ("elbow_joint", 3.15, pi, "upper_arm_link", "forearm_link", (0.0, -0.1719, 0.612), 0.0, _Y),
    ("wrist_1_joint", 3.2, 2.0 * pi, "forearm_link", "wrist_1_link", (0.0, 0.0, 0.5723), 0.5 * pi, _Y),
    ("wrist_2_joint", 3.2, 2.0 * pi, "wrist_1_link", "wrist_2_link", (0.0, 0.1149, 0.0), 0.0, _Z),
    ("wrist_3_joint", 3.2, 2.0 * pi, "wrist_2_link", "wrist_3_link", (0.0, 0.0, 0.1157), 0.0, _Y),
)

# Cylinders of every link: axis, (x, y, z) of a point on it, start and stop along it, radius [m].
# The end of a link on the axis of a joint is the start of the next link.
_CYLINDERS = {
    "base_link": [("z", (0.0, 0.0, 0.0), 0.0, 0.0383, 0.075)],
    "shoulder_link": [
        ("z", (0.0, 0.0, 0.0), -0.089, 0.078, 0.0755),
        ("y", (0.0, 0.0, 0.0), 0.0, 0.086, 0.0755),
    ],
    "upper_arm_link": [
        ("y", (0.0, 0.0, 0.0), -0.134941, 0.038, 0.075),
        ("z", (0.0, -0.047, 0.0), 0.0, 0.095, 0.0755),
        ("z", (0.0, -0.045, 0.0), 0.0, 0.612, 0.054),
        ("y", (0.0, 0.0, 0.612), -0.105, 0.017, 0.06),
    ],
    "forearm_link": [
        ("y", (0.0, 0.0, 0.0), -0.063, 0.0669, 0.0595),
        ("z", (0.0, 0.0, 0.0), 0.0, 0.085, 0.058),
        ("z", (0.0, -0.001, 0.0), 0.0, 0.5723, 0.043),
        ("y", (0.0, 0.0, 0.5723), -0.056, 0.061, 0.0455),
    ],
    "wrist_1_link": [
        ("y", (0.0, 0.0, 0.0), 0.061, 0.1149, 0.0455),
        ("z", (0.0, 0.1149, 0.0), -0.055, 0.062, 0.0455),
    ],
    "wrist_2_link": [
        ("z", (0.0, 0.0, 0.0), 0.062, 0.1157, 0.0455),
        ("y", (0.0, 0.0, 0.1157), -0.055, 0.0616, 0.0455),
    ],
    "wrist_3_link": [
        ("y", (0.0, 0.0, 0.0), 0.0616, 0.084, 0.045),
        ("y", (0.0, 0.0, 0.0), 0.084, 0.0922, 0.034),
    ],
    "tool0": [],
}

# A sphere rounds the corner where the two housings of a wrist meet at a right angle: centre, radius [m].
_SPHERES = {
    "wrist_1_link": ((0.0, 0.1149, 0.0), 0.0455),
    "wrist_2_link": ((0.0, 0.0, 0.1157), 0.0455),
}


def joints() -> list[Joint]:
    """The six joints, and the fixed one to the flange tool0."""
    moving = [
        Joint(name, parent, child, Pose.from_rpy(xyz, (0.0, pitch, 0.0)), axis, "revolute", (-angle, angle), rate)
        for name, rate, angle, parent, child, xyz, pitch, axis in _JOINTS
    ]
    flange = Pose.from_rpy((0.0, 0.0922, 0.0), (-0.5 * pi, 0.0, 0.0))
    return [*moving, Joint("wrist_3_link-tool0_fixed_joint", "wrist_3_link", "tool0", flange, kind="fixed")]


def shapes() -> dict[str, Mesh | None]:
    """Shapes by link; tool0 has none."""
    meshes: dict[str, Mesh | None] = {}
    for link, cylinders in _CYLINDERS.items():
        parts = []
        for axis, through, start, stop, radius in cylinders:
            # Shapes lie along z; -pi/2 about x turns z to y.
            roll = -0.5 * pi if axis == "y" else 0.0
            center = np.array(through) + 0.5 * (start + stop) * (_Y if axis == "y" else _Z)
            parts.append((cylinder(radius, stop - start), Pose.from_rpy(center, (roll, 0.0, 0.0))))
        if link in _SPHERES:
            middle, radius = _SPHERES[link]
            # Coarse facets: only strips of it show.
            parts.append((sphere(radius, subdivisions=3), Pose(middle)))
        meshes[link] = merged_mesh(parts) if parts else None
    return meshes
