"""Paths of scenes that are hard on a fast sum, and the error of its samples as the contract has it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from radarcore import _core
from radarcore.simulate.beat import core_rows

C = 299_792_458.0  # [m/s]
EPS = np.finfo(float).eps

Real = NDArray[np.float64]
Ranges = Callable[[Real], Real]
"""One-way ranges [m], (time, path), at times [s], (time, 1), since the middle of the frame."""


def sweep_waveform(num_chirps: int = 64, num_samples: int = 64, slope_sign: int = 1, **changes: Any) -> rc.Waveform:
    """1 GHz about 58 GHz in every chirp, down to 16 samples."""
    bandwidth = 1e9 * min(1.0, num_samples / 16)
    settings: dict[str, Any] = {
        "start_frequency": 58e9,
        "slope": slope_sign * bandwidth * 2e6 / num_samples,
        "sample_rate": 2e6,
        "num_samples": num_samples,
        "num_chirps": num_chirps,
        "chirp_interval": 300e-6,
        "adc_delay": 3e-6,
    }
    return rc.Waveform(**settings | changes)


@dataclass(frozen=True)
class Report:
    """Report of a sum as the core gives it."""

    text: str
    engine: str
    is_single: bool
    width: int
    static_paths: int
    error: float
    memory: int

    @property
    def precision(self) -> str:
        return "single" if self.is_single else "double"

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Paths:
    """Arguments of `beat_signal`: derivatives, or delays at nodes."""

    delay: Real
    amplitude: NDArray[np.complex128]
    rate: Real | None = None
    acceleration: Real | None = None

    def signal(self, waveform: rc.Waveform, **options: Any) -> tuple[NDArray[Any], Report]:
        settings = {"tolerance": 1e-4, "method": "auto", "threads": 1} | options
        rows = core_rows(self.delay, self.amplitude, self.rate, self.acceleration)
        samples, text, numbers = _core.beat_signal(**rows, waveform=waveform._core, **settings)
        return samples, Report(text, **numbers)

    def samples(self, waveform: rc.Waveform, **options: Any) -> NDArray[Any]:
        return self.signal(waveform, **options)[0]

    def exact(self, waveform: rc.Waveform) -> NDArray[np.complex128]:
        """Every sample of every path in double precision, 5 ns each: (channel, chirp, sample)."""
        return self.samples(waveform, tolerance=1e-12, method="direct", threads=None)

    def norm(self) -> Real:
        """l2 of the amplitudes, (channel,); amplitudes at nodes count with their mean power."""
        power = abs(np.atleast_2d(self.amplitude)) ** 2
        return np.sqrt(power.sum(axis=-1) if power.ndim == 2 else power.mean(axis=0).sum(axis=-1))

    def scaled(self, factor: complex) -> Paths:
        return replace(self, amplitude=factor * self.amplitude)


def relative_error(got: NDArray[Any], exact: NDArray[Any], paths: Paths) -> Real:
    """rms(error over the samples of a channel) / l2(amplitudes of the channel): (channel,)."""
    return np.sqrt((abs(got.astype(np.complex128) - exact) ** 2).mean(axis=(1, 2))) / paths.norm()


def allowance(exact: NDArray[Any], paths: Paths, waveform: rc.Waveform, tolerance: float) -> float:
    """Error beyond the tolerance by contract: rounding of complex64 samples, and of the delays.

    Samples: 2^-24 of each. Delays: eps/2 of 2 pi f tau in each of a few steps, in the reference as in the result, more
    where they pass through a series; of paths that add up in phase the errors do so too.
    """
    gain = max(1.0, float((np.sqrt((abs(exact) ** 2).mean(axis=(1, 2))) / paths.norm()).max()))
    delay = float(abs(np.asarray(paths.delay)).max())
    for power, derivative in ((1, paths.rate), (2, paths.acceleration)):
        if derivative is not None:
            delay += float(abs(derivative).max()) * waveform.duration**power / power
    turns = (waveform.start_frequency + abs(waveform.slope) * (waveform.sample_times[-1] + delay)) * delay
    single = 6e-8 if tolerance >= 1e-6 else 0.0
    steps = 4.0 if paths.delay.ndim < 3 else 16.0
    return gain * (single + steps * 2.0 * np.pi * turns * EPS + 50.0 * EPS)


def random_phases(rng: np.random.Generator, shape: Any) -> NDArray[np.complex128]:
    return rng.uniform(0.2, 1.0, shape) * np.exp(2j * np.pi * rng.uniform(size=shape))


# --- motion --------------------------------------------------------------------------------------------------------


def _places(points: Real, velocity: Real, omega: float, pivot: Real, tilt: float = 0.0) -> Ranges:
    """Points (path, 3) that turn about an axis along z through the pivot, and move."""

    def ranges(t: Real) -> Real:
        angle = tilt + omega * t
        x, y, z = points.T
        place = np.stack(
            [
                pivot[0] + velocity[0] * t + np.cos(angle) * x - np.sin(angle) * y,
                pivot[1] + velocity[1] * t + np.sin(angle) * x + np.cos(angle) * y,
                pivot[2] + velocity[2] * t + z,
            ]
        )
        return np.linalg.norm(place, axis=0)

    return ranges


def _patch(num_paths: int, width: float, height: float) -> Real:
    """A plate in the yz plane, row by row from the top as an image has it."""
    columns = max(1, round(np.sqrt(num_paths)))
    index = np.arange(num_paths)
    rows = max(1, -(-num_paths // columns))
    y = width * ((index % columns + 0.5) / columns - 0.5)
    z = height * (0.5 - (index // columns + 0.5) / rows)
    return np.stack([np.zeros(num_paths), y, z], axis=1)


def _image(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """Two smooth bodies side by side, one walking, one turning."""
    points = _patch(n, 1.0, 0.6)
    points[:, 0] = 0.2 - 0.8 * np.sqrt(np.maximum(0.0, 0.3 - (abs(points[:, 1]) - 0.25) ** 2 - points[:, 2] ** 2))
    right = points[:, 1] > 0.0
    walking = _places(points, np.array([1.2, 0.5, 0.1]), 0.0, np.array([1.6, 0.0, 0.0]))
    turning = _places(points, np.zeros(3), rng.uniform(2.0, 4.0), np.array([1.3, 0.1, 0.0]))
    return lambda t: np.where(right, walking(t), turning(t))


def _tilted(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """A plate seen at 35 degrees: its echoes nearly cancel."""
    velocity = np.array([rng.uniform(-1.0, 1.0), 0.0, 0.0])
    return _places(_patch(n, 0.3, 0.2), velocity, 0.3, np.array([1.2, 0.0, 0.0]), tilt=0.6)


def _facing(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """A plate that faces the radar: all its echoes add up."""
    return _places(_patch(n, 0.03, 0.03), np.array([rng.uniform(-2, 2), 0.1, 0.0]), 0.0, np.array([2.0, 0.0, 0.0]))


def _swinging(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """A plate that faced the radar a few frames ago: nothing adds up in the frame, all did before."""
    frames = rng.choice([-2.0, -1.5, -1.0, 1.0, 1.5, 2.0])
    omega = rng.uniform(1.0, 3.0)
    return _places(_patch(n, 0.3, 0.1), np.zeros(3), omega, np.array([1.5, 0, 0]), tilt=omega * frames * wf.duration)


def _together(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """All paths of one point."""
    at, velocity = rng.uniform(0.5, 2.0), rng.uniform(-3.0, 3.0)
    return lambda t: np.abs(at + velocity * t + 3.0 * t**2) + np.zeros(n)


def _still(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    at = rng.uniform(0.3, 3.0, n)
    return lambda t: at + 0.0 * t


def _outlier(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """One path at 40 m/s among others that stand still."""
    at = rng.uniform(1.0, 3.0, n)
    velocity = np.where(np.arange(n) == n // 2, 40.0, 0.0)
    return lambda t: at + velocity * (t + 0.5 * wf.duration)


def _lateral(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """3 m/s across at 0.3 m."""
    return _places(_patch(n, 0.1, 0.1), np.array([0.0, 3.0, 0.0]), 0.0, np.array([0.3, 0.0, 0.0]))


def _fan(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """Blades of 0.15 m at 20 revolutions per second."""
    radius, angle = rng.uniform(0.03, 0.15, n), 2.0 * np.pi * (rng.integers(3, size=n) / 3.0 + rng.uniform(0, 0.05, n))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(-0.02, 0.02, n)], axis=1)
    return _places(points, np.zeros(3), 2.0 * np.pi * 20.0, np.array([0.9, 0.1, 0.0]))


def _beyond(rng: np.random.Generator, n: int, wf: rc.Waveform) -> Ranges:
    """Up to ten times the largest range, and twenty times the largest velocity."""
    at = rng.uniform(1.0, 10.0 * max(wf.max_range, 5.0), n)
    velocity = rng.uniform(-20.0, 20.0, n) * wf.max_velocity if wf.num_chirps > 1 else rng.uniform(-60.0, 60.0, n)
    return lambda t: np.abs(at + 50.0 + velocity * t)


COURSES: dict[str, Callable[[np.random.Generator, int, rc.Waveform], Ranges]] = {
    "image": _image,
    "tilted": _tilted,
    "facing": _facing,
    "swinging": _swinging,
    "together": _together,
    "still": _still,
    "outlier": _outlier,
    "lateral": _lateral,
    "fan": _fan,
    "beyond": _beyond,
}
SCENES = ("random", "single", *COURSES)
IN_PHASE = ("image", "tilted", "facing", "swinging", "together")
"""Scenes of smooth surfaces: their amplitudes have one phase."""


def num_nodes(scene: str, wf: rc.Waveform) -> int:
    """Nodes that follow the motion to about 1e-7 rad."""
    if scene in ("still", "outlier", "beyond"):
        return 2
    if scene == "fan":
        return 8 if wf.duration < 2e-3 else 24 if wf.duration < 50e-3 else 60
    return 5 if wf.duration < 2e-3 else 8 if wf.duration < 50e-3 else 24


def scene_paths(
    scene: str, wf: rc.Waveform, num_paths: int, rng: np.random.Generator, *, nodal: bool = False, nodes: int = 0
) -> Paths:
    """Paths of a scene in one channel; `nodal` amplitudes fall with the square of the range."""
    if scene in ("random", "single"):
        n = 1 if scene == "single" else num_paths
        paths = Paths(
            2.0 / C * rng.uniform(0.3, 3.0, n),
            random_phases(rng, n),
            2.0 / C * rng.uniform(-5.0, 5.0, n),
            2.0 / C * rng.uniform(-20.0, 20.0, n),
        )
        if not nodal:
            return paths
        t = wf.delay_times(4)[:, None]
        delay = paths.delay + paths.rate * t + 0.5 * paths.acceleration * t**2
        return Paths(delay[:, None], (paths.amplitude * (paths.delay / delay) ** 2)[:, None])
    ranges = COURSES[scene](rng, num_paths, wf)
    t = wf.delay_times(nodes or num_nodes(scene, wf))[:, None] - 0.5 * wf.duration
    distance = ranges(t)
    amplitude = np.full(num_paths, 0.8 + 0.3j) if scene in IN_PHASE else random_phases(rng, num_paths)
    if nodal:
        return Paths(2.0 / C * distance[:, None], (amplitude * (distance[:1] / distance) ** 2)[:, None])
    return Paths(np.ascontiguousarray(2.0 / C * distance[:, None]), amplitude[None])
