"""Frames of prims: the motion that carries each, and its matrix to that."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Pose, as_pose, transforms
from radarcore.geometry.rotation import Matrix
from radarcore.motion.group import Attached
from radarcore.motion.protocol import Motion
from radarcore.motion.samples import Samples


class Place(NamedTuple):
    """Frame of a prim or joint."""

    carrier: Motion | None
    """Motion that carries it; None for the world."""
    matrix: Matrix
    """To the carrier, (4, 4), with the scale of all frames above."""
    is_live: bool = False
    """True below a prim that a program moves."""

    @property
    def stretch(self) -> Matrix:
        """Scale and shear of the matrix, (3, 3): without its rotation."""
        return polar(self.matrix[:3, :3])[1]

    def motion(self, mount: Pose | None = None) -> Motion:
        """Motion of what is mounted at a pose in the frame."""
        rotation, _ = polar(self.matrix[:3, :3])
        pose = as_pose(transforms(rotation, self.matrix[:3, 3])) @ (mount or Pose())
        return pose if self.carrier is None else Attached(self.carrier, pose)

    def moved(self, samples: Samples, matrices: Matrix) -> Place:
        """Frame that moves in this one, by homogeneous matrices (k, 4, 4)."""
        rotations, stretches = polar(check.finite("transform", matrices)[:, :3, :3])
        if np.ptp(stretches, axis=0).max() > _ROUNDING * np.abs(stretches).max():
            raise ValueError("transform: expected a scale without change over time, got time samples of it")
        stretch = self.stretch
        if np.abs(stretch @ rotations - rotations @ stretch).max() > _ROUNDING * np.abs(stretch).max():
            raise ValueError("transform: expected equal scales of all axes above a rotation over time, got others")
        moving = samples.add(transforms(rotations, matrices[:, :3, 3] @ stretch))
        return Place(Attached(self.motion(), moving), homogeneous(stretch @ stretches[0]), self.is_live)


_ROUNDING = 1e-5
"""Of products in single precision, relative."""


def polar(linear: Matrix) -> tuple[Matrix, Matrix]:
    """Rotations and symmetric stretches (..., 3, 3) whose products are matrices (..., 3, 3)."""
    u, sizes, vt = np.linalg.svd(linear)
    sign = np.sign(np.linalg.det(u @ vt))[..., None, None]
    return sign * (u @ vt), sign * (np.swapaxes(vt, -1, -2) @ (sizes[..., None] * vt))


def homogeneous(linear: Matrix) -> Matrix:
    """Matrices (..., 4, 4) of linear maps (..., 3, 3)."""
    matrices = np.zeros((*linear.shape[:-2], 4, 4))
    matrices[..., :3, :3], matrices[..., 3, 3] = linear, 1.0
    return matrices


def columns(matrices: ArrayLike) -> Matrix:
    """Matrices (..., 4, 4) of USD, for row vectors, as ones for column vectors."""
    given = np.asarray(matrices, dtype=np.float64)
    return np.swapaxes(check.finite("transform", given if given.size else given.reshape(0, 4, 4)), -1, -2)
