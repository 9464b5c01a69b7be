"""Times of a frame at which paths are evaluated: just enough for phases and amplitudes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=1e13, sample_rate=2e6, num_samples=64, num_chirps=32, chirp_interval=400e-6
)
TOLERANCE = 1e-4


def ball(distance: Any) -> rc.Body:
    """Ahead of the sensor, at a distance over time [m]."""
    return rc.Body(rc.shapes.sphere(0.05), motion=lambda time: rc.Pose([distance(time), 0.0, 0.0]))


def simulator(bodies: list[Any], **options: Any) -> rc.Simulator:
    settings = {"sampling": "footprint", "resolution": 32, "field_of_view_deg": (6.0, 6.0), "tolerance": TOLERANCE}
    return rc.Simulator(rc.Scene(bodies), rc.Radar(WAVEFORM), **settings | options)


def test_slow_amplitudes_of_fast_paths_are_taken_at_few_times() -> None:
    # Phases swing by 100 rad, amplitudes by 1 %.
    swing = 100.0 * WAVEFORM.wavelength / (4.0 * np.pi)
    body = ball(lambda time: 8.0 + swing * np.cos(2.0 * np.pi * time / WAVEFORM.duration))
    stats = simulator([body], retrace_deg=np.inf, field_of_view_deg=(2.0, 2.0)).frame().stats
    assert stats["delay_nodes"] >= 16
    assert stats["amplitude_nodes"] <= 12


@pytest.mark.filterwarnings("ignore:.*has a radial speed of")
@pytest.mark.parametrize(("start", "most"), [(0.0, 4), (1e5, 6), (1e6, 12)])
@pytest.mark.parametrize("speed", [1.0, 30.0])
def test_large_absolute_times_take_little_more(start: float, most: int, speed: float) -> None:
    # Times are rounded to 1e-16 of them, so that paths jump by that times the speed: no number of times follows jumps.
    rounding = 4.0 * np.pi * speed / WAVEFORM.wavelength * np.spacing(start)
    stats = simulator([ball(lambda time: 2.0 + speed * (time - start))]).frame(start).stats
    if rounding < 0.01 * TOLERANCE:
        assert stats["delay_nodes"] <= most
        assert stats["series_residual"] <= 0.2 * TOLERANCE


def vibrating(cycles: float, phase: float) -> Any:
    """Distance that swings by some radians of phase, with so many cycles in a frame."""
    swing = phase * WAVEFORM.wavelength / (4.0 * np.pi)
    return lambda time: 2.0 + swing * np.sin(2.0 * np.pi * cycles * time / WAVEFORM.duration)


@pytest.mark.parametrize("cycles", [3.0, 7.0])
def test_motion_too_fast_for_the_first_times_is_placed_at_more(cycles: float) -> None:
    # A point on a rod that vibrates; its phase at every sample is on paper.
    distance = vibrating(cycles, 2.0)
    asked: list[float] = []

    def pose(time: float) -> rc.Pose:
        asked.append(time)
        return rc.Pose([2.0 - distance(time), 0.0, 0.0])

    sim = simulator([rc.PointTarget([2.0, 0.0, 0.0])], radar_motion=pose, tolerance=1e-8)
    frame = sim.frame()
    assert len(set(asked)) > 33  # 17 did not do
    wf = WAVEFORM
    time = wf.chirp_times[:, None] + wf.adc_delay + np.arange(wf.num_samples) / wf.sample_rate
    delay = 2.0 * np.vectorize(distance)(time) / 299_792_458.0
    sweep = time - wf.chirp_times[:, None]
    phase = 2.0 * np.pi * (wf.start_frequency * delay + wf.slope * (sweep * delay - 0.5 * delay**2))
    expected = np.exp(1j * phase) / np.vectorize(distance)(time) ** 2
    ratio = np.vdot(expected, frame.cube[0]) / np.vdot(expected, expected)
    assert np.linalg.norm(frame.cube[0] - ratio * expected) < 1e-6 * np.linalg.norm(frame.cube[0])


def test_body_that_needs_many_times_has_them_alone() -> None:
    # A disc swings by 2 rad of phase beside a disc in steady motion: the latter needs no more times than alone.
    def disc(side: float, motion: Any) -> rc.Body:
        return rc.Body(rc.shapes.disc(0.05), motion=lambda time: rc.Pose([motion(time), side, 0.0]))

    smooth, fast = disc(0.3, lambda time: 2.0 + 0.5 * time), disc(-0.3, vibrating(3.0, 2.0))
    options = {"field_of_view_deg": (30.0, 6.0), "resolution": (64, 320), "method": "auto"}
    alone = simulator([smooth], **options).frame()
    assert alone.stats["delay_nodes"] <= 8
    both = simulator([smooth, fast], **options)
    frame = both.frame()
    assert frame.stats["delay_nodes"] > 8
    # Both add up to the sum sample by sample.
    expected = simulator([smooth, fast], **options | {"method": "direct"}).frame()
    l2 = np.sqrt(np.sum(np.abs(both.paths().amplitude) ** 2))
    error = np.sqrt(np.mean(np.abs(frame.cube - expected.cube) ** 2))
    assert error <= TOLERANCE * l2
