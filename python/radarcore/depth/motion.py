"""Motion of the surfaces in a depth image: twists of bodies, or range rates of pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check
from radarcore.depth.image import Image
from radarcore.geometry.pose import transforms
from radarcore.geometry.rotation import rate_jacobian, rotations_about
from radarcore.recording.frame import Truth


@dataclass(frozen=True, eq=False)
class ImageMotion:
    """Motion of the pixels of an image.

    Attributes
    ----------
    twists : (body, 6) float64
        Velocity [m/s] and angular velocity [rad/s] of every body; zeros where none are given.
    interval : float or None
        Time between two images whose difference gives range rates [s].
    """

    twists: NDArray[np.float64]
    interval: float | None

    @classmethod
    def of(cls, twists: ArrayLike | None, num_bodies: int, previous: object, interval: float | None) -> ImageMotion:
        """Checked motion: by `twists`, by `previous` and `interval`, or none."""
        if (previous is None) != (interval is None):
            raise ValueError(
                "interval: expected previous and interval together, got "
                f"{'interval' if previous is None else 'previous'} alone"
            )
        if twists is not None and previous is not None:
            raise ValueError("twists: expected either twists or previous, got both")
        rates = np.zeros((num_bodies, 6)) if twists is None else check.array("twists", twists, (num_bodies, 6))
        return cls(rates, None if interval is None else check.positive("interval", interval, "s"))

    def placement(self, elapsed: NDArray[np.float64]) -> _core.Placement:
        """Poses at times after the image [s]; the sensor's axes are the world's."""
        poses = _rigid_motions(self.twists, elapsed)
        sensor = np.broadcast_to(np.eye(3, 4), (len(elapsed), 3, 4)).copy()
        return _core.Placement(sensor, poses, np.zeros((len(elapsed), 0, 3)))

    def truth(self, image: Image, num_bodies: int) -> Truth:
        """Truth: the nearest visible point of every body."""
        values = np.full((4, num_bodies), np.nan)
        u, v = image.camera.plane(*image.distance.shape)
        for number in range(num_bodies):
            distance = np.where(image.body == number, image.distance, np.inf)
            row, column = np.unravel_index(distance.argmin(), distance.shape)
            if np.isinf(distance[row, column]):
                continue
            direction = np.array([1.0, u[column], v[row]]) / np.sqrt(1.0 + u[column] ** 2 + v[row] ** 2)
            point = image.distance[row, column] * direction
            linear, angular = self.twists[number, :3], self.twists[number, 3:]
            rate = direction @ (linear + np.cross(angular, point)) + image.range_rate[row, column]
            azimuth, elevation = np.arctan2(u[column], 1.0), np.arctan2(v[row], np.hypot(1.0, u[column]))
            values[:, number] = image.distance[row, column], rate, azimuth, elevation
        return Truth(tuple(f"body {number}" for number in range(num_bodies)), *values)


def _rigid_motions(twists: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rigid motions by constant twists, (time, body, 3, 4): rotation exp([w] t), translation its integral times v.

    Murray, Li, Sastry, A Mathematical Introduction to Robotic Manipulation, eqs. (2.14) and (2.36).
    """
    moved, turned = np.moveaxis(times[:, None, None, None] * twists.reshape(-1, 2, 3), 2, 0)
    return transforms(rotations_about(turned), (rate_jacobian(turned) @ moved[..., None])[..., 0])
