"""Samples, settings and maps in messages of ROS: every bit comes back."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
import rosbags_types
from radarcore.adapters import ros
from radarcore.recording.frame import to_samples

BOARD = rc.bgt60tr13c(num_samples=8, num_chirps=4)
CODES = np.random.default_rng(1).integers(0, 4096, (3, 4, 8)).astype(np.uint16)
NUMBERS = np.random.default_rng(2).normal(size=(3, 4, 8, 2))


@pytest.mark.parametrize("world", [None, *rosbags_types.WORLDS])
def test_codes_are_int16_by_axis_and_come_back_bit_for_bit(world: str | None) -> None:
    frame = rc.Frame(to_samples(CODES), 0.5, BOARD, raw=CODES)
    types = None if world is None else rosbags_types.typestore(world)
    message = ros.to_samples_message(frame, types=types)
    settings = ros.to_settings_message(frame, types=types)
    assert message.__msgtype__ == "std_msgs/msg/Int16MultiArray"
    if world is not None:
        message, settings = (rosbags_types.through_bytes(world, each) for each in (message, settings))
    assert [(d.label, d.size, d.stride) for d in message.layout.dim] == [
        ("channel", 3, 96),
        ("chirp", 4, 32),
        ("sample", 8, 8),
    ]
    assert message.data.dtype == np.int16
    np.testing.assert_array_equal(message.data, CODES.ravel())

    radar, unit = ros.from_settings_message(settings)
    assert unit == "full scale"
    again = ros.to_frame(message, radar, 0.5, cube_unit=unit)
    assert radar == frame.radar
    assert again.raw is not None
    np.testing.assert_array_equal(again.raw, CODES)
    np.testing.assert_array_equal(again.cube, frame.cube)
    assert again.time == 0.5


@pytest.mark.parametrize("world", [None, *rosbags_types.WORLDS])
@pytest.mark.parametrize("kind", [np.float32, np.float64, np.complex64, np.complex128])
def test_samples_that_are_no_codes_come_back_bit_for_bit(kind: Any, world: str | None) -> None:
    is_iq = np.dtype(kind).kind == "c"
    cube = (NUMBERS @ [1.0, 1j] if is_iq else NUMBERS[..., 0]).astype(kind)
    radar = rc.Radar(BOARD.waveform, rx=BOARD.rx)
    frame = rc.Frame(cube, 0.0, radar)
    types = None if world is None else rosbags_types.typestore(world)
    message = ros.to_samples_message(frame, types=types)
    if world is not None:
        message = rosbags_types.through_bytes(world, message)
    assert message.layout.dim[-1].label == ("iq" if is_iq else "sample")
    again = ros.to_frame(message, radar, 0.0)
    assert again.cube.dtype == kind
    np.testing.assert_array_equal(again.cube, cube)
    assert again.raw is None
    assert "cube_unit" not in again.stats


@pytest.mark.parametrize("kind", [np.float32, np.complex64])
def test_lists_of_numbers_are_single_precision_again(kind: Any) -> None:
    """As ROS 1 delivers them: tuples of Python's numbers, NaN among them."""
    cube = np.array([[[1.1, 2.5, np.nan]]], kind)
    message = ros.to_samples_message(cube)
    message.data = tuple(message.data.tolist())
    again = ros.from_samples_message(message)
    assert again.dtype == kind
    np.testing.assert_array_equal(again[0], cube)


def test_several_frames_of_integers_with_i_and_q_are_counts() -> None:
    message = ros.to_samples_message(np.arange(-24, 24).reshape(2, 1, 3, 8)[:, :, :, :4])
    assert [d.label for d in message.layout.dim] == ["frame", "channel", "chirp", "sample"]
    assert ros.from_samples_message(message).shape == (2, 1, 3, 4)
    # The same numbers as I and Q of half as many samples.
    message.layout.dim[-1].size = 2
    message.layout.dim[-1].stride = 4
    message.layout.dim.append(SimpleNamespace(label="iq", size=2, stride=2))
    found = ros.from_samples_message(message)
    assert found.dtype == np.complex64
    np.testing.assert_array_equal(found[0, 0], [[-24 - 23j, -22 - 21j], [-16 - 15j, -14 - 13j], [-8 - 7j, -6 - 5j]])


def test_offset_and_strides_of_the_layout_are_obeyed() -> None:
    """As std_msgs says: number (i, j, k) is data[offset + stride1 i + stride2 j + k]."""
    numbers = np.arange(100, dtype=np.int16)
    sizes, strides = (2, 3, 4), (60, 20, 5)
    dims = [
        SimpleNamespace(label=label, size=size, stride=stride)
        for label, size, stride in zip(("channel", "chirp", "sample"), sizes, strides, strict=True)
    ]
    message = SimpleNamespace(layout=SimpleNamespace(dim=dims, data_offset=7), data=numbers)
    found = ros.from_samples_message(message)[0]
    for i, j, k in np.ndindex(*sizes):
        assert found[i, j, k] == 7 + 20 * i + 5 * j + k


def test_codes_of_a_receiver_with_an_adc_need_no_unit() -> None:
    radar = rc.bgt60tr13c(num_samples=8, num_chirps=4, receiver="measured")
    frame = ros.to_frame(ros.to_samples_message(CODES), radar, 0.0)
    np.testing.assert_array_equal(frame.raw, CODES)


def test_other_integers_are_counts() -> None:
    frame = ros.to_frame(ros.to_samples_message(CODES.astype(np.int64) - 2048), BOARD, 0.0)
    assert frame.cube.dtype == np.float32
    np.testing.assert_array_equal(frame.cube, CODES - 2048.0)
    assert frame.stats == {"cube_unit": "counts"}


def test_simulated_frames_of_an_adc_go_through_messages() -> None:
    radar = rc.bgt60tr13c(num_samples=8, num_chirps=4, receiver="measured")
    frame = rc.Simulator(rc.Scene([rc.PointTarget([1.0, 0.0, 0.0])]), radar).frame()
    sent, unit = ros.from_settings_message(ros.to_settings_message(frame))
    again = ros.to_frame(ros.to_samples_message(frame), sent, frame.time, cube_unit=unit)
    np.testing.assert_array_equal(again.cube, frame.cube)


@pytest.mark.parametrize("world", [None, *rosbags_types.WORLDS])
def test_map_is_an_image_of_single_precision(world: str | None) -> None:
    decibels = np.linspace(-80.0, 3.7, 15).reshape(3, 5)
    types = None if world is None else rosbags_types.typestore(world)
    message = ros.to_map_image(decibels, time_ns=5, frame_id="radar_link", types=types)
    if world is not None:
        message = rosbags_types.through_bytes(world, message)
    assert (message.encoding, message.height, message.width, message.step) == ("32FC1", 3, 5, 20)
    assert (message.header.frame_id, ros.header_nanoseconds(message)) == ("radar_link", 5)
    np.testing.assert_array_equal(np.frombuffer(bytes(message.data), "<f4"), decibels.ravel().astype(np.float32))
    np.testing.assert_array_equal(ros.from_map_image(message), decibels.astype(np.float32))


SAMPLES = ros.to_samples_message(CODES)


def short(data: Any) -> SimpleNamespace:
    return SimpleNamespace(layout=SAMPLES.layout, data=data)


@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        (lambda: ros.to_samples_message(CODES[0]), ValueError, r"samples: expected \[channel, .* got shape \(4, 8\)"),
        (lambda: ros.to_samples_message(CODES * 10), ValueError, "samples: expected integers of 16 bits, got"),
        (lambda: ros.to_samples_message(CODES > 9), TypeError, "samples: expected integers, float32, .* got bool"),
        (
            lambda: ros.from_samples_message(short(CODES[:1])),
            ValueError,
            "data: expected at least 96 numbers .* got 32",
        ),
        (lambda: ros.from_samples_message(short(["a"] * 96)), TypeError, "data: expected int16, float32"),
        (
            lambda: ros.to_frame(SAMPLES, rc.bgt60tr13c(), 0.0),
            ValueError,
            r"message: expected shape \(1, 3, .* got \(1,",
        ),
        (
            lambda: ros.from_samples_message(SimpleNamespace(layout=SimpleNamespace(dim=[], data_offset=0), data=[])),
            ValueError,
            "layout: expected frame, channel, chirp, sample .* got no dimensions",
        ),
        (
            lambda: ros.to_frame(ros.to_samples_message(CODES.astype(int) - 5000), BOARD, 0.0, cube_unit="full scale"),
            ValueError,
            "codes: expected 0 to 4095",
        ),
        (
            lambda: ros.from_settings_message(SimpleNamespace(data="hello")),
            ValueError,
            "data: expected settings .* 'hello'",
        ),
        (
            lambda: ros.from_settings_message(SimpleNamespace(data="{}")),
            ValueError,
            "data: expected settings of a radar",
        ),
        (lambda: ros.to_map_image(np.ones(3), time_ns=0), ValueError, r"values: expected shape \(doppler, range\)"),
        (lambda: ros.to_map_image(np.ones((2, 2)) * 1j, time_ns=0), TypeError, "values: expected real numbers"),
        (
            lambda: ros.from_map_image(SimpleNamespace(encoding="mono8")),
            ValueError,
            "encoding: expected 32FC1, got 'mono8'",
        ),
    ],
)
def test_bad_messages_name_their_field(call: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        call()
