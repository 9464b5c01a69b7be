"""A CW radar, of slope 0: samples by the direct sum, and velocities."""

from __future__ import annotations

import numpy as np
import pytest

import radarcore as rc
from reference import beat_signal_reference

WAVEFORM = rc.Waveform(
    start_frequency=24e9, slope=0.0, sample_rate=1e6, num_samples=32, num_chirps=64, chirp_interval=200e-6
)
VELOCITY = 3.0


@pytest.mark.parametrize("method", ["direct", "grid"])
def test_samples_are_those_of_the_direct_sum(method: str) -> None:
    rng, num_paths = np.random.default_rng(1), 300
    delay, rate = rng.uniform(1e-8, 1e-7, num_paths), rng.normal(size=num_paths) * 3e-8
    amplitude = rng.normal(size=num_paths) + 1j * rng.normal(size=num_paths)
    cube = rc.beat_signal(delay, amplitude, WAVEFORM, delay_rate=rate, method=method)
    expected = beat_signal_reference(delay, amplitude, WAVEFORM, rate)
    assert np.sqrt(np.mean(np.abs(cube - expected) ** 2)) <= 1e-3 * np.linalg.norm(amplitude)  # the tolerance


def test_velocity_is_that_of_the_target() -> None:
    point = rc.PointTarget([20.0, 0.0, 0.0], velocity=[VELOCITY, 0.0, 0.0])
    recording = rc.Simulator(rc.Scene([point]), rc.Radar(WAVEFORM)).record(0.0, 0.1, 20.0, progress=False)
    peak = rc.strongest_peak(recording[0].cube, WAVEFORM)
    assert abs(peak.velocity - VELOCITY) <= 0.02 * WAVEFORM.velocity_resolution  # as `strongest_peak` promises
    assert np.isnan(peak.range)
    spectrogram = rc.spectrogram(recording)
    found = spectrogram.velocity[spectrogram.power.argmax(axis=1)]
    assert (np.abs(found - VELOCITY) <= 0.5 * WAVEFORM.velocity_resolution).all()
