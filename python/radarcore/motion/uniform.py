"""Constant velocities and angular velocities of several bodies."""

from __future__ import annotations

import numpy as np

from radarcore.geometry.pose import Matrix, cross_matrix, transforms


class Uniform:
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
        # What the pose changes by: per second, and by Rodrigues' formula with the sine and 1 - cosine of the angle.
        self._drift = transforms(0.0 * rotations, velocities)
        self._by_sine, self._by_versine = (
            transforms(turn @ rotations, 0.0 * positions) for turn in (axes, axes @ axes)
        )
        self._speed = speed

    def poses_at(self, times: Matrix) -> Matrix:
        """``[rotation | position]`` at times (n,), or of every body its own (n, body), (n, body, 3, 4)."""
        elapsed = _per_body(times)
        half = (0.5 * elapsed) * self._speed
        # 1 - cos as 2 sin^2 keeps small angles exact.
        versine = 2.0 * np.sin(half) ** 2
        turned: Matrix = np.sin(2.0 * half) * self._by_sine + versine * self._by_versine
        turned += elapsed * self._drift
        turned += self._start
        return turned

    def rates_at(self, times: Matrix) -> Matrix:
        """Time derivatives of `poses_at`."""
        angle = _per_body(times) * self._speed
        turning: Matrix = np.cos(angle) * self._by_sine + np.sin(angle) * self._by_versine
        turning *= self._speed
        turning += self._drift
        return turning


def _per_body(times: Matrix) -> Matrix:
    """Times as (n, 1, 1, 1) or (n, body, 1, 1)."""
    return (times if times.ndim == 2 else times[:, None])[..., None, None]
