"""Recordings that commands take: by their path, and a file with their radar if they are bare."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame
from radarcore.recording.reader import RecordingReader
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import load_radar


def add_config(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--config``."""
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="radar of a bare .npy file: a scene file (TOML, its table [radar]), or the meta.json of a recording",
    )


def load_recording(path: Path, config: Path | None) -> Recording:
    """The recording at a path."""
    return Recording.load(path, radar=_radar(path, config))


def open_recording(path: Path, config: Path | None) -> RecordingReader:
    """The frames of the recording at a path, one by one."""
    return RecordingReader(path, radar=_radar(path, config))


def moving(reader: RecordingReader | Recording) -> Iterator[Frame]:
    """The frames without what stands still throughout: their mean over all chirps of the recording, taken off."""
    mean: NDArray[Any] | float = 0.0
    for frame in _frames(reader):
        mean = mean + frame.cube.mean(axis=1, keepdims=True, dtype=np.result_type(frame.cube, np.float64)) / len(reader)
    for frame in _frames(reader):
        yield replace(frame, cube=(frame.cube - mean).astype(frame.cube.dtype), raw=None)


def _frames(reader: RecordingReader | Recording) -> Iterator[Frame]:
    return iter(reader) if isinstance(reader, RecordingReader) else reader.frames()


def _radar(path: Path, config: Path | None) -> Radar | None:
    if config is None and path.suffix == ".npy" and path.is_file():
        raise ValueError(f"{path}: expected --config with the radar of a bare .npy file, got none")
    return None if config is None else load_radar(config)
