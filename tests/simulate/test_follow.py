"""At how many times of a frame paths are taken: as many as phases and amplitudes each need, and no more."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from radarcore.simulate.follow import Course, Nodes, Times, follow_nodes

import radarcore as rc

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=1e13, sample_rate=2e6, num_samples=64, num_chirps=32, chirp_interval=400e-6
)
TOLERANCE = 1e-4
NUM_PATHS = 8


def oscillation(times: Times, turns: float) -> NDArray[np.float64]:
    """Of so many radians within a frame."""
    return np.cos(turns * (times / WAVEFORM.duration - 0.3))


def swinging(phase: float, turns: float) -> Course:
    """Paths whose phases swing by some radians, while amplitudes oscillate."""

    def follow(times: Times, amplitude_times: Times, part: slice) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        number = len(range(NUM_PATHS)[part])
        delay = 1e-8 + phase / (2.0 * np.pi * WAVEFORM.start_frequency) * oscillation(times, 2.0 * np.pi)
        amplitude = oscillation(amplitude_times, turns).astype(complex)
        return (
            np.repeat(delay[:, None, None], number, axis=2),
            np.repeat(amplitude[:, None, None], number, axis=2),
        )

    return Course(NUM_PATHS, False, follow)


def error_of_amplitudes(nodes: Nodes, turns: float) -> float:
    """Of the series through amplitudes at the nodes, rms over the frame, relative to the amplitude."""

    def on_domain(times: Times) -> NDArray[np.float64]:
        return 2.0 * times / WAVEFORM.duration - 1.0

    at = nodes.amplitude_times
    series = chebyshev.chebfit(on_domain(at), oscillation(at, turns), len(at) - 1)
    times = np.linspace(0.0, WAVEFORM.duration, 2001)
    error = chebyshev.chebval(on_domain(times), series) - oscillation(times, turns)
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("phase", [0.1, 30.0, 100.0])
@pytest.mark.parametrize("turns", [1.0, 6.0, 14.0, 18.0, 22.0, 26.0, 30.0, 60.0])
def test_errors_of_amplitudes_are_those_that_are_told(phase: float, turns: float) -> None:
    nodes = follow_nodes(swinging(phase, turns), WAVEFORM, 0.0, TOLERANCE)
    error = error_of_amplitudes(nodes, turns)
    # Where it is told that too few follow them, a few times that: what oscillates faster yet is folded back.
    assert error <= (nodes.weight if nodes.weight <= TOLERANCE else 5.0 * nodes.weight) + 1e-12
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        assert nodes.warn_beyond(TOLERANCE) == bool(told) == (nodes.residual > TOLERANCE)
    # What oscillates slowly enough is followed, however little or much phases swing.
    assert turns > 22.0 or nodes.residual <= 0.2 * TOLERANCE


def test_slow_amplitudes_of_fast_paths_are_taken_at_few_times() -> None:
    nodes = follow_nodes(swinging(100.0, 1.0), WAVEFORM, 0.0, TOLERANCE)
    assert len(nodes.times) >= 16
    assert len(nodes.amplitude_times) <= 8


@pytest.mark.parametrize(("start", "most"), [(0.0, 4), (1e5, 6), (1e6, 12), (1e8, 32)])
@pytest.mark.parametrize("speed", [1.0, 30.0])
def test_large_absolute_times_take_little_more(start: float, most: int, speed: float) -> None:
    # Times are rounded to 1e-16 of them, so that paths jump by that times the speed: no number of times follows jumps.
    def follow(times: Times, amplitude_times: Times, part: slice) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        delay = 1e-8 + 2.0 * speed * (times - start) / 3e8
        return delay[:, None, None], np.ones((len(amplitude_times), 1, 1), complex)

    nodes = follow_nodes(Course(1, False, follow), WAVEFORM, start, TOLERANCE)
    rounding = 2.0 * np.pi * 60e9 * 2.0 * speed / 3e8 * np.spacing(start)
    if rounding < 0.01 * TOLERANCE:
        assert len(nodes.times) <= most
        assert nodes.phase <= 0.1 * TOLERANCE
