"""Motions relative to another motion."""

from __future__ import annotations

from numpy.typing import ArrayLike

from radarcore.geometry.pose import Matrix, Pose, transforms
from radarcore.motion.function import as_motion
from radarcore.motion.protocol import AnyMotion, Motion, poses_at


class Attached:
    """A motion relative to another: a body, or the radar, mounted on something that moves.

    Parameters
    ----------
    parent : motion
        What it is mounted on: any motion, such as that of a body or of a robot's link.
    motion : motion
        How it is mounted, in the parent's coordinates; default: with the parent's axes at its origin.
    """

    def __init__(self, parent: AnyMotion, motion: AnyMotion | None = None) -> None:
        self.parent = as_motion("parent", parent)
        self.motion: Motion = Pose() if motion is None else as_motion("motion", motion)

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return self.parent.at(time) @ self.motion.at(time)

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        parent = poses_at(self.parent, times)
        placed: Matrix = parent[..., :3] @ poses_at(self.motion, times)
        placed[..., 3] += parent[..., 3]
        return placed

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        parent, rate = self.parent.at(time), self.parent.rate_at(time)
        own, own_rate = self.motion.at(time), self.motion.rate_at(time)
        turning = rate[:, :3] @ own.rotation + parent.rotation @ own_rate[:, :3]
        moving = rate[:, :3] @ own.position + parent.rotation @ own_rate[:, 3] + rate[:, 3]
        return transforms(turning, moving)
