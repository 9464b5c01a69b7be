"""Small bags of every format to read, whole and cut."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader, typed
from rosbags_types import typestore

FORMATS = ("mcap", "sqlite3")
"""Of bags that are written."""

START_NS = 1_700_000_000_123_456_789
EVERY_NS = 25_000_000
NUM = 150
"""Messages of a topic."""
ARRAY = "std_msgs/msg/Int16MultiArray"
POSE = "geometry_msgs/msg/PoseStamped"


def stamp_of(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}


def header_of(time_ns: int, frame_id: str = "world") -> dict[str, Any]:
    return {"seq": 0, "stamp": stamp_of(time_ns), "frame_id": frame_id}


def pose_of(position: Any, quaternion_xyzw: Any = (0.0, 0.0, 0.0, 1.0)) -> dict[str, Any]:
    return {
        "position": dict(zip("xyz", map(float, position), strict=True)),
        "orientation": dict(zip("xyzw", map(float, quaternion_xyzw), strict=True)),
    }


def array_of(number: int) -> dict[str, Any]:
    return {"layout": {"dim": [], "data_offset": 0}, "data": np.full(6000, number, np.int16)}


def messages(num: int = NUM) -> Iterable[tuple[str, str, int, Any]]:
    """num arrays that count on /array, and num poses on /arm/pose: topic, type, time, message."""
    for k in range(num):
        time = START_NS + k * EVERY_NS
        yield "/array", ARRAY, time, array_of(k)
        yield "/arm/pose", POSE, time, {"header": header_of(time), "pose": pose_of([k, 0.0, 0.0])}


def write_bag(path: Path, format: str, num: int = NUM) -> Path:
    with BagWriter(path, format) as bag:
        for topic, kind, time, message in messages(num):
            bag.write(topic, message, time, type=kind)
    return path


def write_ros1_bag(path: Path, num: int = NUM) -> Path:
    from rosbags.rosbag1 import Writer

    store, topics = typestore("ROS 1"), dict[str, Any]()
    with Writer(path) as bag:
        for topic, kind, time, message in messages(num):
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=store)
            bag.write(topics[topic], time, store.serialize_ros1(typed(store, kind, message), kind))
    return path


def file_of(path: Path) -> Path:
    """The file with the messages."""
    return path if path.is_file() else next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))


def cut(path: Path, share: float) -> Path:
    """The bag without its end: its file is `share` as long."""
    file = file_of(path)
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    return path


def read_cut(path: Path) -> tuple[list[int], list[str]]:
    """Numbers of the arrays that come out, every one whole, and the warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with BagReader(path) as bag:
            found = [np.unique(message.message.data).tolist() for message in bag.messages("/array")]
    assert all(len(values) == 1 for values in found)
    return [values[0] for values in found], [str(entry.message) for entry in caught]
