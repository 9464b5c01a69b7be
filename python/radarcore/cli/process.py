"""The command `radarcore process`: detections and tracks of a recording, however long."""

from __future__ import annotations

import argparse
import csv
import errno
import json
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from radarcore import check, notice
from radarcore.cli.source import AnyReader, open_recording
from radarcore.cli.static import moving, removes_static
from radarcore.processing.detection import detect
from radarcore.processing.point_cloud import Detections
from radarcore.processing.tracking import Tracker
from radarcore.processing.tracks import TrackState
from radarcore.recording.frame import Frame

FILES = ("detections.csv", "tracks.csv")
"""Files of the results."""

_OF_DETECTIONS = ("frame", "time", "range", "velocity", "azimuth_deg", "elevation_deg", "snr_db")
_OF_TRACKS = ("frame", "time", "track", "range", "velocity", "azimuth_deg", "elevation_deg", "detected")


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
        if state.is_detected:  # what it expects after that is no part of it if it ends so
            self.last_frame, self.stop, self.hits = frame, state.time, state.num_hits
            self.nearest, self.farthest = min(self.nearest, state.range), max(self.farthest, state.range)


def run(options: argparse.Namespace) -> int:
    """Detect and track frame by frame, write results as they come, and print a summary."""
    names = ("false_alarm_rate", "method", "min_range", "max_range")
    chosen = {name: value for name in names if (value := getattr(options, name)) is not None}
    tracks: dict[int, _Summary] = {}
    num_detections = 0
    began = time.perf_counter()
    if options.samples and options.bag is None:
        raise ValueError("--samples: expected --bag as well, got none")
    with ExitStack() as files:
        reader = files.enter_context(open_recording(options.source, options.config))
        write = _writers(options.output, options.overwrite, files) if options.output is not None else None
        bag = _bag(reader, options, files) if options.bag is not None else None
        for index, frame, part, found, states in _processed(reader, options, chosen):
            num_detections += len(found)
            believed = [state for state in states if state.is_confirmed]
            for state in believed:
                new = _Summary(index, index, state.time, state.time, 0, state.range, state.range)
                tracks.setdefault(state.id, new).add(index, state)
            if write is not None:
                write(index, found, believed)
            if bag is not None:
                bag.write(frame, part, found)
    elapsed = time.perf_counter() - began

    duration = len(reader) * reader.radar.waveform.frame_interval  # of data
    summary = {
        "recording": str(options.source),
        "frames": len(reader),
        "detections": num_detections,
        "tracks": [{"track": number, **vars(track)} for number, track in sorted(tracks.items())],
        "seconds": elapsed,
        "real_time_factor": duration / elapsed,
    }
    if options.json:
        print(json.dumps(summary, indent=2))
        return 0
    print(f"{options.source}: {len(reader)} frames, {num_detections} detections, {len(tracks)} tracks")
    if tracks:
        print("track  from [s]  to [s]  detected  nearest [m]  farthest [m]")
    for number, track in sorted(tracks.items()):
        print(
            f"{number:>5}  {track.start:>8.2f}  {track.stop:>6.2f}  {track.hits:>8}  {track.nearest:>11.2f}  "
            f"{track.farthest:>12.2f}"
        )
    print(f"{elapsed:.1f} s, {duration / elapsed:.2g} x real time")
    if options.output is not None:
        print(" ".join(str(options.output / name) for name in FILES))
    if options.bag is not None:
        print(options.bag)
    return 0


def _processed(
    reader: AnyReader, options: argparse.Namespace, chosen: dict[str, Any]
) -> Iterator[tuple[int, Frame, Frame, Detections, Sequence[TrackState]]]:
    """Index, frame, what was processed of it, detections and tracks of all frames, with a bar of the progress."""
    radars = reader.radar.sequences()
    sequence = check.index("sequence", options.sequence, len(radars))
    radar = radars[sequence]
    has_period = radar.waveform.num_chirps > 1 and radar.waveform.has_uniform_chirps
    tracker = Tracker(
        max_velocity=radar.max_velocity if has_period else None, num_dimensions=1 if options.range_only else None
    )
    removes = removes_static(reader, options.remove_static)
    frames = zip(reader, moving(reader), strict=True) if removes else ((one, one) for one in reader)
    with notice.progress(frames, "processing", "frame", total=len(reader)) as counted:
        for index, (frame, filtered) in enumerate(counted):
            part = filtered.sequences()[sequence]
            found = detect(part, **chosen)
            yield index, frame, part, found, tracker.update(found)


def _bag(reader: AnyReader, options: argparse.Namespace, files: ExitStack) -> Any:
    """Bag of the results."""
    from radarcore.cli.bag_results import ResultBag

    return ResultBag(
        options.bag,
        reader.radar,
        reader.source,
        with_samples=options.samples,
        overwrite=options.overwrite,
        files=files,
    )


def _writers(directory: Path, overwrite: bool, files: ExitStack) -> Any:
    """A function that writes the results of a frame; each is in the files before the next comes."""
    taken = [directory / name for name in FILES if (directory / name).exists()]
    if taken and not overwrite:
        raise FileExistsError(
            errno.EEXIST, "expected no such file, got results; overwrite=True replaces them", taken[0]
        )
    directory.mkdir(parents=True, exist_ok=True)
    opened = [files.enter_context((directory / name).open("w", newline="", encoding="utf-8")) for name in FILES]
    writers = [csv.writer(file, lineterminator="\n") for file in opened]
    for writer, header in zip(writers, (_OF_DETECTIONS, _OF_TRACKS), strict=True):
        writer.writerow(header)

    def write(index: int, found: Detections, states: list[TrackState]) -> None:
        for k in range(len(found)):
            angles = np.rad2deg([found.azimuth[k], found.elevation[k]])
            writers[0].writerow(
                [index, *_texts(found.time, found.range[k], found.velocity[k], *angles, found.snr_db[k])]
            )
        for state in states:
            angles = np.rad2deg([state.azimuth, state.elevation])
            values = _texts(state.range, state.velocity, *angles)
            writers[1].writerow([index, *_texts(state.time), state.id, *values, int(state.is_detected)])
        for file in opened:
            file.flush()

    return write


def _texts(*values: float) -> list[str]:
    """Numbers as text; empty for what is not known."""
    return ["" if np.isnan(value) else f"{value:.6g}" for value in values]
