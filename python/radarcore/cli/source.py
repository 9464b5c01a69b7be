"""Recordings that commands take: by their path, and a file with their radar if they are bare."""

from __future__ import annotations

import argparse
from pathlib import Path

from radarcore.radar.radar import Radar
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


def _radar(path: Path, config: Path | None) -> Radar | None:
    if config is None and path.suffix == ".npy" and path.is_file():
        raise ValueError(f"{path}: expected --config with the radar of a bare .npy file, got none")
    return None if config is None else load_radar(config)
