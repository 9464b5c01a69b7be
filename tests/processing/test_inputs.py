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
    """Whose noise is not that of the receiver's figure."""
    receiver = rc.Receiver(noise_figure_db=10.0, output="real")
    codes = np.full(CUBE.shape[1:], 2048, np.uint16)
    frame = rc.Frame(CUBE[0], 0.0, rc.Radar(WAVEFORM, rx=RADAR.rx, receiver=receiver), raw=codes)
    assert rc.range_time(frame).noise is None


def test_missing_and_superfluous_radars_are_refused_by_name(transform: Callable[..., Any]) -> None:
    with pytest.raises(TypeError, match=r"waveform: expected Waveform or Radar with a cube .*, got none"):
        transform(CUBE)
    with pytest.raises(TypeError, match="waveform: expected none with a Frame, which has its radar"):
        transform(FRAME, WAVEFORM)
    with pytest.raises(TypeError, match=r"waveform: expected Waveform or Radar .*, got dict"):
        transform(CUBE, {})


def multiplexed() -> rc.Recording:
    """Two transmitters at once with a Doppler code."""
    tx = [[0.0, 0.0, 0.0], [0.0, 5e-3, 0.0]]
    radar = rc.Radar(WAVEFORM, tx=tx, rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]], schedule=rc.Schedule.ddm())
    return rc.Recording(CUBE, np.arange(3.0), radar)


@pytest.mark.parametrize(
    "function",
    [rc.detect, rc.strongest_peak, rc.doppler_velocity, lambda frame, *_: rc.remove_static(frame, [0.0, 0.0, 0.0])],
)
def test_echoes_at_a_velocity_per_transmitter_are_refused(function: Callable[..., Any]) -> None:
    recording = multiplexed()
    with pytest.raises(ValueError, match=r"radar: expected transmitters apart, got a schedule of kind 'ddm'"):
        function(recording[0])


@pytest.mark.parametrize(("function", "name"), [(rc.detect, "frame"), (rc.strongest_peak, "cube")])
def test_recordings_are_refused_in_words_where_one_frame_is_wanted(function: Callable[..., Any], name: str) -> None:
    with pytest.raises(TypeError, match=rf"{name}: expected a Frame .*, got a Recording; take its frames one by one"):
        function(RECORDING)


@pytest.mark.parametrize(
    "function",
    [
        *(rc.range_time, rc.spectrogram, rc.range_profile, rc.range_angle, rc.processing.chirp_rate_velocity),
        *(rc.processing.chirp_rate_velocity, lambda recording: rc.remove_static(recording, [0.1, 0.0, 0.0])),
        lambda recording: rc.track(recording),
    ],
)
def test_recordings_of_several_waveforms_are_refused(function: Callable[..., Any]) -> None:
    radar = rc.Radar(WAVEFORM.alternating(), rx=RADAR.rx)
    with pytest.raises(ValueError, match="radar: expected one waveform, got 2"):
        function(rc.Recording(CUBE, np.arange(3.0), radar))
