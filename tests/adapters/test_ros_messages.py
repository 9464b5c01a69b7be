"""Stamps to the nanosecond, and messages in the classes of an installed ROS, which fakes stand for."""

from __future__ import annotations

import sys
from array import array
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters import ros

STAMP = 1_700_000_000_123_456_789


@pytest.mark.parametrize(
    "stamp",
    [
        SimpleNamespace(sec=1_700_000_000, nanosec=123_456_789),
        SimpleNamespace(secs=1_700_000_000, nsecs=123_456_789),
        SimpleNamespace(sec=1_700_000_000, nsec=123_456_789),
        SimpleNamespace(sec=np.int32(1_700_000_000), nanosec=np.uint32(123_456_789)),
    ],
)
def test_stamps_of_all_worlds_are_whole_nanoseconds(stamp: Any) -> None:
    assert ros.nanoseconds(stamp) == STAMP
    assert ros.header_nanoseconds(SimpleNamespace(header=SimpleNamespace(stamp=stamp))) == STAMP
    assert ros.seconds(STAMP, STAMP - 1) == 1e-9


def test_what_is_no_stamp_is_refused() -> None:
    with pytest.raises(TypeError, match=r"stamp: expected sec and nanosec .* got float"):
        ros.nanoseconds(1.0)
    assert ros.header_nanoseconds(SimpleNamespace()) is None


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        (0.0, 0),
        (12.5, 12_500_000_000),
        (1e-9, 1),
        (0.1 + 0.2, 300_000_000),
        (-0.25, -250_000_000),
        (-1e-20, 0),
        (1_700_000_000.5, 1_700_000_000_500_000_000),
        # The float64 next to this time, exactly 1700000000.123456716537475...
        (1_700_000_000.1234567, 1_700_000_000_123_456_717),
    ],
)
def test_times_become_the_nearest_nanosecond(time: float, expected: int) -> None:
    assert ros.nearest_nanoseconds(time) == expected


def test_times_before_the_epoch_have_stamps_too() -> None:
    stamp = ros.to_pose_stamped(rc.Pose(), time_ns=-250_000_000).header.stamp
    assert (stamp.sec, stamp.nanosec) == (-1, 750_000_000)
    assert ros.nanoseconds(stamp) == -250_000_000


def rclpy_class(name: str) -> type:
    """Like a class of rclpy: keywords, and arrays of numbers as `array.array` alone."""

    def make(self: Any, **fields: Any) -> None:
        assert not any(isinstance(value, np.ndarray) for value in fields.values())
        vars(self).update(fields)

    return type(name, (), {"__init__": make, "get_fields_and_field_types": dict})


def install(patch: pytest.MonkeyPatch, make: Any, *names: str) -> None:
    """Replace installed packages of messages, if any."""
    for package in {name.split("/")[0] for name in names}:
        kinds = [name.split("/")[1] for name in names if name.startswith(f"{package}/")]
        module = ModuleType(f"{package}.msg")
        vars(module).update({kind: make(kind) for kind in kinds})
        patch.setitem(sys.modules, package, ModuleType(package))
        patch.setitem(sys.modules, f"{package}.msg", module)


IMAGE = ("std_msgs/Header", "sensor_msgs/Image")


def test_messages_of_an_installed_ros_2_have_its_classes_and_arrays(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, rclpy_class, "builtin_interfaces/Time", *IMAGE)
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    image = ros.to_map_image(values, time_ns=STAMP, types=ros.installed)
    assert type(image) is sys.modules["sensor_msgs.msg"].Image
    assert isinstance(image.data, array)
    assert image.data.typecode == "B"
    np.testing.assert_array_equal(ros.from_map_image(image), values)
    assert ros.header_nanoseconds(image) == STAMP


def test_ros_that_is_not_installed_is_an_import_error_that_says_what_to_do() -> None:
    with pytest.raises(
        ImportError, match=r"no_msgs/msg/String needs a ROS installation with no_msgs: .*No module named"
    ):
        ros.installed("no_msgs/msg/String")
