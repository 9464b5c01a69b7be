"""Amplitude and phase of an echo at its place between the cells."""

from __future__ import annotations

import numpy as np
import pytest

import radarcore as rc
from radarcore.comparison.echoes import echo, pairs
from radarcore.units import SPEED_OF_LIGHT


@pytest.mark.parametrize("slope", [2e13, -2e13])
@pytest.mark.parametrize("output", ["iq", "real"])
def test_echo_has_the_amplitude_and_the_phase_of_its_path(slope: float, output: str) -> None:
    wf = rc.Waveform(start_frequency=60e9, slope=slope, sample_rate=2e6, num_samples=128, num_chirps=32)
    radar = rc.Radar(wf, rx=[[0.0, 0.0, 0.0]], receiver=rc.Receiver(output=output))
    amplitude = complex(0.3 * np.exp(0.7j))  # of the echo; the beat signal has its conjugate
    middle, velocity = 2.3456, -0.8
    start = middle - velocity * 0.5 * wf.duration
    cube = rc.beat_signal([2.0 * start / SPEED_OF_LIGHT], [amplitude], wf, delay_rate=[2.0 * velocity / SPEED_OF_LIGHT])
    samples = cube.real.astype(np.float32) if output == "real" else cube
    frame = rc.Frame(samples, 0.0, radar)
    expected = amplitude.conjugate() * np.exp(2j * np.pi * wf.center_frequency * 2.0 * middle / SPEED_OF_LIGHT)
    (found,) = echo(frame, middle, velocity)
    assert abs(found) == pytest.approx(0.3, rel=3e-5)
    # The range migrates by 8 mm of 12 cm bins during the frame; the residual video phase is 0.015 rad.
    assert np.angle(found / expected) == pytest.approx(0.0, abs=0.05)
    # Errors of a tenth of a bin hardly change it.
    (near,) = echo(frame, middle + 0.1 * wf.range_resolution, velocity + 0.1 * wf.velocity_resolution)
    assert np.angle(near / found) == pytest.approx(0.0, abs=0.02)


def test_frames_at_about_the_same_time_are_pairs() -> None:
    a, b = np.array([0.0, 0.1, 0.2, 0.3]), np.array([-0.2, 0.04, 0.14, 0.31, 0.36])
    assert pairs(a, b, 0.05).tolist() == [[0, 1], [1, 2], [3, 3]]
