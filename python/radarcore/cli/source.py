"""Recordings that commands take: by their path, and a file with their radar if they are bare."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from radarcore.adapters.ros.bags import BagReader, is_bag
from radarcore.adapters.ros.raw_frames import SETTINGS_TYPE, BagFrames
from radarcore.radar.radar import Radar
from radarcore.recording.reader import RecordingReader
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import load_radar

AnyReader = RecordingReader | BagFrames
"""Frames that need not fit into memory."""

_SETTINGS = "/settings"


def add_config(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--config``."""
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="radar of a bare .npy file: a scene file (TOML, its table [radar]), or the meta.json of a recording",
    )


def path_and_topic(source: str | Path) -> tuple[Path, str]:
    """Path, and topic of a bag or nothing."""
    head, separator, tail = str(source).rpartition(":/")
    return (Path(head), f"/{tail}") if separator and is_bag(Path(head)) else (Path(source), "")


def only_radar(bag: BagReader) -> str:
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


def load_recording(source: Path, config: Path | None) -> Recording:
    """The recording at a path, or the frames of a bag, ``BAG`` or ``BAG:/TOPIC``."""
    path, topic = path_and_topic(source)
    if is_bag(path) and config is None:
        with BagReader(path) as bag:
            return BagFrames(bag, topic or only_radar(bag)).recording()
    return Recording.load(path, radar=_radar(path, config))


@contextmanager
def open_recording(source: Path, config: Path | None) -> Iterator[AnyReader]:
    """The frames of the recording at a path, or of a bag, ``BAG`` or ``BAG:/TOPIC``, one by one."""
    path, topic = path_and_topic(source)
    if is_bag(path) and config is None:
        with BagReader(path) as bag:
            yield BagFrames(bag, topic or only_radar(bag))
    else:
        yield RecordingReader(path, radar=_radar(path, config))


def _topics(bag: BagReader) -> str:
    return ", ".join(f"{topic.name} ({topic.type})" for topic in bag.topics.values()) or "no topics"


def _radar(path: Path, config: Path | None) -> Radar | None:
    if config is None and path.suffix == ".npy" and path.is_file():
        raise ValueError(f"{path}: expected --config with the radar of a bare .npy file, got none")
    return None if config is None else load_radar(config)
