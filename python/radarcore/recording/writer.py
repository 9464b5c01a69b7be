"""Recordings written frame by frame."""

from __future__ import annotations

import json
import os
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from radarcore import check
from radarcore.output import Lock, make_folder, replaces, write_text
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame, Kind, check_alike, frame_shape, kind_of, unit_of
from radarcore.recording.native import FORMAT, TRUTH_FILES, format_of, meta_text, truth_arrays
from radarcore.recording.npy import GrowingFile


class RecordingWriter:
    """Writes a recording's directory frame by frame, readable at any moment as far as it got.

    The directory and ``meta.json`` are made at once, so an unwritable place fails before any frame is computed.

    Parameters
    ----------
    path : path
        Directory to make (no suffix), with missing parents; an empty one may exist.
    radar : Radar
    num_frames : int, optional
        Planned number of frames; a reader of fewer is warned. More are refused.
    source : dict, optional
        Origin of the frames: anything JSON can hold. Without a ``cube_unit``, frames with the codes of
        an ADC make it full scale.
    overwrite : bool
        Replace a recording that is already there.

    Raises
    ------
    FileExistsError
        When `path` exists and is not a recording to be overwritten.
    BlockingIOError
        When another writer has locked the folder.
    OSError
        When the place cannot be written to.

    See Also
    --------
    Recording.load : Reads it, frame by frame too.
    Recording.save : Writes all at once.
    Simulator.record : Writes what it simulates with `path`.

    Examples
    --------
    >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c())
    >>> with rc.RecordingWriter("live", simulator.radar) as writer:
    ...     for time in (0.0, 0.025):
    ...         writer.append(simulator.frame(time))
    >>> len(rc.Recording.load("live"))
    2
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        radar: Radar,
        *,
        num_frames: int | None = None,
        source: dict[str, Any] | None = None,
        overwrite: bool = False,
    ) -> None:
        self.path: Path = Path(path)
        self.radar = radar
        self.num_frames: int | None = None if num_frames is None else check.count("num_frames", num_frames, 0)
        self.source: dict[str, Any] = dict(source or {})
        self._kind: Kind | None = None
        self._files: dict[str, GrowingFile] = {}
        self._written = 0
        self._last_time: float | None = None
        self._closed = False

        check.instance("radar", radar, Radar)
        meta = meta_text(radar, self.source, self.num_frames, None)
        check_room(self.path, overwrite)
        make_folder(self.path)
        self._lock = Lock(self.path)
        try:
            if check_room(self.path, overwrite):  # again: another writer may have finished meanwhile
                for name in ("cube", "time", "lost", *TRUTH_FILES):
                    (self.path / f"{name}.npy").unlink(missing_ok=True)
            write_text(self.path / "meta.json", meta, overwrite=True)
        except BaseException:
            self._lock.release()
            raise

    def append(self, frame: Frame) -> None:
        """Write one frame of the same radar, bodies and dtype as the first, after that before it.

        Raises
        ------
        OSError
            When it cannot be written (disk full); the frames before it stay readable.
        """
        if self._closed:
            raise ValueError(f"{self.path}: expected an open recording, got one that is closed")
        if self._written == self.num_frames:
            raise ValueError(f"{self.path}: expected num_frames = {self.num_frames} frames, got one more")
        check_alike("frame", frame, self.radar, self._kind)
        if self._last_time is not None:
            check.in_order("frame.time", np.array([self._last_time, frame.time]))
        num_lost = frame.lost_before
        try:
            if self._kind is None:
                if (unit := unit_of(frame)) is not None:
                    self.source.setdefault("cube_unit", unit)
                open_as(self, kind_of(frame.cube, frame.truth))
            if num_lost is not None and "lost" not in self._files:
                none_yet = np.zeros(self._written, np.int32)
                self._files["lost"] = GrowingFile(self.path / "lost.npy", none_yet.dtype, (), none_yet)
            arrays = {"time": np.asarray(frame.time), **truth_arrays(frame.truth)}
            if "lost" in self._files:
                arrays["lost"] = np.asarray(num_lost or 0)
            for name, values in (arrays | {"cube": frame.cube}).items():
                self._files[name].append(values)
            self._written, self._last_time = self._written + 1, frame.time
        except BaseException:  # a full disk, Ctrl-C: keep the whole frames
            self.close()
            raise

    def close(self) -> None:
        """Put the number of frames in the headers; drops what an interruption left of an unfinished frame."""
        if self._closed:
            return
        self._closed = True
        with ExitStack() as stack:  # every file is closed, even where one fails
            stack.callback(self._lock.release)
            for file in self._files.values():
                stack.callback(file.close, self._written)

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def open_as(writer: RecordingWriter, kind: Kind) -> None:
    """Make the array files, the cube last: where it is missing, no frame has been written."""
    dtype, names = kind
    text = meta_text(writer.radar, writer.source, writer.num_frames, kind)
    write_text(writer.path / "meta.json", text, overwrite=True)
    writer._files["time"] = GrowingFile(writer.path / "time.npy", np.dtype(np.float64), ())
    for name in () if names is None else TRUTH_FILES:
        writer._files[name] = GrowingFile(writer.path / f"{name}.npy", np.dtype(np.float64), (len(names or ()),))
    writer._files["cube"] = GrowingFile(writer.path / "cube.npy", dtype, frame_shape(writer.radar))
    writer._kind = kind


def check_room(path: Path, overwrite: bool) -> bool:
    """True when a recording is to be replaced at `path`; an error where none can be written."""
    if format_of(path) != "directory":
        raise ValueError(f"path: expected a directory (no suffix) to write frame by frame, got {str(path)!r}")
    return replaces(path, _is_native, "recording", overwrite)


def _is_native(path: Path) -> bool:
    try:
        return bool(json.loads((path / "meta.json").read_bytes())["format"] == FORMAT)
    except (OSError, ValueError, KeyError, TypeError):
        return False
