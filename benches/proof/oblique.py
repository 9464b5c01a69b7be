"""Surfaces that must not echo: walls and plates that are tilted, and Doppler where nothing moves so."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import radarcore as rc
from proof.closed_forms import mirror_level, square_echo
from proof.measure import (
    TURNS,
    WAVEFORM,
    Reals,
    Run,
    conductor,
    decibels,
    floor_text,
    frame,
    num_cells,
    rms,
    simulator,
    turned,
)

WALL_DISTANCE, WALL_TILT = 3.0, np.deg2rad(50.0)
PLATE_TILT = np.deg2rad(20.0)

BEAMWIDTH = np.rad2deg(np.sqrt(4.0 * np.log(2.0) * 0.08))
"""Of the gain exp(-(az² + el²) / 0.08) [degrees]."""


@dataclass(frozen=True)
class Quiet:
    """Distance of a level below its bound, by one sampling [dB]."""

    name: str
    sampling: str
    setting: str
    rays: int
    paths: int
    level: float


def ways(run: Run) -> Iterator[tuple[str, str, int, dict[str, Any]]]:
    """Sampling, setting, side of the pixels that the radar is turned by parts of, and options."""
    for sampling in ("point", "footprint"):
        for side in run.resolutions:
            yield sampling, str(side), side, {"sampling": sampling, "resolution": side}
    yield "adaptive", "default", num_cells(60.0), {}
    for rcs_floor in run.floors:
        yield "adaptive", floor_text(rcs_floor), num_cells(60.0), {"rcs_floor": rcs_floor, "ray_budget": math.inf}


def oblique_results(run: Run) -> Iterator[Quiet]:
    beam = rc.Radar(WAVEFORM, pattern=rc.GaussianPattern(0.0, BEAMWIDTH, BEAMWIDTH))
    wall = conductor(rc.shapes.plate(6.0, 6.0), WALL_DISTANCE, WALL_TILT)
    for sampling, setting, side, options in ways(run):
        frames = [
            frame(simulator(wall, beam, radar_motion=turned(turn, side, 60.0), **options))
            for turn in TURNS[: run.turns]
        ]
        level = np.array([f.cube[0, 0] for f in frames]) / mirror_level(WALL_DISTANCE)
        stats = frames[0].stats
        name = "wall, 6 m, at 3 m, tilted 50 degrees"
        yield Quiet(name, sampling, setting, stats["rays_cast"], stats["paths"], float(decibels(rms(level))))

    plate = conductor(rc.shapes.plate(0.2, 0.2), 1.0, PLATE_TILT)
    expected, broadside = square_echo(0.2, 1.0, PLATE_TILT), rms(square_echo(0.2, 1.0))
    for sampling, setting, side, options in ways(run):
        frames = [
            frame(simulator(plate, radar_motion=turned(turn, side, 60.0), **options)) for turn in TURNS[: run.turns]
        ]
        error = np.conj([f.cube[0, 0] for f in frames]) - expected
        stats = frames[0].stats
        name = "square, 20 cm, at 1 m, tilted 20 degrees"
        yield Quiet(
            name, sampling, setting, stats["rays_cast"], stats["paths"], float(decibels(rms(error) / broadside))
        )


# A sphere that moves evenly.

DOPPLER_RADIUS, DOPPLER_START, DOPPLER_VELOCITY = 0.1, [1.0, 0.05, 0.02], [0.5, 0.1, 0.0]
FAR_BINS = 16
"""Bins from the peak on which count: a Hann window's own side lobes are 76 dB down there."""


def doppler_results(run: Run) -> Iterator[Quiet]:
    sphere = rc.Body(
        rc.shapes.sphere(DOPPLER_RADIUS),
        material=rc.materials["perfect_conductor"],
        motion=rc.Linear(rc.Pose(DOPPLER_START), velocity=DOPPLER_VELOCITY),
    )
    sweep: dict[str, Any] = {"start_frequency": 60e9, "stop_frequency": 61e9, "sample_rate": 2e6, "num_samples": 128}
    waveform = rc.Waveform.from_sweep(**sweep, num_chirps=run.chirps, chirp_interval=400e-6)
    radar = rc.Radar(waveform)
    for sampling, setting, _, options in ways(run):
        got = frame(simulator(sphere, radar, **options))
        yield Quiet(
            "one frame", sampling, setting, got.stats["rays_cast"], got.stats["paths"], doppler_floor(got.cube[0])
        )
    # Every chirp a frame of its own, whose rays are cast where the sphere is then.
    single = rc.Radar(rc.Waveform.from_sweep(**sweep))
    one_of_each = {
        sampling: (sampling, setting, options) for sampling, setting, _, options in reversed(list(ways(run)))
    }
    for sampling, setting, options in reversed(one_of_each.values()):
        sim = simulator(sphere, single, **options)
        frames = [sim.frame(time) for time in waveform.chirp_times]
        stats = frames[0].stats
        cube = np.concatenate([f.cube[0] for f in frames])
        yield Quiet(
            "cast anew for every chirp", sampling, setting, stats["rays_cast"], stats["paths"], doppler_floor(cube)
        )


def doppler_floor(chirps: Any) -> float:
    """Strongest line far from the peak, over the peak [dB], at the range of the peak, from (chirp, sample)."""
    windowed = chirps * np.hanning(chirps.shape[1]) * np.hanning(chirps.shape[0])[:, None]
    power: Reals = np.abs(np.fft.fft2(windowed)) ** 2
    doppler, at = np.unravel_index(power.argmax(), power.shape)
    lines = np.roll(power[:, at], -int(doppler))
    return float(10.0 * np.log10(lines[FAR_BINS:-FAR_BINS].max() / lines[0]))


def quiet_rows(results: list[Quiet]) -> Iterator[list[str]]:
    for row in results:
        yield [row.name, row.sampling, row.setting, str(row.rays), str(row.paths), f"{row.level:.1f}"]
