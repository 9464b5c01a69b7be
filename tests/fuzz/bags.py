"""Inputs of ROS bags, of all formats, whole and packed."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from fuzz.cases import HOSTILE_NUMBERS, Case, read_back


@cache
def bag_seeds() -> list[Case]:
    from ros_bags import write_bag, write_ros1_bag

    found = []
    for name, kind in (("take.mcap", "mcap"), ("take.db3", "sqlite3"), ("take.bag", "ros1")):
        with tempfile.TemporaryDirectory() as directory:
            path = Path(directory) / name
            write_ros1_bag(path, 2) if kind == "ros1" else write_bag(path, kind, 2)
            found.append(read_back(Path(directory)))
    return found


def make_bag(random: Random) -> Case:
    """A bag with other numbers and lengths."""
    ((name, whole),) = random.choice(bag_seeds()).items()
    data = bytearray(whole)
    for _ in range(random.choice((1, 1, 2, 4))):
        at, word = random.randrange(len(data) - 4), random.choice(HOSTILE_NUMBERS)
        data[at : at + len(word)] = word
    return {name: bytes(data)}


def read_bag(folder: Path) -> Any:
    from radarcore.adapters.ros.bags import BagReader

    with BagReader(next(folder.iterdir(), folder / "none")) as bag:
        return list(bag.messages())
