"""Arms of the package example-robot-data by name."""

from __future__ import annotations

from typing import Literal, NamedTuple

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.models.robots import urdf
from radarcore.models.robots.data import data_file
from radarcore.models.robots.joint import Joint


class Description(NamedTuple):
    """An arm of the package."""

    file: str
    """URDF file, as `data_file` finds it."""
    licence: str
    """Licence of the robot's files, as the package states it."""
    held: tuple[str, ...] = ()
    """Joints that stay where they are at zero: fingers of a hand."""
    bare: tuple[str, ...] = ()
    """Links whose shape is only a mark for the eye."""


_UR_MARK = ("ee_link",)  # a box of 1 cm

ARMS = {
    "ur3": Description("ur_description/urdf/ur3_robot.urdf", "BSD", bare=_UR_MARK),
    "ur5": Description("ur_description/urdf/ur5_robot.urdf", "BSD", bare=_UR_MARK),
    "ur10": Description("ur_description/urdf/ur10_robot.urdf", "BSD", bare=_UR_MARK),
    "panda": Description(
        "panda_description/urdf/panda.urdf", "Apache-2.0", held=("panda_finger_joint1", "panda_finger_joint2")
    ),
    "kinova": Description("kinova_description/robots/kinova.urdf", "BSD"),
    "xarm7": Description("xarm_description/urdf/xarm7.urdf", "BSD-3-Clause"),
    "so100": Description("so_arm_description/urdf/so100.urdf", "Apache-2.0"),
    "so101": Description("so_arm_description/urdf/so101.urdf", "Apache-2.0"),
}
"""Arms with a permissive licence."""


def arm_names() -> tuple[str, ...]:
    """Names that `RobotArm.named` knows.

    See Also
    --------
    models.RobotArm.named : The arm of a name.
    models.robots.is_available : Whether their files are there.

    Examples
    --------
    >>> rc.models.robots.arm_names()[:3]
    ('ur3', 'ur5', 'ur10')
    """
    return tuple(ARMS)


def read(name: str, geometry: Literal["collision", "visual"] | None) -> tuple[list[Joint], dict[str, Mesh | None]]:
    """Joints, from the base outwards, and shapes by link; a KeyError that suggests near names."""
    if name not in ARMS:
        raise KeyError(f"no arm {name!r}; {check.near_names(name, ARMS)}")
    arm = ARMS[name]
    model = urdf.read(data_file(arm.file), geometry=geometry, held=arm.held)
    shapes = urdf.shapes_of(model._replace(links={**model.links, **{link: [] for link in arm.bare}}))
    return _outwards(model.joints), shapes


def _outwards(joints: list[Joint]) -> list[Joint]:
    """Joints in an order where every one follows that of its parent."""
    children = {joint.child for joint in joints}
    reached = {joint.parent for joint in joints} - children
    ordered: list[Joint] = []
    while len(ordered) < len(joints):
        ordered += [joint for joint in joints if joint.parent in reached and joint not in ordered]
        reached |= {joint.child for joint in ordered}
    return ordered
