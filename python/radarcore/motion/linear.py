"""Constant velocity and angular velocity."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Matrix, Pose, as_pose, cross_matrix, not_a_pose, rotations_about, transforms
from radarcore.units import SPEED_OF_LIGHT

FASTEST_TURN = 1e7
"""No body turns faster [rad/s]: the fastest rotors are a thousand times slower."""


@dataclass(frozen=True, eq=False)
class Linear:
    """Constant velocity and angular velocity in world axes, turning about the pose's origin.

    Parameters
    ----------
    pose : Pose
        Pose of the body at absolute time 0.
    velocity : (3,) array_like
        Velocity of the pose's origin [m/s].
    angular_velocity : (3,) array_like
        Angular velocity [rad/s].

    See Also
    --------
    Trajectory : Motion through several poses.
    Function : Motion by a function of time.
    Attached : Motion relative to another.

    Examples
    --------
    >>> car = rc.Linear(rc.Pose([5.0, 0.0, 0.0]), velocity=[-2.0, 0.0, 0.0])
    >>> car.at(1.5).position
    array([2., 0., 0.])
    """

    pose: Pose
    velocity: Matrix
    angular_velocity: Matrix

    def __init__(
        self,
        pose: Pose,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        if not isinstance(pose, Pose):
            raise not_a_pose("pose", "Pose", pose)
        put = object.__setattr__
        put(self, "pose", pose)
        for name, value, most, unit in (
            ("velocity", velocity, SPEED_OF_LIGHT, "m/s"),
            ("angular_velocity", angular_velocity, FASTEST_TURN, "rad/s"),
        ):
            put(self, name, check.frozen(check.below(name, check.array(name, value, (3,)), most, unit)))

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        elapsed = check.numbers("times", times)[:, None]
        turned = rotations_about(elapsed * self.angular_velocity) @ self.pose.rotation
        return transforms(turned, self.pose.position + elapsed * self.velocity)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        turning = cross_matrix(self.angular_velocity) @ self.at(time).rotation
        return transforms(turning, self.velocity)
