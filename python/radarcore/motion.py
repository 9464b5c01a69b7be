"""Rigid motion: poses, twists, splines, functions and attachments, and what one body sees of another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, cast

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
        inside = float(np.clip(time, self.times[0], self.times[-1]))
        rotation, position = self._rotation(inside).as_matrix(), self._position(inside)
        if inside == time:
            return Pose._unchecked(position, rotation)
        # The spline's angular velocity is in body axes.
        beyond = time - inside
        turned = rotation @ _rotation(self._rotation(inside, 1) * beyond)
        return Pose._unchecked(position + self._position(inside, 1) * beyond, turned)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        inside = float(np.clip(time, self.times[0], self.times[-1]))
        # The spline's angular velocity is in body axes: d/dt R = R (omega x).
        turning = self.at(time).rotation @ _cross_matrix(self._rotation(inside, 1))
        return np.column_stack([turning, self._position(inside, 1)])


class Function:
    """A motion given by a function of time.

    Parameters
    ----------
    pose : callable
        Maps a time [s] to a `Pose`.
    rate : callable, optional
        Maps a time [s] to the time derivative of ``[rotation | position]``, (3, 4) [1/s | m/s]. Default: central
        differences of fourth order over steps of 0.5 ms, off by 2e-15 of the motion's fifth derivative [m/s^5].
    """

    def __init__(self, pose: Callable[[float], Pose], rate: Callable[[float], ArrayLike] | None = None) -> None:
        if not callable(pose):
            raise TypeError(f"pose: expected a function of time, got {type(pose).__name__}")
        self._pose, self._rate = pose, rate

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        pose = self._pose(time)
        if not isinstance(pose, Pose):
            raise TypeError(f"pose: expected a function that returns Pose, got {type(pose).__name__} at {time:g} s")
        return pose

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        if self._rate is not None:
            return check.array("rate", self._rate(time), (3, 4))
        return derivative(self._matrix, time)

    def _matrix(self, time: float) -> Matrix:
        pose = self.at(time)
        return np.column_stack([pose.rotation, pose.position])


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

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        parent, rate = self.parent.at(time), self.parent.rate_at(time)
        own, own_rate = self.motion.at(time), self.motion.rate_at(time)
        turning = rate[:, :3] @ own.rotation + parent.rotation @ own_rate[:, :3]
        moving = rate[:, :3] @ own.position + parent.rotation @ own_rate[:, 3] + rate[:, 3]
        return np.column_stack([turning, moving])


# Step of the finite differences of a function of time [s].
_STEP = 5e-4


class Motion(Protocol):
    """What moves: a pose at every time, and how fast it changes."""

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        ...

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        ...


AnyMotion = Motion | Callable[[float], Pose]
"""What `Body` and `Simulator` take: `Pose`, `Linear`, `Trajectory`, `Attached`, or a function of time."""


def as_motion(name: str, motion: object) -> Motion:
    """The motion, a function wrapped, or a TypeError that names the argument."""
    if isinstance(motion, Pose | Linear | Trajectory | Function | Attached):
        return motion
    if hasattr(motion, "at") and hasattr(motion, "rate_at"):
        return cast(Motion, motion)
    if callable(motion):
        return Function(motion)
    raise TypeError(
        f"{name}: expected Pose, Linear, Trajectory, Attached or a function of time, got {type(motion).__name__}"
    )


def is_static(motion: Motion) -> bool:
    """True when the pose is known to be the same at all times."""
    if isinstance(motion, Linear):
        return not (motion.velocity.any() or motion.angular_velocity.any())
    if isinstance(motion, Attached):
        return is_static(motion.parent) and is_static(motion.motion)
    return isinstance(motion, Pose)


def derivative(values: Callable[[float], Matrix], time: float) -> Matrix:
    """Time derivative of a function of time by central differences, see `Function`."""
    near, far = ((values(time + step) - values(time - step)) / (2.0 * step) for step in (_STEP, 2.0 * _STEP))
    rate: Matrix = (4.0 * near - far) / 3.0
    return rate


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
