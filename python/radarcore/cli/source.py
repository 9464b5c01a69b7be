"""Recordings that commands take: by their path, and a description of bare ones."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from radarcore.adapters.ros.bags import BagReader, is_bag
from radarcore.adapters.ros.raw_frames import SETTINGS_TYPE, BagFrames
from radarcore.recording.description import NOTHING_SAID, Description
from radarcore.recording.reader import RecordingReader
from radarcore.recording.recording import Recording

AnyReader = RecordingReader | BagFrames
"""Frames that need not fit into memory."""

_SETTINGS = "/settings"


class _Describe(argparse.Action):
    """Option that fills the field of its name in the `Description` under ``config``."""

    def __call__(
        self,
        _: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        name = (option_string or "").lstrip("-")
        setattr(namespace, self.dest, replace(getattr(namespace, self.dest), **{name: values}))


def add_config(parser: argparse.ArgumentParser) -> None:
    """Add the options of bare samples; all of them are a `Description` in ``options.config``."""
    bare = parser.add_argument_group("bare samples", "options of .npy and .mat files, raw files and captures")
    for name, kind, metavar, text in (
        (
            "config",
            Path,
            "FILE",
            "their radar: a scene file (TOML, its table [radar]), the meta.json of a recording, or settings of a chip: "
            "config.json (Infineon), .mmwave.json, .setup.json, .cfg (TI)",
        ),
        ("shape", str, "AXES", "axes in the order of the file, as frame,rx,chirp,sample; frame,tx,rx,chirp,sample,iq"),
        ("dtype", str, "TYPE", "numbers of a raw file: int16, uint16, >i2, float32"),
        ("variable", str, "NAME", "array of a .mat file, of several"),
    ):
        bare.add_argument(
            f"--{name}", dest="config", action=_Describe, type=kind, metavar=metavar, default=NOTHING_SAID, help=text
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


def load_recording(source: Path, config: Description = NOTHING_SAID) -> Recording:
    """The recording at a path, or the frames of a bag, ``BAG`` or ``BAG:/TOPIC``."""
    path, topic = path_and_topic(source)
    if is_bag(path) and not config.given:
        with BagReader(path) as bag:
            return BagFrames(bag, topic or only_radar(bag)).recording()
    return Recording.load(path, **vars(config))


@contextmanager
def open_recording(source: Path, config: Description = NOTHING_SAID) -> Iterator[AnyReader]:
    """The frames of the recording at a path, or of a bag, ``BAG`` or ``BAG:/TOPIC``, one by one."""
    path, topic = path_and_topic(source)
    if is_bag(path) and not config.given:
        with BagReader(path) as bag:
            yield BagFrames(bag, topic or only_radar(bag))
    else:
        yield RecordingReader(path, **vars(config))


def _topics(bag: BagReader) -> str:
    return ", ".join(f"{topic.name} ({topic.type})" for topic in bag.topics.values()) or "no topics"
