"""Splines through poses at given times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Matrix, Pose, as_pose, cross_matrix, rotations_about, transforms
from radarcore.sealed import sealed


@sealed
class Trajectory:
    """A smooth motion through poses at given times: C2 splines of position and rotation.

    Positions follow a natural-ended cubic spline, rotations a `scipy.spatial.transform.RotationSpline`, so velocity and
    angular velocity are continuous and known in closed form. Before the first and after the last time the body goes
    on as it was moving there.

    Parameters
    ----------
    times : (n,) array_like
        Increasing [s], at least two.
    poses : sequence of Pose
        One per time.
    """

    def __init__(self, times: ArrayLike, poses: Sequence[Pose]) -> None:
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

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        wanted = np.asarray(times, dtype=np.float64)
        inside = np.clip(wanted, self.times[0], self.times[-1])
        rotation, position = self._rotation(inside).as_matrix(), self._position(inside)
        beyond = (wanted - inside)[:, None]
        if beyond.any():
            # The spline's angular velocity is in body axes.
            rotation = rotation @ rotations_about(self._rotation(inside, 1) * beyond)
            position = position + self._position(inside, 1) * beyond
        return transforms(rotation, position)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        inside = float(np.clip(time, self.times[0], self.times[-1]))
        # The spline's angular velocity is in body axes: d/dt R = R (omega x).
        turning = self.at(time).rotation @ cross_matrix(self._rotation(inside, 1))
        return transforms(turning, self._position(inside, 1))
