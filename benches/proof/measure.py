"""The sensor that all sections look through, and what they measure of its frames.

One isotropic antenna, 1 W. A frame of one chirp that sweeps 57 to 64 GHz in a second samples the transfer function
H(f): its samples are conj(H), as the delays are nanoseconds.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import radarcore as rc

SPEED_OF_LIGHT = 299_792_458.0

Reals = NDArray[np.float64]
Phasors = NDArray[np.complex128]


def sweep(num_samples: int) -> rc.Waveform:
    """57 to 64 GHz in a second: as good as steps of frequency, and slower than what radarcore takes without a word."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "sample_rate: expected ramps of at most")
        return rc.Waveform.from_sweep(
            start_frequency=57e9, stop_frequency=64e9, sample_rate=float(num_samples), num_samples=num_samples
        )


def frequencies(waveform: rc.Waveform) -> Reals:
    """Of the samples of a chirp, (sample,) [Hz]."""
    return waveform.start_frequency + waveform.slope * waveform.sample_times


def tone(frequency: float = 60e9) -> rc.Waveform:
    """A ramp without slope to speak of: its one sample is conj(H) at one frequency."""
    return rc.Waveform(start_frequency=frequency, slope=1.0, sample_rate=1e6, num_samples=1)


WAVEFORM = sweep(64)
RADAR = rc.Radar(WAVEFORM)
WAVENUMBERS = 2.0 * np.pi * frequencies(WAVEFORM) / SPEED_OF_LIGHT


@dataclass(frozen=True)
class Run:
    """Sizes of a measurement; cost counts in frames of `unit` by `unit` footprints."""

    resolutions: list[int]
    finest: list[int]
    floors: list[float]
    unit: int
    turns: int
    flat_targets: int | None
    """Number of flat surfaces, None for all."""
    placements: int
    """Of flat surfaces."""
    repeats: int
    seeds: int
    corner_side: int
    aspects: int
    rooms: int
    finenesses: int
    """Of meshes of exact surfaces."""
    mesh_resolutions: list[int]
    mesh_floors: list[float]
    pitch: float
    """Of the rays of a dense integration [rad]."""
    shifts: int
    nodes: int
    """Of exact surfaces, along a side."""
    chirps: int
    """Of the frames of a moving sphere."""
    near_pitch: float
    """Between points of plates near the radar [m]."""
    section_edge: float
    """Of reflectors whose cross-sections are taken [m]."""


FULL = Run(
    resolutions=[128, 256, 512],
    finest=[1024],
    floors=[1e-3, 1e-5, 1e-7],
    unit=256,
    turns=6,
    flat_targets=None,
    placements=20,
    repeats=3,
    seeds=100,
    corner_side=128,
    aspects=4,
    rooms=2,
    finenesses=3,
    mesh_resolutions=[64, 128, 256, 512, 1024],
    mesh_floors=[1e-1, 1e-2, 1e-3, 1e-4],
    pitch=2e-4,
    shifts=8,
    nodes=600,
    chirps=128,
    near_pitch=4e-4,
    section_edge=0.1,
)
TINY = Run(
    resolutions=[32],
    finest=[],
    floors=[1.0],
    unit=32,
    turns=1,
    flat_targets=1,
    placements=1,
    repeats=1,
    seeds=2,
    corner_side=16,
    aspects=1,
    rooms=1,
    finenesses=1,
    mesh_resolutions=[32],
    mesh_floors=[1.0],
    pitch=8e-3,
    shifts=2,
    nodes=60,
    chirps=40,
    near_pitch=2e-3,
    section_edge=0.02,
)

TURNS = np.array([[0.0, 0.0], [0.5, 0.17], [0.17, 0.67], [0.83, 0.33], [0.33, 0.83], [0.67, 0.5]])
"""Offsets of the rays, in pixels from the image's symmetry, down and left. The first, the foot point on a corner of
four pixels, is often the worst."""


def conductor(mesh: rc.Mesh, distance: float, tilt: float = 0.0) -> rc.Body:
    """A body straight ahead [m], turned about the vertical [rad]."""
    pose = rc.Pose.from_rpy([distance, 0.0, 0.0], [0.0, 0.0, tilt])
    return rc.Body(mesh, material=rc.materials["perfect_conductor"], motion=pose)


def simulator(target: rc.Body | rc.PointTarget, radar: rc.Radar = RADAR, **options: Any) -> rc.Simulator:
    # Of the tolerance only the double precision below 1e-6 is used: rounding to complex64 would show.
    view: dict[str, Any] = {"field_of_view_deg": (60.0, 60.0)}
    return rc.Simulator(rc.Scene([target]), radar, tolerance=1e-9, **(view | options))


def frame(sim: rc.Simulator) -> rc.Frame:
    with warnings.catch_warnings():
        # The samples are H at some frequencies; nobody reads a range from them.
        warnings.filterwarnings("ignore", message="the scene reaches to")
        return sim.frame()


def transfer_function(sim: rc.Simulator) -> Phasors:
    """H at the frequencies of the samples, (sample,)."""
    return np.conj(frame(sim).cube[0, 0])


def best_time(action: Callable[[], object], repeats: int) -> float:
    """Shortest of some runs [s]: other programs on the machine only add time."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


def turned(pixels: Reals, resolution: int, field_of_view_deg: float) -> rc.Pose:
    """The radar turned about y and z by parts of a pixel: every echo stays what it is, the rays fall elsewhere."""
    pixel = 2.0 * np.tan(np.deg2rad(0.5 * field_of_view_deg)) / resolution
    return rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, *pixels * pixel])


def num_cells(field_of_view_deg: float) -> int:
    """Cells of the base grid of adaptive sampling, along a side."""
    return round(64 * field_of_view_deg / 60.0)


def rms(values: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def decibels(ratio: Any) -> Any:
    """Level of a ratio of amplitudes; nothing is infinitely many dB down."""
    with np.errstate(divide="ignore"):
        return 20.0 * np.log10(np.abs(ratio))


def errors(got: Phasors, expected: Phasors) -> tuple[float, float, float, float, float]:
    """Rms of level [dB] over all turns and frequencies, of the worst turn, and rms of phase [rad]; largest of both."""
    ratio = got / expected
    level, phase = decibels(ratio), np.angle(ratio)
    return rms(level), max(map(rms, level)), rms(phase), float(abs(level).max()), float(abs(phase).max())


def floor_text(rcs_floor: float) -> str:
    return f"{rcs_floor:.0e} m²"
