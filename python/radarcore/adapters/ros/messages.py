"""Messages of ROS made by types from anywhere: rosbags, an installed ROS, or none at all; and their stamps.

``types=`` of every function that makes a message is one of

- None: messages are `types.SimpleNamespace`, for anything that reads attributes;
- rosbags' ``get_typestore(...)``, or its ``types``;
- `installed`: the Python classes of a ROS 2 that is installed, for publishers;
- any other mapping or function from names such as ``"std_msgs/msg/Header"`` to classes.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np

from radarcore import check

_BILLION = 10**9


def nanoseconds(stamp: Any) -> int:
    """Time of a stamp [ns], exact: of ROS 2 (sec, nanosec), ROS 1 (secs, nsecs) or Gazebo (sec, nsec).

    See Also
    --------
    adapters.ros.header_nanoseconds : Of the header of a message.
    adapters.ros.seconds : Seconds since a start.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> rc.adapters.ros.nanoseconds(SimpleNamespace(sec=1_700_000_000, nanosec=123_456_789))
    1700000000123456789
    """
    for whole, part in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")):
        if hasattr(stamp, whole) and hasattr(stamp, part):
            return int(getattr(stamp, whole)) * _BILLION + int(getattr(stamp, part))
    raise TypeError(f"stamp: expected sec and nanosec (or secs and nsecs), got {type(stamp).__name__}")


def header_nanoseconds(message: Any) -> int | None:
    """Stamp in the header of a message [ns]; None if it has none.

    See Also
    --------
    adapters.ros.nanoseconds : Of a stamp.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> stamp = SimpleNamespace(sec=5, nanosec=250_000_000)
    >>> rc.adapters.ros.header_nanoseconds(SimpleNamespace(header=SimpleNamespace(stamp=stamp)))
    5250000000
    """
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return None if stamp is None else nanoseconds(stamp)


def seconds(time_ns: int, start_ns: int = 0) -> float:
    """Time since `start_ns` [s], rounded once: times of motions should count from the start of a recording.

    See Also
    --------
    adapters.ros.nearest_nanoseconds : The way back.

    Examples
    --------
    >>> rc.adapters.ros.seconds(1_700_000_000_250_000_000, start_ns=1_700_000_000_000_000_000)
    0.25
    """
    return (int(time_ns) - int(start_ns)) / _BILLION


def nearest_nanoseconds(time: float) -> int:
    """Whole nanoseconds nearest to a time [s].

    See Also
    --------
    adapters.ros.seconds : The way back.

    Examples
    --------
    >>> rc.adapters.ros.nearest_nanoseconds(0.1 + 0.2)
    300000000
    """
    given = check.number("time", time, "s")
    whole = math.floor(given)
    return whole * _BILLION + round((given - whole) * 1e9)


Types = Any
"""See above."""

DEFINITIONS = {
    "radar_msgs/msg/RadarReturn": "\n".join(
        f"float32 {name}" for name in ("range", "azimuth", "elevation", "doppler_velocity", "amplitude")
    ),
    "radar_msgs/msg/RadarScan": "std_msgs/Header header\nradar_msgs/RadarReturn[] returns",
    "radarcore_msgs/msg/RadarFrame": (
        "std_msgs/Header header\nfloat64 time\nstring dtype\nuint32[] shape\nuint8[] data\n"
        "int32 lost\nfloat64[] truth\nstring settings"
    ),
    "edgefirst_msgs/msg/RadarCube": (
        "uint8 UNDEFINED = 0\nuint8 RANGE = 1\nuint8 DOPPLER = 2\nuint8 AZIMUTH = 3\nuint8 ELEVATION = 4\n"
        "uint8 RXCHANNEL = 5\nuint8 SEQUENCE = 6\nstd_msgs/Header header\nuint64 timestamp\nuint8[] layout\n"
        "uint16[] shape\nfloat32[] scales\nint16[] cube\nbool is_complex"
    ),
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "mocap4r2_msgs/msg/Marker": (
        "int8 USE_NAME=0\nint8 USE_INDEX=1\nint8 USE_BOTH=2\n"
        "int8 id_type\nint32 marker_index\nstring marker_name\ngeometry_msgs/Point translation"
    ),
    "mocap4r2_msgs/msg/RigidBody": ("string rigid_body_name\nmocap4r2_msgs/Marker[] markers\ngeometry_msgs/Pose pose"),
    "mocap4r2_msgs/msg/RigidBodies": (
        "std_msgs/Header header\nuint32 frame_number\nmocap4r2_msgs/RigidBody[] rigidbodies"
    ),
}
"""Definitions of messages that not every typestore has: radar_msgs 0.2.2, EdgeFirst, TF in ROS 1, MOCAP4ROS2, frames.

For rosbags: ``store.register(get_types_from_msg(text, name))`` for names that ``store.types`` lacks.
"""


def make(types: Types, name: str, /, **fields: Any) -> Any:
    """A message of a type such as ``"std_msgs/msg/Header"``, its arrays as that type has them."""
    if types is None:
        return SimpleNamespace(__msgtype__=name, **fields)
    kind = _class(types, name)
    return kind(**{field: _as_field(kind, value) for field, value in fields.items()})


def header(time: float | None, time_ns: int | None, frame_id: str, types: Types) -> Any:
    """Header of a message: its stamp is `time_ns` [ns], or else `time` [s] to the nearest nanosecond."""
    if time_ns is None:
        time_ns = nearest_nanoseconds(0.0 if time is None else time)
    whole, part = divmod(int(time_ns), 10**9)
    if not -(2**31) <= whole < 2**32:
        raise ValueError(f"time_ns: expected nanoseconds within the 32 bits of seconds of a stamp, got {time_ns}")
    stamp = make(types, "builtin_interfaces/msg/Time", sec=whole, nanosec=part)
    return make(types, "std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def checked_frame_id(frame_id: str) -> str:
    """Name of a frame with x forward, y left and z up (REP 103), as TF writes it: without a slash in front."""
    if not isinstance(frame_id, str):
        raise TypeError(f"frame_id: expected a name, got {type(frame_id).__name__}")
    if not frame_id or frame_id.startswith("/"):
        raise ValueError(f"frame_id: expected a name without a slash in front, got {frame_id!r}")
    if frame_id.endswith("_optical_frame"):
        raise ValueError(f"frame_id: expected a frame with x forward (REP 103), got the optical one {frame_id!r}")
    return frame_id


def installed(name: str) -> Callable[..., Any]:
    """Class of a message of the ROS 2 that is installed: ``types=installed``.

    See Also
    --------
    adapters.ros.BagWriter : Has types of its own, ``bag.types``.
    adapters.ros.to_frame_message : One of the functions that take them.

    Examples
    --------
    >>> try:
    ...     message = rc.adapters.ros.to_pose_stamped(rc.Pose(), time_ns=0, types=rc.adapters.ros.installed)
    ... except ImportError:
    ...     message = rc.adapters.ros.to_pose_stamped(rc.Pose(), time_ns=0)  # without ROS
    >>> message.header.frame_id
    'world'
    """
    package, *_, kind = name.split("/")
    try:
        found: Callable[..., Any] = getattr(import_module(f"{package}.msg"), kind)
    except ImportError as error:
        raise ImportError(
            f"{name} needs a ROS installation with {package}: source its setup file, or give rosbags' types ({error})"
        ) from error
    return found


def _class(types: Types, name: str) -> Callable[..., Any]:
    """Class of a type by name."""
    known = getattr(types, "types", types)
    if not isinstance(known, Mapping):
        if callable(known):
            kind: Callable[..., Any] = known(name)
            return kind
        raise TypeError(f"types: expected a mapping or a function of names of messages, got {type(types).__name__}")
    if name not in known:
        hint = "; register it from DEFINITIONS" if name in DEFINITIONS else ""
        raise ValueError(f"types: expected {name!r} among them, got none{hint}")
    found: Callable[..., Any] = known[name]
    return found


def _as_field(kind: Any, value: Any) -> Any:
    """An array as the fields of a class have it: NumPy's, or an `array.array` of an installed ROS 2."""
    if isinstance(value, np.ndarray) and hasattr(kind, "get_fields_and_field_types"):
        return array(value.dtype.char, value.tobytes())
    return value
