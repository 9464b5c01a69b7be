"""Joints, and joint angles as functions of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.geometry.pose import Pose, scaled
from radarcore.geometry.rotation import Matrix
from radarcore.motion.series import Ends, check_steps
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
        check.choice("kind", kind, ("revolute", "prismatic", "fixed"))
        self.kind = kind
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


@sealed
class JointTrajectory:
    """Joint angles that pass through given values: C2 cubic splines.

    Parameters
    ----------
    times : (n,) array_like
        Increasing [s], at least two.
    angles : (n, num_joints) array_like
        One row per time [rad; m for joints that slide].
    arm : RobotArm, optional
        Warn when a joint is faster, or turned further, than this arm's can be.
    extrapolate : "hold", "continue" or "error", optional
        Before the first and after the last time the joints rest there, go on at the rates that they have there, or
        raise a ValueError. Default: they rest. With ``ends="rest"`` the rates at the ends are zero.
    ends : "rest" or "moving"
        At the first and the last time the joints are at rest; or they move there, as in a part of a longer, measured
        motion. The second derivative is zero then.

    See Also
    --------
    models.cartesian_line : Joint angles of a straight line.
    RobotArm.moving : Takes it.

    Examples
    --------
    >>> joints = rc.models.JointTrajectory([0.0, 1.0], [[0.0, -1.57], [0.6, -1.0]])
    >>> joints.angles(0.5)
    array([ 0.3  , -1.285])
    >>> joints.rates(0.5).round(2)
    array([0.9 , 0.86])
    """

    def __init__(
        self,
        times: ArrayLike,
        angles: ArrayLike,
        *,
        arm: Jointed | None = None,
        extrapolate: str | None = None,
        ends: str = "rest",
    ) -> None:
        from scipy.interpolate import CubicSpline

        self.times: NDArray[np.float64] = check.increasing("times", times)
        num_joints = None if arm is None else len(arm.joint_names)
        values = check.array("angles", angles, (len(self.times), num_joints))
        turns = [True] * values.shape[1] if arm is None else [joint.kind == "revolute" for joint in arm.moving_joints]
        check.radians("angles", values[:, turns])
        check.choice("ends", ends, ("rest", "moving"))
        self._spline = CubicSpline(self.times, values, bc_type="clamped" if ends == "rest" else "natural")
        self._derivative = self._spline.derivative()
        check_steps("times, angles", self.times, np.abs(np.diff(values, axis=0)).max(axis=1, initial=0.0))
        self._ends = Ends("JointTrajectory", self.times, extrapolate)
        if arm is not None:
            for excess in self.excesses(arm):
                notice.warn(excess)

    @property
    def extrapolate(self) -> str | None:
        """As given."""
        return self._ends.choice

    @property
    def num_joints(self) -> int:
        """Number of joints."""
        return int(self._spline.c.shape[2])

    def angles(self, time: ArrayLike) -> Matrix:
        """Joint angles at a time [s], (num_joints,) [rad or m], or at several, (n, num_joints)."""
        inside, elapsed = self._ends.split(time)
        result: Matrix = self._spline(inside)
        return result + elapsed[..., None] * self._derivative(inside) if elapsed.any() else result

    def rates(self, time: ArrayLike) -> Matrix:
        """Time derivatives at a time [s], (num_joints,) [rad/s or m/s], or at several, (n, num_joints)."""
        inside, _ = self._ends.split(time)
        result: Matrix = np.where(self._ends.moves(time)[..., None], self._derivative(inside), 0.0)
        return result

    def excesses(self, arm: Jointed) -> list[str]:
        """Violations of the limits of the joints of `arm`, one text each; anywhere, not only at `times`."""
        if len(arm.joint_names) != self.num_joints:
            raise ValueError(f"arm: expected {self.num_joints} joints that move, got {len(arm.joint_names)}")
        found = []
        for column, joint in enumerate(arm.moving_joints):
            if joint.max_velocity is not None:
                when, rate = _largest(self._derivative, column)
                if rate > joint.max_velocity * (1.0 + 1e-9):
                    found.append(
                        f"joint {joint.name!r} moves at {rate:.3g} {joint.unit}/s at {when:.3g} s, "
                        f"its limit is {joint.max_velocity:g} {joint.unit}/s"
                    )
            found += self._beyond(joint, column)
        return found

    def _beyond(self, joint: Joint, column: int) -> list[str]:
        if joint.limits is None:
            return []
        lower, upper = joint.limits
        when, beyond = _largest(self._spline, column, 0.5 * (lower + upper))
        if beyond <= 0.5 * (upper - lower) + 1e-9:
            return []
        angle = float(self._spline(when)[column])
        return [
            f"joint {joint.name!r} is at {angle:.3g} {joint.unit} at {when:.3g} s, "
            f"its limits are {lower:g} and {upper:g} {joint.unit}"
        ]


def _largest(spline: Any, column: int, center: float = 0.0) -> tuple[float, float]:
    """Time and size of the largest deviation of a spline's column from `center`: at knots and turning points."""
    from scipy.interpolate import PPoly

    piece = PPoly(spline.c[:, :, column], spline.x)
    turning = piece.derivative().roots(discontinuity=False, extrapolate=False)
    times = np.concatenate([spline.x, turning[np.isfinite(turning)]])
    distances = np.abs(piece(times) - center)
    k = int(distances.argmax())
    return float(times[k]), float(distances[k])
