"""Warnings about the validity of results, one of each kind, and refusals of antennas inside of bodies."""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, notice
from radarcore.direction import angles
from radarcore.geometry.mesh import nearest_point
from radarcore.motion.protocol import poses_at
from radarcore.radar import beam
from radarcore.radar.radar import Radar
from radarcore.receive.adc import Use
from radarcore.scene import library
from radarcore.scene.scene import Scene
from radarcore.simulate.placement import Placement
from radarcore.simulate.view import Angles, is_outside

_PLACES = np.stack(np.meshgrid(*3 * [np.linspace(0.0, 1.0, 3)], indexing="ij"), axis=-1).reshape(-1, 3)
"""Corners of a box and points between them, in parts of its sides."""

_FRAMES_PER_LOOK = 8
"""Single frames between searches for bodies outside of the field of view: one takes a twentieth of a frame."""

_FARTHEST_MEDIAN, _FAR_BEYOND = 100.0, 10.0
"""Median distance of an image [m], also relative to the radar's, above which metres are implausible."""

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

_ROOM = 2.0
"""Diagonal of the bounds of a body above which it may be a room around the sensor [m]."""

_CLEARANCE = 1e-3
"""Smallest distance of a surface or point from an antenna at the start of a run [m]."""


_TEXTS = {
    "view": "{name!r}{more} lies in the beam of the antennas, at azimuth {azimuth:.0f} and elevation {elevation:.0f} "
    "degrees, but outside of field_of_view_deg ({view[0]:g}, {view[1]:g}): {effect}; without a given field of view all "
    "that the antennas see is simulated",
    "sight": "no body is seen: the middle of the nearest, {name!r}, lies at {distance:.4g} m, azimuth {azimuth:.0f} "
    "and elevation {elevation:.0f} degrees from the x axis that the radar looks along, at {time:g} s",
    "no surface": "no body is seen: none of them has a surface",
    "meshes": "the mesh of {names} has no triangles: it returns nothing",
    "backs": "{name!r} shows its back to the radar: a corner reflector opens towards -x, and Pose.look_at turns +x to "
    "its target; half a turn more about z, as by @ Pose.from_rpy([0, 0, 0], [0, 0, pi]), opens it towards the target",
    "velocity": "{name!r} has a radial speed of {speed:.3g} m/s, beyond max_velocity {limit:.3g} m/s of the waveform: "
    "it appears at wrong velocities",
    "overlap": "frames of {duration_ms:.2f} ms overlap at {rate:g} frames per second; no real sensor can do that",
    "series": "{series} are interpolated within a frame with an error of {error:.1e}, above the tolerance of "
    "{tolerance:.1e}",
    "bounces": "paths of several reflections have not converged: ray tubes ran out with an error of {error:.0%} of "
    "their field; a narrower field_of_view_deg or a larger resolution resolves more, a smaller max_bounces asks for "
    "less",
    "sampling": "adaptive sampling ended at its finest cells or its ray_budget: {number} cells have a larger residual "
    "error than rcs_floor asks for",
    "range": "the scene reaches to {farthest:.2f} m, beyond max_unambiguous_range {limit:.2f} m of the radar: {effect}",
    "metres": "distance: expected metres, got a median of {median:.4g} m for a radar with a max_unambiguous_range of "
    "{limit:.4g} m; scale=1e-3 takes millimetres",
    "clipping": "receiver.full_scale: {percent:.3g} % of the samples are beyond it and clip; less gain_db or a larger "
    "full_scale keeps them",
    "codes": "receiver.adc_bits: the signal uses {used} of {all} codes; more gain_db or a smaller full_scale resolves "
    "it",
    "interference": "an interferer is received with {dbm:.0f} dBm: real receivers compress what is above about -10 "
    "dBm, this one is linear",
}
"""Warnings by their kind."""


class Warnings:
    """Warnings of a simulation, each given once.

    Parameters
    ----------
    scene : Scene
        Empty for a depth image.
    radar : Radar
    tolerance : float
        Bound on the error of the synthesis.
    """

    def __init__(self, scene: Scene, radar: Radar, tolerance: float) -> None:
        self._scene, self._radar, self._tolerance = scene, radar, tolerance
        self._given: set[str] = set()
        self._num_looks = 0

    def _warn(self, kind: str, **values: Any) -> None:
        """Warn once of each kind of `_TEXTS`."""
        if kind not in self._given:
            self._given.add(kind)
            notice.warn(_TEXTS[kind].format(**values))

    def before_first_frame(self, placement: Placement, time: float) -> None:
        """Refuse antennas, interferers' too, inside of a body or at its surface at the first time [s] simulated.

        Warn of materials, meshes and reflectors.
        """
        if "first frame" in self._given:
            return
        self.unknown_materials()
        self._empty_meshes()
        if abs(time) >= _EPOCH:
            self._refuse_epoch(placement, time)
        scene, poses = self._scene, placement.poses_at([time])[0]
        check_antennas(scene, poses, self._radar, time)
        for name, interferer in zip(scene.interferer_names, scene.interferers, strict=True):
            others = np.concatenate([poses[:-1], poses_at(interferer.motion, [time])])
            check_antennas(scene, others, interferer.radar, time, name=f"motion of {name!r}")
        self._reflectors_from_behind(placement, time)
        self._given.add("first frame")

    def before_first_worlds(
        self, poses: NDArray[np.float64], points: NDArray[np.float64], moved: NDArray[np.float64], rows: list[int]
    ) -> None:
        """Refuse antennas inside of a body or at its surface at the start of any of the first worlds; warn of meshes.

        Arguments as the core takes them, at one time.
        """
        if "first worlds" in self._given:
            return
        self.unknown_materials()
        self._empty_meshes()
        for world in moved:
            placed = np.zeros((len(poses) + len(points), 3, 4))
            placed[: len(poses)], placed[len(poses) :, :, 3] = poses, points
            placed[rows] = world
            own, targets = placed[: len(poses)], placed[len(poses) :, :, 3]
            check_antennas(self._scene, own, self._radar, 0.0, points=targets, name="poses")
        self._given.add("first worlds")

    def unknown_materials(self) -> None:
        """Warn of materials at frequencies for which they are not known."""
        if "materials" not in self._given:
            self._given.add("materials")
            used = (body.material for body in self._scene.parts.meshed)
            if text := library.extrapolation(used, self._radar.waveform.center_frequency):
                notice.warn(text)

    def bodies_out_of_view(self, placement: Placement, starts: list[float], view: Angles) -> None:
        """Warn of bodies that the antennas see beyond a field of view [degrees], in the middle of frames."""
        meshed = self._scene.parts.meshed
        if "view" in self._given or not meshed:
            return
        self._num_looks += 1
        if len(starts) == 1 and self._num_looks % _FRAMES_PER_LOOK != 1:
            return
        # Places on the bounding boxes of all bodies, in the sensor frame about the middle of the array.
        low, high = np.array([body.mesh.bounds for body in meshed]).swapaxes(0, 1)
        boxes = low[:, None] + _PLACES * (high - low)[:, None]
        poses = placement.poses_at(np.array(starts) + 0.5 * placement.duration)
        moved, mount = poses[:, :-1], poses[:, -1:]
        world = boxes @ moved[..., :3].swapaxes(-1, -2) + moved[..., None, :, 3]
        seen = (world - mount[..., None, :, 3]) @ mount[..., :3] - self._radar.array_center
        is_lost = is_outside(seen, view)
        is_lost[is_lost] = self._is_in_beam(seen[is_lost]).any(axis=-1)
        if is_lost.any():
            bodies = np.flatnonzero(is_lost.any(axis=0)).tolist()
            first = seen[is_lost[:, bodies[0]].argmax(), bodies[0]]
            names = [self._name_of_mesh(body) for body in bodies]
            self._out_of_view(names, first[len(_PLACES) // 2], view, "it returns nothing")

    def points_out_of_view(self, names: list[str], directions: NDArray[np.float64], view: Angles) -> None:
        """Warn of point targets in directions (point, 3) in the beam, but beyond a field of view [degrees]."""
        if len(seen := np.flatnonzero(self._is_in_beam(directions))) > 0:
            self._out_of_view([names[point] for point in seen], directions[seen[0]], view, "its truth is NaN")

    def nothing_visible(self, placement: Placement, time: float) -> None:
        """Warn of an invisible scene, with the position of its nearest body at a time [s]."""
        if not self._scene.bodies or "sight" in self._given:
            return
        names, middles = self._middles(placement, time)
        distances = np.linalg.norm(middles, axis=1)
        if np.isnan(distances).all():
            self._warn("no surface")
            return
        nearest = int(np.nanargmin(distances))
        azimuth, elevation = np.rad2deg(angles(middles[nearest]))
        name, distance = names[nearest], distances[nearest]
        self._warn("sight", name=name, distance=distance, azimuth=azimuth, elevation=elevation, time=time)

    def too_fast(self, range_rates: NDArray[np.float64]) -> None:
        """Warn of bodies, (body,) [m/s], that are too fast for the chirps of a frame."""
        wf, limit, speeds = self._radar.waveform, self._radar.max_velocity, np.abs(range_rates)
        # NaN of bodies that no ray hit is not beyond the limit.
        if wf.num_chirps > 1 and wf.has_uniform_chirps and (speeds > limit).any():
            fastest, names = int(np.nanargmax(speeds)), self._scene.names
            self._warn("velocity", name=names[fastest % len(names)], speed=speeds[fastest], limit=limit)

    def overlapping_frames(self, rate: float) -> None:
        """Warn of frames that overlap at a rate [Hz]."""
        if self._radar.duration * rate > 1.0 + 1e-9:  # back to back, but for rounding
            notice.warn(_TEXTS["overlap"].format(duration_ms=1e3 * self._radar.duration, rate=rate))

    def unresolved(self, ideal: _core.IdealFrame) -> None:
        """Warn of unresolved motion, reflections and cells of a frame, and of echoes from beyond the largest range."""
        phase, weight = ideal.series_errors
        if (residual := hypot(phase, weight)) > self._tolerance:
            bodies = ", ".join(repr(self._scene.names[body]) for body in ideal.fast_varying[:_MOST_NAMES])
            of = f" of {bodies}" if bodies else ""
            phases = f"phases (fast motion{of}, or large absolute times)"
            series = phases if phase > weight else f"amplitudes (turning edges{of})"
            self._warn("series", series=series, error=residual, tolerance=self._tolerance)
        if ideal.bounce_error > _UNRESOLVED:
            self._warn("bounces", error=ideal.bounce_error)
        self._too_far(ideal)

    def unsplit_cells(self, number: int) -> None:
        """Warn of cells that adaptive sampling should have refined, and could not."""
        if number > 0:
            self._warn("sampling", number=number)

    def distances_not_in_metres(self, distance: NDArray[np.float64]) -> None:
        """Warn of an image whose distances along the rays, infinite without a return, are hardly in metres."""
        seen = distance[np.isfinite(distance)]
        median, limit = float(np.median(seen)) if seen.size > 0 else 0.0, self._radar.max_unambiguous_range
        if median > max(_FARTHEST_MEDIAN, _FAR_BEYOND * limit):
            self._warn("metres", median=median, limit=limit)
            self._given.add("range")  # same cause

    def unsuitable_gain(self, use: Use) -> None:
        """Warn of a signal that clips or uses few codes of the ADC."""
        receiver = self._radar.receiver
        bits = 0 if receiver is None or receiver.adc_bits is None else receiver.adc_bits
        if use.clipped_share > _CLIPS:
            self._warn("clipping", percent=100.0 * use.clipped_share)
        if bits > 1 and use.lowest < use.highest and use.num_codes(bits) <= _FEWEST_CODES:
            self._warn("codes", used=use.num_codes(bits), all=2**bits)

    def strong_interferer(self, power: float) -> None:
        """Warn of an interferer whose power at a receiver [W] drives real ones out of their linear range."""
        if power > _COMPRESSES:
            self._warn("interference", dbm=10.0 * np.log10(power) + 30.0)

    def _empty_meshes(self) -> None:
        """Warn of bodies without triangles; `nothing_visible` warns if the scene has only these."""
        scene = self._scene
        empty = [index for index, body in enumerate(scene.parts.meshed) if len(body.mesh.triangles) == 0]
        if 0 < len(empty) < len(scene.bodies):
            self._warn("meshes", names=", ".join(repr(self._name_of_mesh(index)) for index in empty[:_MOST_NAMES]))

    def _reflectors_from_behind(self, placement: Placement, time: float) -> None:
        """Warn of a corner reflector in the beam that shows only its back at a time [s]."""
        parts = self._scene.parts
        reflectors = [mesh for mesh, body in enumerate(parts.meshed) if body.mesh.is_reflector]
        if not reflectors:
            return
        *poses, sensor = placement.poses_at([time])[0]
        for mesh in reflectors:
            turn, place = poses[mesh][:, :3], poses[mesh][:, 3]
            corners = parts.vertices_at(mesh, time)[parts.meshed[mesh].mesh.triangles]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            is_front = (normals * ((sensor[:, 3] - place) @ turn - corners[:, 0])).sum(axis=1) > 0.0
            if not is_front.any() and self._is_in_beam((place - sensor[:, 3])[None] @ sensor[:, :3]).any():
                self._warn("backs", name=self._name_of_mesh(mesh))

    def _is_in_beam(self, directions: NDArray[np.float64]) -> NDArray[np.bool_]:
        """True for directions (..., 3) in which some pair of antennas sees."""
        return beam.is_in_beam(self._radar.tx_patterns, self._radar.rx_patterns, directions)

    def _out_of_view(self, names: list[str], direction: NDArray[np.float64], view: Angles, effect: str) -> None:
        """Warn of targets outside of a field of view [degrees]; direction of the first."""
        azimuth, elevation = np.rad2deg(angles(direction))
        more = f" (and {len(names) - 1} more)" if len(names) > 1 else ""
        self._warn("view", name=names[0], more=more, azimuth=azimuth, elevation=elevation, view=view, effect=effect)

    def _too_far(self, ideal: _core.IdealFrame) -> None:
        """Warn of echoes from beyond the largest range, and of bodies there without an echo."""
        farthest, effect = ideal.farthest, "echoes from there appear at wrong ranges"
        limit = self._radar.max_unambiguous_range
        if 0.0 < farthest <= limit:
            return
        ranges = [] if ideal.truth is None else ideal.truth[0][np.isfinite(ideal.truth[0])].tolist()
        nearest = min(ranges, default=0.0)
        if farthest == 0.0 and ideal.counts.get("rays_hit", 0) > 0:
            # Rays met bodies, but no path returns: far bodies are smaller than the finest cells.
            farthest, effect = nearest, "bodies there are too small for an echo"
        if farthest > limit:
            if nearest > limit:
                self._given.add("sampling")  # same cause
            self._warn("range", farthest=farthest, limit=limit, effect=effect)

    def _middles(self, placement: Placement, time: float) -> tuple[list[str], NDArray[np.float64]]:
        """Names of the bodies, and the middles of their bounds in sensor axes, (body, 3), at a time [s].

        The middle is NaN for a body without a surface.
        """
        parts, (*poses, sensor) = self._scene.parts, placement.poses_at([time])[0]
        middles = [parts.bounds_at(mesh, time).mean(axis=0) for mesh in range(len(poses))]
        world = [pose[:, :3] @ middle + pose[:, 3] for pose, middle in zip(poses, middles, strict=True)]
        numbers = [*parts.mesh_numbers.tolist(), *parts.point_numbers.tolist()]
        places = np.array([*world, *(parts.positions + time * parts.velocities)]).reshape(-1, 3)
        return [self._scene.names[number] for number in numbers], (places - sensor[:, 3]) @ sensor[:, :3]

    def _refuse_epoch(self, placement: Placement, time: float) -> None:
        """Refuse a time since 1970 [s] if a body has moved far away by then."""
        names, middles = self._middles(placement, time)
        distances = np.nan_to_num(np.linalg.norm(middles, axis=1))
        if (farthest := distances.max(initial=0.0)) > _LOST:
            raise ValueError(
                f"time: expected seconds from about 0 on, where motions begin, got {time:.10g} s, as times since 1970 "
                f"are: {names[int(distances.argmax())]!r} has moved to {farthest:.3g} m by then; subtract the time of "
                "the first frame"
            )

    def _name_of_mesh(self, mesh: int) -> str:
        return self._scene.names[int(self._scene.parts.mesh_numbers[mesh])]


def check_antennas(
    scene: Scene,
    poses: NDArray[np.float64],
    radar: Radar,
    time: float,
    *,
    points: NDArray[np.float64] | None = None,
    name: str = "radar_motion",
) -> None:
    """Refuse a surface or a point at an antenna when a run begins, at a time [s]; `name` is what places the radar.

    The antennas must not be inside a body, unless it is large enough to be a room around them. `poses` of the bodies
    with meshes and of the sensor at that time, (body + 1, 3, 4), to the world; `points`: positions of the point
    targets, by default of the scene.
    """
    antennas = np.concatenate([radar.tx, radar.rx])
    parts, sensor = scene.parts, poses[-1]
    world = antennas @ sensor[:, :3].T + sensor[:, 3]
    for mesh, number in enumerate(parts.mesh_numbers):
        pose = poses[mesh]
        local = (world - pose[:, 3]) @ pose[:, :3]
        # Few antennas are near the box around a body.
        low, high = parts.bounds_at(mesh, time)
        near = local[((local > low - _CLEARANCE) & (local < high + _CLEARANCE)).all(axis=1)]
        if len(near) == 0:
            continue
        corners = parts.vertices_at(mesh, time)[parts.meshed[mesh].mesh.triangles]
        gaps = [float(np.linalg.norm(nearest_point(antenna, corners) - antenna)) for antenna in near]
        _check_gap(min(gaps), name, scene.names[number])
        if np.linalg.norm(high - low) < _ROOM and any(_is_inside(antenna, corners) for antenna in near):
            raise ValueError(
                f"{name}: expected the antennas outside of every body smaller than {_ROOM:g} m when the run begins, "
                f"got them inside {scene.names[number]!r}"
            )
    points = parts.positions + time * parts.velocities if points is None else points
    for point, number in zip(points, parts.point_numbers, strict=True):
        _check_gap(float(np.linalg.norm(point - world, axis=1).min()), name, scene.names[number])


def _check_gap(gap: float, name: str, body: str) -> None:
    if gap < _CLEARANCE:
        raise ValueError(
            f"{name}: expected all antennas at least {1e3 * _CLEARANCE:g} mm from every surface when the run begins, "
            f"got {1e3 * gap:.2g} mm to {body!r}"
        )


def _is_inside(point: NDArray[np.float64], corners: NDArray[np.float64]) -> bool:
    """True when closed triangles (n, 3, 3) enclose a point: the solid angles add up to 4 pi, not to zero.

    Van Oosterom, Strackee, The solid angle of a plane triangle, IEEE Trans. Biomed. Eng. 30 (1983).
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(-1)
    cosines = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return bool(abs(np.arctan2(volume, cosines).sum()) > np.pi)
