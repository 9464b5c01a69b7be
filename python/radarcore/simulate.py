"""From a scene to radar frames: cast, sample the surfaces, follow them through the frame, synthesise, receive."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, check
from radarcore.beat import METHODS, check_threads, core_waveform, sample_dtype
from radarcore.depth import DepthImage
from radarcore.motion import AnyMotion, Motion, Pose, as_motion, is_static
from radarcore.radar import Radar
from radarcore.receiver import Receiver
from radarcore.recording import Frame, Recording, RecordingWriter, Truth
from radarcore.scene import Placement, Scene
from radarcore.units import SPEED_OF_LIGHT

SAMPLINGS = ("footprint", "point")
"""How a pixel stands for the patch it covers."""

# Delays and amplitudes are taken at as many Chebyshev times as the tolerance needs; amplitudes of surfaces that turn
# out of sight have a kink, which no number of times follows exactly.
_NODE_COUNTS = (4, 6, 8, 12, 16, 24, 32, 48, 64)
_MAX_NODES_FOR_AMPLITUDES = 16
# Delays are followed to this phase [rad] whatever the tolerance: it costs little, and other processing may need it.
_PHASE_GOAL = 1e-7
# Paths that are looked at to choose the number of times.
_NUM_PROBES = 2048
# Work and memory of one piece of the sum: path-samples (half a second), and numbers per path.
_PIECE_PATH_SAMPLES = 2**28
_PIECE_NUMBERS = 2**25


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
        Number of the body in the scene.
    """

    delay: NDArray[np.float64]
    delay_rate: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    body: NDArray[np.int32]


class Simulator:
    """Simulates what a radar receives from a scene.

    Parameters
    ----------
    scene : Scene
    radar : Radar
    radar_motion : Pose, Linear, Trajectory, Attached or function of time
        Sensor to world; default: the world's own frame, looking along +x.
    resolution : int or (rows, columns)
        Rays of the image.
    field_of_view_deg : (float, float)
        Horizontal and vertical angle that is simulated [degrees], each below 180.
    sampling : "footprint" or "point"
        Footprint: the phase varies over the patch behind a pixel, which converges as pixels get smaller. Point: one
        phasor per pixel as in Stetco et al., ICRA 2020, for comparison; it does not converge.
    tolerance : float
        Bound on rms(error of synthesis over the samples of a channel) / l2(amplitudes of that channel); below 1e-6
        the samples are in double precision.
    method : "auto" or "direct"
        Way to form the sum over paths, see `beat_signal`.
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
        resolution: int | tuple[int, int] = 256,
        field_of_view_deg: tuple[float, float] = (60.0, 60.0),
        sampling: str = "footprint",
        tolerance: float = 1e-4,
        method: str = "auto",
        seed: int = 0,
        threads: int | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: expected Scene, got {type(scene).__name__}")
        if not isinstance(radar, Radar):
            raise TypeError(f"radar: expected Radar, got {type(radar).__name__}")
        self.scene = scene
        self.radar = radar
        self.radar_motion: Motion = Pose() if radar_motion is None else as_motion("radar_motion", radar_motion)
        self.resolution = _resolution(resolution)
        self.field_of_view_deg = _field_of_view(field_of_view_deg)
        self.sampling = check.choice("sampling", sampling, SAMPLINGS)
        self.method = check.choice("method", method, METHODS)
        sample_dtype(tolerance)
        self.tolerance = float(tolerance)
        self.seed = check.count("seed", seed, minimum=0)
        if self.seed >= 2**64:
            raise ValueError(f"seed: expected less than 2**64, got {seed}")
        self._has_warned_of_range = self._has_warned_of_series = False
        self.threads = check_threads(threads)

    def depth_image(self, time: float = 0.0) -> DepthImage:
        """What the rays of the image hit at a time [s]."""
        at = check.number("time", time, "s")
        return self._image(self._cast(at), at)

    def paths(self, time: float = 0.0) -> Paths:
        """Delays, rates and amplitudes at a time [s]: those that `frame` follows from there on.

        The rays are cast at the middle of the frame; the points they hit are taken back to `time` with their bodies.
        """
        start = check.number("time", time, "s")
        scatterers = self._scatterers(self._cast(start + self._middle))
        place, rates = self._place(np.array([start])), self.scene._place_rates(start, self.radar_motion)
        delay, amplitude = self._follow(scatterers, place)
        delay_rate = scatterers.delay_rates(
            place.poses[0], rates.poses[0], place.points[0], rates.points[0], threads=self.threads
        )
        bodies = np.concatenate([self.scene._mesh_numbers[scatterers.body()], self.scene._point_numbers])
        return Paths(delay[0], delay_rate, amplitude[0], np.tile(bodies, (len(delay_rate), 1)))

    def frame(self, time: float = 0.0) -> Frame:
        """One frame of samples; its first chirp starts at `time` [s].

        The rays are cast once, at the middle of the frame. What they hit moves with its body, and delay and amplitude
        follow the exact geometry through the frame; which surfaces are seen does not change within it.
        `Frame.truth` holds for the middle of the frame.
        """
        start = check.number("time", time, "s")
        hits = self._cast(start + self._middle)
        scatterers = self._scatterers(hits)
        times, residual = self._follow_times(scatterers, start)
        ideal = self._beat_signal(scatterers, self._place(times))
        image = self._image(hits, start + self._middle)
        num_hit = int((image.body >= 0).sum())
        num_paths = len(scatterers) + len(self.scene._rcs)
        stats = {
            "rays_cast": image.body.size,
            "rays_hit": num_hit,
            "tiles_skipped": 0,
            "tiles_reused": 0,
            "paths": num_paths,
            "paths_skipped": num_hit - len(scatterers),
            "delay_nodes": len(times),
            "series_residual": residual,
            "plan": f"direct sum in double precision: {self.radar.num_channels} channels, {num_paths} paths, delays at "
            f"{len(times)} times",
        }
        return Frame(self._receive(ideal, start), start, self.radar, self._truth(image, start + self._middle), stats)

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
        bar = _progress(times, progress)
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
        waveform = self.radar.waveform
        return 0.5 * (float(waveform.chirp_times[0]) + waveform.duration)

    def _place(self, times: NDArray[np.float64]) -> Placement:
        """Bodies and points at `times` [s], in sensor axes about the centre of the array."""
        return self.scene._place(times, self.radar_motion, self.radar.array_center)

    def _cast(self, time: float) -> _core.Hits:
        """Rays of the image with the bodies where they are at `time`."""
        (rows, columns), (horizontal, vertical) = self.resolution, np.deg2rad(self.field_of_view_deg)
        return self.scene._core.cast(
            self._place(np.array([time])).poses[0],
            rows=rows,
            columns=columns,
            half_width=float(np.tan(0.5 * horizontal)),
            half_height=float(np.tan(0.5 * vertical)),
            threads=self.threads,
        )

    def _image(self, hits: _core.Hits, time: float) -> DepthImage:
        """The hits as arrays, bodies numbered as in the scene."""
        numbers = np.append(self.scene._mesh_numbers, np.int32(-1))
        return DepthImage(
            distance=hits.distance(),
            cos_incidence=hits.cos_incidence(threads=self.threads),
            reflectance=hits.reflectance(),
            body=numbers[hits.body()],
            directions=hits.directions(),
            field_of_view_deg=self.field_of_view_deg,
            time=time,
        )

    def _scatterers(self, hits: _core.Hits) -> _core.Scatterers:
        """Material points of the hits that send anything back."""
        return hits.scatterers(
            tx=self.radar.tx - self.radar.array_center,
            rx=self.radar.rx - self.radar.array_center,
            pattern=self.radar.pattern.gaussian_parameters,
            power=self.radar.tx_power,
            frequency=self.radar.waveform.center_frequency,
            is_footprint=self.sampling == "footprint",
            seed=self.seed,
            threads=self.threads,
        )

    def _follow(
        self, scatterers: _core.Scatterers, place: Placement, first: int = 0, last: int | None = None, step: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Delays and amplitudes (time, channel, path) of some paths with bodies and points at their places."""
        delay, amplitude = scatterers.paths(
            place.poses, place.points, self.scene._rcs, first=first, last=last, step=step, threads=self.threads
        )
        if not np.isfinite(amplitude).all():
            raise ValueError("scene: expected nothing at the place of an antenna, got a path of length zero")
        return delay, amplitude

    def _follow_times(self, scatterers: _core.Scatterers, start: float) -> tuple[NDArray[np.float64], float]:
        """Times of a frame at which delays and amplitudes are taken, and the error of the series through them."""
        waveform = self.radar.waveform
        if self.scene.is_static and is_static(self.radar_motion):
            return start + waveform.delay_times(1), 0.0
        step = max(1, (len(scatterers) + len(self.scene._rcs)) // _NUM_PROBES)
        highest = max(waveform.start_frequency, waveform.center_frequency) + 0.5 * waveform.bandwidth
        last_phase = np.inf
        for num_nodes in _NODE_COUNTS:
            times = start + waveform.delay_times(num_nodes)
            delay, amplitude = self._follow(scatterers, self._place(times), step=step)
            phase, weight = _series_residuals(delay, amplitude, highest)
            # Rounding of absolute time ends the improvement before the goal where time is large.
            goal = 0.1 * self.tolerance
            phase_is_done = phase <= min(goal, _PHASE_GOAL) or (phase <= goal and phase > 0.5 * last_phase)
            weight_is_done = weight <= goal or num_nodes >= _MAX_NODES_FOR_AMPLITUDES
            if phase_is_done and weight_is_done:
                break
            last_phase = phase
        residual = float(np.hypot(phase, weight))
        if residual > self.tolerance and not self._has_warned_of_series:
            self._has_warned_of_series = True
            reason = "phases (fast motion, or large absolute times)" if phase > weight else "amplitudes (turning edges)"
            warnings.warn(
                f"{reason} are followed within a frame to {residual:.1e} only, tolerance is {self.tolerance:.1e}",
                stacklevel=3,
            )
        return times, residual

    def _beat_signal(self, scatterers: _core.Scatterers, place: Placement) -> NDArray[np.complex128]:
        """The sum over all paths, piece by piece: bounded memory, and Ctrl-C is heard between pieces."""
        waveform = self.radar.waveform
        num_paths, num_nodes = len(scatterers) + len(self.scene._rcs), len(place.poses)
        cube = np.zeros((self.radar.num_channels, waveform.num_chirps, waveform.num_samples), dtype=np.complex128)
        size = max(1, min(_PIECE_PATH_SAMPLES // cube.size, _PIECE_NUMBERS // (self.radar.num_channels * num_nodes)))
        for first in range(0, num_paths, size):
            delay, amplitude = self._follow(scatterers, place, first, min(first + size, num_paths))
            self._warn_beyond_range(delay, amplitude)
            cube += _core.beat_signal(
                delay, amplitude, is_chebyshev=True, threads=self.threads, **core_waveform(waveform)
            )
        return cube

    def _receive(self, ideal: NDArray[np.complex128], start: float) -> NDArray[Any]:
        """The cube as the receiver delivers it."""
        receiver = self.radar.receiver or Receiver()
        time_bits = int(np.float64(start + 0.0).view(np.uint64))
        cube = receiver.receive(ideal, self.radar.waveform.sample_rate, np.random.default_rng([self.seed, time_bits]))
        single = sample_dtype(self.tolerance) is np.complex64
        if np.iscomplexobj(cube):
            return cube.astype(np.complex64 if single else np.complex128, copy=False)
        return cube.astype(np.float32 if single else np.float64, copy=False)

    def _truth(self, image: DepthImage, time: float) -> Truth:
        """Range, velocity and direction of the nearest visible point of every body at `time`."""
        points = np.full((len(self.scene.bodies), 3), np.nan)
        velocities = np.full_like(points, np.nan)
        place, rates = self._place(np.array([time])), self.scene._place_rates(time, self.radar_motion)

        directions = image.directions.reshape(-1, 3)
        for b, number in enumerate(self.scene._mesh_numbers):
            pixels = np.flatnonzero(image.body == number)
            if len(pixels) > 0:
                nearest = pixels[image.distance.flat[pixels].argmin()]
                pose, rate = place.poses[0, b], rates.poses[0, b]
                points[number] = image.distance.flat[nearest] * directions[nearest]
                material_point = pose[:, :3].T @ (points[number] - pose[:, 3])
                velocities[number] = rate[:, :3] @ material_point + rate[:, 3]
        points[self.scene._point_numbers] = place.points[0]
        velocities[self.scene._point_numbers] = rates.points[0]

        x, y, z = points.T
        distance = np.linalg.norm(points, axis=1)
        velocity = (points * velocities).sum(axis=1) / np.maximum(distance, np.finfo(float).tiny)
        return Truth(self.scene.names, distance, velocity, np.arctan2(y, x), np.arctan2(z, np.hypot(x, y)))

    def _warn_beyond_range(self, delay: NDArray[np.float64], amplitude: NDArray[np.complex128]) -> None:
        farthest = 0.5 * SPEED_OF_LIGHT * float(delay.max(initial=0.0, where=amplitude != 0.0 if delay.size else True))
        if farthest > self.radar.max_range and not self._has_warned_of_range:
            self._has_warned_of_range = True
            warnings.warn(
                f"the scene reaches to {farthest:.2f} m, beyond max_range {self.radar.max_range:.2f} m of the "
                "waveform: echoes from there appear at wrong ranges",
                stacklevel=4,
            )

    def _warn_of_overlap(self, rate: float) -> None:
        duration = self.radar.waveform.duration
        if duration * rate > 1.0:
            warnings.warn(
                f"frames of {1e3 * duration:.2f} ms overlap at {rate:g} frames per second: no real sensor can do that",
                stacklevel=3,
            )

    def _source(self) -> dict[str, Any]:
        """What made the samples, for the recording."""
        return {
            "simulator": "radarcore",
            "version": _core.__version__,
            "bodies": list(self.scene.names),
            "resolution": list(self.resolution),
            "field_of_view_deg": list(self.field_of_view_deg),
            "sampling": self.sampling,
            "tolerance": self.tolerance,
            "seed": self.seed,
        }


def _series_residuals(
    delay: NDArray[np.float64], amplitude: NDArray[np.complex128], frequency: float
) -> tuple[float, float]:
    """Error of the Chebyshev series through delays and amplitudes (node, channel, path), relative to l2(amplitudes).

    Of phases and of amplitudes, the worst channel's; from the last two coefficients, which for smooth motion are larger
    than all that follow.
    """
    n = len(delay)
    angles = np.pi * (2 * np.arange(n)[::-1] + 1) / (2 * n)
    last = np.cos(np.arange(n - 2, n)[:, None] * angles) * (2.0 / n)

    def end(values: NDArray[Any]) -> NDArray[np.float64]:
        coefficients: NDArray[np.float64] = np.abs(np.tensordot(last, values - values[0], axes=1)).max(axis=0)
        return coefficients

    strength = np.abs(amplitude).max(axis=0)
    total = np.maximum(np.linalg.norm(strength, axis=-1), np.finfo(float).tiny)
    phase = np.linalg.norm(2.0 * np.pi * frequency * end(delay) * strength, axis=-1) / total
    weight = np.linalg.norm(end(amplitude), axis=-1) / total
    return float(phase.max(initial=0.0)), float(weight.max(initial=0.0))


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
    num_frames = int(np.ceil((last - first) * per_second - 1e-6))
    return [first + i / per_second for i in range(num_frames)]


def _progress(times: list[float], progress: bool) -> Any:
    from tqdm import tqdm  # heavier than the rest of the import

    return tqdm(times, desc="simulating", unit="frame", disable=None if progress else True)
