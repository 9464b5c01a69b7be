"""Motions that are evaluated together, and motions composed of others: one relative to another, and the inverse."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.pose import Pose, as_pose, transforms
from radarcore.geometry.rotation import Matrix
from radarcore.motion.linear import Linear, together
from radarcore.motion.protocol import (
    AnyMotion,
    LinkMotion,
    Links,
    Motion,
    SensorState,
    as_motion,
    factors_of,
    latest_update,
    poses_at,
    with_factors,
)
from radarcore.records import sealed

Members = NDArray[np.intp] | slice
"""Indices of the members of a group."""


class Group(Protocol):
    """Several motions, evaluated together."""

    def poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` at times (n,) [s], (n, member, 3, 4); (1, member, 3, 4) if all are equal."""
        ...

    def poses_and_rates_at(self, times: Matrix) -> ArrayLike:
        """`poses_at` and their time derivatives, (2, n, member, 3, 4)."""
        ...


class _Still:
    """Motions at rest: evaluated once."""

    def __init__(self, motions: Sequence[Motion]) -> None:
        poses = np.array([poses_at(motion, [0.0])[0] for motion in motions]).reshape(1, -1, 3, 4)
        self._both = np.array([poses, np.zeros_like(poses)])

    def poses_at(self, _: Matrix) -> Matrix:
        poses: Matrix = self._both[0]
        return poses

    def poses_and_rates_at(self, _: Matrix) -> ArrayLike:
        return self._both


class _Linked:
    """Some of the links of an arm or a person."""

    def __init__(self, links: Links, members: Sequence[int]) -> None:
        self._links, self._members = links, list(members)

    def poses_at(self, times: Matrix) -> Matrix:
        return self._links.link_poses_at(times)[:, self._members]

    def poses_and_rates_at(self, times: Matrix) -> ArrayLike:
        return self._links.link_poses_and_rates_at(times)[:, :, self._members]


class _Single:
    """Any other motion; one without `rates_at` is evaluated time by time."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion

    def poses_at(self, times: Matrix) -> Matrix:
        return poses_at(self._motion, times)[:, None]

    def poses_and_rates_at(self, times: Matrix) -> ArrayLike:
        together = getattr(self._motion, "rates_at", None)
        if together is None:
            rates = [check.array("rate_at", self._motion.rate_at(time), (3, 4)) for time in times.tolist()]
        else:
            rates = together(times)
        return [self.poses_at(times), np.reshape(rates, (-1, 1, 3, 4))]


class Motions:
    """Motions of several bodies at several times: as few calls as their groups allow.

    Parameters
    ----------
    motions : sequence of Motion
        One per body. All links of an arm or a person (`LinkMotion`) are evaluated by one call. An `Attached` motion is
        the product of its two factors. Every factor is evaluated once, however many motions share it.
    """

    def __init__(self, motions: Sequence[Motion]) -> None:
        motions = [motion.at(0.0) if factors_of(motion) and is_static(motion) else motion for motion in motions]
        ordered = with_factors(motions)
        places = {id(motion): number for number, motion in enumerate(ordered)}
        self._wanted = _members([places[id(motion)] for motion in motions])
        sources = {id(source): source for motion in ordered for source in [getattr(motion, "group", motion)]}
        self._live = [
            source for source in sources.values() if not factors_of(source) and latest_update(source) is not None
        ]
        self._composed = [
            (number, cast(Composed, motion), [places[id(factor)] for factor in factors_of(motion)])
            for number, motion in enumerate(ordered)
            if factors_of(motion)
        ]
        self._num_evaluated = len(ordered)
        self._groups = _groups(ordered)

    @property
    def newest(self) -> float | None:
        """Time of the newest update of what is live [s], minus infinity before the first; None if nothing is live."""
        return latest_update(*self._live)

    def poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` at times (n,) [s], (n, motion, 3, 4): body coordinates to the world."""
        poses = np.empty((len(times), self._num_evaluated, 3, 4))
        for group, numbers in self._groups:
            poses[:, numbers] = group.poses_at(times)
        for number, motion, factors in self._composed:
            poses[:, number] = motion.poses_of(*(poses[:, factor] for factor in factors))
        return poses[:, self._wanted]

    def rates_at(self, times: Matrix) -> Matrix:
        """Time derivatives of `poses_at`."""
        rates: Matrix = self.poses_and_rates_at(times)[1]
        return rates

    def poses_and_rates_at(self, times: Matrix) -> Matrix:
        """`poses_at` and `rates_at` in one evaluation, (2, n, motion, 3, 4)."""
        poses, rates = both = np.empty((2, len(times), self._num_evaluated, 3, 4))
        for group, numbers in self._groups:
            both[:, :, numbers] = group.poses_and_rates_at(times)
        for number, motion, factors in self._composed:
            of_factors = [values[:, factor] for values in both for factor in factors]
            poses[:, number] = motion.poses_of(*of_factors[: len(factors)])
            rates[:, number] = motion.rates_of(*of_factors)
        return both[:, :, self._wanted]


def sensor_state(motions: Motions, time: float, point: ArrayLike = (0.0, 0.0, 0.0)) -> SensorState:
    """State of a sensor by its motion, the only one of `motions`, at a time [s], with the velocity of a point of it."""
    newest = motions.newest
    age = 0.0 if newest is None else max(time - newest, 0.0)
    pose, rate = motions.poses_and_rates_at(np.array([time]))[:, 0, 0]
    check.finite("poses_at", pose)
    check.finite("rate_at", rate)
    return SensorState(check.frozen(pose), check.frozen(rate[:, :3] @ np.asarray(point) + rate[:, 3]), age)


class Composed(ABC):
    """A motion composed of others, its `factors`; each factor is evaluated once."""

    @property
    @abstractmethod
    def factors(self) -> tuple[Motion, ...]:
        """The motions that it is composed of."""

    poses_of: Callable[..., Matrix]
    rates_of: Callable[..., Matrix]

    @cached_property
    def _motions(self) -> Motions:
        return Motions(self.factors)

    @property
    def newest(self) -> float | None:
        """Time of the newest update of its live motions [s]; None without any."""
        return self._motions.newest

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        poses = self._motions.poses_at(np.asarray(times, dtype=np.float64))
        return self.poses_of(*poses.swapaxes(0, 1))

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        poses, rates = self._motions.poses_and_rates_at(np.array([time], dtype=np.float64))
        return self.rates_of(*poses[0], *rates[0])


def _groups(motions: Sequence[Motion]) -> list[tuple[Group, Members]]:
    """Groups of all motions except composed ones, each with the indices of its members."""
    still: list[int] = []
    uniform: list[int] = []
    linked: dict[int, list[int]] = {}
    single: list[int] = []
    for number, motion in enumerate(motions):
        if not factors_of(motion) and is_static(motion):
            still.append(number)
        elif type(motion) is Linear:
            uniform.append(number)
        elif isinstance(motion, LinkMotion):
            linked.setdefault(id(motion.group), []).append(number)
        elif not factors_of(motion):
            single.append(number)
    found: list[tuple[Group, list[int]]] = [(_Single(motions[number]), [number]) for number in single]
    if still:
        found.append((_Still([motions[number] for number in still]), still))
    if uniform:
        found.append((together([cast(Linear, motions[number]) for number in uniform]), uniform))
    for numbers in linked.values():
        links = [cast(LinkMotion, motions[number]) for number in numbers]
        found.append((_Linked(links[0].group, [link.member for link in links]), numbers))
    return [(group, _members(numbers)) for group, numbers in found]


def _members(numbers: list[int]) -> Members:
    """Indices as a slice where they follow each other, which numpy copies faster."""
    start = numbers[0] if numbers else 0
    stop = start + len(numbers)
    return slice(start, stop) if numbers == list(range(start, stop)) else np.array(numbers)


def is_static(motion: Motion) -> bool:
    """True when the pose is known to be the same at all times."""
    return all(_is_at_rest(part) for part in with_factors([motion]) if not factors_of(part))


def _is_at_rest(motion: Motion) -> bool:
    if type(motion) is Linear:
        return not (motion.velocity.any() or motion.angular_velocity.any())
    return type(motion) is Pose  # a subclass may move


@sealed
class Attached(Composed):
    """A motion relative to another: a body, or the radar, mounted on something that moves.

    Parameters
    ----------
    parent : motion
        Any motion, such as of a body or of a robot's link.
    motion : motion
        Relative to the parent, in its coordinates; default: at its origin, with its axes.

    See Also
    --------
    Linear : Constant velocity.
    models.MovingArm.link_motion : Motion of a robot's link, for a radar on it.

    Examples
    --------
    >>> cart = rc.Linear(rc.Pose(), velocity=[1.0, 0.0, 0.0])
    >>> radar = rc.Attached(cart, rc.Pose([0.2, 0.0, 0.5]))
    >>> radar.at(2.0).position
    array([2.2, 0. , 0.5])
    """

    def __init__(self, parent: AnyMotion, motion: AnyMotion | None = None) -> None:
        self.parent: Motion = as_motion("parent", parent)
        self.motion: Motion = Pose() if motion is None else as_motion("motion", motion)

    @property
    def factors(self) -> tuple[Motion, Motion]:
        """The parent, and the motion relative to it."""
        return self.parent, self.motion

    def poses_of(self, parent: Matrix, own: Matrix) -> Matrix:
        """Products of maps ``[rotation | position]``, (..., 3, 4): parent to world, and own to parent."""
        placed: Matrix = parent[..., :3] @ own
        placed[..., 3] += parent[..., 3]
        return placed

    def rates_of(self, parent: Matrix, own: Matrix, parent_rate: Matrix, own_rate: Matrix) -> Matrix:
        """Time derivatives of `poses_of`, by the product rule, (..., 3, 4)."""
        rates: Matrix = parent_rate[..., :3] @ own + parent[..., :3] @ own_rate
        rates[..., 3] += parent_rate[..., 3]
        return rates


@sealed
class Inverse(Composed):
    """Motion of the world as seen from a body: the inverse pose at every time.

    Parameters
    ----------
    motion : motion
        Any motion.
    """

    def __init__(self, motion: AnyMotion) -> None:
        self.motion: Motion = as_motion("motion", motion)

    @property
    def factors(self) -> tuple[Motion]:
        """The motion."""
        return (self.motion,)

    def poses_of(self, maps: Matrix) -> Matrix:
        """Inverses of maps ``[rotation | position]``, (..., 3, 4)."""
        back = np.swapaxes(maps[..., :3], -1, -2)
        return transforms(back, (-back @ maps[..., 3:])[..., 0])

    def rates_of(self, maps: Matrix, rates: Matrix) -> Matrix:
        """Time derivatives of `poses_of`, (..., 3, 4)."""
        back, turning = (np.swapaxes(values[..., :3], -1, -2) for values in (maps, rates))
        return transforms(turning, -(turning @ maps[..., 3:] + back @ rates[..., 3:])[..., 0])
