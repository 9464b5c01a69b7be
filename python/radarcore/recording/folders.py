"""Folders of several recordings: what is in them."""

from __future__ import annotations

from pathlib import Path

from radarcore.recording import infineon
from radarcore.recording.configuration import is_setup

_FILES = (".npz", ".npy", ".mat", ".bin")
"""Suffixes of files with samples."""

_MANY = 8
"""Names that a message has at most."""


def recordings_in(path: Path) -> list[Path]:
    """Recordings that lie in a folder that is none itself, or the sensors of one, in the order of their names."""
    if not path.is_dir() or is_one(path):
        return []
    if sensors := infineon.sensor_folders(path):
        return [path / name for name in sensors] if len(sensors) > 1 else []
    return sorted(place for place in path.iterdir() if _is_recording(place))


def is_one(path: Path) -> bool:
    """True for a folder that is a recording of one sensor, even if a part of it is missing."""
    is_native = any((path / name).is_file() for name in ("meta.json", "cube.npy"))
    return (is_native or infineon.is_recording(path)) and len(infineon.sensor_folders(path)) <= 1


def refuse_several(path: Path) -> None:
    """Refuse a folder with recordings in it, which does not say which of them is meant; of sensors others do."""
    found = recordings_in(path)
    if found and not infineon.sensor_folders(path):
        names = [place.name for place in found]
        listed = ", ".join(names[:_MANY]) + (f" and {len(names) - _MANY} more" if len(names) > _MANY else "")
        raise ValueError(
            f"{path}: expected one recording, got a folder with {listed}; give one of these, as {found[0]} "
            "(radarcore info describes them)"
        )


def _is_recording(place: Path) -> bool:
    if place.is_dir():
        return (place / "meta.json").is_file() or infineon.is_recording(place)
    return place.suffix.lower() in _FILES or is_setup(place)
