"""Truth and recordings of `radarcore compare`: motion capture in files of Motive and in bags, frames in bags."""

from __future__ import annotations

from pathlib import Path

from radarcore.adapters.optitrack.csv import read_motive_csv
from radarcore.adapters.ros.bags import BagReader, is_bag
from radarcore.adapters.ros.messages import nearest_nanoseconds
from radarcore.adapters.ros.motions import POSES, RIGID_BODIES, first_stamp_ns
from radarcore.adapters.ros.poses import pose_series, rigid_body_series
from radarcore.cli.source import only_radar, path_and_topic
from radarcore.motion.protocol import Motion

_LONGEST_GAP = 0.1
"""Bodies that motion capture does not see for longer have a gap [s]."""

_POSE = "pose"
"""Last part of topics that are called for a body: ``/natnet_ros/NAME/pose``."""


def name_of(text: str) -> str:
    """Name of a recording: the last part of its topic, or of its path."""
    path, topic = path_and_topic(text)
    return topic.rpartition("/")[2] if topic else path.resolve().stem


def motions_of(path: Path, reference: str) -> dict[str, Motion]:
    """Motions of the bodies that a take of Motive, or a bag, holds, by their names.

    Times of a bag are those of the frames of `reference`, if that is in the same bag; else they count from its first
    stamp.
    """
    if not is_bag(path):
        capture = read_motive_csv(path)
        seen = [name for name in capture.names if capture[name].is_tracked.sum() >= 2]
        return {name: capture.trajectory(name) for name in seen}
    with BagReader(path) as bag:
        of_frames, topic = path_and_topic(reference)
        is_same = is_bag(of_frames) and of_frames.resolve() == path.resolve()
        start = _start_of_frames(bag, topic or only_radar(bag)) if is_same else first_stamp_ns(bag)
        series = {}
        for found in bag.topics.values():
            messages = bag.messages(found.name)
            if found.type in POSES:
                series[_body_of(found.name)] = pose_series(messages)
            elif found.type in RIGID_BODIES:
                series |= rigid_body_series(messages)
        if not series:
            bag.only_topic(*POSES, *RIGID_BODIES, argument="--truth")  # says which topics there are
        return {name: one.trajectory(start, max_gap=_LONGEST_GAP) for name, one in series.items()}


def _body_of(topic: str) -> str:
    """Name of the body of a topic: the last part that is not ``pose``."""
    parts = [part for part in topic.split("/") if part]
    return parts[-2] if len(parts) > 1 and parts[-1] == _POSE else parts[-1]


def _start_of_frames(bag: BagReader, topic: str) -> int:
    """Stamp of time 0 of the frames on a topic [ns]."""
    name = bag.topic(f"{topic}/time").name
    first = next(iter(bag.messages(name)), None)
    if first is None:
        raise ValueError(f"{bag.path}, {topic}: expected at least one frame, got none")
    return first.time_ns - nearest_nanoseconds(float(first.message.data))
