"""A scene: bodies and point targets, and where they are as the sensor sees them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.body import Body, PointTarget
from radarcore.motion import Motion, is_static, relative_pose, relative_rate


@dataclass(frozen=True)
class Placement:
    """Bodies and points at several times, in sensor axes about the centre of the array.

    ``poses``: (time, body, 3, 4) maps of body coordinates; ``points``: (time, point, 3) [m].
    """

    poses: NDArray[np.float64]
    points: NDArray[np.float64]


class Scene:
    """Bodies and point targets; an empty scene is a scene without echoes.

    Parameters
    ----------
    bodies : iterable of Body and PointTarget
        Their order gives the body numbers of images and paths.

    Attributes
    ----------
    bodies : tuple
        As given.
    names : tuple of str
        One per body; unnamed ones are called "body 3" or "point 3".
    """

    def __init__(self, bodies: Iterable[Body | PointTarget] = ()) -> None:
        if not isinstance(bodies, Iterable):
            raise TypeError(f"bodies: expected a list of Body and PointTarget, got {type(bodies).__name__}")
        self.bodies = tuple(bodies)
        for i, body in enumerate(self.bodies):
            if not isinstance(body, Body | PointTarget):
                raise TypeError(f"bodies: expected Body and PointTarget, got {type(body).__name__} at index {i}")
        self.names = tuple(
            body.name or f"{'body' if isinstance(body, Body) else 'point'} {i}" for i, body in enumerate(self.bodies)
        )

        # Meshes and points go separate ways; the numbers lead back to the scene's order.
        self._meshed = [(i, body) for i, body in enumerate(self.bodies) if isinstance(body, Body)]
        self._targets = [(i, body) for i, body in enumerate(self.bodies) if isinstance(body, PointTarget)]
        self._mesh_numbers = np.array([i for i, _ in self._meshed], dtype=np.int32)
        self._point_numbers = np.array([i for i, _ in self._targets], dtype=np.int32)
        self._rcs = np.array([target.rcs for _, target in self._targets], dtype=np.float64)
        self._positions = np.array([t.position for _, t in self._targets], dtype=np.float64).reshape(-1, 3)
        self._velocities = np.array([t.velocity for _, t in self._targets], dtype=np.float64).reshape(-1, 3)
        self._core = _core.Scene(
            [body.mesh._surface for _, body in self._meshed],
            np.array([body.material.reflection for _, body in self._meshed], dtype=np.complex128),
            np.array([body.material.albedo for _, body in self._meshed], dtype=np.float64),
        )

    @property
    def num_triangles(self) -> int:
        """Triangles of all bodies; a mesh that several share counts for each."""
        return sum(len(body.mesh.triangles) for _, body in self._meshed)

    @property
    def memory(self) -> int:
        """Memory of triangles, trees and vertices in the core [bytes]; a mesh that bodies share counts once."""
        surfaces = {id(body.mesh._surface): body.mesh._surface for _, body in self._meshed}
        return sum(sum(surface.memory) for surface in surfaces.values())

    @property
    def is_static(self) -> bool:
        """True when nothing ever moves."""
        return bool(self._are_still.all()) and not self._velocities.any()

    @cached_property
    def _are_still(self) -> NDArray[np.bool_]:
        """Bodies with meshes that never move, (body,)."""
        return np.array([is_static(body.motion) for _, body in self._meshed], dtype=np.bool_)

    def _place(self, times: NDArray[np.float64], sensor_motion: Motion, center: NDArray[np.float64]) -> Placement:
        """Bodies and points at `times` (n,) [s], in sensor axes about the array's centre."""
        poses = np.empty((len(times), len(self._meshed), 3, 4))
        points = np.empty((len(times), len(self._targets), 3))
        for k, time in enumerate(times.tolist()):
            sensor = sensor_motion.at(time)
            for b, (_, body) in enumerate(self._meshed):
                poses[k, b] = relative_pose(body.motion.at(time), sensor)
            points[k] = (self._positions + time * self._velocities - sensor.position) @ sensor.rotation
        poses[..., 3] -= center
        return Placement(poses, points - center)

    def _place_rates(self, time: float, sensor_motion: Motion) -> Placement:
        """Time derivatives of `_place` at one time: poses (1, body, 3, 4) and points (1, point, 3) [m/s]."""
        sensor, sensor_rate = sensor_motion.at(time), sensor_motion.rate_at(time)
        rates = [
            relative_rate(body.motion.at(time), body.motion.rate_at(time), sensor, sensor_rate)
            for _, body in self._meshed
        ]
        offsets = self._positions + time * self._velocities - sensor.position
        velocities = (self._velocities - sensor_rate[:, 3]) @ sensor.rotation + offsets @ sensor_rate[:, :3]
        return Placement(np.array(rates, dtype=np.float64).reshape(1, -1, 3, 4), velocities[None])

    def __reduce__(self) -> tuple[type[Scene], tuple[tuple[Body | PointTarget, ...]]]:
        return type(self), (self.bodies,)

    def __repr__(self) -> str:
        return f"<Scene: {', '.join(self.names) or 'empty'}>"
