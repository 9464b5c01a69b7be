"""Where the bodies and points of a scene are as a sensor sees them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from radarcore.motion import Motion, is_static, poses_at, relative_poses, relative_rates
from radarcore.scene import Scene

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Placement:
    """Bodies and points at several times, in sensor axes about the centre of the array.

    ``poses``: (time, body, 3, 4) maps of body coordinates; ``points``: (time, point, 3) [m]; ``vertices``: one array
    (time, vertex, 3) in body coordinates [m] for each body that was asked for.
    """

    poses: Matrix
    points: Matrix
    vertices: list[Matrix]


@dataclass(frozen=True)
class _Kept:
    """What has been placed: poses and points by times, vertices by times and body."""

    placed: dict[bytes, tuple[Matrix, Matrix]] = field(default_factory=dict)
    vertices: dict[tuple[bytes, int], Matrix] = field(default_factory=dict)


class Places:
    """A scene as seen from a sensor in motion.

    Bodies that never move are placed in the world once; when the sensor never moves either, once and for all.

    Parameters
    ----------
    scene : Scene
    sensor_motion : Motion
        Sensor to world.
    center : (3,) array
        Centre of the array in sensor axes [m].
    """

    def __init__(self, scene: Scene, sensor_motion: Motion, center: Matrix) -> None:
        self.scene, self.sensor_motion, self.center = scene, sensor_motion, center
        motions = [body.motion for _, body in scene._meshed]
        is_still = np.array([is_static(motion) for motion in motions], dtype=np.bool_)
        self._still, self._moving = np.flatnonzero(is_still), np.flatnonzero(~is_still)
        self._motions = [motions[b] for b in self._moving]
        self._still_in_world = _side_by_side([motions[b] for b in self._still], np.zeros(1))
        self._still_as_seen: Matrix | None = None
        if is_static(sensor_motion):
            self._still_as_seen = relative_poses(self._still_in_world, poses_at(sensor_motion, np.zeros(1)))
        self._kept: _Kept | None = None

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Inside, nothing is placed at the same times twice; outside, functions of time are asked every time."""
        self._kept = _Kept()
        try:
            yield
        finally:
            self._kept = None

    def at(self, times: Matrix, deforming: Iterable[int] = ()) -> Placement:
        """Bodies and points at `times` (n,) [s], and the vertices of some bodies."""
        kept, key = self._kept or _Kept(), times.tobytes()
        if key not in kept.placed:
            kept.placed[key] = self._place(times)
        bodies = list(deforming)
        for body in bodies:
            if (key, body) not in kept.vertices:
                vertices = [self.scene._vertices(body, time) for time in times.tolist()]
                kept.vertices[key, body] = np.array(vertices)
        return Placement(*kept.placed[key], [kept.vertices[key, body] for body in bodies])

    def rates_at(self, time: float, deforming: Iterable[int] = ()) -> Placement:
        """Time derivatives of all that at one time: poses (1, body, 3, 4), points (1, point, 3) and vertices [m/s]."""
        scene, times = self.scene, np.array([time])
        sensor, sensor_rate = poses_at(self.sensor_motion, times), self.sensor_motion.rate_at(time)[None]
        bodies, rates = self._in_world(times), np.zeros((1, len(scene._meshed), 3, 4))
        for b, motion in zip(self._moving, self._motions, strict=True):
            rates[0, b] = motion.rate_at(time)
        offsets = scene._positions + time * scene._velocities - sensor[:, :, 3]
        velocities = (scene._velocities - sensor_rate[0, :, 3]) @ sensor[0, :, :3] + offsets @ sensor_rate[0, :, :3]
        return Placement(
            relative_rates(bodies, rates, sensor, sensor_rate),
            velocities[None],
            [scene._vertex_rates(body, time)[None] for body in deforming],
        )

    def _place(self, times: Matrix) -> tuple[Matrix, Matrix]:
        """Poses and points."""
        scene, sensor = self.scene, poses_at(self.sensor_motion, times)
        if self._still_as_seen is None:
            poses = relative_poses(self._in_world(times), sensor)
        else:
            poses = np.empty((len(times), len(scene._meshed), 3, 4))
            poses[:, self._still] = self._still_as_seen
            poses[:, self._moving] = relative_poses(_side_by_side(self._motions, times), sensor)
        poses[..., 3] -= self.center
        offsets = scene._positions + times[:, None, None] * scene._velocities - sensor[:, None, :, 3]
        return poses, offsets @ sensor[..., :3] - self.center

    def _in_world(self, times: Matrix) -> Matrix:
        """Places of the bodies in the world, (time, body, 3, 4)."""
        poses = np.empty((len(times), len(self.scene._meshed), 3, 4))
        poses[:, self._still] = self._still_in_world
        poses[:, self._moving] = _side_by_side(self._motions, times)
        return poses


def _side_by_side(motions: list[Motion], times: Matrix) -> Matrix:
    """Places of several bodies in the world, (time, body, 3, 4)."""
    places = [poses_at(motion, times) for motion in motions]
    return np.stack(places, axis=1) if places else np.empty((len(times), 0, 3, 4))
