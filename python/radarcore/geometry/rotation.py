"""Rotations: matrices, rotation vectors and their rates, quaternions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def cross_matrix(v: Matrix) -> Matrix:
    """The matrix of ``v x``, (..., 3, 3)."""
    matrix = np.zeros((*v.shape, 3))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        matrix[..., k, j], matrix[..., j, k] = v[..., i], -v[..., i]
    return matrix


def rotations_about(vectors: Matrix) -> Matrix:
    """Rotations by rotation vectors (..., 3) [rad], (..., 3, 3): Rodrigues' formula."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    k = cross_matrix(vectors / np.where(angle[..., 0] > 0.0, angle[..., 0], 1.0))
    # 1 - cos as 2 sin^2 keeps small angles exact.
    turned: Matrix = np.eye(3) + np.sin(angle) * k + 2.0 * np.sin(0.5 * angle) ** 2 * (k @ k)
    return turned


def rotation_vectors(rotations: Matrix) -> Matrix:
    """Rotation vectors (..., 3) [rad] of rotations (..., 3, 3), up to half a turn long: `rotations_about` undone."""
    from scipy.spatial.transform import Rotation

    vectors: Matrix = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_rotvec()
    return vectors.reshape(rotations.shape[:-1])


def rotations_of(quaternions: Matrix) -> Matrix:
    """Rotations (..., 3, 3) of unit quaternions (..., 4), order (w, x, y, z)."""
    w, cross = quaternions[..., :1, None], cross_matrix(quaternions[..., 1:])
    rotations: Matrix = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    return rotations


def quaternion_of(rotation: Matrix) -> Matrix:
    """Unit quaternion (4,), order (w, x, y, z) and w not negative, of a rotation (3, 3): `rotations_of` undone."""
    from scipy.spatial.transform import Rotation

    quaternion: Matrix = Rotation.from_matrix(rotation).as_quat(canonical=True)
    return np.roll(quaternion, 1)


def rate_jacobian(turn: Matrix) -> Matrix:
    """Angular velocity over the rate of a rotation vector (..., 3), (..., 3, 3).

    Chirikjian, Stochastic Models, Information Theory, and Lie Groups, vol. 2, eq. (10.86): the left Jacobian.
    """
    angle = np.linalg.norm(turn, axis=-1)[..., None, None]
    small = angle < 1e-3
    safe, a2 = np.where(small, 1.0, angle), angle**2
    by_cross = np.where(small, 0.5 - a2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    by_square = np.where(small, 1.0 / 6.0 - a2 / 120.0, (safe - np.sin(safe)) / safe**3)
    cross = cross_matrix(turn)
    jacobian: Matrix = np.eye(3) + by_cross * cross + by_square * (cross @ cross)
    return jacobian


def inverse_rate_jacobian(turn: Matrix) -> Matrix:
    """Inverse of `rate_jacobian`, up to a full turn."""
    angle = np.linalg.norm(turn, axis=-1)[..., None, None]
    small = angle < 1e-3
    safe, a2 = np.where(small, 1.0, angle), angle**2
    by_square = np.where(small, 1.0 / 12.0 + a2 / 720.0, 1.0 / safe**2 - 0.5 / (safe * np.tan(0.5 * safe)))
    cross = cross_matrix(turn)
    inverse: Matrix = np.eye(3) - 0.5 * cross + by_square * (cross @ cross)
    return inverse
