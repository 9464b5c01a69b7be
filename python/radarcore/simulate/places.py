"""Where the bodies and points of a scene are as a sensor sees them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.geometry.pose import relative_poses, relative_rates
from radarcore.motion.protocol import Motion, poses_at
from radarcore.motion.static import is_static
from radarcore.scene.scene import Scene

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
    """What has been placed: sensor, poses and points by times, rates by time, vertices by times and body."""

    placed: dict[bytes, tuple[Matrix, Matrix, Matrix]] = field(default_factory=dict)
    rates: dict[float, tuple[Matrix, Matrix]] = field(default_factory=dict)
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
        motions = [body.motion for body in scene.parts.meshed]
        is_still = np.array([is_static(motion) for motion in motions], dtype=np.bool_)
        self._still, self._moving = np.flatnonzero(is_still).tolist(), np.flatnonzero(~is_still).tolist()
        self._motions = [motions[body] for body in self._moving]
        still = [poses_at(motions[body], np.zeros(1)) for body in self._still]
        self._still_in_world = np.array(still, dtype=np.float64).reshape(1, -1, 3, 4)
        self._still_as_seen: Matrix | None = None
        if is_static(sensor_motion):
            self._still_as_seen = relative_poses(self._still_in_world, poses_at(sensor_motion, np.zeros(1)))
        self._anything_moves = bool(self._moving or self._still_as_seen is None or scene.parts.velocities.any())
        self._kept: _Kept | None = None

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Inside, nothing is placed at the same times twice; outside, functions of time are asked every time."""
        self._kept = _Kept()
        try:
            yield
        finally:
            self._kept = None

    def place_ahead(self, sets: Sequence[Matrix]) -> None:
        """Place what moves at all sets of times that will be asked for, which takes hardly longer than one of them."""
        kept = self._kept
        if kept is None or not self._anything_moves:
            return
        ends = np.cumsum([len(times) for times in sets])[:-1]
        parts = (np.split(values, ends) for values in self._place(np.concatenate(sets)))
        for times, sensor, poses, points in zip(sets, *parts, strict=True):
            kept.placed[times.tobytes()] = sensor, check.frozen(poses), check.frozen(points)

    def at(self, times: Matrix, deforming: Iterable[int] = ()) -> Placement:
        """Bodies and points at `times` (n,) [s], and the vertices of some bodies."""
        kept, key = self._kept or _Kept(), times.tobytes()
        _, poses, points = self._placed(kept, times)
        bodies = list(deforming)
        for body in bodies:
            if (key, body) not in kept.vertices:
                vertices = [self.scene.parts.vertices_at(body, time) for time in times.tolist()]
                kept.vertices[key, body] = check.frozen(np.array(vertices))
        return Placement(poses, points, [kept.vertices[key, body] for body in bodies])

    def rates_at(self, time: float, deforming: Iterable[int] = ()) -> Placement:
        """Time derivatives of all that at one time: poses (1, body, 3, 4), points (1, point, 3) and vertices [m/s]."""
        kept = self._kept or _Kept()
        if time not in kept.rates:
            kept.rates[time] = self._rates(kept, time)
        poses, points = kept.rates[time]
        return Placement(poses, points, [self.scene.parts.vertex_rates_at(body, time)[None] for body in deforming])

    def _rates(self, kept: _Kept, time: float) -> tuple[Matrix, Matrix]:
        """Of poses and points."""
        scene = self.scene
        sensor, poses, points = self._placed(kept, np.array([time]))
        sensor_rate = self.sensor_motion.rate_at(time)[None]
        rates = np.zeros_like(poses)
        for body, motion in zip(self._moving, self._motions, strict=True):
            rates[0, body] = motion.rate_at(time)
        # The sensor turns about its origin, not about the centre of the array.
        poses = poses.copy()
        poses[..., 3] += self.center
        turning = np.swapaxes(sensor_rate[..., :3], 1, 2) @ sensor[..., :3]
        drift = (scene.parts.velocities - sensor_rate[:, None, :, 3]) @ sensor[..., :3]
        seen = relative_rates(poses, rates, sensor, sensor_rate)
        return check.frozen(seen), check.frozen(drift + (points + self.center) @ np.swapaxes(turning, 1, 2))

    def _placed(self, kept: _Kept, times: Matrix) -> tuple[Matrix, Matrix, Matrix]:
        """The sensor in the world, poses and points, new ones into what is kept."""
        key = times.tobytes()
        if key not in kept.placed:
            sensor, poses, points = self._place(times)
            kept.placed[key] = sensor, check.frozen(poses), check.frozen(points)
        return kept.placed[key]

    def _place(self, times: Matrix) -> tuple[Matrix, Matrix, Matrix]:
        scene, sensor = self.scene, poses_at(self.sensor_motion, times)
        poses = np.empty((len(times), len(scene.parts.meshed), 3, 4))
        for body, motion in zip(self._moving, self._motions, strict=True):
            poses[:, body] = poses_at(motion, times)
        if self._still_as_seen is None:
            poses[:, self._still] = self._still_in_world
            poses = relative_poses(poses, sensor)
        else:
            poses[:, self._moving] = relative_poses(poses[:, self._moving], sensor)
            poses[:, self._still] = self._still_as_seen
        poses[..., 3] -= self.center
        offsets = scene.parts.positions + times[:, None, None] * scene.parts.velocities - sensor[:, None, :, 3]
        return sensor, poses, offsets @ sensor[..., :3] - self.center
