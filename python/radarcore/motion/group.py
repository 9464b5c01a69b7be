"""Motions that are evaluated together: at rest, uniform, live, and the links of an arm or a person."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.pose import Matrix
from radarcore.motion.attached import Attached, carried_poses, carried_rates
from radarcore.motion.linear import Linear
from radarcore.motion.links import LinkMotion, Links
from radarcore.motion.live import Live, Together
from radarcore.motion.protocol import Motion, newest_of, poses_at
from radarcore.motion.static import is_static
from radarcore.motion.uniform import Uniform

Members = NDArray[np.intp] | slice
"""Indices of the members of a group."""


class Group(Protocol):
    """Several motions, evaluated together."""

    def poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` at times (n,) [s], (n, member, 3, 4); (1, member, 3, 4) if all are equal."""
        ...

    def rates_at(self, times: Matrix) -> Matrix:
        """Time derivatives of `poses_at`."""
        ...


class _Still:
    """Motions at rest: evaluated once."""

    def __init__(self, motions: Sequence[Motion]) -> None:
        self._poses = np.array([poses_at(motion, [0.0])[0] for motion in motions]).reshape(1, -1, 3, 4)

    def poses_at(self, _: Matrix) -> Matrix:
        return self._poses

    def rates_at(self, _: Matrix) -> Matrix:
        return np.zeros_like(self._poses)


def _uniform(motions: Sequence[Linear]) -> Uniform:
    """Constant velocities and angular velocities."""
    poses = [motion.pose for motion in motions]
    rotations, positions = np.array([pose.rotation for pose in poses]), np.array([pose.position for pose in poses])
    rates = ([motion.velocity for motion in motions], [motion.angular_velocity for motion in motions])
    return Uniform(rotations, positions, *(np.array(values) for values in rates))


class _Linked:
    """Some of the links of an arm or a person."""

    def __init__(self, links: Links, members: Sequence[int]) -> None:
        self._links, self._members = links, list(members)

    def poses_at(self, times: Matrix) -> Matrix:
        return self._links.link_poses_at(times)[:, self._members]

    def rates_at(self, times: Matrix) -> Matrix:
        return self._links.link_rates_at(times)[:, self._members]


class _Single:
    """Any other motion; one without `rates_at` is evaluated time by time."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion

    def poses_at(self, times: Matrix) -> Matrix:
        return poses_at(self._motion, times)[:, None]

    def rates_at(self, times: Matrix) -> Matrix:
        together = getattr(self._motion, "rates_at", None)
        if together is not None:
            return cast(Matrix, together(times))[:, None]
        return np.array([self._motion.rate_at(time) for time in times.tolist()]).reshape(-1, 1, 3, 4)


class Motions:
    """Motions of several bodies at several times: as few calls as their groups allow.

    Parameters
    ----------
    motions : sequence of Motion
        One per body. All links of an arm or a person (`LinkMotion`) are evaluated by one call. An `Attached` motion is
        the product of its two factors, which are evaluated with all others.
    """

    def __init__(self, motions: Sequence[Motion]) -> None:
        self._number = len(motions)
        sources = {id(source): source for motion in motions for source in [getattr(motion, "group", motion)]}
        self._live = [source for source in sources.values() if newest_of(source) is not None]
        every = list(motions)
        numbers = {id(motion): number for number, motion in enumerate(every) if not _is_product(motion)}
        self._products: list[tuple[int, int, int]] = []
        for number, motion in enumerate(every):  # which grows by the factors of products
            if isinstance(motion, Attached) and _is_product(motion):
                parent, own = (_place_of(factor, every, numbers) for factor in (motion.parent, motion.motion))
                self._products.append((number, parent, own))
        # Factors stand behind their products.
        self._products.reverse()
        self._num_evaluated = len(every)
        self._groups = _groups(every)

    @property
    def newest(self) -> float | None:
        """Time of the newest update of what is live [s], minus infinity before the first; None if nothing is live."""
        return newest_of(*self._live)

    def poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` at times (n,) [s], (n, motion, 3, 4): body coordinates to the world."""
        return self._poses(times)[:, : self._number]

    def rates_at(self, times: Matrix) -> Matrix:
        """Time derivatives of `poses_at`."""
        rates = np.empty((len(times), self._num_evaluated, 3, 4))
        for group, numbers in self._groups:
            rates[:, numbers] = group.rates_at(times)
        if self._products:
            poses = self._poses(times)
            for number, parent, own in self._products:
                rates[:, number] = carried_rates(poses[:, parent], rates[:, parent], poses[:, own], rates[:, own])
        return rates[:, : self._number]

    def _poses(self, times: Matrix) -> Matrix:
        """Poses of the motions and of the factors of products, (n, evaluated, 3, 4)."""
        poses = np.empty((len(times), self._num_evaluated, 3, 4))
        for group, numbers in self._groups:
            poses[:, numbers] = group.poses_at(times)
        for number, parent, own in self._products:
            poses[:, number] = carried_poses(poses[:, parent], poses[:, own])
        return poses


def _is_product(motion: Motion) -> bool:
    return type(motion) is Attached and not is_static(motion)


def _place_of(factor: Motion, every: list[Motion], numbers: dict[int, int]) -> int:
    """Index of a factor in `every`, appended unless it is there; a product always is, behind those that contain it."""
    if not _is_product(factor) and id(factor) in numbers:
        return numbers[id(factor)]
    every.append(factor)
    numbers[id(factor)] = len(every) - 1
    return len(every) - 1


def _groups(motions: Sequence[Motion]) -> list[tuple[Group, Members]]:
    """Groups of all motions but products, each with the indices of its members."""
    still: list[int] = []
    uniform: list[int] = []
    live: list[int] = []
    linked: dict[int, list[int]] = {}
    single: list[int] = []
    for number, motion in enumerate(motions):
        if is_static(motion):
            still.append(number)
        elif type(motion) is Linear:
            uniform.append(number)
        elif type(motion) is Live:
            live.append(number)
        elif isinstance(motion, LinkMotion):
            linked.setdefault(id(motion.group), []).append(number)
        elif not _is_product(motion):
            single.append(number)
    found: list[tuple[Group, list[int]]] = [(_Single(motions[number]), [number]) for number in single]
    if still:
        found.append((_Still([motions[number] for number in still]), still))
    if uniform:
        found.append((_uniform([cast(Linear, motions[number]) for number in uniform]), uniform))
    if live:
        found.append((Together([cast(Live, motions[number]) for number in live]), live))
    for numbers in linked.values():
        links = [cast(LinkMotion, motions[number]) for number in numbers]
        found.append((_Linked(links[0].group, [link.member for link in links]), numbers))
    return [(group, _members(numbers)) for group, numbers in found]


def _members(numbers: list[int]) -> Members:
    """Indices as a slice where they follow each other, which numpy copies faster."""
    start, stop = numbers[0], numbers[-1] + 1
    return slice(start, stop) if numbers == list(range(start, stop)) else np.array(numbers)
