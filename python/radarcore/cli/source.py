"""Recordings that commands take: by their path, and a description of bare ones."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Annotated

from cyclopts import Group, Parameter

from radarcore.adapters.ros.bags import BagReader, is_bag
from radarcore.adapters.ros.frames import SETTINGS_TYPE, BagFrames
from radarcore.recording.bare import NOTHING_SAID, Description
from radarcore.recording.recording import Recording, RecordingReader

AnyReader = RecordingReader | BagFrames
"""Frames that need not fit into memory."""

_SETTINGS = "/settings"


@Parameter(
    name="*", group=Group("Bare samples", sort_key=2, help="options of .npy and .mat files, raw files and captures")
)
@dataclass(frozen=True, kw_only=True)
class BareSamples:
    """Options that describe samples without a description of their own."""

    config: Annotated[
        Path | None,
        Parameter(
            metavar="FILE",
            help="their radar: a scene file (TOML, its table [radar]), the meta.json of a recording, or settings of a "
            "chip: config.json (Infineon), .mmwave.json, .setup.json, .cfg (TI)",
        ),
    ] = None

    shape: Annotated[str | None, Parameter(metavar="AXES")] = None
    """axes in the order of the file, as frame,rx,chirp,sample; frame,tx,rx,chirp,sample,iq"""

    dtype: Annotated[str | None, Parameter(metavar="TYPE")] = None
    """numbers of a raw file: int16, uint16, >i2, float32"""

    variable: Annotated[str | None, Parameter(metavar="NAME")] = None
    """array in a .mat or .npz file with several"""

    @property
    def description(self) -> Description:
        """Description that readers take."""
        return Description(**vars(self))


NOT_BARE = BareSamples()


def path_and_topic(source: str | PurePath) -> tuple[Path, str]:
    """Path, and topic of a bag or nothing."""
    # A Windows path has lost the slash of the topic; no topic of a bag follows the colon of its drive.
    text = source if isinstance(source, str) else source.as_posix()
    head, separator, tail = text.rpartition(":/")
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
