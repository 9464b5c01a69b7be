"""Rigid motion: poses, constant twists, and what one body sees of another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check

Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """A fixed place: maps body (or sensor) coordinates to the world, ``rotation @ x + position``.

    Parameters
    ----------
    position : (3,) array_like
        Origin of the body in the world [m].
    rotation : (3, 3) array_like
        Body axes in the world, as columns.

    Raises
    ------
    ValueError
        When `rotation` is not a rotation to 1e-6 (what is left is removed).
    """

    position: Matrix
    rotation: Matrix

    def __init__(self, position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike | None = None) -> None:
        matrix = check.array("rotation", np.eye(3) if rotation is None else rotation, (3, 3))
        error = np.abs(matrix @ matrix.T - np.eye(3)).max()
        if error > 1e-6 or np.linalg.det(matrix) < 0.0:
            raise ValueError(
                f"rotation: expected a rotation matrix (orthonormal, determinant +1), got one with "
                f"deviation {error:.3g} and determinant {np.linalg.det(matrix):.3g}"
            )
        if error > 1e-15:
            u, _, vt = np.linalg.svd(matrix)
            matrix = u @ vt
        object.__setattr__(self, "position", check.frozen(check.array("position", position, (3,))))
        object.__setattr__(self, "rotation", check.frozen(matrix))

    @classmethod
    def _unchecked(cls, position: Matrix, rotation: Matrix) -> Pose:
        """A pose from numbers that are known to be one: products of rotations need no second look."""
        pose = object.__new__(cls)
        object.__setattr__(pose, "position", check.frozen(position))
        object.__setattr__(pose, "rotation", check.frozen(rotation))
        return pose

    @classmethod
    def look_at(cls, position: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> Pose:
        """Pose at `position` whose x axis points to `target`, with z as close to `up` as it can be."""
        origin = check.array("position", position, (3,))
        x = check.array("target", target, (3,)) - origin
        y = np.cross(check.array("up", up, (3,)), x)
        if not np.linalg.norm(x) > 0.0:
            raise ValueError(f"target: expected a point other than the position, got {origin}")
        if np.linalg.norm(y) <= 1e-9 * np.linalg.norm(x):
            raise ValueError("up: expected a direction that is not along the line of sight")
        x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        return cls(origin, np.column_stack([x, y, np.cross(x, y)]))

    @classmethod
    def from_quaternion(cls, position: ArrayLike, quaternion: ArrayLike) -> Pose:
        """Pose from a quaternion in the order (w, x, y, z), of any length but zero."""
        q = check.array("quaternion", quaternion, (4,))
        if not np.linalg.norm(q) > 0.0:
            raise ValueError("quaternion: expected (w, x, y, z) of any length but zero")
        w, *v = q / np.linalg.norm(q)
        cross = _cross_matrix(np.array(v))
        return cls(position, np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross)

    @classmethod
    def from_rpy(cls, position: ArrayLike, rpy: ArrayLike) -> Pose:
        """Pose from roll, pitch and yaw [rad] about the fixed axes x, y and z, in that order (as in URDF)."""
        roll, pitch, yaw = check.array("rpy", rpy, (3,))
        about = (_rotation(angle * axis) for angle, axis in zip((yaw, pitch, roll), np.eye(3)[::-1], strict=True))
        z, y, x = about
        return cls(position, z @ y @ x)

    def __matmul__(self, other: Pose) -> Pose:
        """The pose of `other`, given in this pose's coordinates, in the world."""
        if not isinstance(other, Pose):
            return NotImplemented
        return Pose._unchecked(self.apply(other.position), self.rotation @ other.rotation)

    def inverse(self) -> Pose:
        """The pose that maps the world to the body."""
        return Pose._unchecked(-self.rotation.T @ self.position, self.rotation.T)

    def apply(self, points: ArrayLike) -> Matrix:
        """Points (..., 3) of the body, in the world [m]."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.position

    def at(self, time: float) -> Pose:  # noqa: ARG002  # every motion has `at`
        """The pose at a time [s]: always the same."""
        return self

    def rate_at(self, time: float) -> Matrix:  # noqa: ARG002  # every motion has `rate_at`
        """Time derivative of ``[rotation | position]``, (3, 4): zero."""
        return np.zeros((3, 4))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Pose)
            and np.array_equal(self.position, other.position)
            and np.array_equal(self.rotation, other.rotation)
        )

    def __hash__(self) -> int:
        return hash((self.position.tobytes(), self.rotation.tobytes()))


@dataclass(frozen=True, eq=False)
class Linear:
    """Constant velocity and angular velocity in world axes, turning about the pose's origin.

    Parameters
    ----------
    pose : Pose
        Where the body is at absolute time 0.
    velocity : (3,) array_like
        Velocity of the pose's origin [m/s].
    angular_velocity : (3,) array_like
        Angular velocity [rad/s].
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
            raise TypeError(f"pose: expected Pose, got {type(pose).__name__}")
        put = object.__setattr__
        put(self, "pose", pose)
        put(self, "velocity", check.frozen(check.array("velocity", velocity, (3,))))
        put(self, "angular_velocity", check.frozen(check.array("angular_velocity", angular_velocity, (3,))))

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        turned = _rotation(self.angular_velocity * time) @ self.pose.rotation
        return Pose._unchecked(self.pose.position + self.velocity * time, turned)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        turning = _cross_matrix(self.angular_velocity) @ self.at(time).rotation
        return np.column_stack([turning, self.velocity])


Motion = Pose | Linear
"""What `Body` and `Simulator` take as a motion."""


def check_motion(name: str, motion: object) -> Motion:
    """The motion, or a TypeError that names the argument."""
    if not isinstance(motion, Pose | Linear):
        raise TypeError(f"{name}: expected Pose or Linear, got {type(motion).__name__}")
    return motion


def is_static(motion: Motion) -> bool:
    """True when the pose is the same at all times."""
    return isinstance(motion, Pose) or not (motion.velocity.any() or motion.angular_velocity.any())


def relative_pose(body: Pose, sensor: Pose) -> Matrix:
    """Map of body coordinates to the sensor frame, ``[rotation | translation]``, (3, 4)."""
    to_sensor = sensor.rotation.T
    return np.column_stack([to_sensor @ body.rotation, to_sensor @ (body.position - sensor.position)])


def relative_rate(body: Pose, body_rate: Matrix, sensor: Pose, sensor_rate: Matrix) -> Matrix:
    """Time derivative of `relative_pose`, (3, 4)."""
    to_sensor, turning = sensor.rotation.T, sensor_rate[:, :3].T
    offset = body.position - sensor.position
    return np.column_stack(
        [
            turning @ body.rotation + to_sensor @ body_rate[:, :3],
            turning @ offset + to_sensor @ (body_rate[:, 3] - sensor_rate[:, 3]),
        ]
    )


def _cross_matrix(v: Matrix) -> Matrix:
    """The matrix of ``v x``."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _rotation(vector: Matrix) -> Matrix:
    """Rotation about an axis by the length of the vector [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    k = _cross_matrix(vector / angle)
    # 1 - cos as 2 sin^2 keeps small angles exact.
    turned: Matrix = np.eye(3) + np.sin(angle) * k + 2.0 * np.sin(0.5 * angle) ** 2 * (k @ k)
    return turned
