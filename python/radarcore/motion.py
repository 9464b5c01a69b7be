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
        z, y, x = _rotations(np.fliplr(np.diag([yaw, pitch, roll])))
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

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4): the same at all of them."""
        return np.broadcast_to(_maps(self.rotation, self.position), (np.size(times), 3, 4))

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
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        elapsed = np.asarray(times, dtype=np.float64)[:, None]
        turned = _rotations(elapsed * self.angular_velocity) @ self.pose.rotation
        return _maps(turned, self.pose.position + elapsed * self.velocity)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        turning = _cross_matrix(self.angular_velocity) @ self.at(time).rotation
        return _maps(turning, self.velocity)


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
            rotation = rotation @ _rotations(self._rotation(inside, 1) * beyond)
            position = position + self._position(inside, 1) * beyond
        return _maps(rotation, position)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        inside = float(np.clip(time, self.times[0], self.times[-1]))
        # The spline's angular velocity is in body axes: d/dt R = R (omega x).
        turning = self.at(time).rotation @ _cross_matrix(self._rotation(inside, 1))
        return _maps(turning, self._position(inside, 1))


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

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4), one after another."""
        return _one_by_one(self, times)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        if self._rate is not None:
            return check.array("rate", self._rate(time), (3, 4))
        return derivative(lambda when: self.poses_at([when])[0], time)


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
        return _maps(turning, moving)


# Step of the finite differences of a function of time [s].
_STEP = 5e-4


class Motion(Protocol):
    """What moves: a pose at every time, and how fast it changes.

    A motion that also has ``poses_at(times)``, which gives ``[rotation | position]`` at several times [s] at once,
    (n, 3, 4), is asked for these; one that has not, time by time.
    """

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


def poses_at(motion: Motion, times: ArrayLike) -> Matrix:
    """``[rotation | position]`` of any motion at several times [s], (n, 3, 4): body coordinates to the world."""
    together: Callable[[ArrayLike], Matrix] | None = getattr(motion, "poses_at", None)
    maps = _one_by_one(motion, times) if together is None else together(times)
    if np.shape(maps) != (expected := (np.size(times), 3, 4)):
        raise ValueError(f"poses_at: expected shape {expected}, got {np.shape(maps)}")
    return maps


def _one_by_one(motion: Motion, times: ArrayLike) -> Matrix:
    """The same by `Motion.at`."""
    poses = [motion.at(time) for time in np.asarray(times, dtype=np.float64).tolist()]
    return np.array([_maps(pose.rotation, pose.position) for pose in poses]).reshape(-1, 3, 4)


def as_pose(matrix: Matrix) -> Pose:
    """The pose of a map ``[rotation | position]`` that is known to be one."""
    return Pose._unchecked(matrix[:3, 3].copy(), matrix[:3, :3].copy())


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


def relative_poses(bodies: Matrix, sensor: Matrix) -> Matrix:
    """Maps of body coordinates to a sensor's frame, (..., body, 3, 4).

    From ``[rotation | position]`` of `bodies` (..., body, 3, 4) and of the `sensor` (..., 3, 4) in the world.
    """
    to_sensor = np.swapaxes(sensor[..., :3], -1, -2)
    seen: Matrix = to_sensor[..., None, :, :] @ (bodies - _moved_only(sensor)[..., None, :, :])
    return seen


def relative_rates(seen: Matrix, body_rates: Matrix, sensor: Matrix, sensor_rate: Matrix) -> Matrix:
    """Time derivatives of `relative_poses`, (..., body, 3, 4).

    From these, `seen`, and the time derivatives of the places in the world, as there.
    """
    to_sensor, turning = np.swapaxes(sensor[..., :3], -1, -2), np.swapaxes(sensor_rate[..., :3], -1, -2)
    drift = to_sensor[..., None, :, :] @ (body_rates - _moved_only(sensor_rate)[..., None, :, :])
    rates: Matrix = drift + (turning @ sensor[..., :3])[..., None, :, :] @ seen
    return rates


def _moved_only(maps: Matrix) -> Matrix:
    """Positions alone, as maps (..., 3, 4) without a rotation."""
    moved = np.zeros_like(maps)
    moved[..., 3] = maps[..., 3]
    return moved


def _maps(rotations: Matrix, positions: Matrix) -> Matrix:
    """``[rotation | position]``, (..., 3, 4)."""
    return np.concatenate([rotations, positions[..., None]], axis=-1)


def _cross_matrix(v: Matrix) -> Matrix:
    """The matrix of ``v x``, (..., 3, 3)."""
    matrix = np.zeros((*v.shape, 3))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        matrix[..., k, j], matrix[..., j, k] = v[..., i], -v[..., i]
    return matrix


def _rotations(vectors: Matrix) -> Matrix:
    """Rotations about the directions of vectors (n, 3) by their lengths [rad], (n, 3, 3) (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=-1)[:, None, None]
    k = _cross_matrix(vectors / np.where(angle[..., 0] > 0.0, angle[..., 0], 1.0))
    # 1 - cos as 2 sin^2 keeps small angles exact.
    turned: Matrix = np.eye(3) + np.sin(angle) * k + 2.0 * np.sin(0.5 * angle) ** 2 * (k @ k)
    return turned
