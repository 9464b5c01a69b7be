"""Warnings about the validity of results, one of each kind."""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, notice
from radarcore.motion.protocol import poses_at
from radarcore.radar import beam
from radarcore.radar.radar import Radar
from radarcore.receive.adc import Use
from radarcore.scene import library
from radarcore.scene.scene import Scene
from radarcore.simulate.clearance import check_antennas
from radarcore.simulate.directions import angles
from radarcore.simulate.placement import Placement
from radarcore.simulate.sectors import Angles, is_outside

_PLACES = np.stack(np.meshgrid(*3 * [np.linspace(0.0, 1.0, 3)], indexing="ij"), axis=-1).reshape(-1, 3)
"""Corners of a box and points between them, in parts of its sides."""


_FRAMES_PER_LOOK = 8
"""Frames placed one by one until bodies outside of the field of view are looked for again."""


_FARTHEST_MEDIAN, _FAR_BEYOND = 100.0, 10.0
"""Median distance of an image [m], also over that of the radar, above which it is hardly in metres."""


_COMPRESSES = 1e-4
"""Power at a receiver [W] above which real ones are not linear: -10 dBm, as in their data sheets."""

_CLIPS = 1e-3
"""Share of clipped samples above which the spectrum is distorted."""

_FEWEST_CODES = 2
"""Number of ADC codes that contain only the sign of a signal."""

_EPOCH, _LOST = 1e8, 1e6
"""Times that may count from 1970 [s], and distances that are implausible for a body [m]."""

_UNRESOLVED = 0.2
"""Error of paths of several reflections relative to their field that is warned of: about 1.6 dB."""

_MOST_NAMES = 3
"""Names of bodies in one warning, at most."""


def _check_epoch(scene: Scene, poses: NDArray[np.float64], time: float) -> None:
    """Refuse times since 1970 if a body has moved far away by then."""
    if abs(time) < _EPOCH:
        return
    parts, sensor = scene.parts, poses[-1, :, 3]
    places = np.concatenate([poses[:-1, :, 3], parts.positions + time * parts.velocities]) - sensor
    numbers = [*parts.mesh_numbers.tolist(), *parts.point_numbers.tolist()]
    distances = np.linalg.norm(places, axis=1)
    if len(distances) > 0 and distances.max() > _LOST:
        raise ValueError(
            f"time: expected seconds from about 0 on, where motions begin, got {time:.10g} s, as times since 1970 are: "
            f"{scene.names[numbers[int(distances.argmax())]]!r} has moved to {distances.max():.3g} m by then; subtract "
            "the time of the first frame"
        )


def _nearest(ideal: _core.IdealFrame) -> float:
    """Range of the nearest visible body [m]; 0 without any."""
    ranges = np.empty(0) if ideal.truth is None else ideal.truth[0][np.isfinite(ideal.truth[0])]
    return float(ranges.min()) if ranges.size > 0 else 0.0


class Doubts:
    """Warnings of a simulation, each given once.

    Parameters
    ----------
    radar : Radar
    tolerance : float
        Bound on the error of the synthesis.
    """

    def __init__(self, radar: Radar, tolerance: float) -> None:
        self._radar, self._tolerance = radar, tolerance
        self._told: set[str] = set()
        self._boxes: NDArray[np.float64] | None = None
        self._num_looks = 0

    def of_materials(self, scene: Scene) -> None:
        """Warn of materials at frequencies for which they are not known."""
        if self._is_new("materials"):
            used = (body.material for body in scene.parts.meshed)
            if text := library.extrapolation(used, self._radar.waveform.center_frequency):
                notice.warn(text)

    def of_meshes(self, scene: Scene) -> None:
        """Warn of bodies without triangles; `of_sight` warns if the scene has only these."""
        if not self._is_new("meshes"):
            return
        empty = [index for index, body in enumerate(scene.parts.meshed) if len(body.mesh.triangles) == 0]
        if 0 < len(empty) < len(scene.bodies):
            names = ", ".join(repr(scene.names[scene.parts.mesh_numbers[index]]) for index in empty[:_MOST_NAMES])
            notice.warn(f"the mesh of {names} has no triangles: it returns nothing")

    def of_view(self, scene: Scene, poses: NDArray[np.float64], view: Angles) -> None:
        """Warn of bodies that the antennas see beyond a field of view [degrees].

        `poses`: (time, body + 1, 3, 4), those of the bodies with meshes and of the sensor, in the world.
        """
        meshed = scene.parts.meshed
        if "view" in self._told or not meshed:
            return
        # Frame by frame the look would take a twentieth of the time of a frame.
        self._num_looks += 1
        if len(poses) == 1 and self._num_looks % _FRAMES_PER_LOOK != 1:
            return
        # Places on the bounding boxes of all bodies, in the sensor frame about the middle of the array.
        if self._boxes is None:
            low, high = np.array([body.mesh.bounds for body in meshed]).swapaxes(0, 1)
            self._boxes = low[:, None] + _PLACES * (high - low)[:, None]
        bodies, mount = poses[:, :-1], poses[:, -1:]
        world = self._boxes @ bodies[..., :3].swapaxes(-1, -2) + bodies[..., None, :, 3]
        seen = (world - mount[..., None, :, 3]) @ mount[..., :3] - self._radar.array_center

        radar = self._radar
        lost = is_outside(seen, view)
        lost[lost] = beam.is_in_beam(radar.tx_patterns, radar.rx_patterns, seen[lost]).any(axis=-1)
        if not lost.any():
            return
        time, body = (int(index) for index in np.argwhere(lost)[0])
        first_others = [body, *(set(np.flatnonzero(lost.any(axis=0)).tolist()) - {body})]
        names = [scene.names[scene.parts.mesh_numbers[each]] for each in first_others]
        azimuth, elevation = angles(seen[time, body, len(_PLACES) // 2])
        self._warn_of_view(names, (float(azimuth), float(elevation)), view, "it returns nothing")

    def of_points(
        self, names: list[str], azimuth: NDArray[np.float64], elevation: NDArray[np.float64], view: Angles
    ) -> None:
        """Warn of point targets in directions [rad] in the beam, but beyond a field of view [degrees]."""
        if "view" in self._told:
            return
        across = np.cos(elevation)
        directions = np.stack([np.cos(azimuth) * across, np.sin(azimuth) * across, np.sin(elevation)], axis=-1)
        seen = np.flatnonzero(beam.is_in_beam(self._radar.tx_patterns, self._radar.rx_patterns, directions)).tolist()
        if seen:
            at = azimuth[seen[0]], elevation[seen[0]]
            self._warn_of_view([names[point] for point in seen], at, view, "its truth is NaN")

    def _warn_of_view(self, names: list[str], direction: tuple[float, float], view: Angles, effect: str) -> None:
        """Warn of targets outside of a field of view [degrees]; azimuth and elevation [rad] of the first."""
        self._told.add("view")
        azimuth, elevation = np.rad2deg(direction)
        others = len(names) - 1
        more = f" (and {others} more)" if others else ""
        notice.warn(
            f"{names[0]!r}{more} lies in the beam of the antennas, at azimuth {azimuth:.0f} and elevation "
            f"{elevation:.0f} degrees, but outside of field_of_view_deg ({view[0]:g}, {view[1]:g}): {effect}; "
            "without a given field of view all that the antennas see is simulated"
        )

    def of_place(self, scene: Scene, placement: Placement, time: float) -> None:
        """Refuse antennas, interferers' too, inside of a body or at its surface at the first time [s] simulated."""
        if "place" not in self._told:
            poses = placement.poses_at(time)
            _check_epoch(scene, poses, time)
            check_antennas(scene, poses, self._radar, time)
            for name, interferer in zip(scene.interferer_names, scene.interferers, strict=True):
                others = np.concatenate([poses[:-1], poses_at(interferer.motion, [time])])
                check_antennas(scene, others, interferer.radar, time, name=f"motion of {name!r}")
            self._told.add("place")

    def of_backs(self, scene: Scene, placement: Placement, time: float) -> None:
        """Warn of a corner reflector in the beam that shows only its back at a time [s]."""
        reflectors = [mesh for mesh, body in enumerate(scene.parts.meshed) if body.mesh.is_reflector]
        if not reflectors or not self._is_new("backs"):
            return
        poses = placement.poses_at(time)
        sensor = poses[-1]
        for mesh in reflectors:
            turn, place, shape = poses[mesh, :, :3], poses[mesh, :, 3], scene.parts.meshed[mesh].mesh
            corners = scene.parts.vertices_at(mesh, time)[shape.triangles]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            is_front = np.einsum("ij,ij->i", normals, (sensor[:, 3] - place) @ turn - corners[:, 0]) > 0.0
            seen = (place - sensor[:, 3]) @ sensor[:, :3]
            in_beam = beam.is_in_beam(self._radar.tx_patterns, self._radar.rx_patterns, seen[None])[0]
            if in_beam and not is_front.any():
                notice.warn(
                    f"{scene.names[scene.parts.mesh_numbers[mesh]]!r} shows its back to the radar: a corner reflector "
                    "opens towards -x, and Pose.look_at turns +x to its target; half a turn more about z, as by "
                    "@ Pose.from_rpy([0, 0, 0], [0, 0, pi]), opens it towards the target"
                )
                return

    def of_sight(self, scene: Scene, placement: Placement, time: float) -> None:
        """Warn of a scene of which nothing is seen: where the nearest of its bodies lies at a time [s]."""
        if not scene.bodies or not self._is_new("sight"):
            return
        parts, poses = scene.parts, placement.poses_at(time)
        sensor = poses[-1]
        middles = dict(zip(parts.point_numbers.tolist(), parts.positions + time * parts.velocities, strict=True))
        for mesh, number in enumerate(parts.mesh_numbers.tolist()):
            middle, pose = parts.bounds_at(mesh, time).mean(axis=0), poses[mesh]
            if not np.isnan(middle).any():
                middles[number] = pose[:, :3] @ middle + pose[:, 3]
        seen = {number: (middle - sensor[:, 3]) @ sensor[:, :3] for number, middle in middles.items()}
        if not seen:
            notice.warn("no body is seen: none of them has a surface")
            return
        nearest = min(seen, key=lambda number: float(np.linalg.norm(seen[number])))
        x, y, z = seen[nearest].tolist()
        azimuth, elevation = np.rad2deg([np.arctan2(y, x), np.arctan2(z, hypot(x, y))])
        notice.warn(
            f"no body is seen: the middle of the nearest, {scene.names[nearest]!r}, lies at {hypot(x, y, z):.4g} m, "
            f"azimuth {azimuth:.0f} and elevation {elevation:.0f} degrees from the x axis that the radar looks along, "
            f"at {time:g} s"
        )

    def of_velocities(self, names: tuple[str, ...], range_rates: NDArray[np.float64]) -> None:
        """Warn of bodies, (body,) [m/s], that are too fast for the chirps of a frame."""
        wf = self._radar.waveform
        if "velocity" in self._told or wf.num_chirps < 2 or not wf.has_uniform_chirps:
            return
        limit = self._radar.max_velocity
        # Numbers of Python: as fast for few bodies. NaN of bodies that no ray hit is not beyond the limit.
        speeds = [abs(rate) for rate in range_rates.tolist()]
        if any(speed > limit for speed in speeds) and self._is_new("velocity"):
            fastest = max(speed for speed in speeds if speed > limit)
            notice.warn(
                f"{names[speeds.index(fastest)]!r} has a radial speed of {fastest:.3g} m/s, beyond max_velocity "
                f"{limit:.3g} m/s of the waveform: it appears at wrong velocities"
            )

    def of_rate(self, rate: float) -> None:
        """Warn of frames that overlap at a rate [Hz]."""
        duration = self._radar.duration
        if duration * rate > 1.0 + 1e-9:  # back to back, but for rounding
            notice.warn(
                f"frames of {1e3 * duration:.2f} ms overlap at {rate:g} frames per second; no real sensor can do that"
            )

    def of_frame(self, ideal: _core.IdealFrame, names: tuple[str, ...]) -> None:
        """Warn of unresolved motion within a frame, and of echoes from beyond the largest range.

        `names`: those of the bodies in the scene.
        """
        phase, weight = ideal.series_errors
        if (residual := hypot(phase, weight)) > self._tolerance and self._is_new("series"):
            bodies = ", ".join(repr(names[body]) for body in ideal.fast_varying[:_MOST_NAMES])
            of = f" of {bodies}" if bodies else ""
            phases = f"phases (fast motion{of}, or large absolute times)"
            series = phases if phase > weight else f"amplitudes (turning edges{of})"
            notice.warn(
                f"{series} are interpolated within a frame with an error of {residual:.1e}, above the tolerance of "
                f"{self._tolerance:.1e}"
            )
        if ideal.bounce_error > _UNRESOLVED and self._is_new("bounces"):
            notice.warn(
                f"paths of several reflections have not converged: ray tubes ran out with an error of "
                f"{ideal.bounce_error:.0%} of their field; a narrower field_of_view_deg or a larger resolution "
                "resolves more, a smaller max_bounces asks for less"
            )
        self._of_range(ideal)

    def _of_range(self, ideal: _core.IdealFrame) -> None:
        """Warn of echoes from beyond the largest range, and of bodies there without an echo."""
        farthest, effect = ideal.farthest, "echoes from there appear at wrong ranges"
        if farthest == 0.0 and ideal.counts.get("rays_hit", 0) > 0:
            # Rays met bodies, but no path returns: far bodies are smaller than the finest cells.
            farthest, effect = _nearest(ideal), "bodies there are too small for an echo"
        if farthest > self._radar.max_range and self._is_new("range"):
            if _nearest(ideal) > self._radar.max_range:
                self._told.add("sampling")  # same cause
            notice.warn(
                f"the scene reaches to {farthest:.2f} m, beyond max_range {self._radar.max_range:.2f} m of the "
                f"waveform: {effect}"
            )

    def of_depths(self, distance: NDArray[np.float64]) -> None:
        """Warn of an image whose distances along the rays, infinite without a return, are hardly in metres."""
        seen = distance[np.isfinite(distance)]
        median = float(np.median(seen)) if seen.size > 0 else 0.0
        if median > max(_FARTHEST_MEDIAN, _FAR_BEYOND * self._radar.max_range) and self._is_new("range"):
            notice.warn(
                f"distance: expected metres, got a median of {median:.4g} m for a radar with a max_range of "
                f"{self._radar.max_range:.4g} m; scale=1e-3 takes millimetres"
            )

    def of_sampling(self, cells_not_split: int) -> None:
        """Warn of cells that adaptive sampling should have refined, and could not."""
        if cells_not_split > 0 and self._is_new("sampling"):
            notice.warn(
                f"adaptive sampling ended at its finest cells or its ray_budget: {cells_not_split} cells have a larger "
                "residual error than rcs_floor asks for"
            )

    def of_adc(self, use: Use | None) -> dict[str, Any]:
        """Warn of a signal that clips or uses few codes of the ADC; shares for `Frame.stats`."""
        receiver = self._radar.receiver
        if use is None or receiver is None:
            return {}
        if use.clipped_share > _CLIPS and self._is_new("clipping"):
            notice.warn(
                f"receiver.full_scale: {100.0 * use.clipped_share:.3g} % of the samples are beyond it and clip; less "
                "gain_db or a larger full_scale keeps them"
            )
        bits = receiver.adc_bits or 0
        if bits > 1 and use.lowest < use.highest and use.num_codes(bits) <= _FEWEST_CODES and self._is_new("codes"):
            notice.warn(
                f"receiver.adc_bits: the signal uses {use.num_codes(bits)} of {2**bits} codes; more gain_db or a "
                "smaller full_scale resolves it"
            )
        return use.stats(receiver)

    def of_interference(self, power: float) -> None:
        """Warn of an interferer whose power at a receiver [W] drives real ones out of their linear range."""
        if power > _COMPRESSES and self._is_new("interference"):
            notice.warn(
                f"an interferer is received with {10.0 * np.log10(power) + 30.0:.0f} dBm: real receivers compress what "
                "is above about -10 dBm, this one is linear"
            )

    def _is_new(self, kind: str) -> bool:
        if kind in self._told:
            return False
        self._told.add(kind)
        return True
