"""Types of messages for rosbags: those of ROS 1 and ROS 2 that it knows, and `DEFINITIONS`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np

from radarcore.adapters.ros.messages import DEFINITIONS


def need_rosbags() -> None:
    """Raise an ImportError that names the extra, unless rosbags is installed."""
    if find_spec("rosbags") is None:
        raise ImportError("ROS bags need rosbags: pip install radarcore[ros]")


@cache
def typestore(version: int) -> Any:
    """The types of ROS 1 (Noetic) or ROS 2 (Humble), with those of `DEFINITIONS`."""
    need_rosbags()
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    types: dict[str, Any] = {}
    for name in DEFINITIONS.keys() - store.types.keys():
        types |= get_types_from_msg(DEFINITIONS[name], name)
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
    numbers = array.astype(dtype, copy=False).reshape(-1)
    if array.dtype.kind in "iu" and not np.array_equal(numbers, array.reshape(-1)):
        raise ValueError(f"{where}: expected numbers of type {dtype}, got {array.min()} to {array.max()}")
    return numbers
