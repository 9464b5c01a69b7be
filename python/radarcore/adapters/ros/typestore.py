"""Definitions of messages: those of ROS 1 and ROS 2 that rosbags knows, and `radar_msgs`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

RADAR_RETURN = """\
float32 range
float32 azimuth
float32 elevation
float32 doppler_velocity
float32 amplitude
"""
"""radar_msgs 0.2.2; the sign of the velocity is not specified there: ours is a range rate, receding positive."""

RADAR_SCAN = """\
std_msgs/Header header
radar_msgs/RadarReturn[] returns
"""

RIGID_BODIES = """\
std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/RigidBody[] rigidbodies
"""
RIGID_BODY = """\
string rigid_body_name
mocap4r2_msgs/Marker[] markers
geometry_msgs/Pose pose
"""
MARKER = """\
int8 USE_NAME=0
int8 USE_INDEX=1
int8 USE_BOTH=2
int8 id_type
int32 marker_index
string marker_name
geometry_msgs/Point translation
"""
"""mocap4r2_msgs, of motion capture systems."""

DEFINITIONS = {
    "radar_msgs/msg/RadarReturn": RADAR_RETURN,
    "radar_msgs/msg/RadarScan": RADAR_SCAN,
    "mocap4r2_msgs/msg/Marker": MARKER,
    "mocap4r2_msgs/msg/RigidBody": RIGID_BODY,
    "mocap4r2_msgs/msg/RigidBodies": RIGID_BODIES,
}
"""Texts of messages that neither ROS nor rosbags brings along."""


def need_rosbags() -> None:
    """Raise an ImportError that names the extra, unless rosbags is installed."""
    try:
        import rosbags  # noqa: F401  # only whether it is there
    except ImportError as error:
        raise ImportError("ROS bags need rosbags: pip install radarcore[ros]") from error


@cache
def typestore(version: int) -> Any:
    """The types of ROS 1 (Noetic) or ROS 2 (Humble), with those of `DEFINITIONS`."""
    need_rosbags()
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    types: dict[str, Any] = {}
    for name, text in DEFINITIONS.items():
        types |= get_types_from_msg(text, name)
    store.register(types)
    return store


def typed(store: Any, name: str, source: Any) -> Any:
    """A message of the type `name` with the fields of `source`: a mapping, or an object with attributes.

    ROS 1 has one field more in headers, ``seq``, which is zero where `source` has none.

    Raises
    ------
    ValueError
        For a type that is not known, and a field that is missing.
    """
    if name not in store.fielddefs:
        raise ValueError(f"type: expected a known message, got {name!r}")
    values = {
        field: _value(store, description, _field(source, field, name), f"{name}.{field}")
        for field, description in store.fielddefs[name][1]
    }
    return store.types[name](**values)


def _field(source: Any, field: str, name: str) -> Any:
    if isinstance(source, Mapping):
        if field in source:
            return source[field]
    elif hasattr(source, field):
        return getattr(source, field)
    if field == "seq":
        return 0
    if field == "structure_needs_at_least_one_member":  # of messages without fields
        return 0
    raise ValueError(f"{name}: expected the field {field!r}, got none")


def _value(store: Any, description: Any, value: Any, where: str) -> Any:
    """A field as rosbags takes it: numbers in arrays, messages in lists."""
    kind, details = description
    if kind.name == "BASE":
        return str(value) if details[0] in ("string", "wstring") else value
    if kind.name == "NAME":
        return typed(store, details, value)
    inner, _ = details
    if inner[0].name == "NAME":
        return [typed(store, inner[1], entry) for entry in value]
    if inner[1][0] in ("string", "wstring"):
        return [str(entry) for entry in value]
    dtype = {"byte": "uint8", "octet": "uint8", "char": "uint8"}.get(inner[1][0], inner[1][0])
    array = np.frombuffer(value, np.uint8) if isinstance(value, bytes | bytearray | memoryview) else np.asarray(value)
    if array.dtype.kind == "f" and np.dtype(dtype).kind != "f":
        raise ValueError(f"{where}: expected numbers of type {dtype}, got {array.dtype}")
    return array.astype(dtype, copy=False).reshape(-1)
