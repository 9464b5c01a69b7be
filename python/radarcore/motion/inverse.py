"""Motions the other way round."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from radarcore.geometry.pose import Matrix, Pose, transforms
from radarcore.motion.function import as_motion
from radarcore.motion.protocol import AnyMotion, Motion, poses_at
from radarcore.sealed import sealed


@sealed
class Inverse:
    """Motion of the world as seen from a body: the inverse pose at every time.

    Parameters
    ----------
    motion : motion
        Any motion.
    """

    def __init__(self, motion: AnyMotion) -> None:
        self.motion: Motion = as_motion("motion", motion)

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return self.motion.at(time).inverse()

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        maps = poses_at(self.motion, times)
        back = np.swapaxes(maps[..., :3], -1, -2)
        return transforms(back, -(back @ maps[..., 3:])[..., 0])

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        pose, rate = self.motion.at(time), self.motion.rate_at(time)
        back, turning = pose.rotation.T, rate[:, :3].T
        return transforms(turning, -(turning @ pose.position + back @ rate[:, 3]))
