"""Rigid poses, and arrays of them: ``[rotation | position]``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.rotation import Matrix, rotations_of
from radarcore.products import product

_FARTHEST = 1e15
"""Largest coordinate [m], as of meshes: its square is still a number."""

_LARGEST_ANGLE = 1e6
"""Largest angle [rad]: the turn that is left of larger ones is rounding."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Fixed pose: maps body (or sensor) coordinates to the world, ``rotation @ x + position``.

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

    See Also
    --------
    Pose.look_at : Pose that points to a target.
    Pose.from_quaternion : Pose from a quaternion by the name of its order.
    Linear : Constant velocity.
    Trajectory : Motion through several poses.

    Examples
    --------
    >>> table = rc.Pose([1.0, 0.0, 0.8])
    >>> cup = table @ rc.Pose([0.2, 0.0, 0.0])
    >>> cup.position
    array([1.2, 0. , 0.8])
    """

    position: Matrix
    rotation: Matrix

    def __init__(self, position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike | None = None) -> None:
        matrix = check.array("rotation", np.eye(3) if rotation is None else rotation, (3, 3))
        if (largest := float(np.abs(matrix).max())) > 2.0:  # products of huge ones overflow
            raise ValueError(f"rotation: expected entries of a rotation matrix, from -1 to 1, got {largest:g}")
        error = np.abs(matrix @ matrix.T - np.eye(3)).max()
        if error > 1e-6 or np.linalg.det(matrix) < 0.0:
            raise ValueError(
                f"rotation: expected a rotation matrix (orthonormal, determinant +1), got one with "
                f"deviation {error:.3g} and determinant {np.linalg.det(matrix):.3g}"
            )
        if error > 1e-15:
            u, _, vt = np.linalg.svd(matrix)
            matrix = u @ vt
        object.__setattr__(self, "position", check.frozen(checked_position("position", position)))
        object.__setattr__(self, "rotation", check.frozen(matrix))

    @classmethod
    def _unchecked(cls, position: Matrix, rotation: Matrix) -> Pose:
        """Pose from a rotation and a position, unchecked: products of rotations are rotations."""
        pose = object.__new__(cls)
        object.__setattr__(pose, "position", check.frozen(position))
        object.__setattr__(pose, "rotation", check.frozen(rotation))
        return pose

    @classmethod
    def look_at(cls, position: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> Pose:
        """Pose at `position` whose x axis points to `target`, with z as close to `up` as it can be.

        See Also
        --------
        Pose.from_rpy : Pose from roll, pitch and yaw.
        Simulator : Takes the pose of the radar as `radar_motion`.

        Examples
        --------
        >>> radar = rc.Pose.look_at([0.0, 0.0, 2.0], target=[2.0, 0.0, 0.0])
        >>> radar.rotation[:, 0].round(3)
        array([ 0.707,  0.   , -0.707])
        """
        origin = checked_position("position", position)
        x = checked_position("target", target) - origin
        y = np.cross(scaled(check.array("up", up, (3,))), x)
        if not np.linalg.norm(x) > 0.0:
            raise ValueError(f"target: expected a point other than the position, got {origin}")
        if np.linalg.norm(y) <= 1e-9 * np.linalg.norm(x):
            raise ValueError("up: expected a direction that is not along the line of sight")
        x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        return cls(origin, np.column_stack([x, y, np.cross(x, y)]))

    @classmethod
    def from_quaternion(
        cls,
        position: ArrayLike,
        *,
        wxyz: ArrayLike | None = None,
        xyzw: ArrayLike | None = None,
    ) -> Pose:
        """Pose from a quaternion of any length but zero.

        The keyword names its order: `wxyz` (MuJoCo) or `xyzw` (ROS, OptiTrack, SciPy).

        See Also
        --------
        Pose.from_matrix : Pose from a homogeneous matrix.
        Pose.from_rpy : Pose from roll, pitch and yaw.

        Examples
        --------
        >>> pose = rc.Pose.from_quaternion([1.0, 0.0, 0.0], xyzw=[0.0, 0.0, 1.0, 1.0])
        >>> pose.apply([0.5, 0.0, 0.0]).round(3)
        array([1. , 0.5, 0. ])
        """
        given = {"wxyz": wxyz, "xyzw": xyzw}
        names = [name for name, value in given.items() if value is not None]
        if len(names) != 1:
            raise TypeError(f"quaternion: expected one of wxyz= and xyzw=, got {' and '.join(names) or 'none'}")
        (name,) = names
        q = scaled(np.roll(check.array(name, cast(ArrayLike, given[name]), (4,)), 1 if name == "xyzw" else 0))
        if not np.linalg.norm(q) > 0.0:
            order = "(x, y, z, w)" if name == "xyzw" else "(w, x, y, z)"
            raise ValueError(f"{name}: expected {order} of any length but zero")
        return cls(position, rotations_of(q / np.linalg.norm(q)))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose:
        """Pose from a homogeneous matrix (4, 4), or its upper rows ``[rotation | position]``, (3, 4).

        See Also
        --------
        Pose.from_quaternion : Pose from a position and a quaternion.
        Live : Motion of a program that has a pose now.

        Examples
        --------
        >>> matrix = np.eye(4)
        >>> matrix[:3, 3] = [1.0, 2.0, 0.5]
        >>> rc.Pose.from_matrix(matrix).position
        array([1. , 2. , 0.5])
        """
        given = np.asarray(matrix, dtype=object)  # as objects: `check` names values that are not numbers
        rows = check.array("matrix", matrix, (3 if given.shape == (3, 4) else 4, 4))
        if len(rows) == 4 and not np.array_equal(rows[3], [0.0, 0.0, 0.0, 1.0]):
            raise ValueError(f"matrix: expected a last row of 0, 0, 0, 1, got {', '.join(f'{x:g}' for x in rows[3])}")
        return cls(rows[:3, 3], rows[:3, :3])

    @classmethod
    def from_rpy(cls, position: ArrayLike, rpy: ArrayLike) -> Pose:
        """Pose from roll, pitch and yaw [rad] about the fixed axes x, y and z, in that order (as in URDF).

        See Also
        --------
        Pose.from_quaternion : Pose from a quaternion by the name of its order.
        Pose.look_at : Pose that points to a target.

        Examples
        --------
        >>> pose = rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2])
        >>> pose.apply([0.5, 0.0, 0.0]).round(3)
        array([1. , 0.5, 0. ])
        """
        angles = check.array("rpy", rpy, (3,))
        if (largest := float(np.abs(angles).max())) > _LARGEST_ANGLE:
            raise ValueError(f"rpy: expected angles within {_LARGEST_ANGLE:g} rad, got {largest:g}")
        check.radians("rpy", angles)
        (cx, cy, cz), (sx, sy, sz) = np.cos(angles).tolist(), np.sin(angles).tolist()
        rotation = [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
        return cls(position, rotation)

    def __matmul__(self, other: Pose) -> Pose:
        """Pose of `other`, given in this pose's coordinates, in the world."""
        if not isinstance(other, Pose):
            return NotImplemented
        return Pose._unchecked(self.apply(other.position), self.rotation @ other.rotation)

    def inverse(self) -> Pose:
        """Inverse pose: maps the world to the body.

        See Also
        --------
        Pose.apply : Points of the body in the world.

        Examples
        --------
        >>> radar = rc.Pose([1.0, 0.0, 0.5])
        >>> seen = radar.inverse() @ rc.Pose([3.0, 0.0, 0.5])
        >>> seen.position
        array([2., 0., 0.])
        """
        return Pose._unchecked(-self.rotation.T @ self.position, self.rotation.T)

    def apply(self, points: ArrayLike) -> Matrix:
        """Points (..., 3) of the body, in the world [m].

        See Also
        --------
        Pose.inverse : Maps the world to the body.

        Examples
        --------
        >>> pose = rc.Pose([1.0, 0.0, 0.5])
        >>> pose.apply([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
        array([[1. , 0. , 0.5],
               [1.1, 0. , 0.5]])
        """
        return product(check.numbers("points", points), self.rotation.T) + self.position

    def at(self, time: float) -> Pose:  # noqa: ARG002  # every motion has `at`
        """The pose at a time [s]: constant."""
        return self

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4), all equal."""
        return np.broadcast_to(transforms(self.rotation, self.position), (np.size(times), 3, 4))

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
        return hash((*self.position.tolist(), *self.rotation.ravel().tolist()))  # the bytes of 0.0 and -0.0 differ


def not_a_pose(name: str, expected: str, got: object, where: str = "") -> TypeError:
    """Error for an object that is no pose or motion; for an array it names the constructor of a pose."""
    shape = np.asarray(got, dtype=object).shape if isinstance(got, np.ndarray | list | tuple) else ()
    makers = {(4, 4): "rc.Pose.from_matrix", (3, 4): "rc.Pose.from_matrix", (3,): "rc.Pose"}
    hint = f"; {makers[shape]}(...) makes a pose of it" if shape in makers else ""
    return TypeError(f"{name}: expected {expected}, got {type(got).__name__}{where}{hint}")


def checked_position(name: str, value: ArrayLike) -> Matrix:
    """A point (3,) whose coordinates are within 1e15 m."""
    position = check.array(name, value, (3,))
    if (farthest := float(np.abs(position).max())) > _FARTHEST:
        raise ValueError(f"{name}: expected coordinates within {_FARTHEST:g} m, got {farthest:g}")
    return position


def scaled(vector: Matrix) -> Matrix:
    """A vector whose largest entry is 1 or -1: squares of others may not be numbers; zero as it is."""
    largest = np.abs(vector).max()
    return vector if largest == 0.0 else vector / largest


def as_pose(matrix: Matrix) -> Pose:
    """Pose from a map ``[rotation | position]``, unchecked."""
    return Pose._unchecked(matrix[:3, 3].copy(), matrix[:3, :3].copy())


def transforms(rotations: Matrix, positions: Matrix) -> Matrix:
    """Maps ``[rotation | position]``, (..., 3, 4)."""
    return np.concatenate([rotations, positions[..., None]], axis=-1)


def checked_maps(name: str, values: ArrayLike, number: int) -> Matrix:
    """Maps ``[rotation | position]`` (number, 3, 4) from those or from homogeneous matrices (number, 4, 4).

    Each is checked as a `Pose` is; errors name the index of the first that is none.
    """
    given = np.asarray(values)
    maps = check.array(name, values, (number, 4 if given.shape[1:] == (4, 4) else 3, 4))[:, :3]
    rotations, positions = maps[:, :, :3], maps[:, :, 3]
    if (farthest := float(np.abs(positions).max(initial=0.0))) > _FARTHEST:
        raise ValueError(f"{name}: expected coordinates within {_FARTHEST:g} m, got {farthest:g}")
    with np.errstate(over="ignore", invalid="ignore"):  # huge numbers are no rotations either
        error = np.abs(np.swapaxes(rotations, 1, 2) @ rotations - np.eye(3)).max(axis=(1, 2))
        is_rotation = (error <= 1e-6) & (np.linalg.det(rotations) > 0.0)
    if not is_rotation.all():
        k = int(is_rotation.argmin())
        raise ValueError(f"{name}: expected rotation matrices (orthonormal, determinant +1), got another at index {k}")
    if error.max(initial=0.0) <= 1e-15:
        return maps.copy()
    u, _, vt = np.linalg.svd(rotations)
    return transforms(u @ vt, positions)
