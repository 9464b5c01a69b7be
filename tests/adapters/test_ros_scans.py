"""Detections in messages of ROS: RadarScan and PointCloud2, written here by their definitions."""

from __future__ import annotations

import math
import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
import rosbags_types
from radarcore.adapters import ros

STAMP = 1_700_000_000_123_456_789
"""No float64 of seconds has its last digits: the spacing of numbers is 238 ns."""

DETECTIONS = rc.Detections(
    range=[0.9, 2.5, 2.5, 7.3],
    velocity=[0.0, -1.25, 3.1, 0.4],
    azimuth=[0.3, -0.7, 0.0, 1.1],
    elevation=[-0.2, 0.5, 0.1, 0.0],
    snr_db=[40.0, 12.5, 18.1, 9.9],
    time=12.25,
)
FIELDS = ("range", "velocity", "azimuth", "elevation", "snr_db")


def assert_equal_to_float32(found: rc.Detections, expected: rc.Detections) -> None:
    for name in FIELDS:
        values = getattr(expected, name).astype(np.float32)
        np.testing.assert_array_equal(getattr(found, name), values, err_msg=name)


@pytest.mark.parametrize("world", [None, "ROS 2"])
def test_radar_scan_keeps_detections_to_float32_and_stamps_to_the_nanosecond(world: str | None) -> None:
    types = None if world is None else rosbags_types.typestore(world)
    message = ros.to_radar_scan(DETECTIONS, frame_id="radar_link", time_ns=STAMP, types=types)
    if world is not None:
        message = rosbags_types.through_bytes(world, message)
    assert ros.header_nanoseconds(message) == STAMP
    assert message.header.frame_id == "radar_link"
    found = ros.from_radar_scan(message, start_ns=STAMP - 5)
    assert_equal_to_float32(found, DETECTIONS)
    assert found.time == 5e-9
    assert np.isnan(found.covariance).all()


def test_radar_scan_has_the_fields_of_radar_msgs() -> None:
    message = ros.to_radar_scan(DETECTIONS[1])
    (entry,) = message.returns
    assert vars(entry) == {
        "__msgtype__": "radar_msgs/msg/RadarReturn",
        "range": 2.5,
        "azimuth": np.float32(-0.7),
        "elevation": 0.5,
        "doppler_velocity": -1.25,
        "amplitude": 12.5,
    }


def test_stamp_without_one_given_is_the_time_of_the_detections() -> None:
    stamp = ros.to_radar_scan(DETECTIONS).header.stamp
    assert (stamp.sec, stamp.nanosec) == (12, 250_000_000)


def test_elevation_that_is_not_told_is_zero_in_a_scan_as_its_definition_has_it() -> None:
    flat = rc.Detections([1.0], [0.5], [0.2], [np.nan], [10.0])
    message = ros.to_radar_scan(flat)
    assert message.returns[0].elevation == 0.0
    assert ros.from_radar_scan(message).elevation[0] == 0.0
    assert_equal_to_float32(ros.from_radar_scan(message, has_elevation=False), flat)


def scan(*returns: tuple[float, ...], **others: Any) -> SimpleNamespace:
    names = ("range", "azimuth", "elevation", "doppler_velocity", "amplitude")
    entries = [SimpleNamespace(**dict(zip(names, entry, strict=True))) for entry in returns]
    return SimpleNamespace(returns=entries, **others)


def test_returns_out_of_range_are_no_detections() -> None:
    """REP 117: -inf is too close, inf is nothing there, NaN is invalid."""
    rest = (0.1, 0.2, 0.3, 10.0)
    ranges = (3.0, math.inf, -math.inf, 1.0, math.nan)
    found = ros.from_radar_scan(scan(*((distance, *rest) for distance in ranges)))
    np.testing.assert_array_equal(found.range, [1.0, 3.0])


def test_publishers_with_approaching_velocities_are_turned() -> None:
    found = ros.from_radar_scan(scan((1.0, 0.0, 0.0, 2.0, 10.0)), approaching_positive=True)
    assert found.velocity[0] == -2.0


def test_drafts_have_azimuths_to_the_right() -> None:
    point = SimpleNamespace(range=2.0, angle=0.5, elevation=0.1, doppler=-1.0, intensity=200)
    found = ros.from_radar_scan(SimpleNamespace(points=[point]))
    assert [float(getattr(found, name)[0]) for name in FIELDS] == [2.0, -1.0, -0.5, 0.1, 200.0]


@pytest.mark.parametrize("world", [None, "ROS 2"])
def test_bytes_of_a_point_cloud_are_the_detections(world: str | None) -> None:
    types = None if world is None else rosbags_types.typestore(world)
    message = ros.to_point_cloud(DETECTIONS, frame_id="radar_link", time_ns=STAMP, types=types)
    if world is not None:
        message = rosbags_types.through_bytes(world, message)
    assert ros.header_nanoseconds(message) == STAMP
    assert (message.height, message.width, message.point_step, message.row_step) == (1, 4, 20, 80)
    assert [(field.name, field.offset, field.datatype, field.count) for field in message.fields] == [
        ("x", 0, 7, 1),
        ("y", 4, 7, 1),
        ("z", 8, 7, 1),
        ("velocity", 12, 7, 1),
        ("intensity", 16, 7, 1),
    ]
    assert message.is_dense
    assert not message.is_bigendian
    points = list(struct.iter_unpack("<5f", bytes(message.data)))
    for (x, y, z, velocity, intensity), k in zip(points, range(4), strict=True):
        distance, azimuth, elevation = (float(getattr(DETECTIONS, n)[k]) for n in ("range", "azimuth", "elevation"))
        across = distance * math.cos(elevation)
        expected = (across * math.cos(azimuth), across * math.sin(azimuth), distance * math.sin(elevation))
        np.testing.assert_allclose((x, y, z), expected, rtol=1e-7, atol=1e-7)
        assert (velocity, intensity) == (np.float32(DETECTIONS.velocity[k]), np.float32(DETECTIONS.snr_db[k]))


def test_point_cloud_comes_back_as_detections() -> None:
    found = ros.from_point_cloud(ros.to_point_cloud(DETECTIONS))
    for name in FIELDS:
        # Each coordinate is off by at most 2^-25 of its size.
        np.testing.assert_allclose(getattr(found, name), getattr(DETECTIONS, name), rtol=1e-7, atol=1e-7, err_msg=name)
    assert found.time == DETECTIONS.time


def test_points_of_unknown_direction_are_not_numbers_and_the_cloud_says_so() -> None:
    message = ros.to_point_cloud(rc.Detections([1.0, 2.0], [0.0, 0.0], [0.5, np.nan], [0.0, 0.0], [9.0, 9.0]))
    assert not message.is_dense
    np.testing.assert_allclose(ros.from_point_cloud(message).range, [1.0], rtol=1e-7)


def test_any_layout_of_a_point_cloud_is_read() -> None:
    """Two padded rows of big-endian points with other types, names and an order of their own, the far point first."""
    points = [(5.0, 0.0, 0.0, 7, 1.5), (3.0, 4.0, 0.0, 8, -2.5), (0.0, 0.0, 2.0, 9, 0.5), (math.nan, 0.0, 0.0, 1, 0.0)]
    packed = [struct.pack(">xxfdfBfxx", y, x, z, snr, rate) for x, y, z, snr, rate in points]
    offsets = {"y": (2, 7), "x": (6, 8), "z": (14, 7), "snr": (18, 2), "rate": (19, 7)}
    message = SimpleNamespace(
        height=2,
        width=2,
        is_bigendian=True,
        point_step=len(packed[0]),
        row_step=2 * len(packed[0]) + 3,
        data=b"".join(packed[:2]) + b"\xa5" * 3 + b"".join(packed[2:]),
        fields=[SimpleNamespace(name=n, offset=o, datatype=d, count=1) for n, (o, d) in offsets.items()],
    )
    found = ros.from_point_cloud(message, velocity="rate", intensity="snr", approaching_positive=True)
    np.testing.assert_allclose(found.range, [2.0, 5.0, 5.0], rtol=1e-7)
    np.testing.assert_allclose(found.elevation, [0.5 * np.pi, 0.0, 0.0], rtol=1e-7)
    np.testing.assert_allclose(found.azimuth[1:], [0.0, math.atan2(4.0, 3.0)], rtol=1e-7)
    np.testing.assert_array_equal(found.snr_db, [9.0, 7.0, 8.0])
    np.testing.assert_array_equal(found.velocity, [-0.5, -1.5, 2.5])
    assert np.isnan(ros.from_point_cloud(message, velocity=None, intensity="snr").velocity).all()


def test_empty_point_cloud_is_no_detections() -> None:
    assert len(ros.from_point_cloud(ros.to_point_cloud(DETECTIONS[:0]))) == 0


@pytest.mark.parametrize("world", [None, "ROS 2"])
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
