"""Recordings that commands take: by their path, a description of bare ones, and their frames without static echoes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path, PurePath
from typing import Annotated, Any

import numpy as np
from cyclopts import Group, Parameter
from numpy.typing import NDArray

from radarcore import check
from radarcore.adapters.ros.bags import BagReader, is_bag
from radarcore.adapters.ros.frames import FRAME_TYPE, BagFrames
from radarcore.cli.options import OPTIONS, Seconds, given
from radarcore.processing.clutter.static import has_offsets, without_offset
from radarcore.processing.inputs import with_samples
from radarcore.processing.tracking.tracker import Tracker
from radarcore.radar.radar import Radar
from radarcore.recording.bare import Description
from radarcore.recording.frame import Frame, is_of_adc
from radarcore.recording.recording import Recording

AnyReader = Recording | BagFrames
"""Frames that need not fit into memory."""


_BARE = Group("Bare samples", sort_key=2, help="options of .npy and .mat files, raw files and captures")


@Parameter(name="*", group=_BARE)
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

    iq_order: Annotated[str | None, Parameter(metavar="IQ|QI")] = None
    """which of I and Q comes first in a capture of TI (default: by its configuration)"""

    @property
    def description(self) -> Description:
        """Description that readers take."""
        return Description(None, self.config, self.shape, self.dtype, self.variable, self.iq_order)

    @contextmanager
    def open(self, source: Path) -> Iterator[AnyReader]:
        """The frames of the recording at a path, or of a bag, ``BAG`` or ``BAG:/TOPIC``, one by one."""
        (path, topic), described = path_and_topic(source), self.description
        if is_bag(path) and not described.given:
            with BagReader(path) as bag:
                yield self._part_of(BagFrames(bag, topic or only_radar(bag)))
        elif (path / "zarr.json").is_file() and not described.given:
            yield self._part_of(_only_sample(path))
        else:
            yield self._part_of(Recording.load(path, **vars(described)))

    def load(self, source: Path) -> Recording:
        """The recording at a path, the frames of a bag, ``BAG`` or ``BAG:/TOPIC``, or of a dataset of one sample."""
        with self.open(source) as frames:
            return frames if isinstance(frames, Recording) else frames.recording()

    def _part_of(self, frames: AnyReader) -> AnyReader:
        """The frames to read: all."""
        return frames


NOT_BARE = BareSamples()


@Parameter(name="*", group=_BARE)
@dataclass(frozen=True, kw_only=True)
class Reading(BareSamples):
    """Options of commands that read recordings: a description of bare samples, and frames by their time."""

    start: Annotated[Seconds, Parameter(allow_leading_hyphen=True, group=OPTIONS)] = None
    """first time of a recording's frames that counts, by the clock of the recording (default: its first frame)"""

    duration: Annotated[Seconds, Parameter(group=OPTIONS)] = None
    """seconds from there on (default: to its last frame)"""

    def refuse(self, source: str | Path, kind: str = "a scene file") -> None:
        """Refuse these options beside anything but a recording."""
        if got := ", ".join(f"--{name}" for name in given(**vars(self))):
            raise ValueError(f"{source}: expected no option of recordings with {kind}, got {got}")

    def _part_of(self, frames: AnyReader) -> AnyReader:
        """The frames that begin within the span; of a bag, these are in memory."""
        if self.start is None and self.duration is None:
            return frames
        if self.duration is not None:
            check.positive("duration", self.duration, "s")
        first = next((frame.time for frame in frames), 0.0) if self.start is None else self.start
        stop = math.inf if self.duration is None else first + self.duration
        low, high = first - _ROUNDING, stop - _ROUNDING
        part: Recording | None = None
        if isinstance(frames, Recording):
            part = frames[slice(*np.searchsorted(frames.time, (low, high)).tolist())]
        elif chosen := [one for one in takewhile(lambda frame: frame.time < high, frames) if one.time >= low]:
            part = Recording.from_frames(chosen, frames.source)
        if not part:
            name = "duration" if self.start is None else "start"
            raise ValueError(f"{name}: expected times with frames, got {first:.12g} to {stop:.12g} s, which have none")
        return part


WHOLE = Reading()

_ROUNDING = 1e-9
"""Tolerance of sums of times [s]."""


def path_and_topic(source: str | PurePath) -> tuple[Path, str]:
    """Path, and topic of a bag or nothing."""
    # A Windows path has lost the slash of the topic; no topic of a bag follows the colon of its drive.
    text = source if isinstance(source, str) else source.as_posix()
    head, separator, tail = text.rpartition(":/")
    return (Path(head), f"/{tail}") if separator and is_bag(Path(head)) else (Path(source), "")


def is_board(source: Path) -> bool:
    """True for the port of a board or a ``capture:``; ``COM3`` is a port, ``COMPLETE`` a file."""
    name = source.as_posix()
    is_port = name.startswith(("usb:", "/dev/", "capture:")) or re.fullmatch(r"COM\d+", name, re.IGNORECASE)
    return bool(is_port) or source.is_char_device()


def beside(source: Path, ending: str = "") -> Path:
    """Default path of a result: beside its source, or its bag, with the name of that."""
    path = path_and_topic(source)[0]
    path = path if path.name not in ("", "..") else path.resolve()
    return path.with_name(f"{path.name if path.is_dir() else path.stem}{ending}")


def only_radar(bag: BagReader) -> str:
    """Topic of the only radar in a bag, or an error that lists all radars."""
    found = [topic.name for topic in bag.topics.values() if topic.type == FRAME_TYPE]
    if not found:
        raise ValueError(f"{bag.path}: expected a bag with frames of a radar, got none; there are {_topics(bag)}")
    if len(found) > 1:
        raise ValueError(f"{bag.path}: expected {bag.path}:TOPIC with frames of a radar, of {', '.join(found)}")
    return found[0]


def _only_sample(path: Path) -> Recording:
    """The recording of the only sample of a dataset."""
    from radarcore.dataset.reading import open_dataset  # takes longer to load than the rest

    if (count := len(dataset := open_dataset(path))) != 1:
        raise ValueError(
            f"{path}: expected a recording, or a dataset of one sample, got {count} samples; radarcore info "
            "summarises it, Dataset.recording gives one of them"
        )
    return dataset.recording(0)


def _topics(bag: BagReader) -> str:
    return ", ".join(f"{topic.name} ({topic.type})" for topic in bag.topics.values()) or "no topics"


def start_ns_of(source: dict[str, Any]) -> int:
    """Stamp of time 0 of frames whose source is a bag [ns]; else 0."""
    origin = source.get("bag")
    return int(origin.get("start_ns", 0)) if isinstance(origin, dict) else 0


def subtracts_mean(frames: AnyReader, chosen: bool | None) -> bool:
    """True when static echoes are to be removed: as chosen; else of frames that an ADC measured, more than a chirp.

    They have no truth; simulated ones have, and in these what stands still was put there.
    """
    if chosen is not None:
        return chosen
    first = next(iter(frames), None)
    if first is None or first.truth is not None or not is_of_adc(first):
        return False
    return len(frames) * first.radar.num_chirps > 1


def moving(frames: AnyReader) -> Iterator[Frame]:
    """The frames without static echoes: minus their mean over all chirps of the recording.

    Of an ADC's samples the offset of every chirp goes too, which differs a little from the next one's.
    """
    mean = _mean(frames)
    for frame in frames:
        yield _without(frame, mean)


def moving_frame(recording: Recording, index: int) -> Frame:
    """One of the frames that `moving` gives."""
    return _without(recording[index], _mean(recording))


def _without(frame: Frame, mean: NDArray[Any] | float) -> Frame:
    """A frame without the mean of all and offsets."""
    moving = frame.cube - mean
    if has_offsets(frame):
        moving = without_offset(moving)
    return with_samples(frame, moving.astype(frame.cube.dtype), frame.radar)


def _mean(frames: AnyReader) -> NDArray[Any] | float:
    """Mean of all chirps, (channel, 1, sample)."""
    mean: NDArray[Any] | float = 0.0
    for frame in frames:
        mean = mean + frame.cube.mean(axis=1, keepdims=True, dtype=np.result_type(frame.cube, np.float64)) / len(frames)
    return mean


def tracker_for(radar: Radar, num_dimensions: int | None = None, targets: str = "points") -> Tracker:
    """Tracker that knows how velocities of the radar fold."""
    period = 2.0 * radar.max_velocity if radar.waveform.has_uniform_chirps else None
    return Tracker(targets=targets, velocity_ambiguity=period, num_dimensions=num_dimensions)
