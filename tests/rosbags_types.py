"""Types of rosbags for both worlds of ROS, and messages that went through their bytes."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from radarcore.adapters.ros.messages import DEFINITIONS

WORLDS = ("ROS 1", "ROS 2")


@cache
def typestore(world: str) -> Any:
    """Typestore of ROS 1 Noetic or ROS 2 Humble, with the definitions that it lacks."""
    typesys = pytest.importorskip("rosbags.typesys", reason="needs rosbags: pip install radarcore[ros]")
    stores = typesys.Stores
    store = typesys.get_typestore(stores.ROS1_NOETIC if world == "ROS 1" else stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        if name not in store.types:
            store.register(typesys.get_types_from_msg(text, name))
    return store


def through_bytes(world: str, message: Any, name: str | None = None) -> Any:
    """The message as a node receives it: written by rosbags and read again."""
    store, name = typestore(world), name or message.__msgtype__
    if world == "ROS 1":
        return store.deserialize_ros1(store.serialize_ros1(message, name), name)
    return store.deserialize_cdr(store.serialize_cdr(message, name), name)
