"""Simulator of radar frames from a scene: place, simulate, receive."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.direction import unit_vectors
from radarcore.geometry.pose import Pose
from radarcore.motion.protocol import AnyMotion, Motion, as_motion
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import frame_rate
from radarcore.receive.adc import Use
from radarcore.receive.chain import received
from radarcore.recording.frame import Frame, Truth, adc_codes, frame_of, truth_of_rows
from radarcore.recording.native import RecordingWriter
from radarcore.recording.recording import Recording
from radarcore.records import sealed
from radarcore.scene.scene import Scene
from radarcore.simulate.depth_image import DepthImage
from radarcore.simulate.engine import NUM_TIMES, at_receivers, counts_of, ideal_frame, new_engine, ramps_of
from radarcore.simulate.interference import Counts, Interference, counted
from radarcore.simulate.paths import Paths
from radarcore.simulate.placement import Placement, core_placement
from radarcore.simulate.settings import Settings, changed_settings, frame_times
from radarcore.simulate.side_by_side import Ask, directly, in_order
from radarcore.simulate.view import Angles, is_outside, whole_tiles
from radarcore.simulate.warnings import Warnings
from radarcore.simulate.worlds import Placements, Worlds
from radarcore.units import html_table

Engines = list[_core.Simulator]
"""Counterparts in the core, one per sub-sequence."""

_BYTES_SIDE_BY_SIDE = 3_000_000_000
"""Memory of frames that are simulated side by side [bytes]."""

_BYTES_PER_RAY, _BYTES_PER_SAMPLE = 300, 32
"""Memory of a frame, about [bytes]."""


class Placed(NamedTuple):
    """Start of a frame [s], and the motion of bodies and sensor in it, for every sub-sequence."""

    start: float
    motions: list[_core.Placement]


class Simulated(NamedTuple):
    """Start of a frame [s], its ideal frames and samples, counts of interference, and use of the ADC."""

    start: float
    ideals: list[_core.IdealFrame]
    cube: NDArray[Any]
    interference: Counts
    use: Use | None


@sealed
@dataclass(eq=False, repr=False)
class Simulator(Settings):
    """Simulator of the frames that a radar receives from a scene.

    Parameters
    ----------
    scene : Scene
    radar : Radar
    radar_motion : Pose, Linear, Trajectory, Attached, Live or function of time
        Sensor to world; default: the world's own frame, looking along +x.
    resolution : int or (rows, columns), optional
        Pixels of depth images, and rays of frames; with adaptive sampling the cells of the base grid. All across the
        field of view. Default: 256 x 256 pixels, and 128 cells per 60 degrees; frames have more above 60 degrees, so
        that cells in the middle stay equally small.
    field_of_view_deg : (float, float), optional
        Horizontal and vertical angle that is simulated [degrees], each below 180. Default: the field of view of the
        antennas, `Radar.field_of_view_deg`. `view_deg` has the angles either way. A body or point in the beam of the
        antennas, but outside of the given angles, raises one warning.
    sampling : "adaptive", "fast", "footprint" or "point"
        Sampling of surfaces by rays. Adaptive: cells of the image plane are refined where the error of their echo is
        largest, and diffuse surfaces are sampled by material points that move with them. Fast: the same for a tenfold
        `rcs_floor`, in about half the time; single weak echoes may be lost. Footprint: the pixels of an image, with a
        phase that varies over the patch of each, which converges with the number of pixels. Point: one phasor per pixel
        as in Stetco et al., ICRA 2020, but weighted by area, for comparison; it does not converge.
    tolerance : float
        Bound on rms(error of synthesis over the samples of a channel) / l2(amplitudes of that channel). The rounding of
        complex64 comes on top, at most 6e-8 of the samples: 1.9e-5 in this measure for 1e5 equal paths in phase. Below
        1e-6 the samples are in double precision.
    method : "auto", "direct" or "grid"
        Way to form the sum over paths, see `beat_signal`.
    rcs_floor : float, optional
        Smallest cross-section of interest [m^2]: cells of adaptive sampling are refined until the residual error of
        each is 40 dB below the echo of such a target at the peak of the gain and the same distance, or nine times.
        Default: 0.01, 0.1 with fast sampling, and less where the strongest echo in view is weak: a tenth of it.
    ray_budget : int, optional
        Largest number of rays through the cells of a cast, of adaptive sampling; where they do not suffice, the
        permitted residual error grows everywhere, parts of meshes between rays are sought less finely, and one warning
        says so. Infinite: enough for `rcs_floor`. Default: 400 000, or four per cell of the base grid where
        that is more. Not counted: rays of cells that were tried before that error had grown, and rays to the points
        of diffuse surfaces, at most 131 072 per body. `Frame.stats["rays_cast"]` counts both.
    gain_floor_db : float
        Two-way gain below the peak [dB] at which directions are left out: no rays are cast for frames and paths where
        the gain of every pair of antennas is lower. Infinite: none is left out. Depth images are always complete.
    max_bounces : int
        Largest number of reflections of a path. Walls that meet at right angles, as in a corner reflector or a room,
        return the wave after two or three reflections and need 3.
    bounce_floor_db : float
        Loss of power by reflections [dB] at which a ray ends.
    retrace_deg : float
        Largest angle [degrees] by which a body may turn, seen from the sensor, from the time at which the rays of a
        frame are cast: if one turns by more, the rays are cast for parts of the frame. Infinite: one cast per frame.
        The deformation of a body does not count.
    seed : int
        Seed of speckle and noise.
    threads : int, optional
        Threads to use; default: all cores. Results do not depend on it.

    Raises
    ------
    ValueError
        At the first frame, for antennas within 1 mm of a surface or inside of a body smaller than 2 m.

    Warns
    -----
    UserWarning
        Once each: for echoes beyond `Radar.max_unambiguous_range`, bodies faster than `Radar.max_velocity`, a scene
        without a visible body, and invalid assumptions behind the result.

    See Also
    --------
    rcs : Cross-section of a body alone, without a radar.
    beat_signal : Samples of paths that are known already.
    frame_from_depth : Frame from a depth image of another program.
    load_scene : Simulation that a scene file describes.

    Notes
    -----
    Settings are read-only: `dataclasses.replace` makes another simulator.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], name="reflector")])
    >>> simulator = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16))
    >>> simulator.frame()
    <Frame at 0 s: 3 channels x 16 chirps x 128 samples, float32, truth of reflector>
    """

    scene: Scene
    radar: Radar
    radar_motion: AnyMotion | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        check.instance("scene", self.scene, Scene)
        check.instance("radar", self.radar, Radar)
        super().__post_init__()
        self.radar_motion = Pose() if self.radar_motion is None else as_motion("radar_motion", self.radar_motion)

    def __repr__(self) -> str:
        changed = "".join(f", {name}={value!r}" for name, value in changed_settings(self).items())
        horizontal, vertical = self.view_deg
        return f"<Simulator of {self.scene!r} and {self.radar!r}: {horizontal:.4g} x {vertical:.4g} degrees{changed}>"

    def _repr_html_(self) -> str:
        facts = {
            "bodies": list(self.scene.names),
            "triangles": self.scene.num_triangles,
            "field of view [degrees]": "{:.4g} x {:.4g}".format(*self.view_deg),
            **changed_settings(self),
        }
        return html_table("Simulator", {**facts, **self.radar.facts()})

    @cached_property
    def view_deg(self) -> Angles:
        """Horizontal and vertical angle that frames have [degrees]: those chosen, or what the antennas see."""
        if self.field_of_view_deg is not None:
            return self.field_of_view_deg
        horizontal, vertical = self.radar.field_of_view_deg
        return whole_tiles(horizontal), whole_tiles(vertical)

    def with_radar(self, radar: Radar) -> Simulator:
        """Simulator of the same scene with another radar.

        See Also
        --------
        Simulator : Settings, read-only.

        Examples
        --------
        >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=16))
        >>> simulator.with_radar(rc.bgt60tr13c(num_chirps=32)).frame().cube.shape
        (3, 32, 128)
        """
        return replace(self, radar=radar)

    def frame(self, time: float | None = None) -> Frame:
        """Frame of samples; its first chirp starts at `time` [s], by default 0 or the newest update of `Live` motions.

        The rays are cast once, at the middle of the frame. Scatterers move with their body, or with their facet if the
        body deforms, and delay and amplitude follow the exact geometry through the frame; visibility does not change
        within it. If a body turns by more than `retrace_deg` to either side, parts of the frame have casts of their
        own. `Frame.truth` holds for the middle of the frame, with several sub-sequences for the middle of the first.

        See Also
        --------
        Simulator.frames : Frames at a rate, one at a time.
        Simulator.record : Frames at a rate, kept.
        Frame : The result.

        Examples
        --------
        >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
        >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame(time=1.0)
        >>> frame.truth.range.round(2).tolist()
        [1.5]
        """
        start = self._start(time)
        self._warnings.before_first_frame(self._placement, start)
        (placed,) = self._place([start])
        frame = self._deliver(self._simulate(self._engines, placed))
        if not sees_anything(frame):
            self._warnings.nothing_visible(self._placement, start)
        return frame

    def frames(self, start: float, stop: float, rate: float | None = None) -> Iterator[Frame]:
        """Frames that start at `start`, `start` + 1/`rate`, ... before `stop` [s], one by one; rates as in `record`.

        See Also
        --------
        Simulator.record : The same frames as a recording, several of them side by side.
        Simulator.frame : A single frame.

        Examples
        --------
        >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=16))
        >>> [round(frame.time, 3) for frame in simulator.frames(0.0, 0.1, rate=40.0)]
        [0.0, 0.025, 0.05, 0.075]
        """
        # Check the times in this call, not at the first frame.
        times = frame_times(start, stop, frame_rate(self.radar.waveform) if rate is None else rate)
        return (self.frame(time) for time in times)

    def record(
        self,
        start: float,
        stop: float,
        rate: float | None = None,
        *,
        progress: bool = True,
        path: str | PathLike[str] | None = None,
        overwrite: bool = False,
        source: dict[str, Any] | None = None,
    ) -> Recording:
        """Simulate the frames that start before `stop`, several of them side by side where there are threads for it.

        Parameters
        ----------
        start, stop : float
            Times [s].
        rate : float, optional
            Frames per second [Hz]. Default: the radar's own, one per `Waveform.frame_interval`; of frames back to back
            at most 40.
        progress : bool
            Show a progress bar when run in a terminal.
        path : path, optional
            Write frame by frame into this recording directory, readable even if the run is killed. The
            result is then read from there.
        overwrite : bool
            Replace a recording at `path`.
        source : dict, optional
            More to say of the origin of the frames: anything JSON can hold.

        See Also
        --------
        Simulator.frames : One frame at a time, for what is to be processed as it comes.
        Recording.save : Write a recording that is in memory.

        Examples
        --------
        >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
        >>> recording = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).record(0.0, 0.1, rate=40.0)
        >>> recording.truth.range[:, 0].round(3).tolist()
        [1.999, 1.986, 1.974, 1.961]
        """
        rate = frame_rate(self.radar.waveform) if rate is None else rate
        times = frame_times(start, stop, rate)
        self._warnings.overlapping_frames(rate)
        frames, source = self._recorded(times, progress), self._source() | (source or {})
        if path is None:
            return Recording.from_frames(list(frames), source=source)
        with RecordingWriter(path, self.radar, num_frames=len(times), source=source, overwrite=overwrite) as writer:
            for frame in frames:
                writer.append(frame)
        return Recording.load(path)

    def worlds(
        self,
        poses: ArrayLike,
        *,
        velocities: ArrayLike | None = None,
        angular_velocities: ArrayLike | None = None,
        bodies: Sequence[str] | None = None,
    ) -> Worlds:
        """Frames of many worlds at once, with different poses of bodies and radar, for reinforcement learning.

        One call of the core computes all worlds on all threads. Each world reuses its parts that did not move since
        the previous call. Samples are bit-identical to `frame` at time 0 with `Linear` motions. World n draws its noise
        from ``seed + n``.

        Parameters
        ----------
        poses : (world, body, 4, 4) or (world, body, 3, 4) array_like
            Body to world at the start of the frame. Point targets use only the position. One more row than `bodies`
            moves the radar.
        velocities, angular_velocities : (world, body, 3) array_like, optional
            Of the same bodies at their origins, in world axes [m/s], [rad/s]. Default: zero.
        bodies : sequence of str, optional
            Names of the bodies in `poses`; others move as in the scene. Default: all, in scene order.

        Returns
        -------
        Worlds
            Samples (world, channel, chirp, sample), and the truth.

        Raises
        ------
        ValueError
            For shapes that do not fit, a scene with deforming bodies or interferers, a radar whose frame is a single
            sample, and antennas on or inside a body (checked at the first call, as in `frame`).

        See Also
        --------
        Simulator.frame : One world.
        range_doppler : Maps of all worlds at once.

        Examples
        --------
        >>> ball = rc.Body(rc.shapes.sphere(0.1), name="ball")
        >>> simulator = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(num_chirps=16), sampling="fast")
        >>> poses = np.tile(np.eye(4), (3, 1, 1, 1))
        >>> poses[:, 0, 0, 3] = [1.0, 2.0, 3.0]
        >>> worlds = simulator.worlds(poses)
        >>> worlds.cube.shape, worlds.truth.range[:, 0].round(2).tolist()
        ((3, 3, 16, 128), [0.9, 1.9, 2.9])
        """
        names = self.scene.names if bodies is None else tuple(bodies)
        placements = Placements(self.scene, poses, velocities, angular_velocities, names)
        if self._placement.duration == 0.0:
            raise ValueError("worlds: expected a radar whose frames have several samples; `frame` takes a single one")
        by_sequence: list[list[_core.IdealFrame]] = []
        arriving: list[NDArray[Any]] = []
        for engine, placement, radar in zip(self._engines, self._placements, self._sequences, strict=True):
            num_times, frames = NUM_TIMES, None
            while frames is None:
                times, own, points = placement.own(num_times)
                moved = placements.at(times)
                self._warnings.before_first_worlds(own[0], points[0], moved[0], placements.rows)
                frames = engine.worlds(core_placement(own, points), moved, placements.rows)
                num_times = 2 * num_times - 1
            by_sequence.append(frames)
            arriving.append(at_receivers(np.concatenate([frame.cube for frame in frames]), radar))
        seeds = [(self.seed + world) % 2**64 for world in range(placements.number)]
        cube, use = received(arriving, self._sequences, 0.0, seeds=seeds)
        rows = self._checked_truth(by_sequence, use)
        truth = Truth(self.scene.names, *rows.reshape(len(rows), placements.number, -1))
        return Worlds(cube.reshape(placements.number, -1, *cube.shape[1:]), truth)

    def paths(self, time: float | None = None) -> Paths:
        """Delays, rates and amplitudes of all paths at a time [s], as `frame` has them, per TX-RX pair.

        Amplitudes are behind the receiver's filters. Whatever the schedule, there is a channel per pair of antennas; of
        several waveforms the first counts.

        The rays are cast at the middle of the frame, or of its first part where bodies turn fast; the points they hit
        are taken back to `time` with their bodies, or with their facets where bodies deform.

        See Also
        --------
        Paths : The result.
        beat_signal : Samples of paths.

        Examples
        --------
        >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([1.5, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=16))
        >>> paths = simulator.paths()
        >>> print(paths.delay.shape, f"{1e9 * paths.delay[0, 0]:.2f} ns")
        (3, 1) 10.01 ns
        """
        start = self._start(time)
        self._warnings.before_first_frame(self._placement, start)
        place = self._placement
        placed = place.frames([start], NUM_TIMES)[0], place.at(start), place.rates_at(start)
        delay, rate, amplitude, body, order = self._engines[0].paths(*placed)
        # With phase noise the core has more rows, see `responses`.
        own = slice(len(self.radar.tx) * len(self.radar.rx))
        delay, rate, amplitude = delay[own], rate[own], amplitude[own]
        channels = (len(delay), 1)
        return Paths(delay, rate, amplitude, np.tile(body.astype(np.int32), channels), np.tile(order, channels))

    def depth_image(self, time: float | None = None) -> DepthImage:
        """Depth image of a pinhole camera at a time [s], by default as in `frame`.

        Over `image_view_deg`: the field of view that was given, or what the antennas see up to 110 degrees.

        See Also
        --------
        DepthImage : The result.
        frame_from_depth : The way back: a frame from a depth image.
        plot.depth_image : Picture of it.

        Examples
        --------
        >>> wall = rc.Body(rc.shapes.plate(1.0, 1.0), motion=rc.Pose([2.0, 0.0, 0.0]))
        >>> simulator = rc.Simulator(rc.Scene([wall]), rc.bgt60tr13c(), resolution=33, field_of_view_deg=(20.0, 20.0))
        >>> image = simulator.depth_image()
        >>> print(f"{image.distance.min():.3f} m, {(image.body == 0).mean():.0%} of the pixels")
        2.000 m, 100% of the pixels
        """
        at = self._start(time)
        self._warnings.unknown_materials()
        distance, cos_incidence, body, surface_distance, normals = self._engines[0].image(self._placement.at(at))
        # The core numbers bodies with meshes alone.
        numbers = np.append(self.scene.parts.mesh_numbers, np.int32(-1))
        return DepthImage(
            distance=distance,
            cos_incidence=cos_incidence,
            body=numbers[body],
            surface_distance=surface_distance,
            normals=normals,
            field_of_view_deg=self.image_view_deg,
            time=at,
            _reflectance=self._reflectance,
        )

    def is_hidden(self, points: ArrayLike, time: float | None = None) -> NDArray[np.bool_]:
        """True for points that a body occludes from the centre of the array at a time [s].

        The search for an occluder ends at the first triangle in the way, not at the nearest.

        Parameters
        ----------
        points : (n, 3) array_like
            Positions in the world [m]: markers of a motion capture, say. A point on a surface is not occluded by it.
        time : float, optional
            Time [s]; default: as in `frame`.

        Returns
        -------
        is_hidden : (n,) bool

        See Also
        --------
        Simulator.depth_image : Nearest surface in every direction.

        Examples
        --------
        >>> wall = rc.Body(rc.shapes.plate(1.0, 1.0), motion=rc.Pose([2.0, 0.0, 0.0]))
        >>> simulator = rc.Simulator(rc.Scene([wall]), rc.bgt60tr13c())
        >>> simulator.is_hidden([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]]).tolist()
        [False, True]
        """
        at = self._start(time)
        world, sensor = check.array("points", points, (None, 3)), self._motion.at(at)
        local = (world - sensor.position) @ sensor.rotation - self.radar.array_center
        return self._engines[0].occluded(self._placement.at(at), np.ascontiguousarray(local))

    def _start(self, time: float | None) -> float:
        """The given time [s], or the newest update of live motions, or 0."""
        if time is not None:
            return check.number("time", time, "s")
        newest = self._placement.newest
        # Before the first update, the motion itself says that it needs one.
        return 0.0 if newest is None or newest == -np.inf else newest

    def _place(self, starts: list[float]) -> list[Placed]:
        """Motion of bodies and sensor in the frames that start at `starts` [s]."""
        if self.field_of_view_deg is not None:
            self._warnings.bodies_out_of_view(self._placement, starts, self.field_of_view_deg)
        by_sequence = [placement.frames(starts, NUM_TIMES) for placement in self._placements]
        return [Placed(start, motions) for start, *motions in zip(starts, *by_sequence, strict=True)]

    def _simulate(self, engines: Engines, placed: Placed, ask: Ask = directly) -> Simulated:
        """Samples of a placed frame; `ask` calls motions, which are functions of users."""
        ideals: list[_core.IdealFrame] = []
        arriving: list[NDArray[Any]] = []
        counts: list[Counts] = []
        for number, (engine, radar) in enumerate(zip(engines, self._sequences, strict=True)):
            placement = self._placements[number]
            place = partial(_frame_by, ask, placement, placed.start)
            rates = None if placement.duration > 0.0 else ask(partial(placement.rates_at, placed.start))
            ideal = ideal_frame(engine, placed.motions[number], place, rates)
            samples = at_receivers(ideal.cube, radar)
            if self.scene.interferers:
                counts.append(self._interferences[number].add_to(samples, engine, placed.start, ask))
            ideals.append(ideal)
            arriving.append(samples)
        cube, use = received(arriving, self._sequences, placed.start, seeds=[self.seed])
        return Simulated(placed.start, ideals, cube, counted(counts) if counts else {}, use)

    def _deliver(self, simulated: Simulated) -> Frame:
        """Frame with its truth and counts, after warnings of what does not hold."""
        start, ideals, cube, interference, use = simulated
        stats = counts_of(ideals) | {"field_of_view_deg": self.view_deg} | interference
        if use is not None and self.radar.receiver is not None:
            stats |= use.stats(self.radar.receiver)
        if interference:
            self._warnings.strong_interferer(interference["strongest_interferer"])
        truth = truth_of_rows(self.scene.names, self._checked_truth([[ideal] for ideal in ideals], use))
        return frame_of(cube, start, self.radar, truth, stats, adc_codes(cube, self.radar))

    def _checked_truth(self, by_sequence: list[list[_core.IdealFrame]], use: Use | None) -> NDArray[np.float64]:
        """Truth (field, body) of worlds one after the other, after warnings of what does not hold."""
        if use is not None:
            self._warnings.unsuitable_gain(use)
        ideals = [ideal for worlds in by_sequence for ideal in worlds]
        for ideal in ideals:
            self._warnings.unresolved(ideal)
        self._warnings.unsplit_cells(sum(ideal.counts.get("cells_not_split", 0) for ideal in ideals))
        # Every scene has a truth.
        rows = np.concatenate([ideal.truth for ideal in by_sequence[0] if ideal.truth is not None], axis=1)
        self._hide_points(rows)
        self._warnings.too_fast(rows[1])
        return rows

    def _hide_points(self, rows: NDArray[np.float64]) -> None:
        """Set the truth (field, body) of point targets outside of the field of view to NaN, as for bodies."""
        if len(self.scene.parts.point_numbers) == 0:
            return
        # Of several worlds one after the other.
        firsts = np.arange(0, rows.shape[1], len(self.scene.names))
        numbers = np.add.outer(firsts, self.scene.parts.point_numbers).ravel()
        directions = unit_vectors(*rows[2:, numbers])
        lost = is_outside(directions[:, None], self.view_deg)
        if lost.any() and self.field_of_view_deg is not None:
            names = [self.scene.names[number % len(self.scene.names)] for number in numbers[lost]]
            self._warnings.points_out_of_view(names, directions[lost], self.field_of_view_deg)
        rows[:, numbers[lost]] = np.nan

    def _recorded(self, times: list[float], progress: bool) -> Iterator[Frame]:
        """Frames of a recording: placed in blocks, simulated side by side, delivered in order.

        The bar of progress is moved on by hand, so that warnings find the user's line.
        """
        self._warnings.before_first_frame(self._placement, times[0])
        size = self._placement.frames_ahead
        placed = (each for first in range(0, len(times), size) for each in self._place(times[first : first + size]))
        sees = False
        with notice.progress(None, "simulating", "frame", total=len(times), shown=progress) as bar:
            for simulated in in_order(self._simulate, placed, self._side_by_side(len(times)), _stop):
                frame = self._deliver(simulated)
                sees |= sees_anything(frame)
                yield frame
                bar.update()
        if not sees:
            self._warnings.nothing_visible(self._placement, times[0])

    def _side_by_side(self, num_frames: int) -> list[Engines]:
        """Engines for frames that are simulated side by side, at most `num_frames`."""
        threads = self.threads or _num_cores()
        number = min(num_frames, threads, self._most_side_by_side)
        # Live motions may be updated between frames.
        if number <= 1 or self._placement.newest is not None:
            return [self._engines]
        # Threads of their own: a thread that waits for others of its frame would begin another frame meanwhile.
        return [self._new_engines(own_threads=max(1, threads // number)) for _ in range(number)]

    @property
    def _most_side_by_side(self) -> int:
        """Largest number of frames whose rays and samples fit the memory that a recording may take."""
        ramps = [ramps_of(radar) for radar in self._sequences]
        samples = len(self.radar.tx) * len(self.radar.rx) * sum(wf.num_chirps * wf.num_samples for wf in ramps)
        return _BYTES_SIDE_BY_SIDE // (_BYTES_PER_RAY * self.num_rays + _BYTES_PER_SAMPLE * samples)

    @cached_property
    def _sequences(self) -> tuple[Radar, ...]:
        """Radars of the sub-sequences of a frame."""
        return self.radar.sequences()

    @cached_property
    def _placements(self) -> tuple[Placement, ...]:
        return tuple(Placement(self.scene, self._motion, ramps_of(radar)) for radar in self._sequences)

    @property
    def _placement(self) -> Placement:
        """Placement of the first sub-sequence."""
        return self._placements[0]

    @property
    def _motion(self) -> Motion:
        """Sensor to world."""
        return as_motion("radar_motion", self.radar_motion)

    @cached_property
    def _engines(self) -> Engines:
        """Counterparts in the core, which keep the samples of bodies at rest from frame to frame."""
        return self._new_engines()

    def _new_engines(self, own_threads: int | None = None, **debug: Any) -> Engines:
        """Counterparts in the core of all sub-sequences."""
        engines = []
        for radar in self._sequences:
            materials = self._materials_at(radar.waveform.center_frequency)
            center = radar.array_center.tolist()
            engines.append(
                new_engine(self.scene._core, materials, radar, self, center=center, own_threads=own_threads, **debug)
            )
        return engines

    @cached_property
    def _interferences(self) -> list[Interference]:
        """Signals of interferers in every sub-sequence."""
        parts = zip(self._sequences, self._placements, strict=True)
        return [Interference(self.scene, radar, self._motion, placement, self.seed) for radar, placement in parts]

    @cached_property
    def _warnings(self) -> Warnings:
        return Warnings(self.scene, self.radar, self.tolerance)

    def _materials_at(self, frequency: float) -> list[_core.Material]:
        """Materials of the bodies with meshes at a frequency, the centre of a band [Hz]."""
        return [body.material._core_at(frequency) for body in self.scene.parts.meshed]

    def _reflectance(self, image: DepthImage) -> NDArray[np.float64]:
        """Power reflectance at the pixels of an image."""
        # The core numbers bodies with meshes alone.
        numbers = np.full(len(self.scene.bodies) + 1, -1, np.int32)
        numbers[self.scene.parts.mesh_numbers] = np.arange(len(self.scene.parts.mesh_numbers))
        frequency = self.radar.waveform.center_frequency
        return _core.reflectance(
            self._materials_at(frequency),
            numbers[image.body],
            image.cos_incidence,
            image.normals,
            image.directions,
            frequency=frequency,
            polarization=self.radar.polarization_vector,
            threads=self.threads,
        )

    def _source(self) -> dict[str, Any]:
        """Origin of the samples, for the recording."""
        bodies = list(self.scene.names)
        others = {"interferers": list(self.scene.interferer_names)} if self.scene.interferers else {}
        source = {"simulator": "radarcore", "version": _core.__version__, "bodies": bodies, **others, **self.to_dict()}
        receiver = self.radar.receiver
        return source if receiver is None or receiver.unit is None else {**source, "cube_unit": receiver.unit}

    def __getstate__(self) -> dict[str, Any]:
        made = ("_engines", "_placements", "_interferences")
        return {name: value for name, value in self.__dict__.items() if name not in made}


def _num_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def sees_anything(frame: Frame) -> bool:
    """True for a simulated frame in which rays met a body, or a point lies in the field of view."""
    if frame.stats.get("rays_hit", 0) > 0 or frame.stats.get("bounce_paths", 0) > 0:
        return True
    return frame.truth is not None and not np.isnan(frame.truth.range).all()


def _frame_by(ask: Ask, placement: Placement, start: float, num_times: int) -> _core.Placement:
    """Placement at `num_times` times of a frame that starts at `start` [s], by the thread that may call motions."""
    return ask(partial(placement.frames, [start], num_times))[0]  # type: ignore[no-any-return]


def _stop(engines: Engines) -> None:
    """Stop the runs in progress."""
    for engine in engines:
        engine.stop()
