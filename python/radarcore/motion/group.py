"""Motions that are evaluated together: all that stands still, all uniform motions, the links of an arm or a person."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.pose import Matrix, cross_matrix, rotations_about, transforms
from radarcore.motion.linear import Linear
from radarcore.motion.protocol import Motion, poses_at
from radarcore.motion.static import is_static


class Links(Protocol):
    """Motions of several links, by one call for all of them: an arm, a person."""

    def link_poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` of all links at times (n,) [s], (n, link, 3, 4) or (n, link, 4, 4)."""
        ...

    def link_rates_at(self, times: Matrix) -> Matrix:
        """Time derivatives of `link_poses_at`."""
        ...


class Group(Protocol):
    """Several motions, by one call for all of them."""

    def poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` at times (n,) [s], (n, member, 3, 4)."""
        ...

    def rates_at(self, times: Matrix) -> Matrix:
        """Time derivatives of `poses_at`."""
        ...


class _Still:
    """Motions that are known to stand still: placed once."""

    def __init__(self, motions: Sequence[Motion]) -> None:
        self._poses = np.array([poses_at(motion, [0.0])[0] for motion in motions]).reshape(-1, 3, 4)

    def poses_at(self, times: Matrix) -> Matrix:
        return np.broadcast_to(self._poses, (len(times), *self._poses.shape))

    def rates_at(self, times: Matrix) -> Matrix:
        return np.broadcast_to(0.0, (len(times), *self._poses.shape))


class _Uniform:
    """Constant velocities and angular velocities."""

    def __init__(self, motions: Sequence[Linear]) -> None:
        self._positions = np.array([motion.pose.position for motion in motions])
        self._rotations = np.array([motion.pose.rotation for motion in motions])
        self._velocities = np.array([motion.velocity for motion in motions])
        self._turning = np.array([motion.angular_velocity for motion in motions])

    def poses_at(self, times: Matrix) -> Matrix:
        elapsed = times[:, None, None]
        angles = (elapsed * self._turning).reshape(-1, 3)
        turns = rotations_about(angles).reshape(len(times), -1, 3, 3)
        return transforms(turns @ self._rotations, self._positions + elapsed * self._velocities)

    def rates_at(self, times: Matrix) -> Matrix:
        turning = cross_matrix(self._turning) @ self.poses_at(times)[..., :3]
        return transforms(turning, np.broadcast_to(self._velocities, turning.shape[:-1]))


class _Linked:
    """Some of the links of an arm or a person."""

    def __init__(self, links: Links, members: Sequence[int]) -> None:
        self._links, self._members = links, list(members)

    def poses_at(self, times: Matrix) -> Matrix:
        return self._links.link_poses_at(times)[:, self._members, :3]

    def rates_at(self, times: Matrix) -> Matrix:
        return self._links.link_rates_at(times)[:, self._members, :3]


class _Single:
    """Any other motion by itself; one without `rates_at` is asked time by time."""

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
        One per body. Motions with attributes `group` and `member` are links of that group, see `Links`.
    """

    def __init__(self, motions: Sequence[Motion]) -> None:
        still: list[int] = []
        uniform: list[int] = []
        linked: dict[int, list[int]] = {}
        single: list[int] = []
        for number, motion in enumerate(motions):
            if is_static(motion):
                still.append(number)
            elif type(motion) is Linear:
                uniform.append(number)
            elif hasattr(motion, "group") and hasattr(motion, "member"):
                linked.setdefault(id(motion.group), []).append(number)
            else:
                single.append(number)
        self._number = len(motions)
        self._groups: list[tuple[Group, NDArray[np.intp]]] = []
        if still:
            self._add(_Still([motions[number] for number in still]), still)
        if uniform:
            self._add(_Uniform([cast(Linear, motions[number]) for number in uniform]), uniform)
        for numbers in linked.values():
            links = [motions[number] for number in numbers]
            self._add(_Linked(links[0].group, [link.member for link in links]), numbers)  # type: ignore[attr-defined]  # looked for above
        for number in single:
            self._add(_Single(motions[number]), [number])

    def _add(self, group: Group, numbers: list[int]) -> None:
        self._groups.append((group, np.array(numbers)))

    def poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` at times (n,) [s], (n, motion, 3, 4): body coordinates to the world."""
        poses = np.empty((len(times), self._number, 3, 4))
        for group, numbers in self._groups:
            poses[:, numbers] = group.poses_at(times)
        return poses

    def rates_at(self, times: Matrix) -> Matrix:
        """Time derivatives of `poses_at`."""
        rates = np.empty((len(times), self._number, 3, 4))
        for group, numbers in self._groups:
            rates[:, numbers] = group.rates_at(times)
        return rates
