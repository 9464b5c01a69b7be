"""Facts that `radarcore info` prints of a folder of several recordings, or of the sensors of one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from radarcore.cli.measured import measured_facts
from radarcore.recording.bare import NOTHING_SAID, Description
from radarcore.recording.recording import RecordingReader


def folder_facts(path: Path, found: list[Path], config: Description) -> dict[str, Any]:
    """Names of the recordings with a line of what is in each, or of what it lacks."""
    return {"folder": str(path), "recordings": {place.name: _line(place, config) for place in found}}


def _line(place: Path, config: Description) -> str:
    try:
        reader = _reader(place, config)
    except (ValueError, TypeError, OSError, ImportError) as error:
        return str(error).splitlines()[0].removeprefix(f"{place}: ")
    num_frames, *row = reader.shape
    wf = reader.radar.waveform
    seconds = float(reader.time[-1] - reader.time[0]) + wf.frame_interval if num_frames else 0.0
    sensor = f", {text}" if (text := measured_facts(reader.source).get("sensor")) else ""
    shape = " x ".join(map(str, row))
    return f"{num_frames} frames of {shape}, {seconds:.3g} s, {wf.start_frequency * 1e-9:.6g} GHz{sensor}"


def _reader(place: Path, config: Description) -> RecordingReader:
    """Reader of a recording, with the description if it is bare."""
    try:
        return RecordingReader(place, **vars(NOTHING_SAID))
    except (ValueError, TypeError):
        if not config.given or place.is_dir() or place.suffix == ".npz":
            raise
        return RecordingReader(place, **vars(config))
