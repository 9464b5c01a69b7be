"""Vertices that follow several joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.rotation import Matrix
from radarcore.motion.group import Motions
from radarcore.motion.protocol import Motion


class Skin:
    """Vertices that follow joints: linear blending (Magnenat-Thalmann, Laperriere and Thalmann, 1988).

    Parameters
    ----------
    motions : sequence of Motion
        Of all joints.
    to_joints : (joint, 4, 4) float64
        Matrices from the vertices, in the pose of binding, to the joints.
    vertices : (n, 3) float64
        [m].
    joints, weights : (n, influence) int, float64
        Joints that each vertex follows, and their weights with the sum 1.
    """

    def __init__(
        self, motions: Sequence[Motion], to_joints: Matrix, vertices: Matrix, joints: NDArray[np.int64], weights: Matrix
    ) -> None:
        from scipy.sparse import csr_array  # takes longer to load than the rest

        self._motions = Motions(motions)
        points = np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1)
        # Vertices are a linear function of the maps of all joints, (joint, column of the map).
        entries = weights[:, :, None] * np.einsum("nkij,nj->nki", to_joints[joints], points)
        places, starts = 4 * joints[:, :, None] + np.arange(4), 4 * joints.shape[1] * np.arange(len(vertices) + 1)
        self._weighted = csr_array((entries.ravel(), places.ravel(), starts), (len(vertices), 4 * len(motions)))

    def at(self, time: float) -> Matrix:
        """Vertices at a time [s], (n, 3) [m]."""
        return self._sum(self._motions.poses_at(np.array([time]))[0])

    def rate_at(self, time: float) -> Matrix:
        """Velocities of the vertices at a time [s], (n, 3) [m/s]."""
        return self._sum(self._motions.rates_at(np.array([time]))[0])

    def _sum(self, maps: Matrix) -> Matrix:
        vertices: Matrix = self._weighted @ np.swapaxes(maps, 1, 2).reshape(-1, 3)
        return vertices
