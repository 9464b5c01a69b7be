"""Motions of bodies: their interface, links of an arm or a person, and motions given by a function of time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Pose, as_pose, not_a_pose, transforms
from radarcore.geometry.rotation import Matrix
from radarcore.records import sealed


class Motion(Protocol):
    """Motion of a body or sensor: a pose at every time, and its rate of change.

    A motion may also have ``poses_at(times)``, which returns ``[rotation | position]`` at several times [s],
    (n, 3, 4); one without is evaluated time by time. One that a running program updates has ``newest``, see `Live`.
    """

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        ...

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        ...


AnyMotion = Motion | Callable[[float], Pose]
"""Motion as `Body` and `Simulator` take it: `Pose`, `Linear`, `Trajectory`, `Attached`, `Live`, a function of time."""


def newest_update(motion: object) -> float | None:
    """Time of the newest update [s] of a motion that is live, or rides on one; None of others.

    Minus infinity before the first update.
    """
    return getattr(motion, "newest", None)


def latest_update(*motions: object) -> float | None:
    """The latest of the newest updates of motions [s]; None if none of them is live."""
    times = [time for motion in motions if (time := newest_update(motion)) is not None]
    return max(times, default=None)


STALE = 0.1
"""A live motion whose newest update is older is stale [s]: at 1 m/s^2, it is off by 5 mm."""


class SensorState(NamedTuple):
    """Pose and velocity of a sensor at a time, in the world."""

    pose: Matrix
    """``[rotation | position]``, (3, 4): sensor coordinates to the world."""
    velocity: Matrix
    """Of its origin, or of the point in question, (3,) [m/s]."""
    age: float
    """Time since the newest update of a live motion [s]; 0 of other motions, and before that update."""


AT_REST = SensorState(check.frozen(np.eye(3, 4)), check.frozen(np.zeros(3)), 0.0)
"""A sensor whose axes are the world's."""


def factors_of(motion: Motion) -> tuple[Motion, ...]:
    """The motions that a motion such as `Attached` is composed of; empty for other motions.

    Empty for a subclass, too, which may have poses of its own.
    """
    factors: tuple[Motion, ...] = getattr(motion, "factors", ()) if "factors" in vars(type(motion)) else ()
    return factors


def with_factors(motions: Iterable[Motion]) -> list[Motion]:
    """The motions and all their factors: each once, factors before the motions composed of them."""
    found: dict[int, Motion] = {}
    pending = list(motions)
    while pending:
        missing = [factor for factor in factors_of(pending[-1]) if id(factor) not in found]
        if missing:
            pending += missing
        else:
            motion = pending.pop()
            found[id(motion)] = motion
    return list(found.values())


def poses_at(motion: Motion, times: ArrayLike) -> Matrix:
    """``[rotation | position]`` of any motion at several times [s], (n, 3, 4): body coordinates to the world."""
    together: Callable[[ArrayLike], Matrix] | None = getattr(motion, "poses_at", None)
    maps = one_by_one(motion, times) if together is None else together(times)
    if np.shape(maps) != (expected := (np.size(times), 3, 4)):
        raise ValueError(f"poses_at: expected shape {expected}, got {np.shape(maps)}")
    return maps


def one_by_one(motion: Motion, times: ArrayLike) -> Matrix:
    """``[rotation | position]`` by `Motion.at`, time by time, (n, 3, 4)."""
    poses = [motion.at(time) for time in check.numbers("times", times).tolist()]
    return np.array([transforms(pose.rotation, pose.position) for pose in poses]).reshape(-1, 3, 4)


class Links(Protocol):
    """Links of an arm or a person, evaluated together."""

    def link_poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` of all links at times (n,) [s], (n, link, 3, 4)."""
        ...

    def link_poses_and_rates_at(self, times: ArrayLike) -> Matrix:
        """`link_poses_at` and their time derivatives, (2, n, link, 3, 4)."""
        ...

    def link_rates_at(self, times: ArrayLike) -> Matrix:
        """Time derivatives of `link_poses_at`, (n, link, 3, 4)."""
        rates: Matrix = self.link_poses_and_rates_at(times)[1]
        return rates


@sealed
class LinkMotion:
    """Motion of one link of an arm or a person.

    Parameters
    ----------
    group : Links
        All links of the arm or the person.
    member : int
        Index of the link among them.
    """

    def __init__(self, group: Links, member: int) -> None:
        self.group: Links = group
        self.member: int = member

    @property
    def newest(self) -> float | None:
        """Time of the newest update of what carries the links [s]; None if that is not live."""
        return newest_update(self.group)

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        return self.group.link_poses_at(check.numbers("times", times))[:, self.member]

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        rate: Matrix = self.rates_at([time])[0]
        return rate

    def rates_at(self, times: ArrayLike) -> Matrix:
        """Time derivatives of ``[rotation | position]`` at several times [s], (n, 3, 4)."""
        return self.group.link_rates_at(check.numbers("times", times))[:, self.member]


@sealed
class FunctionMotion:
    """A motion given by a function that maps a time [s] to a `Pose`.

    Its rates are central differences of fourth order over steps of 0.5 ms, off by 2e-15 of the motion's fifth
    derivative [m/s^5].
    """

    def __init__(self, pose: Callable[[float], Pose]) -> None:
        self._pose = pose

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        pose = self._pose(time)
        if not isinstance(pose, Pose):
            raise not_a_pose("pose", "a function that returns Pose", pose, f" at {time:g} s")
        return pose

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4), one after another."""
        return one_by_one(self, times)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        return derivative(lambda when: self.poses_at([when])[0], time)


# Step of the finite differences of a function of time [s].
_STEP = 5e-4


def as_motion(name: str, motion: object) -> Motion:
    """The motion, a function wrapped, or a TypeError that names the argument."""
    if hasattr(motion, "at") and hasattr(motion, "rate_at"):
        return cast(Motion, motion)
    if callable(motion):
        return FunctionMotion(motion)
    raise not_a_pose(name, "Pose, Linear, Trajectory, Attached, Live or a function of time", motion)


def derivative(values: Callable[[float], Matrix], time: float) -> Matrix:
    """Time derivative of a function of time: central differences of fourth order, over steps of 0.5 ms."""
    near, far = ((values(time + step) - values(time - step)) / (2.0 * step) for step in (_STEP, 2.0 * _STEP))
    rate: Matrix = (4.0 * near - far) / 3.0
    return rate
