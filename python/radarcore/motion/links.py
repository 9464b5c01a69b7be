"""Links of an arm or a person, or other bodies whose motions are worked out together."""

from __future__ import annotations

from typing import Protocol

from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Matrix, Pose, as_pose
from radarcore.motion.protocol import newest_update
from radarcore.sealed import sealed


class Links(Protocol):
    """Links of an arm or a person, evaluated together."""

    def link_poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` of all links at times (n,) [s], (n, link, 3, 4)."""
        ...

    def link_rates_at(self, times: ArrayLike) -> Matrix:
        """Time derivatives of `link_poses_at`."""
        ...


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
