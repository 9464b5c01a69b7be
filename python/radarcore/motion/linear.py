"""Constant velocity and angular velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Pose, as_pose, not_a_pose, transforms
from radarcore.geometry.rotation import Matrix, cross_matrix
from radarcore.records import sealed
from radarcore.units import SPEED_OF_LIGHT

FASTEST_TURN = 1e7
"""No body turns faster [rad/s]: the fastest rotors are a thousand times slower."""


@sealed
@dataclass(eq=False)
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
        self.pose = pose
        for name, value, most, unit in (
            ("velocity", velocity, SPEED_OF_LIGHT, "m/s"),
            ("angular_velocity", angular_velocity, FASTEST_TURN, "rad/s"),
        ):
            setattr(self, name, check.frozen(check.below(name, check.array(name, value, (3,)), most, unit)))

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        return self._twist.poses_at(check.numbers("times", times))[:, 0]

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        rate: Matrix = self._twist.rates_at(check.numbers("times", [time]))[0, 0]
        return rate

    @cached_property
    def _twist(self) -> ConstantTwist:
        return together([self])


_CACHED = 2000
"""Poses that are computed together."""


def together(motions: Sequence[Linear]) -> ConstantTwist:
    """Several motions, evaluated by one call."""
    poses = [motion.pose for motion in motions]
    rotations, positions = np.array([pose.rotation for pose in poses]), np.array([pose.position for pose in poses])
    rates = ([motion.velocity for motion in motions], [motion.angular_velocity for motion in motions])
    return ConstantTwist(rotations, positions, *(np.array(values) for values in rates))


class ConstantTwist:
    """Poses that go on at constant velocity and angular velocity, turning about their origins.

    Parameters
    ----------
    rotations, positions : (body, 3, 3), (body, 3) float64
        Poses at time 0, to the world.
    velocities, angular_velocities : (body, 3) float64
        In world axes [m/s], [rad/s].
    """

    def __init__(self, rotations: Matrix, positions: Matrix, velocities: Matrix, angular_velocities: Matrix) -> None:
        speed = np.linalg.norm(angular_velocities, axis=-1)[:, None, None]
        axes = cross_matrix(angular_velocities) / np.where(speed > 0.0, speed, 1.0)
        self._start = transforms(rotations, positions)
        # Changes of the pose: per second, and with the sine and 1 - cosine of the angle (Rodrigues' formula).
        self._drift = transforms(0.0 * rotations, velocities)
        self._by_sine, self._by_versine = (
            transforms(turn @ rotations, 0.0 * positions) for turn in (axes, axes @ axes)
        )
        self._speed = speed

    def poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` at times (n,) [s], (n, body, 3, 4)."""
        poses = np.empty((len(times), *self._start.shape))
        # The poses of many bodies in parts that fit the cache.
        step = max(1, _CACHED // max(1, len(self._start)))
        for first in range(0, len(times), step):
            elapsed = times[first : first + step, None, None, None]
            half = (0.5 * elapsed) * self._speed
            # 1 - cos as 2 sin^2 keeps small angles exact.
            versine = 2.0 * np.sin(half) ** 2
            turned = np.multiply(np.sin(2.0 * half), self._by_sine, out=poses[first : first + step])
            turned += versine * self._by_versine
            turned += elapsed * self._drift
            turned += self._start
        return poses

    def rates_at(self, times: Matrix) -> Matrix:
        """Time derivatives of `poses_at`."""
        angle = times[:, None, None, None] * self._speed
        turning: Matrix = np.cos(angle) * self._by_sine + np.sin(angle) * self._by_versine
        turning *= self._speed
        turning += self._drift
        return turning

    def poses_and_rates_at(self, times: Matrix) -> list[Matrix]:
        """`poses_at` and `rates_at`."""
        return [self.poses_at(times), self.rates_at(times)]
