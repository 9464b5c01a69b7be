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
from radarcore.motion import Motion, Pose, check_motion, is_static
from radarcore.radar import Radar
from radarcore.receiver import Receiver
from radarcore.recording import Frame, Recording, RecordingWriter, Truth
from radarcore.scene import Placement, Scene
from radarcore.units import SPEED_OF_LIGHT

SAMPLINGS = ("footprint", "point")
"""How a pixel stands for the patch it covers."""

# Delays and amplitudes are taken at as many times as their Chebyshev series needs to end below this:
# phase [rad], and amplitude relative to the path's own.
_SERIES_END = 1e-9
_NODE_COUNTS = (4, 6, 8, 12, 16, 24, 32, 48, 64)


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
    radar_motion : Pose or Linear
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
        radar_motion: Motion | None = None,
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
        self.radar_motion: Motion = Pose() if radar_motion is None else check_motion("radar_motion", radar_motion)
        self.resolution = _resolution(resolution)
        self.field_of_view_deg = _field_of_view(field_of_view_deg)
        self.sampling = check.choice("sampling", sampling, SAMPLINGS)
        self.method = check.choice("method", method, METHODS)
        sample_dtype(tolerance)
        self.tolerance = float(tolerance)
        self.seed = check.count("seed", seed, minimum=0)
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
        samples = self._samples(self._cast(start + 0.5 * self.radar.waveform.duration))
        now = np.array([start])
        place, rates = self.scene.place(now, self.radar_motion), self.scene.place_rates(start, self.radar_motion)
        delay, amplitude = self._follow(samples, place)
        delay_rate = samples.delay_rates(
            place.poses[0], rates.poses[0], place.points[0], rates.points[0], threads=self.threads
        )
        body = np.broadcast_to(self._path_bodies(samples), delay_rate.shape)
        return Paths(delay[0], delay_rate, amplitude[0], body)

    def frame(self, time: float = 0.0) -> Frame:
        """One frame of samples; its first chirp starts at `time` [s].

        The rays are cast once, at the middle of the frame; what they hit moves with its body, and delay and amplitude
        follow the exact geometry through the frame. `Frame.truth` holds for the middle of the frame.
        """
        start = check.number("time", time, "s")
        middle = start + 0.5 * self.radar.waveform.duration
        hits = self._cast(middle)
        samples = self._samples(hits)
        delay, amplitude = self._path_series(samples, start)
        self._warn_beyond_range(delay)
        ideal = _core.beat_signal(
            delay, amplitude, is_chebyshev=True, threads=self.threads, **core_waveform(self.radar.waveform)
        )
        num_nodes, num_channels, num_paths = delay.shape
        image = self._image(hits, middle)
        stats = {
            "rays_cast": image.body.size,
            "rays_hit": int((image.body >= 0).sum()),
            "paths": num_paths,
            "paths_skipped": int((image.body >= 0).sum()) - len(samples),
            "delay_nodes": num_nodes,
            "plan": f"direct sum: {num_channels} channels x {num_paths} paths, delays at {num_nodes} times, double",
        }
        return Frame(self._receive(ideal, start), start, self.radar, self._truth(image, middle), stats)

    def frames(self, start: float, stop: float, rate: float = 40.0) -> Iterator[Frame]:
        """Frames that start at `start`, `start` + 1/`rate`, ... before `stop` [s], one at a time."""
        for time in _frame_times(start, stop, rate):
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
        times = _frame_times(start, stop, rate)
        bar = _progress(times, progress)
        if path is None:
            return Recording.from_frames([self.frame(time) for time in bar], source=self._source())
        with RecordingWriter(
            path, self.radar, num_frames=len(times), source=self._source(), overwrite=overwrite
        ) as writer:
            for time in bar:
                writer.append(self.frame(time))
        return Recording.load(path)

    def _cast(self, time: float) -> _core.Hits:
        """Rays of the image with the bodies where they are at `time`."""
        place = self.scene.place(np.array([time]), self.radar_motion)
        (rows, columns), (horizontal, vertical) = self.resolution, np.deg2rad(self.field_of_view_deg)
        return self.scene.core.cast(
            place.poses[0],
            rows=rows,
            columns=columns,
            half_width=float(np.tan(0.5 * horizontal)),
            half_height=float(np.tan(0.5 * vertical)),
            threads=self.threads,
        )

    def _image(self, hits: _core.Hits, time: float) -> DepthImage:
        """The hits as arrays, bodies numbered as in the scene."""
        numbers = np.append(self.scene.mesh_numbers, np.int32(-1))
        return DepthImage(
            distance=hits.distance(),
            cos_incidence=hits.cos_incidence(threads=self.threads),
            reflectance=hits.reflectance(),
            body=numbers[hits.body()],
            directions=hits.directions(),
            field_of_view_deg=self.field_of_view_deg,
            time=time,
        )

    def _samples(self, hits: _core.Hits) -> _core.Samples:
        """Material points of the hits that send anything back."""
        return hits.samples(
            tx=self.radar.tx,
            rx=self.radar.rx,
            pattern=self.radar.pattern.gaussian_parameters,
            power=self.radar.tx_power,
            frequency=self.radar.waveform.center_frequency,
            is_footprint=self.sampling == "footprint",
            seed=self.seed,
            threads=self.threads,
        )

    def _follow(self, samples: _core.Samples, place: Placement) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Delays and amplitudes (time, channel, path) with bodies and points at their places."""
        return samples.paths(place.poses, place.points, self.scene.rcs, threads=self.threads)

    def _path_series(self, samples: _core.Samples, start: float) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Delays and amplitudes at enough Chebyshev times of the frame, (node, channel, path)."""
        waveform = self.radar.waveform
        static = self.scene.is_static and is_static(self.radar_motion)
        highest = max(waveform.start_frequency, waveform.center_frequency) + 0.5 * waveform.bandwidth
        for num_nodes in (1,) if static else _NODE_COUNTS:
            times = start + waveform.delay_times(num_nodes)
            delay, amplitude = self._follow(samples, self.scene.place(times, self.radar_motion))
            if num_nodes == 1 or delay.size == 0:
                break
            phase_end = 2.0 * np.pi * highest * _series_end(delay)
            amplitude_end = _series_end(amplitude) / max(float(np.abs(amplitude).max()), np.finfo(float).tiny)
            if max(phase_end, amplitude_end) <= _SERIES_END:
                break
        else:
            warnings.warn(
                f"motion within a frame is too fast for {num_nodes} delays per path: "
                f"phases are off by about {phase_end:.1e} rad",
                stacklevel=3,
            )
        return delay, amplitude

    def _path_bodies(self, samples: _core.Samples) -> NDArray[np.int32]:
        """Number of the body of every path."""
        return np.concatenate([self.scene.mesh_numbers[samples.body()], self.scene.point_numbers])

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
        columns = np.full((4, len(self.scene.bodies)), np.nan)
        times = np.array([time])
        place, rates = self.scene.place(times, self.radar_motion), self.scene.place_rates(time, self.radar_motion)

        for b, number in enumerate(self.scene.mesh_numbers):
            is_body = image.body == number
            if is_body.any():
                nearest = np.where(is_body, image.distance, np.inf).argmin()
                point = image.distance.flat[nearest] * image.directions.reshape(-1, 3)[nearest]
                pose, rate = place.poses[0, b], rates.poses[0, b]
                material_point = pose[:, :3].T @ (point - pose[:, 3])
                columns[:, number] = _polar(point, rate[:, :3] @ material_point + rate[:, 3])
        for p, number in enumerate(self.scene.point_numbers):
            columns[:, number] = _polar(place.points[0, p], rates.points[0, p])
        return Truth(self.scene.names, *columns)

    def _warn_beyond_range(self, delay: NDArray[np.float64]) -> None:
        farthest = 0.5 * SPEED_OF_LIGHT * float(delay.max(initial=0.0))
        if farthest > self.radar.max_range:
            warnings.warn(
                f"the scene reaches to {farthest:.2f} m, beyond max_range {self.radar.max_range:.2f} m of the "
                "waveform: echoes from there appear at wrong ranges",
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


def _series_end(values: NDArray[Any]) -> float:
    """Largest of the last two Chebyshev coefficients of values (node, ...) over all series."""
    n = len(values)
    angles = np.pi * (2 * np.arange(n)[::-1] + 1) / (2 * n)
    last = np.cos(np.arange(n - 2, n)[:, None] * angles) * (2.0 / n)
    return float(np.abs(np.tensordot(last, values - values[0], axes=1)).max())


def _polar(point: NDArray[np.float64], velocity: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Range, range rate, azimuth and elevation of a point of the sensor frame."""
    x, y, z = point
    distance = float(np.linalg.norm(point))
    return distance, float(point @ velocity) / distance, float(np.arctan2(y, x)), float(np.arctan2(z, np.hypot(x, y)))


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


def _frame_times(start: float, stop: float, rate: float) -> list[float]:
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
