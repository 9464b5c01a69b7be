"""Arms by name, from the files of the package example-robot-data (extra `robots`)."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from pathlib import Path
from typing import Literal, NamedTuple

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.models.robots import urdf
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
    """Joints and shapes by link; a KeyError that suggests near names."""
    if name not in ARMS:
        raise KeyError(f"no arm {name!r}; {check.near_names(name, ARMS)}")
    arm = ARMS[name]
    model = urdf.read(data_file(arm.file), geometry=geometry, held=arm.held)
    shapes = urdf.shapes_of(model._replace(links={**model.links, **{link: [] for link in arm.bare}}))
    return model.joints, shapes


UR10 = "urdf/ur10_robot.urdf"
"""The UR10's file in the package, as `data_file` finds it."""


def is_available() -> bool:
    """True when the extra `robots` is installed.

    See Also
    --------
    models.robots.arm_names : Arms that it has.
    models.RobotArm.named : One of them.

    Examples
    --------
    >>> rc.models.robots.is_available()
    True
    """
    try:
        importlib.metadata.distribution("example-robot-data")
    except ImportError:
        return False
    return importlib.util.find_spec("trimesh") is not None  # to import it takes half a second


def data_file(end: str) -> Path:
    """Path of the package's file whose path ends so, wherever the package is installed."""
    try:
        files = importlib.metadata.files("example-robot-data") or []
    except importlib.metadata.PackageNotFoundError:
        raise ImportError("robot and human meshes need example-robot-data: pip install radarcore[robots]") from None
    return Path(str(next(file.locate() for file in files if str(file).endswith("/" + end))))
