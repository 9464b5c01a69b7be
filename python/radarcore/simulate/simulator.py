"""From a scene to radar frames: cast, sample the surfaces, follow them through the frame, synthesise, receive."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.geometry.pose import Pose
from radarcore.motion.function import as_motion
from radarcore.motion.protocol import AnyMotion, Motion
from radarcore.motion.static import is_static
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording
from radarcore.recording.writer import RecordingWriter
from radarcore.scene import library
from radarcore.scene.scene import Scene
from radarcore.simulate import retrace
from radarcore.simulate.depth_image import DepthImage
from radarcore.simulate.follow import Course, Synthesis, first_times, receive, synthesise, warn_beyond_range
from radarcore.simulate.places import Placement, Places
from radarcore.simulate.synthesis import METHODS, check_threads, check_tolerance

_MAX_FRAMES = 10_000_000
"""More frames than a recording can be meant to have: a day at 100 Hz."""

SAMPLINGS = ("adaptive", "footprint", "point")
"""Where rays are cast, and how what they hit stands for what is round it."""

_CELLS_PER_DEGREE = 64.0 / 60.0
"""Of the base grid of adaptive sampling."""

_RAY_BUDGET = 40_000
"""Rays through cells of adaptive sampling, unless something else is asked for."""

_RAYS_PER_CELL = 4
"""Of the base grid, at least: all of its cells can be split once."""

_NO_CELL = 2**32 - 1
"""Cell of material points that belong to none: those of diffuse surfaces."""

_IMAGE_SIDE = 256
"""Pixels of images, unless something else is asked for."""

MAX_BOUNCES = 64
"""More reflections than any path has that is not lost in the noise."""


@dataclass(frozen=True, eq=False)
class Paths:
    """All routes from transmitter to scatterer to receiver at one time.

    Attributes
    ----------
    delay : (channel, path) float64
        Two-way delay [s].
    delay_rate : (channel, path) float64
        Its rate of change [s/s].
    amplitude : (channel, path) complex128
        Amplitude without the phase of propagation [sqrt(W)].
    body : (channel, path) int32
        Number of the body in the scene; of paths of several reflections that of the last.
    order : (channel, path) uint8
        By which power of the frequency amplitudes fall; `amplitude` is that at the centre of the band. Edges have 1 or
        2, everything else 0.
    """

    delay: NDArray[np.float64]
    delay_rate: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    body: NDArray[np.int32]
    order: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class _Part:
    """Chirps of a frame whose rays were cast at one time [s]."""

    synthesis: Synthesis
    rays: _core.Hits | _core.Samples
    time: float
    farthest: float
    """Of what sends something back [m]."""
    stats: dict[str, Any]


class Simulator:
    """Simulates what a radar receives from a scene.

    Parameters
    ----------
    scene : Scene
    radar : Radar
    radar_motion : Pose, Linear, Trajectory, Attached or function of time
        Sensor to world; default: the world's own frame, looking along +x.
    resolution : int or (rows, columns), optional
        Pixels of images, and rays of frames; with adaptive sampling the cells of the base grid. Default: 256 x 256
        pixels, and 64 cells per 60 degrees.
    field_of_view_deg : (float, float)
        Horizontal and vertical angle that is simulated [degrees], each below 180.
    sampling : "adaptive", "footprint" or "point"
        Adaptive: cells of the image plane are split where what is seen through them matters and is not yet known, and
        diffuse surfaces are points that stay on them. Footprint: the pixels of an image, with a phase that varies over
        the patch behind each, which converges as pixels get smaller. Point: one phasor per pixel as in Stetco et al.,
        ICRA 2020, for comparison; it does not converge.
    tolerance : float
        Bound on rms(error of synthesis over the samples of a channel) / l2(amplitudes of that channel); below 1e-6
        the samples are in double precision.
    method : "auto", "direct" or "grid"
        Way to form the sum over paths, see `beat_signal`.
    rcs_floor : float
        Smallest cross-section of interest [m^2]: as far as the budget goes, cells of adaptive sampling are split until
        what each leaves open is 40 dB below the echo of such a target at the peak of the gain and the same distance, or
        they have been halved six times.
    ray_budget : int, optional
        Most rays of a cast through cells of adaptive sampling; what cells may leave open shrinks from step to step, as
        far as they go. Infinite: as many as `rcs_floor` asks for. Default: 40 000, or four per cell of the base grid
        where that is more. Rays to the points of diffuse surfaces, at most 131 072 per body, come on top.
    end_points : bool
        With adaptive sampling: cells over which the phase turns fast stand for their ends, whose phase is exact over
        the whole band and which neighbours cancel; otherwise for their centre, tapered as pixels are.
    gain_floor_db : float
        Directions in which the gain of every pair of antennas, there and back, is this far below their peaks [dB] are
        not cast for frames and paths; infinite: none is left out. Depth images are always whole.
    retrace_deg : float
        Largest angle [degrees] by which a body may turn, as the sensor sees it, from the time when the rays of a frame
        are cast: where one turns by more, parts of the frame have casts of their own. Infinite: one cast per frame.
        Bodies that deform count as they turn and move as a whole.
    seed : int
        Changes speckle and noise, nothing else.
    threads : int, optional
        Threads to use; default: all cores. Results do not depend on it.
    """

    def __init__(
        self,
        scene: Scene,
        radar: Radar,
        *,
        radar_motion: AnyMotion | None = None,
        resolution: int | tuple[int, int] | None = None,
        field_of_view_deg: tuple[float, float] = (60.0, 60.0),
        sampling: str = "adaptive",
        tolerance: float = 1e-4,
        method: str = "auto",
        rcs_floor: float = 1e-5,
        ray_budget: float | None = None,
        end_points: bool = True,
        gain_floor_db: float = 80.0,
        max_bounces: int = 1,
        bounce_floor_db: float = 80.0,
        retrace_deg: float = 10.0,
        seed: int = 0,
        threads: int | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: expected Scene, got {type(scene).__name__}")
        if not isinstance(radar, Radar):
            raise TypeError(f"radar: expected Radar, got {type(radar).__name__}")
        self.scene = scene
        self.radar = radar
        self.radar_motion = Pose() if radar_motion is None else as_motion("radar_motion", radar_motion)
        self.field_of_view_deg = _field_of_view(field_of_view_deg)
        self.sampling = check.choice("sampling", sampling, SAMPLINGS)
        self.resolution = None if resolution is None else _resolution(resolution)
        self.rcs_floor = check.positive("rcs_floor", rcs_floor, "m^2")
        self.ray_budget = None if ray_budget is None else self._ray_budget(ray_budget)
        self.end_points = bool(end_points)
        self.method = check.choice("method", method, METHODS)
        self.tolerance = check_tolerance(tolerance)
        self.gain_floor_db = _floor("gain_floor_db", gain_floor_db)
        self.max_bounces = check_max_bounces(max_bounces)
        self.bounce_floor_db = _floor("bounce_floor_db", bounce_floor_db)
        self.retrace_deg = np.inf if retrace_deg == np.inf else check.positive("retrace_deg", retrace_deg, "degrees")
        self._previous_image: _core.Hits | None = None
        self._previous_rays: _core.Hits | _core.Samples | None = None
        self._previous_tubes: _core.Hits | None = None
        self._reuses_tiles = self._skips_empty_tiles = True
        self.seed = check.count("seed", seed, minimum=0)
        if self.seed >= 2**64:
            raise ValueError(f"seed: expected less than 2**64, got {seed}")
        self._has_warned_of_materials = self._has_warned_of_range = self._has_warned_of_series = False
        self.threads = check_threads(threads)

    @property
    def radar_motion(self) -> Motion:
        """Sensor to world."""
        return self._places.sensor_motion

    @radar_motion.setter
    def radar_motion(self, motion: AnyMotion) -> None:
        self._places = Places(self.scene, as_motion("radar_motion", motion), self.radar.array_center)

    def _ray_budget(self, value: float) -> float:
        """Enough for the base grid."""
        if value == np.inf:
            return np.inf
        (rows, columns), budget = self._num_cells, check.count("ray_budget", value)
        if budget < rows * columns:
            raise ValueError(
                f"ray_budget: expected at least the {rows} x {columns} rays of the base grid, got {budget}"
            )
        if budget >= 2**32:
            raise ValueError(f"ray_budget: expected less than 2**32, or inf, got {budget}")
        return budget

    @property
    def _most_rays(self) -> int | None:
        """Through cells; none: as many as the floor asks for."""
        if self.ray_budget is None:
            rows, columns = self._num_cells
            return max(_RAY_BUDGET, _RAYS_PER_CELL * rows * columns)
        return None if self.ray_budget == np.inf else int(self.ray_budget)

    def with_radar(self, radar: Radar) -> Simulator:
        """The same with another radar in the place of this one's."""
        return Simulator(
            self.scene,
            radar,
            radar_motion=self.radar_motion,
            resolution=self.resolution,
            field_of_view_deg=self.field_of_view_deg,
            sampling=self.sampling,
            tolerance=self.tolerance,
            method=self.method,
            rcs_floor=self.rcs_floor,
            ray_budget=self.ray_budget,
            end_points=self.end_points,
            gain_floor_db=self.gain_floor_db,
            max_bounces=self.max_bounces,
            bounce_floor_db=self.bounce_floor_db,
            retrace_deg=self.retrace_deg,
            seed=self.seed,
            threads=self.threads,
        )

    def depth_image(self, time: float = 0.0) -> DepthImage:
        """What the rays of the image hit at a time [s]."""
        at = check.number("time", time, "s")
        self._warn_of_materials()
        return self._image(self._cast_image(at), at)

    def is_hidden(self, points: ArrayLike, time: float = 0.0) -> NDArray[np.bool_]:
        """Whether a body stands between the centre of the array and points at a time [s].

        The search for what hides a point ends at the first triangle in the way, not at the nearest.

        Parameters
        ----------
        points : (n, 3) array_like
            Positions in the world [m]: markers of a motion capture, say. A point on a surface is not hidden by it.
        time : float
            Time [s].

        Returns
        -------
        is_hidden : (n,) bool
        """
        at = check.number("time", time, "s")
        world, sensor = check.array("points", points, (None, 3)), self.radar_motion.at(at)
        local = (world - sensor.position) @ sensor.rotation - self.radar.array_center
        poses = self._place(np.array([at])).poses[0]
        core = self.scene._core_at(at, self.threads)
        is_hidden, _ = core.hide(poses, np.ascontiguousarray(local), threads=self.threads)
        return is_hidden

    def paths(self, time: float = 0.0) -> Paths:
        """Delays, rates and amplitudes at a time [s]: those that `frame` follows from there on.

        The rays are cast at the middle of the frame, or of its first part where bodies turn fast; the points they hit
        are taken back to `time` with their bodies, or with their facets where bodies deform.
        """
        start = check.number("time", time, "s")
        self._warn_of_materials()
        _, _, cast_time = self._times_of(start, self._blocks(start)[0])
        rays = self._cast_rays(cast_time)
        scatterers = self._scatterers(rays)
        deforming = scatterers.deforming()
        place = self._place(np.array([start]), deforming)
        rates = self._places.rates_at(start, deforming)
        delay, amplitude = self._follow(scatterers, place)
        delay_rate = scatterers.delay_rates(
            place.poses[0],
            rates.poses[0],
            place.points[0],
            rates.points[0],
            vertices=[vertices[0] for vertices in place.vertices],
            vertex_rates=[vertices[0] for vertices in rates.vertices],
            threads=self.threads,
        )
        bodies = np.concatenate([self.scene.parts.mesh_numbers[scatterers.body()], self.scene.parts.point_numbers])
        orders = np.concatenate([scatterers.order(), np.zeros(len(self.scene.parts.cross_sections), np.uint8)])
        channels = (len(delay_rate), 1)
        paths = Paths(delay[0], delay_rate, amplitude[0], np.tile(bodies, channels), np.tile(orders, channels))
        bounces = self._bounces(rays, cast_time)
        return paths if bounces is None else _joined(paths, self._bounce_paths(bounces, start))

    def frame(self, time: float = 0.0) -> Frame:
        """One frame of samples; its first chirp starts at `time` [s].

        The rays are cast once, at the middle of the frame. What they hit moves with its body, or with its facet where
        the body deforms, and delay and amplitude follow the exact geometry through the frame; which surfaces are seen
        does not change within it. Where a body turns by more than `retrace_deg` to either side, that holds for parts of
        the frame. `Frame.truth` holds for the middle of the frame, or of that part of it.
        """
        start = check.number("time", time, "s")
        self._warn_of_materials()
        with self._places.kept():
            return self._frame(start)

    def _frame(self, start: float) -> Frame:
        self._places.place_ahead([np.array([start + self._middle]), *first_times(self.radar.waveform, start)])
        blocks = self._blocks(start)
        parts = [self._part(start, chirps) for chirps in blocks]
        middle = min(parts, key=lambda part: abs(part.time - start - self._middle))
        ideal = (
            np.concatenate([part.synthesis.cube for part in parts], axis=1) if len(parts) > 1 else middle.synthesis.cube
        )
        cube = receive(ideal, self.radar, start, seed=self.seed, tolerance=self.tolerance)
        if not self._has_warned_of_series:
            worst = max((part.synthesis.nodes for part in parts), key=lambda nodes: nodes.residual)
            self._has_warned_of_series = worst.warn_beyond(self.tolerance)
        if not self._has_warned_of_range:
            farthest = max(part.farthest for part in parts)
            self._has_warned_of_range = warn_beyond_range(farthest, self.radar)
        stats = {"casts": len(parts), **_summed([{**part.stats, **part.synthesis.stats} for part in parts])}
        truth = self._truth(middle.rays, middle.rays.body().ravel(), middle.time)
        return Frame(cube, start, self.radar, truth, stats)

    def _blocks(self, start: float) -> list[slice]:
        """Chirps whose rays are cast together, in the frame that begins at `start` [s]."""
        waveform = self.radar.waveform
        is_still = self.scene.is_static and is_static(self.radar_motion)
        if is_still or self.retrace_deg == np.inf or not self.scene.parts.meshed:
            return [slice(0, waveform.num_chirps)]
        time = start + self._middle
        place, rates = self._place(np.array([time])), self._places.rates_at(time)
        fastest = retrace.turn_rates(place.poses[0], rates.poses[0], self._corners).max()
        return retrace.blocks(waveform, float(fastest), np.deg2rad(self.retrace_deg))

    def _times_of(self, start: float, chirps: slice) -> tuple[Waveform, float, float]:
        """Some chirps of the frame that begins at `start`; when they begin, and when their rays are cast [s]."""
        waveform = retrace.waveform_of(self.radar.waveform, chirps)
        first = start if waveform is self.radar.waveform else start + float(self.radar.waveform.chirp_times[chirps][0])
        return waveform, first, first + _middle_of(waveform)

    def _part(self, start: float, chirps: slice) -> _Part:
        """Some chirps of the frame that begins at `start` [s]."""
        waveform, first, time = self._times_of(start, chirps)
        if waveform is not self.radar.waveform:
            self._places.place_ahead([np.array([time]), *first_times(waveform, first)])
        rays = self._cast_rays(time)
        scatterers, bounces = self._scatterers(rays), self._bounces(rays, time)
        synthesis = synthesise(
            self._courses(scatterers) + ([] if bounces is None else self._bounce_courses(bounces)),
            waveform,
            self.radar.num_channels,
            first,
            tolerance=self.tolerance,
            method=self.method,
            threads=self.threads,
        )
        num_hit = int(np.count_nonzero(rays.body() >= 0))
        rays_cast, tiles_skipped, tiles_reused, *cells = rays.counts
        bounce_paths, bounce_rays, bounces_stopped = (0, 0, 0) if bounces is None else (len(bounces), *bounces.counts)
        stats = {
            "rays_cast": rays_cast,
            "rays_hit": num_hit,
            "tiles_skipped": tiles_skipped,
            "tiles_reused": tiles_reused,
            **({"cells_not_split": cells[0]} if cells else {}),
            "paths": len(scatterers) + len(self.scene.parts.cross_sections) + bounce_paths,
            "paths_skipped": num_hit - _num_cells_of(scatterers),
            "bounce_paths": bounce_paths,
            "bounce_rays": bounce_rays,
            "bounces_stopped": bounces_stopped,
        }
        # Ends of cells may lie beyond the surfaces that these show.
        shown = scatterers.cell()[scatterers.order() > 0]
        farthest = max(synthesis.farthest, float(rays.distance().ravel()[shown].max(initial=0.0)))
        return _Part(synthesis, rays, time, farthest, stats)

    def frames(self, start: float, stop: float, rate: float = 40.0) -> Iterator[Frame]:
        """Frames that start at `start`, `start` + 1/`rate`, ... before `stop` [s], one at a time."""
        for time in frame_times(start, stop, rate):
            yield self.frame(time)

    def record(
        self,
        start: float,
        stop: float,
        rate: float = 40.0,
        *,
        progress: bool = True,
        path: str | PathLike[str] | None = None,
        overwrite: bool = False,
    ) -> Recording:
        """Simulate the frames that start before `stop`.

        Parameters
        ----------
        start, stop : float
            Times [s].
        rate : float
            Frames per second [Hz].
        progress : bool
            Show a progress bar when run in a terminal.
        path : path, optional
            Write frame by frame into this recording directory; what is there stays readable if the run is killed. The
            result is then read from there.
        overwrite : bool
            Replace a recording at `path`.
        """
        times = frame_times(start, stop, rate)
        self._warn_of_overlap(rate)
        bar = notice.progress(times, "simulating", "frame", shown=progress)
        if path is None:
            return Recording.from_frames([self.frame(time) for time in bar], source=self._source())
        with RecordingWriter(
            path, self.radar, num_frames=len(times), source=self._source(), overwrite=overwrite
        ) as writer:
            for time in bar:
                writer.append(self.frame(time))
        return Recording.load(path)

    @property
    def _middle(self) -> float:
        """From the start of a frame to the middle of its chirps [s]."""
        return _middle_of(self.radar.waveform)

    def _place(self, times: NDArray[np.float64], deforming: Iterable[int] = ()) -> Placement:
        """Bodies and points at `times` [s], in sensor axes about the centre of the array, and some bodies' vertices."""
        return self._places.at(times, deforming)

    @property
    def _half_sizes(self) -> tuple[float, float]:
        """Half the width and height of the image in the plane at distance 1."""
        horizontal, vertical = np.deg2rad(self.field_of_view_deg)
        return float(np.tan(0.5 * horizontal)), float(np.tan(0.5 * vertical))

    @property
    def _num_pixels(self) -> tuple[int, int]:
        """Rows and columns of images, and of the rays of frames unless sampling is adaptive."""
        return self.resolution or (_IMAGE_SIDE, _IMAGE_SIDE)

    @property
    def _num_cells(self) -> tuple[int, int]:
        """Rows and columns of the base grid of adaptive sampling."""
        columns, rows = (max(1, int(np.ceil(_CELLS_PER_DEGREE * angle - 1e-9))) for angle in self.field_of_view_deg)
        return self.resolution or (rows, columns)

    def _grid(self, shape: tuple[int, int]) -> dict[str, Any]:
        """An image plane, as the core takes it."""
        half_width, half_height = self._half_sizes
        return {"rows": shape[0], "columns": shape[1], "half_width": half_width, "half_height": half_height}

    @property
    def _skips(self) -> dict[str, Any]:
        """What of the rays of frames need not be cast."""
        beam = None
        if np.isfinite(self.gain_floor_db):
            beam = (self.radar._core, 10.0 ** (-0.1 * self.gain_floor_db))
        return {"beam": beam, "skip_empty": self._skips_empty_tiles}

    def _cast_image(self, time: float) -> _core.Hits:
        """Rays of the image with the bodies where they are at `time`; tiles where nothing has moved are kept."""
        self._previous_image = self.scene._core_at(time, self.threads).cast(
            self._place(np.array([time])).poses[0],
            **self._grid(self._num_pixels),
            previous=self._previous_image if self._reuses_tiles else None,
            skip_empty=self._skips_empty_tiles,
            with_cosines=True,
            threads=self.threads,
        )
        return self._previous_image

    def _cast_rays(self, time: float) -> _core.Hits | _core.Samples:
        """Rays of a frame likewise: of an image, or where they are needed."""
        core, poses = self.scene._core_at(time, self.threads), self._place(np.array([time])).poses[0]
        previous = self._previous_rays if self._reuses_tiles else None
        if self.sampling == "adaptive":
            assert not isinstance(previous, _core.Hits)
            self._previous_rays = core.sample(
                poses,
                self._materials,
                **self._grid(self._num_cells),
                antennas=self.radar._core,
                rcs_floor=self.rcs_floor,
                budget=self._most_rays,
                end_points=self.end_points,
                seed=self.seed,
                previous=previous,
                **self._skips,
                threads=self.threads,
            )
        else:
            assert not isinstance(previous, _core.Samples)
            self._previous_rays = core.cast(
                poses, **self._grid(self._num_pixels), previous=previous, **self._skips, threads=self.threads
            )
        return self._previous_rays

    def _image(self, hits: _core.Hits, time: float) -> DepthImage:
        """The hits as arrays, bodies numbered as in the scene."""
        numbers = np.append(self.scene.parts.mesh_numbers, np.int32(-1))
        body = hits.body()
        has_other_numbers = not np.array_equal(
            self.scene.parts.mesh_numbers, np.arange(len(self.scene.parts.mesh_numbers))
        )
        return DepthImage(
            distance=hits.distance(),
            cos_incidence=hits.cos_incidence(threads=self.threads),
            body=numbers[body] if has_other_numbers else body,
            field_of_view_deg=self.field_of_view_deg,
            time=time,
            _hits=hits,
            _reflectance=self._reflectance,
            _threads=self.threads,
        )

    @cached_property
    def _corners(self) -> NDArray[np.float64]:
        return retrace.corners(self.scene)

    @cached_property
    def _materials(self) -> list[_core.Material]:
        """Materials of the bodies with meshes, at the centre of the band."""
        return [body.material._core_at(self.radar.waveform.center_frequency) for body in self.scene.parts.meshed]

    def _reflectance(self, hits: _core.Hits) -> NDArray[np.float64]:
        """Power reflectance of what the pixels show."""
        return hits.reflectance(
            self._materials,
            frequency=self.radar.waveform.center_frequency,
            polarization=self.radar.polarization_vector,
            threads=self.threads,
        )

    def _scatterers(self, rays: _core.Hits | _core.Samples) -> _core.Scatterers:
        """Material points of what rays hit that send anything back."""
        if isinstance(rays, _core.Samples):
            return rays.scatterers(self._materials, antennas=self.radar._core, threads=self.threads)
        return rays.scatterers(
            self._materials,
            antennas=self.radar._core,
            is_footprint=self.sampling == "footprint",
            seed=self.seed,
            threads=self.threads,
        )

    def _bounces(self, rays: _core.Hits | _core.Samples, time: float) -> _core.Bounces | None:
        """Routes of several reflections, where wanted: of the rays, or of an image where these are adaptive."""
        if self.max_bounces == 1:
            return None
        if isinstance(rays, _core.Samples):
            self._previous_tubes = self.scene._core_at(time, self.threads).cast(
                self._place(np.array([time])).poses[0],
                **self._grid(self._num_pixels),
                previous=self._previous_tubes if self._reuses_tiles else None,
                **self._skips,
                threads=self.threads,
            )
            rays = self._previous_tubes
        return rays.bounces(
            self._materials,
            antennas=self.radar._core,
            is_footprint=self.sampling != "point",
            max_bounces=self.max_bounces,
            floor=10.0 ** (-0.1 * self.bounce_floor_db),
            threads=self.threads,
        )

    def _bounce_paths(self, bounces: _core.Bounces, start: float) -> Paths:
        """Their delays, rates and amplitudes at a time [s]."""
        deforming = bounces.deforming()
        place = self._place(np.array([start]), deforming)
        rates = self._places.rates_at(start, deforming)
        delay, amplitude = self._follow_bounces(bounces, place)
        delay_rate = bounces.delay_rates(
            place.poses[0],
            rates.poses[0],
            vertices=[vertices[0] for vertices in place.vertices],
            vertex_rates=[vertices[0] for vertices in rates.vertices],
            threads=self.threads,
        )
        bodies = self.scene.parts.mesh_numbers[bounces.body()]
        channels = (len(delay_rate), 1)
        orders = np.zeros((len(delay_rate), len(bodies)), np.uint8)
        return Paths(delay[0], delay_rate, amplitude[0], np.tile(bodies, channels), orders)

    def _follow_bounces(
        self,
        bounces: _core.Bounces,
        place: Placement,
        part: slice = slice(0, None, 1),
        amplitudes_at: Placement | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Delays and amplitudes (time, channel, path) of some routes with bodies at their places."""
        return bounces.paths(
            place.poses,
            vertices=place.vertices,
            amplitudes_at=None if amplitudes_at is None else (amplitudes_at.poses, amplitudes_at.vertices),
            first=part.start,
            last=part.stop,
            step=part.step,
            threads=self.threads,
        )

    def _bounce_courses(self, bounces: _core.Bounces) -> list[Course]:
        """How they run through time: those over bodies that all stand still need no more than one time."""

        def course(chosen: _core.Bounces, is_still: bool) -> Course:
            deforming = chosen.deforming()
            return Course(
                num_paths=len(chosen),
                is_static=is_still,
                follow=lambda times, others, part: self._follow_bounces(
                    chosen, self._place(times, deforming), part, self._place(others, deforming)
                ),
            )

        if not is_static(self.radar_motion):
            return [course(bounces, False)]
        still, moving = bounces.split(self.scene.parts.are_still)
        return [course(still, True), course(moving, False)]

    def _follow(
        self,
        scatterers: _core.Scatterers,
        place: Placement,
        part: slice = slice(0, None, 1),
        amplitudes_at: Placement | None = None,
        *,
        has_points: bool = True,
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Delays and amplitudes (time, channel, path) of some paths with bodies and points at their places."""

        def points_of(place: Placement) -> NDArray[np.float64]:
            return place.points if has_points else place.points[:, :0]

        others = amplitudes_at
        delay, amplitude = scatterers.paths(
            place.poses,
            points_of(place),
            self.scene.parts.cross_sections if has_points else self.scene.parts.cross_sections[:0],
            vertices=place.vertices,
            amplitudes_at=None if others is None else (others.poses, points_of(others), others.vertices),
            first=part.start,
            last=part.stop,
            step=part.step,
            threads=self.threads,
        )
        if not np.isfinite(amplitude.sum()):
            raise ValueError("scene: expected nothing at the place of an antenna, got a path of length zero")
        return delay, amplitude

    def _courses(self, scatterers: _core.Scatterers) -> list[Course]:
        """How the paths run through time: those of bodies that stand still need no more than one time."""

        def course(wanted: NDArray[np.bool_], order: int, *, is_still: bool, has_points: bool) -> Course:
            chosen = scatterers.select(wanted, order)
            deforming = chosen.deforming()
            return Course(
                num_paths=len(chosen) + (len(self.scene.parts.cross_sections) if has_points else 0),
                is_static=is_still,
                follow=lambda times, others, part: self._follow(
                    chosen, self._place(times, deforming), part, self._place(others, deforming), has_points=has_points
                ),
                order=order,
            )

        sensor_is_still = is_static(self.radar_motion)
        are_still = self.scene.parts.are_still & sensor_is_still
        points_are_still = sensor_is_still and self.scene.is_static
        orders = range(1 + int(scatterers.order().max(initial=0)))
        return [
            course(
                are_still == is_still, order, is_still=is_still, has_points=points_are_still == is_still and order == 0
            )
            for is_still in (True, False)
            for order in orders
        ]

    def __getstate__(self) -> dict[str, Any]:
        kept = {name: value for name, value in self.__dict__.items() if name not in ("_materials", "_corners")}
        return {**kept, "_previous_image": None, "_previous_rays": None, "_previous_tubes": None}

    def _truth(self, rays: _core.Hits | _core.Samples, body: NDArray[np.int32], time: float) -> Truth:
        """Range, velocity and direction at `time` of the nearest point of every body that rays hit."""
        points = np.full((len(self.scene.bodies), 3), np.nan)
        velocities = np.full_like(points, np.nan)
        place, rates = self._place(np.array([time])), self._places.rates_at(time)
        distance = rays.distance().ravel()
        seen, nearest = _nearest(body, distance, len(self.scene.parts.meshed))
        directions = np.array([rays.direction(ray) for ray in nearest.tolist()]).reshape(-1, 3)
        hits = distance[nearest, None] * directions
        poses, pose_rates = place.poses[0, seen], rates.poses[0, seen]
        material_points = np.swapaxes(poses[..., :3], 1, 2) @ (hits - poses[..., 3])[..., None]
        speeds = (pose_rates[..., :3] @ material_points)[..., 0] + pose_rates[..., 3]
        for k, (b, ray) in enumerate(zip(seen.tolist(), nearest.tolist(), strict=True)):
            if b in self.scene.parts.deforming:
                corners, weights = rays.place_on_mesh(ray)
                vertex_rates = self.scene.parts.vertex_rates_at(b, time)[list(corners)]
                speeds[k] += poses[k, :, :3] @ (weights @ vertex_rates)
        numbers = self.scene.parts.mesh_numbers[seen]
        points[numbers], velocities[numbers] = hits, speeds
        points[self.scene.parts.point_numbers] = place.points[0]
        velocities[self.scene.parts.point_numbers] = rates.points[0]

        x, y, z = points.T
        distance = np.linalg.norm(points, axis=1)
        velocity = (points * velocities).sum(axis=1) / np.maximum(distance, np.finfo(float).tiny)
        return Truth(self.scene.names, distance, velocity, np.arctan2(y, x), np.arctan2(z, np.hypot(x, y)))

    def _warn_of_materials(self) -> None:
        if not self._has_warned_of_materials:
            self._has_warned_of_materials = True
            used = (body.material for body in self.scene.parts.meshed)
            if text := library.extrapolation(used, self.radar.waveform.center_frequency):
                notice.warn(text)

    def _warn_of_overlap(self, rate: float) -> None:
        duration = self.radar.waveform.duration
        if duration * rate > 1.0:
            notice.warn(
                f"frames of {1e3 * duration:.2f} ms overlap at {rate:g} frames per second: no real sensor can do that",
            )

    def _source(self) -> dict[str, Any]:
        """What made the samples, for the recording."""
        return {
            "simulator": "radarcore",
            "version": _core.__version__,
            "bodies": list(self.scene.names),
            "resolution": list(self._num_cells if self.sampling == "adaptive" else self._num_pixels),
            "field_of_view_deg": list(self.field_of_view_deg),
            "sampling": self.sampling,
            **(
                {"rcs_floor": self.rcs_floor, "ray_budget": self._most_rays, "end_points": self.end_points}
                if self.sampling == "adaptive"
                else {}
            ),
            "tolerance": self.tolerance,
            "gain_floor_db": self.gain_floor_db if np.isfinite(self.gain_floor_db) else None,
            "max_bounces": self.max_bounces,
            "bounce_floor_db": self.bounce_floor_db if np.isfinite(self.bounce_floor_db) else None,
            "retrace_deg": self.retrace_deg if np.isfinite(self.retrace_deg) else None,
            "seed": self.seed,
        }


def _middle_of(waveform: Waveform) -> float:
    """From the start of a frame to the middle of its chirps [s]."""
    return 0.5 * (float(waveform.chirp_times[0]) + waveform.duration)


def _summed(stats: list[dict[str, Any]]) -> dict[str, Any]:
    """Of all parts of a frame: the largest numbers of times and errors, all plans, and the sums of what is counted."""
    summed = dict(stats[0])
    for other in stats[1:]:
        for name, value in other.items():
            if name in ("delay_nodes", "amplitude_nodes", "series_residual"):
                summed[name] = max(summed[name], value)
            else:
                summed[name] = f"{summed[name]}\n{value}" if name == "plan" else summed[name] + value
    return summed


def _num_cells_of(scatterers: _core.Scatterers) -> int:
    """Cells that have a material point."""
    cells = scatterers.cell()
    cells = cells[cells != _NO_CELL]
    has_point = np.zeros(1 + int(cells.max(initial=0)), dtype=np.bool_)
    has_point[cells] = True
    return int(np.count_nonzero(has_point))


def _nearest(
    body: NDArray[np.int32], distance: NDArray[np.float64], num_bodies: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The bodies that rays hit, and which ray hits each of them the nearest: the first of several."""
    least = np.full(num_bodies + 1, np.inf)  # the last for rays that hit nothing, whose body is -1
    np.minimum.at(least, body, distance)
    rays = np.flatnonzero((distance == least[body]) & (body >= 0))[::-1]
    nearest = np.full(num_bodies, -1)
    nearest[body[rays]] = rays
    seen = np.flatnonzero(nearest >= 0)
    return seen, nearest[seen]


def _joined(first: Paths, second: Paths) -> Paths:
    """The paths of both, channel by channel."""
    names = ("delay", "delay_rate", "amplitude", "body", "order")
    return Paths(*(np.concatenate([getattr(first, name), getattr(second, name)], axis=1) for name in names))


def _floor(name: str, value: float) -> float:
    return np.inf if value == np.inf else check.positive(name, value, "dB")


def check_max_bounces(value: int) -> int:
    """A number of reflections."""
    number = check.count("max_bounces", value)
    if number > MAX_BOUNCES:
        raise ValueError(f"max_bounces: expected at most {MAX_BOUNCES}, got {number}")
    return number


def _resolution(value: int | tuple[int, int]) -> tuple[int, int]:
    pair = (value, value) if np.ndim(value) == 0 else tuple(value)  # type: ignore[arg-type]  # ndim tells them apart
    if len(pair) != 2:
        raise ValueError(f"resolution: expected an integer or (rows, columns), got {value!r}")
    rows, columns = (check.count("resolution", side) for side in pair)
    if rows * columns > 2**28:
        raise ValueError(f"resolution: expected at most {2**28} rays, got {rows} x {columns}")
    return rows, columns


def _field_of_view(value: tuple[float, float]) -> tuple[float, float]:
    angles = check.array("field_of_view_deg", value, (2,))
    if (angles <= 0.0).any() or (angles >= 180.0).any():
        raise ValueError(f"field_of_view_deg: expected angles between 0 and 180 degrees, got {angles.tolist()}")
    return float(angles[0]), float(angles[1])


def frame_times(start: float, stop: float, rate: float) -> list[float]:
    """Starts of the frames before `stop` [s]."""
    first, last = check.number("start", start, "s"), check.number("stop", stop, "s")
    per_second = check.positive("rate", rate, "Hz")
    if last <= first:
        raise ValueError(f"stop: expected a time after start {first:g} s, got {last:g} s")
    # A stop that is a whole number of frames away, but for rounding, is not the start of one more.
    num_frames = max(1.0, float(np.ceil((last - first) * per_second - 1e-6)))
    if num_frames > _MAX_FRAMES:
        raise ValueError(f"rate, stop: expected at most {_MAX_FRAMES} frames, got {num_frames:.3g}")
    return [first + i / per_second for i in range(int(num_frames))]
