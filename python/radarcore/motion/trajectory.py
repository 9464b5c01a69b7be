"""Splines through poses at given times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Matrix, Pose, as_pose, cross_matrix, rotations_about, transforms
from radarcore.motion.ends import Ends
from radarcore.sealed import sealed


@sealed
class Trajectory:
    """A smooth motion through poses at given times: C2 splines of position and rotation.

    Positions follow a natural-ended cubic spline, rotations a `scipy.spatial.transform.RotationSpline`, so velocity and
    angular velocity are continuous and known in closed form.

    Parameters
    ----------
    times : (n,) array_like
        Increasing [s], at least two.
    poses : sequence of Pose
        One per time.
    beyond : "hold", "continue" or "error", optional
        Before the first and after the last time the body rests there, goes on at the velocity and angular velocity
        that it has there, or raises a ValueError. Default: it goes on, which is warned of once.
    """

    def __init__(self, times: ArrayLike, poses: Sequence[Pose], *, beyond: str | None = None) -> None:
        from scipy.interpolate import CubicSpline
        from scipy.spatial.transform import Rotation, RotationSpline

        self.times = check.increasing("times", times)
        self.poses = tuple(poses)
        if len(self.poses) != len(self.times):
            raise ValueError(f"poses: expected {len(self.times)}, one per time, got {len(self.poses)}")
        for k, pose in enumerate(self.poses):
            if not isinstance(pose, Pose):
                raise TypeError(f"poses: expected Pose, got {type(pose).__name__} at index {k}")
        positions = np.array([pose.position for pose in self.poses])
        self._position = CubicSpline(self.times, positions, bc_type="natural")
        self._rotation = RotationSpline(
            self.times, Rotation.from_matrix(np.array([pose.rotation for pose in self.poses]))
        )
        first, last = (
            float(max(np.abs(self._position(end, 1)).max(), np.abs(self._rotation(end, 1)).max()))
            for end in self.times[[0, -1]]
        )
        self._ends = Ends("Trajectory", self.times, beyond, (first, last))

    @property
    def beyond(self) -> str | None:
        """As given."""
        return self._ends.choice

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        inside, elapsed = self._ends.split(times)
        rotation, position = self._rotation(inside).as_matrix(), self._position(inside)
        beyond = elapsed[:, None]
        if beyond.any():
            # The spline's angular velocity is in body axes.
            rotation = rotation @ rotations_about(self._rotation(inside, 1) * beyond)
            position = position + self._position(inside, 1) * beyond
        return transforms(rotation, position)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        inside, _ = self._ends.split(time)
        if not self._ends.moves(time):
            return np.zeros((3, 4))
        # The spline's angular velocity is in body axes: d/dt R = R (omega x).
        turning = self.at(time).rotation @ cross_matrix(self._rotation(inside, 1))
        return transforms(turning, self._position(inside, 1))
