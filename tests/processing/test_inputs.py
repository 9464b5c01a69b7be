"""Inputs of processing: cubes with a waveform or radar, frames and recordings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import radarcore as rc

WAVEFORM = rc.Waveform(start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=32, num_chirps=4)
RADAR = rc.Radar(WAVEFORM, rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]])
CUBE = np.random.default_rng(1).standard_normal((3, 2, 4, 32)).astype(np.float32)
FRAME = rc.Frame(CUBE[0], 0.0, RADAR)
RECORDING = rc.Recording(CUBE, np.arange(3.0), RADAR)


@pytest.fixture(params=[rc.range_profile, rc.range_doppler], ids=lambda function: function.__name__)
def transform(request: pytest.FixtureRequest) -> Callable[..., Any]:
    function: Callable[..., Any] = request.param
    return function


def test_frame_recording_and_cube_with_its_radar_give_the_same(transform: Callable[..., Any]) -> None:
    expected = transform(CUBE, WAVEFORM)
    np.testing.assert_array_equal(transform(CUBE, RADAR), expected)
    np.testing.assert_array_equal(transform(RECORDING), expected)
    np.testing.assert_array_equal(transform(FRAME), expected[0])


@pytest.mark.parametrize("history", [rc.range_time, rc.spectrogram], ids=lambda function: function.__name__)
def test_frame_is_a_recording_of_one_over_time(history: Callable[..., Any]) -> None:
    receiver = rc.Receiver(noise_figure_db=10.0, output="real")
    noisy = rc.Recording(CUBE, np.arange(3.0), rc.Radar(WAVEFORM, rx=RADAR.rx, receiver=receiver))
    for recording in (RECORDING, noisy):
        expected, found = history(recording), history(recording[1])
        np.testing.assert_allclose(found.time, expected.time[1:2])
        np.testing.assert_array_equal(found.power, expected.power[1:2])
        assert found.noise == expected.noise
    assert found.noise is not None


def test_codes_of_a_frame_are_in_full_scale_over_time_too() -> None:
    """Its noise differs from the receiver's figure."""
    receiver = rc.Receiver(noise_figure_db=10.0, output="real")
    codes = np.full(CUBE.shape[1:], 2048, np.uint16)
    frame = rc.Frame(CUBE[0], 0.0, rc.Radar(WAVEFORM, rx=RADAR.rx, receiver=receiver), raw=codes)
    assert rc.range_time(frame).noise is None
