"""Truth and recordings of `radarcore compare`: motion capture in files of Motive and in bags, frames in bags."""

from __future__ import annotations

from pathlib import Path

from radarcore.adapters.optitrack.motive_csv import read_motive_csv
from radarcore.adapters.ros.bag_motions import POSES, RIGID_BODIES, first_stamp_ns
from radarcore.adapters.ros.bags import BagReader, is_bag
from radarcore.adapters.ros.poses import pose_series, rigid_body_series
from radarcore.adapters.ros.raw_frames import SETTINGS_TYPE, BagFrames
from radarcore.adapters.ros.stamps import nearest_nanoseconds
from radarcore.cli.source import load_recording
from radarcore.motion.protocol import Motion
from radarcore.recording.recording import Recording

_LONGEST_GAP = 0.1
"""Bodies that motion capture does not see for longer have a gap [s]."""

_POSE = "pose"
"""Last part of topics that are called for a body: ``/natnet_ros/NAME/pose``."""

_SETTINGS = "/settings"


def recording_of(text: str) -> Recording:
    """The recording at a path, or the frames on a topic of a bag, ``BAG:/TOPIC``."""
    path, topic = _parts(text)
    if not is_bag(path):
        return load_recording(path, None)
    with BagReader(path) as bag:
        return BagFrames(bag, topic or _only_radar(bag)).recording()


def name_of(text: str) -> str:
    """Name of a recording: the last part of its topic, or of its path."""
    path, topic = _parts(text)
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
        of_frames, topic = _parts(reference)
        is_same = is_bag(of_frames) and of_frames.resolve() == path.resolve()
        start = _start_of_frames(bag, topic or _only_radar(bag)) if is_same else first_stamp_ns(bag)
        series = {}
        for found in bag.topics.values():
            messages = (one.message for one in bag.messages(found.name))
            if found.type in POSES:
                series[_body_of(found.name)] = pose_series(messages)
            elif found.type in RIGID_BODIES:
                series |= rigid_body_series(messages)
        if not series:
            bag.only_topic(*POSES, *RIGID_BODIES, argument="--truth")  # says which topics there are
        return {name: one.trajectory(start, max_gap=_LONGEST_GAP) for name, one in series.items()}


def _parts(text: str) -> tuple[Path, str]:
    """Path, and topic of a bag or nothing."""
    head, separator, tail = text.rpartition(":/")
    return (Path(head), f"/{tail}") if separator and is_bag(Path(head)) else (Path(text), "")


def _only_radar(bag: BagReader) -> str:
    """Topic of the only radar in a bag, or an error with those that there are."""
    found = sorted(
        name.removesuffix(_SETTINGS)
        for name, topic in bag.topics.items()
        if topic.type == SETTINGS_TYPE and name.endswith(_SETTINGS)
    )
    if not found:
        raise ValueError(f"{bag.path}: expected a bag with frames of a radar, got none; there are {_topics(bag)}")
    if len(found) > 1:
        raise ValueError(f"{bag.path}: expected {bag.path}:TOPIC with frames of a radar, of {', '.join(found)}")
    return found[0]


def _topics(bag: BagReader) -> str:
    return ", ".join(f"{topic.name} ({topic.type})" for topic in bag.topics.values()) or "no topics"


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
