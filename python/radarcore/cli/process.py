"""The command `radarcore process`: detections and tracks of a recording, however long."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from radarcore import check, notice
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.frames import FrameWriter
from radarcore.adapters.ros.messages import nearest_nanoseconds
from radarcore.adapters.ros.scans import to_map_image, to_point_cloud, to_radar_scan
from radarcore.cli.options import AS_USUAL, Detecting, Flag, Json, Number, OutputFolder, Quiet, Source, SubtractMean
from radarcore.cli.sources import (
    WHOLE,
    AnyReader,
    Reading,
    beside,
    moving,
    path_and_topic,
    start_ns_of,
    subtracts_mean,
    tracker_for,
)
from radarcore.cli.terminal import show
from radarcore.output import Lock, check_file, make_folder, refuse_source
from radarcore.processing.detection.detect import detect
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.spectra.spectra import range_doppler
from radarcore.processing.tracking.tracker import Tracker
from radarcore.processing.tracking.tracks import TrackState
from radarcore.recording.frame import Frame
from radarcore.table import Table

_COORDINATES = {"range": "range", "velocity": "velocity", "azimuth_deg": "azimuth", "elevation_deg": "elevation"}
FILES = {
    "detections.csv": {"time": "time", **_COORDINATES, "snr_db": "snr_db"},
    "tracks.csv": {"time": "time", "track": "id", **_COORDINATES, "nearest": "nearest", "detected": "is_detected"},
}
"""Files of the results: columns after the number of the frame, and the attribute of a detection or track in each."""


@dataclass
class _Summary:
    """A confirmed track so far: frames, times [s], frames with a detection, and ranges [m]."""

    first_frame: int
    last_frame: int
    start: float
    stop: float
    hits: int
    nearest: float
    farthest: float

    def add(self, frame: int, state: TrackState) -> None:
        if state.is_detected:  # the part after that is no expectation if it ends so
            self.last_frame, self.stop, self.hits = frame, state.time, state.num_hits
            self.nearest, self.farthest = min(self.nearest, state.range), max(self.farthest, state.range)


def run(
    source: Source,
    /,
    *,
    output: OutputFolder = None,
    bag: Annotated[Path | None, Parameter(metavar="BAG")] = None,
    samples: Flag = False,
    overwrite: Flag = False,
    sequence: Number = 0,
    subtract_mean: SubtractMean = None,
    range_only: Flag = False,
    people: Flag = False,
    _quiet: Quiet = False,
    as_json: Json = False,
    detecting: Detecting = AS_USUAL,
    reading: Reading = WHOLE,
) -> None:
    """Detect and track frame by frame, write results as they come, and print a summary.

    Parameters
    ----------
    source : path
        recording, bag with one, BAG:/TOPIC, or bare samples with --config
    output : path
        directory for detections.csv and tracks.csv (default: NAME-results beside the source; none with --bag, --json)
    bag : path
        write detections and range-velocity maps into a ROS bag
    samples : bool
        put the samples into that bag as well
    overwrite : bool
        replace the results that are there
    sequence : int
        sub-sequence of radars with several
    range_only : bool
        track ranges and velocities, without angles
    people : bool
        track people: one track for each, none for things at rest
    """
    tracks: dict[int, _Summary] = {}
    num_detections = 0
    began = time.perf_counter()
    if samples and bag is None:
        raise ValueError("samples: expected --bag as well, got none")
    if bag is not None:
        refuse_source("bag", bag, path_and_topic(source)[0])
    if output is None and bag is None and not as_json:
        output = beside(source, "-results")
    with ExitStack() as files:
        reader = files.enter_context(reading.open(source))
        radars = reader.radar.sequences()
        radar = radars[check.index("sequence", sequence, len(radars))]
        for first in islice(reader, 1):
            detect(first.sequences()[sequence], **detecting.given)  # wrong settings are found before a file is made
        tables = _ResultFiles(output, overwrite, files) if output is not None else None
        messages = _ResultBag(bag, reader, samples, overwrite, files) if bag is not None else None
        removes = subtracts_mean(reader, subtract_mean)
        tracker = tracker_for(radar, 1 if range_only else None, "people" if people else "points")
        processed = _processed(reader, sequence, detecting.given, tracker, removes=removes)
        for index, frame, part, found, states in processed:
            num_detections += len(found)
            confirmed = [state for state in states if state.is_confirmed]
            for state in confirmed:
                new = _Summary(index, index, state.time, state.time, 0, state.range, state.range)
                tracks.setdefault(state.id, new).add(index, state)
            if tables is not None:
                tables.write(index, found, confirmed)
            if messages is not None:
                messages.write(frame, part, found)
    elapsed = time.perf_counter() - began

    duration = len(reader) * reader.radar.waveform.frame_interval  # of data
    summary = {
        "recording": str(source),
        "frames": len(reader),
        "detections": num_detections,
        "tracks": [{"track": number, **vars(track)} for number, track in sorted(tracks.items())],
        "seconds": elapsed,
        "real_time_factor": duration / elapsed,
    }
    if as_json:
        print(json.dumps(summary, indent=2))
        return
    show(f"{source}: {len(reader)} frames, {num_detections} detections, {len(tracks)} tracks")
    if tracks:
        show(_table(tracks))
    show(f"{elapsed:.1f} s, {duration / elapsed:.2g} x real time")
    if output is not None:
        show(" ".join(str(output / name) for name in FILES))
    if bag is not None:
        show(bag)


def _table(tracks: dict[int, _Summary]) -> Table:
    rows = [
        {
            "track": str(number),
            "from [s]": f"{track.start:.2f}",
            "to [s]": f"{track.stop:.2f}",
            "detected": str(track.hits),
            "nearest [m]": f"{track.nearest:.2f}",
            "farthest [m]": f"{track.farthest:.2f}",
        }
        for number, track in sorted(tracks.items())
    ]
    return Table(list(rows[0]), [list(row.values()) for row in rows], num_left=0)


def _processed(
    reader: AnyReader, sequence: int, chosen: dict[str, Any], tracker: Tracker, *, removes: bool
) -> Iterator[tuple[int, Frame, Frame, Detections, Sequence[TrackState]]]:
    """Index, frame, its processed part, detections and tracks of all frames, with a progress bar."""
    frames = zip(reader, moving(reader), strict=True) if removes else ((one, one) for one in reader)
    with notice.progress(frames, "processing", "frame", total=len(reader)) as counted:
        for index, (frame, filtered) in enumerate(counted):
            part = filtered.sequences()[sequence]
            found = detect(part, **chosen)
            yield index, frame, part, found, tracker.update(found)


class _ResultFiles:
    """Writes what was found into `FILES`: the rows of a frame are there before the next frame comes."""

    def __init__(self, directory: Path, overwrite: bool, files: ExitStack) -> None:
        for name in FILES:
            check_file(directory / name, overwrite=overwrite)
        make_folder(directory)
        files.enter_context(Lock(directory))
        self._files = {}
        for name, columns in FILES.items():
            file = (directory / name).open("w", encoding="utf-8", newline="\n")
            self._files[name] = files.enter_context(file)
            self._write_rows(name, [("frame", *columns)])

    def write(self, index: int, found: Detections, states: Sequence[TrackState]) -> None:
        """Write what was found in a frame."""
        for name, items in (("detections.csv", [found[k] for k in range(len(found))]), ("tracks.csv", states)):
            rows = [[_text(column, getattr(one, key)) for column, key in FILES[name].items()] for one in items]
            self._write_rows(name, [(str(index), *row) for row in rows])

    def _write_rows(self, name: str, rows: Iterable[Iterable[str]]) -> None:
        self._files[name].writelines(f"{','.join(row)}\n" for row in rows)
        self._files[name].flush()


def _text(column: str, value: Any) -> str:
    """A number of a column; empty if it is unknown."""
    number = np.asarray(np.rad2deg(value) if column.endswith("_deg") else value).item()
    return "" if np.isnan(number) else f"{number:.6g}"


_FRAME_ID = "radar"
_TOPIC = "/radar"


class _ResultBag:
    """Writes what was found in frame after frame into a bag, whose format its suffix says.

    ``/radar/scan`` (radar_msgs/RadarScan) and ``/radar/points`` (PointCloud2) are the detections, ``/radar/map`` is the
    range-velocity map [dB] of every radar that has one. Stamps of a recording from a bag go on from that one's.
    """

    def __init__(self, path: Path, reader: AnyReader, with_samples: bool, overwrite: bool, files: ExitStack) -> None:
        radar = reader.radar
        self._start_ns = start_ns_of(reader.source)
        self._bag = files.enter_context(BagWriter(path, overwrite=overwrite))
        self._frames: FrameWriter | None = None
        if with_samples:
            self._frames = FrameWriter(self._bag, radar, source=reader.source, start_ns=self._start_ns)
        for name, kind in (("scan", "radar_msgs/msg/RadarScan"), ("points", "sensor_msgs/msg/PointCloud2")):
            self._bag.add_topic(f"{_TOPIC}/{name}", kind)

    def write(self, frame: Frame, part: Frame, found: Detections) -> None:
        """Write a frame, and what was found in it or in the sub-sequence `part` of it."""
        if self._frames is not None:
            self._frames.append(frame)
        stamp = self._start_ns + nearest_nanoseconds(found.time)
        options: dict[str, Any] = {"frame_id": _FRAME_ID, "time_ns": stamp, "types": self._bag.types}
        waveform = part.radar.waveform
        if not waveform.is_cw and waveform.num_chirps > 1 and waveform.has_uniform_chirps:
            power = (np.abs(range_doppler(part)) ** 2).sum(axis=0)
            values = 10.0 * np.log10(np.maximum(power, np.finfo(np.float32).tiny))
            self._bag.write(f"{_TOPIC}/map", to_map_image(values, **options), stamp)
        self._bag.write(f"{_TOPIC}/scan", to_radar_scan(found, **options), stamp)
        self._bag.write(f"{_TOPIC}/points", to_point_cloud(found, **options), stamp)
