"""Poses of sensor and bodies, points and vertices at the Chebyshev times of frames, as the core takes them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core
from radarcore.motion.group import Motions
from radarcore.motion.protocol import Motion, latest_update
from radarcore.radar.waveform import Waveform
from radarcore.scene.scene import Scene

_FRAMES_AHEAD = 16
"""Largest number of frames that are placed together: beyond it a call costs little beside its work."""


class Placement:
    """Poses and positions of a moving scene and sensor at the times of a frame.

    Parameters
    ----------
    scene : Scene
    sensor_motion : Motion
        Sensor to world.
    waveform : Waveform
        Times of a frame.

    Attributes
    ----------
    duration : float
        Of a frame [s].
    """

    def __init__(self, scene: Scene, sensor_motion: Motion, waveform: Waveform) -> None:
        self._parts, self._waveform = scene.parts, waveform
        self.duration: float = waveform.duration
        self._interfering = [interferer.motion for interferer in scene.interferers]
        # The sensor is the last of them.
        self._motions = Motions([*(body.motion for body in self._parts.meshed), sensor_motion])

    @property
    def newest(self) -> float | None:
        """Time of the newest update of what is live [s], minus infinity before the first; None if nothing is live."""
        return latest_update(self._motions, *self._interfering)

    @property
    def frames_ahead(self) -> int:
        """Number of frames that are worth placing together.

        Live ones may be updated before the next, and vertices are many.
        """
        return 1 if self.newest is not None or self._parts.deforming else _FRAMES_AHEAD

    def frames(self, starts: Sequence[float], num_times: int) -> list[_core.Placement]:
        """Placements at `num_times` times of each frame that starts at `starts` [s]."""
        times = np.array(starts)[:, None] + self._waveform.delay_times(num_times)
        poses = self._motions.poses_at(times.ravel()).reshape(len(starts), num_times, -1, 3, 4)
        placements = []
        for frame, start in enumerate(starts):
            vertices = self._vertices(start + self._waveform.delay_times(_num_vertex_times(num_times)))
            placements.append(core_placement(poses[frame], self._points(times[frame]), vertices))
        return placements

    def own(self, num_times: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Times of a frame that starts at 0 [s], and there poses as of `poses_at` and positions of points."""
        times = self._waveform.delay_times(num_times)
        return times, np.ascontiguousarray(self.poses_at(times)), self._points(times)

    def poses_at(self, times: ArrayLike) -> NDArray[np.float64]:
        """Poses to the world at times [s], (time, body + 1, 3, 4): of the bodies with meshes, then of the sensor."""
        return self._motions.poses_at(np.asarray(times))

    def at(self, time: float) -> _core.Placement:
        """Placement at one time [s]."""
        times = np.array([time])
        return core_placement(self._motions.poses_at(times), self._points(times), self._vertices(times))

    def rates_at(self, time: float) -> _core.Placement:
        """Time derivatives of the placement at one time [s]."""
        rates, parts = self._motions.rates_at(np.array([time])), self._parts
        vertices = [parts.vertex_rates_at(mesh, time)[None] for mesh in parts.deforming]
        return core_placement(rates, parts.velocities[None], vertices)

    def _points(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._parts.positions + times[:, None, None] * self._parts.velocities

    def _vertices(self, times: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        parts = self._parts
        return [np.array([parts.vertices_at(mesh, at) for at in times.tolist()]) for mesh in parts.deforming]


def core_placement(
    poses: NDArray[np.float64], points: NDArray[np.float64], vertices: Sequence[NDArray[np.float64]] = ()
) -> _core.Placement:
    """Poses (time, body + 1, 3, 4), positions of points (time, point, 3) and vertices of bodies, for the core."""
    bodies, sensor = np.ascontiguousarray(poses[:, :-1]), np.ascontiguousarray(poses[:, -1])
    return _core.Placement(sensor, bodies, points, vertices)


def _num_vertex_times(num_times: int) -> int:
    """Number of times for vertices, which are many: about half of those for poses, and odd too."""
    half = (num_times + 1) // 2
    return half + 1 - half % 2
