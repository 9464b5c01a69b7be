"""Joints, and joint angles as functions of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Pose, scaled
from radarcore.geometry.rotation import Matrix
from radarcore.records import sealed

JointAngles = Mapping[str, float] | Sequence[float] | Matrix
"""One angle [rad] (prismatic: [m]) per moving joint, in order; or by name, those left out being zero."""


@sealed
@dataclass(eq=False)
class Joint:
    """Joint between a link and its parent.

    Parameters
    ----------
    name, parent, child : str
        Names of the joint and of the two links.
    origin : Pose
        The joint in the parent's coordinates; the child's coordinates coincide with it at angle zero.
    axis : (3,) array_like, optional
        Direction of the axis in the child's coordinates, of any length; None for a fixed joint.
    kind : "revolute", "prismatic" or "fixed"
        Turns about the axis, slides along it, or neither.
    limits : (float, float), optional
        Smallest and largest angle [rad], or displacement [m].
    max_velocity : float, optional
        Largest rate [rad/s or m/s].
    """

    name: str
    parent: str
    child: str
    origin: Pose
    axis: Matrix | None
    kind: Literal["revolute", "prismatic", "fixed"]
    limits: tuple[float, float] | None
    max_velocity: float | None

    def __init__(
        self,
        name: str,
        parent: str,
        child: str,
        origin: Pose | None = None,
        axis: ArrayLike | None = None,
        kind: Literal["revolute", "prismatic", "fixed"] = "revolute",
        limits: tuple[float, float] | None = None,
        max_velocity: float | None = None,
    ) -> None:
        self.name = name
        self.parent = parent
        self.child = child
        self.origin = Pose() if origin is None else origin
        self.kind = check.choice("kind", kind, ("revolute", "prismatic", "fixed"))
        if (axis is None) != (kind == "fixed"):
            raise ValueError(
                f"axis: expected {'None for a fixed' if kind == 'fixed' else f'a direction for a {kind}'} joint, "
                f"got {axis!r} for {name!r}"
            )
        if axis is not None:
            direction = scaled(check.array("axis", axis, (3,)))
            if not (length := np.linalg.norm(direction)) > 0.0:
                raise ValueError(f"axis: expected a direction, got zero for {name!r}")
            axis = check.frozen(direction / length)
        self.axis = axis
        self.limits = None if limits is None else (float(limits[0]), float(limits[1]))
        if kind == "revolute" and limits is not None:
            check.radians(f"limits of {name!r}", np.array(self.limits))
        self.max_velocity = None if max_velocity is None else float(max_velocity)

    @property
    def unit(self) -> str:
        """Unit of the joint's angle: "rad", or "m" when it slides."""
        return "m" if self.kind == "prismatic" else "rad"


class Jointed(Protocol):
    """Object with joints that move, such as an arm."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints that move, in the order of joint angles."""
        ...

    @property
    def moving_joints(self) -> tuple[Joint, ...]:
        """The joints that move, in the order of joint angles."""
        ...


class JointMotion(Protocol):
    """Joint angles as a function of time, with their rates in closed form."""

    def angles(self, time: float) -> Matrix:
        """Joint angles at a time [s], (num_joints,) [rad or m]."""
        ...

    def rates(self, time: float) -> Matrix:
        """Time derivatives of `angles`, (num_joints,)."""
        ...
