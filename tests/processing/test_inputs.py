"""What processing takes: cubes with a waveform or radar, frames and recordings."""

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


def test_missing_and_superfluous_radars_are_refused_by_name(transform: Callable[..., Any]) -> None:
    with pytest.raises(TypeError, match=r"waveform: expected Waveform or Radar with a cube .*, got none"):
        transform(CUBE)
    with pytest.raises(TypeError, match="waveform: expected none with a Frame, which has its radar"):
        transform(FRAME, WAVEFORM)
    with pytest.raises(TypeError, match=r"waveform: expected Waveform or Radar .*, got dict"):
        transform(CUBE, {})
