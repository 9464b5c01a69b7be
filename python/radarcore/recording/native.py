"""Recordings on disk: a directory of plain NPY files, readable with `numpy.load`, or one .npz file.

- ``meta.json``: format, version, radar, source, units, planned number of frames, names of the bodies;
- ``cube.npy`` [frame, channel, chirp, sample], ``time.npy`` (frame,) [s];
- ``truth_range.npy``, ``truth_velocity.npy``, ``truth_azimuth.npy``, ``truth_elevation.npy`` (frame, body), where
  the truth is known;
- ``lost.npy`` (frame,), frames lost just before each, where they were counted.

A frame is written behind the others, file by file, and the counts in the headers are put right at the end. A
process killed on the way leaves its finished frames: a reader takes the whole frames that all files
have in common.
"""

from __future__ import annotations

import json
import os
import zipfile
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.output import Lock, check_folder_name, make_folder, new_file, replaces, write_text
from radarcore.radar.radar import Radar
from radarcore.recording.frame import (
    CUBE_TYPES,
    TRUTH_FIELDS,
    Frame,
    Kind,
    Truth,
    check_alike,
    frame_shape,
    kind_of,
    unit_of,
)
from radarcore.recording.npy import ArrayFile, GrowingFile, read_npz

FORMAT = "radarcore recording"
VERSION = 1
UNITS = {"cube": "sqrt(W)", "time": "s", "range": "m", "velocity": "m/s", "azimuth": "rad", "elevation": "rad"}
TRUTH_FILES = tuple(f"truth_{name}" for name in TRUTH_FIELDS)

_NPZ_NAMES = ("meta", "time", "cube")
"""Arrays that an .npz file has in any case."""

_DTYPES = dict.fromkeys(("time", *TRUTH_FILES), ("float64",)) | {"lost": ("int32",), "cube": CUBE_TYPES}
"""Names of the dtypes that the arrays may have."""


@dataclass(frozen=True, eq=False)
class Stored:
    """Content of a recording's file, unchecked; see `Recording`."""

    cube: NDArray[Any]
    time: NDArray[np.float64]
    radar: Radar
    truth: Truth | None = None
    source: dict[str, Any] = field(default_factory=dict)
    lost: NDArray[np.int32] | None = None


def save_npz(path: Path, stored: Stored, overwrite: bool) -> None:
    """Write one .npz file, whole or not at all."""
    meta = meta_text(stored.radar, stored.source, len(stored.cube), kind_of(stored.cube, stored.truth))
    arrays: dict[str, Any] = {"meta": meta, "cube": stored.cube, "time": stored.time, **truth_arrays(stored.truth)}
    if stored.lost is not None:
        arrays["lost"] = stored.lost
    with new_file(path, overwrite=overwrite) as part, part.open("wb") as file:
        np.savez(file, **arrays)


def load_directory(path: Path, mmap: bool) -> Stored:
    """The whole frames that all files of a directory have in common."""
    meta_path = path / "meta.json"
    if not meta_path.is_file():
        raise ValueError(f"{path}: expected a recording, got a directory without meta.json")
    meta = Meta.parse(meta_path.read_bytes(), str(meta_path))
    rows: dict[str, tuple[int, ...]] = {"time": ()}
    rows |= dict.fromkeys(() if meta.names is None else TRUTH_FILES, (len(meta.names or ()),))
    rows |= {"lost": ()} if (path / "lost.npy").is_file() else {}
    rows["cube"] = frame_shape(meta.radar)
    present = {name: path / f"{name}.npy" for name in rows if (path / f"{name}.npy").is_file()}
    files = {name: ArrayFile(file, rows[name], _DTYPES[name], "meta.json") for name, file in present.items()}

    # The cube's file is made last: without it there are no frames yet, unless it has been lost.
    if "cube" not in files and all(file.num_rows == 0 for file in files.values()):
        warn_of_missing(path, 0, meta.num_frames, closed=False)
        empty = np.zeros((0, *rows["cube"]), np.float32 if meta.radar.is_real else np.complex64)
        return Stored(empty, np.zeros(0), meta.radar, _truth_of(meta.names, {}, 0), meta.source)
    if missing := rows.keys() - files.keys():
        raise ValueError(f"{path}: expected a recording, got one without {sorted(missing)[0]}.npy")
    num_frames = min(file.num_rows for file in files.values() if file.num_rows is not None)
    closed = all(file.header_rows == num_frames for file in files.values())
    planned = max(file.header_rows for file in files.values()) if meta.num_frames is None else meta.num_frames
    warn_of_missing(path, num_frames, planned, closed or meta.num_frames is not None)

    arrays = {name: file.read(num_frames, mmap and name == "cube") for name, file in files.items()}
    truth = _truth_of(meta.names, arrays, num_frames)
    return Stored(arrays["cube"], arrays["time"], meta.radar, truth, meta.source, arrays.get("lost"))


def is_native(path: Path) -> bool:
    """True for an .npz file with the settings of a recording."""
    try:
        with zipfile.ZipFile(path) as archive:
            return "meta.npy" in archive.namelist()
    except (OSError, zipfile.BadZipFile, ValueError):
        return False


def load_npz(path: Path) -> Stored:
    """Content of an .npz file."""
    if not zipfile.is_zipfile(path):
        raise ValueError(f"{path}: expected a recording's directory or .npz file, got another or a damaged file")
    arrays = read_npz(path, ("meta", *_DTYPES))
    if missing := set(_NPZ_NAMES) - arrays.keys():
        raise ValueError(
            f"{path}: expected a recording with {', '.join(_NPZ_NAMES)}, got one without {sorted(missing)[0]}; for "
            "other arrays pass config=... or radar=..., --config FILE, and variable=..., --variable NAME"
        )
    meta = Meta.parse(str(arrays["meta"]).encode(), f"{path}, meta")
    if meta.names is not None and (missing := set(TRUTH_FILES) - arrays.keys()):
        raise ValueError(f"{path}: expected the truth its meta names, got a recording without {sorted(missing)[0]}")
    warn_of_missing(path, arrays["time"].size, None, closed=True)
    for name, dtypes in _DTYPES.items():
        if name in arrays and arrays[name].dtype.name not in dtypes:
            raise ValueError(f"{path}, {name}: expected {', '.join(dtypes)}, got {arrays[name].dtype}")
    with check.located(f"{path}, truth"):
        truth = _truth_of(meta.names, arrays, 0)
    return Stored(arrays["cube"], arrays["time"], meta.radar, truth, meta.source, arrays.get("lost"))


def format_of(path: Path) -> str:
    """Format by the suffix of the path."""
    if path.suffix in (".zarr", ".h5", ".hdf5", ".npy", ".mat"):
        raise ValueError(f"path: expected a directory or an .npz file, got {str(path)!r}")
    if path.suffix != ".npz":
        check_folder_name(path)
    # Any other name is a directory: dates and versions have dots.
    return "npz" if path.suffix == ".npz" else "directory"


def truth_arrays(truth: Truth | None) -> dict[str, NDArray[np.float64]]:
    """The truth's arrays by the names of their files."""
    return {} if truth is None else {f"truth_{name}": getattr(truth, name) for name in TRUTH_FIELDS}


def warn_of_missing(path: Path, num_frames: int, planned: int | None, closed: bool) -> None:
    """Warn of frames that its writer did not finish, and of a recording without any."""
    if planned is not None and num_frames < planned:
        message = f"{path}: {num_frames} of {planned} planned frames, its writer was interrupted"
    elif not closed:
        message = f"{path}: {num_frames} frames, its writer was interrupted"
    elif num_frames == 0:
        message = f"{path}: a recording without frames"
    else:
        return
    notice.warn(message)


def parsed_json(data: bytes | str, where: str) -> Any:
    """The value of a JSON text, or a ValueError that says where it is wrong."""
    with check.located(where):
        return json.loads(data)


def _truth_of(names: tuple[str, ...] | None, arrays: dict[str, NDArray[Any]], num_frames: int) -> Truth | None:
    if names is None:
        return None
    empty = np.zeros((num_frames, len(names)))
    return Truth(names, *(arrays.get(name, empty) for name in TRUTH_FILES))


@dataclass(frozen=True)
class Meta:
    """Content of meta.json."""

    radar: Radar
    source: dict[str, Any]
    num_frames: int | None
    names: tuple[str, ...] | None

    @classmethod
    def parse(cls, data: bytes, where: str) -> Meta:
        """Content of a text; a ValueError that begins with `where` for a damaged one."""
        values = parsed_json(data, where)
        if not isinstance(values, dict) or values.get("format") != FORMAT:
            got = values.get("format") if isinstance(values, dict) else type(values).__name__
            raise ValueError(f"{where}: expected format {FORMAT!r}, got {got!r}")
        if not isinstance(version := values.get("version"), int) or version > VERSION:
            raise ValueError(
                f"{where}: expected version {VERSION} (or older), got {version!r}; a newer radarcore wrote it"
            )
        with check.located(where):
            names, num_frames = values["truth"], values["num_frames"]
            return cls(
                radar=Radar.from_dict(values["radar"]),
                source=dict(values["source"]),
                num_frames=None if num_frames is None else check.count("num_frames", num_frames, 0),
                names=None if names is None else tuple(map(str, names)),
            )


def meta_text(radar: Radar, source: dict[str, Any], num_frames: int | None, kind: Kind | None) -> str:
    """Text of meta.json."""
    values = {
        "format": FORMAT,
        "version": VERSION,
        "radar": radar.to_dict(),
        "source": source,
        "units": UNITS | {"cube": source.get("cube_unit", UNITS["cube"])},
        "num_frames": num_frames,
        "truth": None if kind is None or kind[1] is None else list(kind[1]),
    }
    return json_text(values, "source", indent=2)


def json_text(values: dict[str, Any], name: str, **layout: Any) -> str:
    """JSON text of values, or an error that names the values that JSON cannot hold."""
    try:
        return json.dumps(values, allow_nan=False, **layout) + "\n"
    except (TypeError, ValueError) as error:
        raise type(error)(f"{name}: expected what JSON can hold ({error})") from error


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
    return replaces(path, _is_recording, "recording", overwrite)


def _is_recording(path: Path) -> bool:
    try:
        return bool(json.loads((path / "meta.json").read_bytes())["format"] == FORMAT)
    except (OSError, ValueError, KeyError, TypeError):
        return False
