"""Frames and recordings: beat signals with their radar, times and truth, in memory and on disk.

On disk a recording is a directory of plain NPY files, readable with `numpy.load`:

- ``meta.json``: format, version, radar, source, units, planned number of frames, names of the bodies;
- ``cube.npy`` [frame, channel, chirp, sample], ``time.npy`` (frame,) [s];
- ``truth_range.npy``, ``truth_velocity.npy``, ``truth_azimuth.npy``, ``truth_elevation.npy`` (frame, body), where
  the truth is known.

A frame is written behind the others, file by file, and the counts in the headers are put right at the end. A
process killed on the way leaves the frames it had finished: whoever reads takes the whole frames that all files
have in common.
"""

from __future__ import annotations

import errno
import json
import os
import warnings
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar import Radar

FORMAT = "radarcore recording"
VERSION = 1
TRUTH_FIELDS = ("range", "velocity", "azimuth", "elevation")
UNITS = {"cube": "sqrt(W)", "time": "s", "range": "m", "velocity": "m/s", "azimuth": "rad", "elevation": "rad"}
_CUBE_TYPES = ("float32", "float64", "complex64", "complex128")
_TRUTH_FILES = tuple(f"truth_{name}" for name in TRUTH_FIELDS)

Kind = tuple[np.dtype[Any], tuple[str, ...] | None]
"""Dtype of the cube and names of the bodies (None: no truth): what all frames of a recording share."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Where the bodies really were, seen from the radar; NaN where a body was not visible.

    Parameters
    ----------
    names : tuple of str
        One per body.
    range : (body,) or (frame, body) array_like
        Distance from the centre of the array [m].
    velocity : (body,) or (frame, body) array_like
        Range rate, receding positive [m/s].
    azimuth, elevation : (body,) or (frame, body) array_like
        Angles [rad], positive to the left and up.
    """

    names: tuple[str, ...]
    range: NDArray[np.float64]
    velocity: NDArray[np.float64]
    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]

    def __post_init__(self) -> None:
        if isinstance(self.names, str):
            raise TypeError(f"names: expected one name per body, got the text {self.names!r}")
        object.__setattr__(self, "names", tuple(map(str, self.names)))
        shape = np.shape(self.range)
        if len(shape) not in (1, 2) or shape[-1] != len(self.names):
            bodies = len(self.names)
            raise ValueError(f"range: expected shape ({bodies},) or (frame, {bodies}) as names, got {shape}")
        for name in TRUTH_FIELDS:
            try:
                values = np.asarray(getattr(self, name), dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise TypeError(f"{name}: expected numbers of shape {shape}, got {getattr(self, name)!r}") from error
            if values.shape != shape:
                raise ValueError(f"{name}: expected shape {shape} as range, got {values.shape}")
            object.__setattr__(self, name, values)

    def select(self, names: Sequence[str]) -> Truth:
        """The truth of some bodies only, in the order of `names`; KeyError for a name that is not there."""
        if missing := [name for name in names if name not in self.names]:
            raise KeyError(f"no truth of {', '.join(map(repr, missing))}; there is {', '.join(self.names)}")
        columns = [self.names.index(name) for name in names]
        kept = (a[..., columns] for a in (self.range, self.velocity, self.azimuth, self.elevation))
        return Truth(tuple(names), *kept)

    def __getitem__(self, frame_index: int) -> Truth:
        """Truth of one frame of a recording."""
        return Truth(self.names, *(getattr(self, name)[frame_index] for name in TRUTH_FIELDS))


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of samples, simulated or measured.

    Parameters
    ----------
    cube : (channel, chirp, sample) complex64, complex128, float32 or float64
        Beat signal, I/Q or real.
    time : float
        Start of the first chirp [s].
    radar : Radar
    truth : Truth, optional
        Of this frame: arrays (body,).
    stats : dict
        Counts of the simulation; not written to files.
    """

    cube: NDArray[Any]
    time: float
    radar: Radar
    truth: Truth | None = None
    stats: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_radar(self.radar)
        object.__setattr__(self, "cube", _checked_cube(self.cube, _frame_shape(self.radar)))
        object.__setattr__(self, "time", check.number("time", self.time, "s"))
        _check_truth(self.truth, ())


@dataclass(frozen=True, eq=False)
class Recording:
    """Frames of one radar.

    Parameters
    ----------
    cube : (frame, channel, chirp, sample) complex64, complex128, float32 or float64
        Beat signal, I/Q or real.
    time : (frame,) array_like
        Start of every frame [s].
    radar : Radar
    truth : Truth, optional
        Arrays (frame, body).
    source : dict
        Where the frames come from: anything JSON can hold. ``cube_unit`` is the unit of the samples, if not
        sqrt(W).
    """

    cube: NDArray[Any]
    time: NDArray[np.float64]
    radar: Radar
    truth: Truth | None = None
    source: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_radar(self.radar)
        object.__setattr__(self, "cube", _checked_cube(self.cube, (None, *_frame_shape(self.radar))))
        object.__setattr__(self, "time", check.array("time", self.time, (len(self.cube),)))
        _check_truth(self.truth, (len(self.cube),))

    def __len__(self) -> int:
        return len(self.cube)

    def __getitem__(self, frame_index: int) -> Frame:
        """Frame at an index; negative ones count from the end. Its cube is a view."""
        if not -len(self) <= (index := check.count("frame_index", frame_index, -(2**63))) < len(self):
            raise IndexError(f"frame_index: expected an index into {len(self)} frames, got {frame_index}")
        truth = None if self.truth is None else self.truth[index]
        return Frame(self.cube[index], float(self.time[index]), self.radar, truth)

    def frames(self) -> Iterator[Frame]:
        """The frames in order, one at a time."""
        for index in range(len(self)):
            yield self[index]

    @classmethod
    def from_frames(cls, frames: Iterable[Frame], source: dict[str, Any] | None = None) -> Recording:
        """Recording of frames of one radar with the same bodies and dtype."""
        kept = list(frames)
        if not kept:
            raise ValueError("frames: expected at least one frame, got none")
        first, truth = kept[0], None
        _check_frame("frames[0]", first)
        for index, frame in enumerate(kept):
            _check_alike(f"frames[{index}]", frame, first.radar, _kind(first.cube, first.truth))
        if first.truth is not None:
            rows = ([getattr(frame.truth, name) for frame in kept] for name in TRUTH_FIELDS)
            truth = Truth(first.truth.names, *map(np.stack, rows))
        times = np.array([frame.time for frame in kept])
        return cls(np.stack([frame.cube for frame in kept]), times, first.radar, truth, dict(source or {}))

    def save(self, path: str | os.PathLike[str], format: str | None = None, *, overwrite: bool = False) -> None:
        """Write to disk.

        Parameters
        ----------
        path : path
            A directory (no suffix) or an ``.npz`` file; missing parents are made.
        format : "npz", optional
            Default: by the suffix of `path`.
        overwrite : bool
            Replace a recording that is already there.

        Raises
        ------
        FileExistsError
            When `path` exists and is not a recording to be overwritten.
        OSError
            When the place cannot be written to.
        """
        path = Path(path)
        if _format(path, format) == "npz":
            self._save_npz(path, overwrite)
            return
        with RecordingWriter(path, self.radar, num_frames=len(self), source=self.source, overwrite=overwrite) as writer:
            writer._open(_kind(self.cube, self.truth))  # also where there are no frames
            for frame in self.frames():
                writer.append(frame)

    def _save_npz(self, path: Path, overwrite: bool) -> None:
        if path.is_dir() or (path.exists() and not overwrite):
            raise _exists(path, "a directory" if path.is_dir() else "a file; overwrite=True replaces it")
        meta = _meta_text(self.radar, self.source, len(self), _kind(self.cube, self.truth))
        arrays: dict[str, Any] = {"meta": meta, "cube": self.cube, "time": self.time, **_truth_arrays(self.truth)}
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(path.name + ".part")
        try:
            with _naming(path), partial.open("wb") as file:
                np.savez(file, **arrays)
            partial.replace(path)
        finally:
            if partial.is_file():
                partial.unlink()

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, mmap: bool = True) -> Recording:
        """Read from disk; warns when frames are missing because the writer was interrupted.

        Parameters
        ----------
        path : path
            A recording's directory, or an ``.npz`` file.
        mmap : bool
            Leave the cube of a directory on disk and map it into memory, read-only.

        Raises
        ------
        FileNotFoundError
            When there is nothing at `path`.
        ValueError
            When it is not a recording, of a newer version, damaged, or the arrays do not fit the radar.
        """
        path = Path(path)
        if path.is_dir():
            return _load_directory(path, mmap)
        if path.exists():
            return _load_npz(path)
        raise FileNotFoundError(errno.ENOENT, "no such recording", str(path))


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
        Where the frames come from: anything JSON can hold.
    overwrite : bool
        Replace a recording that is already there.

    Raises
    ------
    FileExistsError
        When `path` exists and is not a recording to be overwritten.
    OSError
        When the place cannot be written to.
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
        self.path = Path(path)
        self.radar = radar
        self.num_frames = None if num_frames is None else check.count("num_frames", num_frames, 0)
        self.source = dict(source or {})
        self._kind: Kind | None = None
        self._files: dict[str, _GrowingFile] = {}
        self._written = 0
        self._closed = False

        _check_radar(radar)
        if _format(self.path, None) != "directory":
            raise ValueError(f"path: expected a directory (no suffix) to write frame by frame, got {str(path)!r}")
        meta = _meta_text(radar, self.source, self.num_frames, None)
        _make_room(self.path, overwrite)
        _write_whole(self.path / "meta.json", meta.encode())

    def append(self, frame: Frame) -> None:
        """Write one frame of the same radar, bodies and dtype as the first.

        Raises
        ------
        OSError
            When it cannot be written (disk full); the frames before it stay readable.
        """
        if self._closed:
            raise ValueError(f"{self.path}: expected an open recording, got one that is closed")
        if self._written == self.num_frames:
            raise ValueError(f"{self.path}: expected num_frames = {self.num_frames} frames, got one more")
        _check_alike("frame", frame, self.radar, self._kind)
        if self._kind is None:
            self._open(_kind(frame.cube, frame.truth))
        arrays = {"time": np.asarray(frame.time), **_truth_arrays(frame.truth), "cube": frame.cube}
        try:
            for name, values in arrays.items():
                self._files[name].append(values)
            self._written += 1
        except BaseException:  # a full disk, Ctrl-C: keep the whole frames
            self.close()
            raise

    def _open(self, kind: Kind) -> None:
        """Make the array files, the cube last: where it is missing, no frame has been written."""
        dtype, names = kind
        _write_whole(self.path / "meta.json", _meta_text(self.radar, self.source, self.num_frames, kind).encode())
        self._files["time"] = _GrowingFile(self.path / "time.npy", np.dtype(np.float64), ())
        for name in () if names is None else _TRUTH_FILES:
            self._files[name] = _GrowingFile(self.path / f"{name}.npy", np.dtype(np.float64), (len(names or ()),))
        self._files["cube"] = _GrowingFile(self.path / "cube.npy", dtype, _frame_shape(self.radar))
        self._kind = kind

    def close(self) -> None:
        """Put the number of frames in the headers; drops what an interruption left of an unfinished frame."""
        if self._closed:
            return
        self._closed = True
        with ExitStack() as stack:  # every file is closed, even where one fails
            for file in self._files.values():
                stack.callback(file.close, self._written)

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class _GrowingFile:
    """An NPY file that grows along its first axis; NumPy leaves room in the header for any length of it."""

    def __init__(self, path: Path, dtype: np.dtype[Any], row: tuple[int, ...]) -> None:
        self.path, self.dtype, self.row = path, dtype.newbyteorder("<"), row
        header = self._header(0)
        self._offset = len(header)
        _write_whole(path, header)
        self._file = path.open("r+b", buffering=0)  # the system has every frame at once, killed or not
        self._file.seek(self._offset)

    def append(self, values: NDArray[Any]) -> None:
        self._write(np.ascontiguousarray(values, dtype=self.dtype).reshape(-1).view(np.uint8).data)

    def close(self, num_rows: int) -> None:
        with self._file, _naming(self.path):
            self._file.truncate(self._offset + num_rows * _num_bytes(self.row, self.dtype))
            self._file.seek(0)
            self._write(memoryview(self._header(num_rows)))

    def _write(self, data: memoryview) -> None:
        with _naming(self.path):
            while len(data) > 0:
                data = data[self._file.write(data) :]

    def _header(self, num_rows: int) -> bytes:
        text = BytesIO()
        shape = (num_rows, *self.row)
        npy.write_array_header_1_0(
            text, {"descr": npy.dtype_to_descr(self.dtype), "fortran_order": False, "shape": shape}
        )
        return text.getvalue()


def _load_directory(path: Path, mmap: bool) -> Recording:
    """The whole frames that all files of a directory have in common."""
    meta_path = path / "meta.json"
    if not meta_path.is_file():
        raise ValueError(f"{path}: expected a recording, got a directory without meta.json")
    meta = _Meta.parse(meta_path.read_bytes(), str(meta_path))
    rows: dict[str, tuple[int, ...]] = {"time": ()}
    rows |= dict.fromkeys(() if meta.names is None else _TRUTH_FILES, (len(meta.names or ()),))
    rows["cube"] = _frame_shape(meta.radar)
    present = {name: path / f"{name}.npy" for name in rows if (path / f"{name}.npy").is_file()}
    files = {name: _ArrayFile(file, rows[name]) for name, file in present.items()}

    # The cube's file is made last: without it there are no frames yet, unless it has been lost.
    if "cube" not in files and all(file.num_rows == 0 for file in files.values()):
        _warn_of_missing(path, 0, meta.num_frames, closed=False)
        empty = np.zeros((0, *rows["cube"]), np.float32 if meta.radar.is_real else np.complex64)
        return Recording(empty, np.zeros(0), meta.radar, _truth_of(meta.names, {}, 0), meta.source)
    if missing := rows.keys() - files.keys():
        raise ValueError(f"{path}: expected a recording, got one without {sorted(missing)[0]}.npy")
    num_frames = min(file.num_rows for file in files.values() if file.num_rows is not None)
    closed = all(file.header_rows == num_frames for file in files.values())
    planned = max(file.header_rows for file in files.values()) if meta.num_frames is None else meta.num_frames
    _warn_of_missing(path, num_frames, planned, closed or meta.num_frames is not None)

    arrays = {name: file.read(num_frames, mmap and name == "cube") for name, file in files.items()}
    truth = _truth_of(meta.names, arrays, num_frames)
    return _recording(path, arrays["cube"], arrays["time"], meta, truth)


def _load_npz(path: Path) -> Recording:
    if not zipfile.is_zipfile(path):
        raise ValueError(f"{path}: expected a recording's directory or .npz file, got another or a damaged file")
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (zipfile.BadZipFile, ValueError, EOFError) as error:
        raise ValueError(f"{path}: damaged .npz file ({error})") from error
    names = ("meta", "time", "cube")
    if missing := set(names) - arrays.keys():
        raise ValueError(f"{path}: expected a recording with {', '.join(names)}, got one without {sorted(missing)[0]}")
    meta = _Meta.parse(str(arrays["meta"]).encode(), f"{path}, meta")
    if meta.names is not None and (missing := set(_TRUTH_FILES) - arrays.keys()):
        raise ValueError(f"{path}: expected the truth its meta names, got a recording without {sorted(missing)[0]}")
    return _recording(path, arrays["cube"], arrays["time"], meta, _truth_of(meta.names, arrays, len(arrays["time"])))


def _recording(
    path: Path, cube: NDArray[Any], time: NDArray[np.float64], meta: _Meta, truth: Truth | None
) -> Recording:
    try:
        return Recording(cube, time, meta.radar, truth, meta.source)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path}: {error}") from error


def _truth_of(names: tuple[str, ...] | None, arrays: dict[str, NDArray[Any]], num_frames: int) -> Truth | None:
    if names is None:
        return None
    empty = np.zeros((num_frames, len(names)))
    return Truth(names, *(arrays.get(name, empty) for name in _TRUTH_FILES))


def _warn_of_missing(path: Path, num_frames: int, planned: int | None, closed: bool) -> None:
    if planned is not None and num_frames < planned:
        message = f"{path}: {num_frames} of {planned} planned frames, its writer was interrupted"
    elif not closed:
        message = f"{path}: {num_frames} frames, its writer was interrupted"
    else:
        return
    warnings.warn(message, stacklevel=4)  # the caller of Recording.load


class _ArrayFile:
    """Header and whole rows of an NPY file, whatever number of rows the header says."""

    def __init__(self, path: Path, row: tuple[int, ...]) -> None:
        self.path = path
        readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
        with path.open("rb") as file:
            try:
                version = npy.read_magic(file)
                if version not in readers:
                    raise ValueError(f"NPY version {version}")
                shape, fortran_order, self.dtype = readers[version](file)
            except ValueError as error:
                raise ValueError(f"{path}: damaged or not an NPY file ({error})") from error
            self._offset = file.tell()
            num_bytes = file.seek(0, os.SEEK_END) - self._offset
        allowed = _CUBE_TYPES if path.stem == "cube" else ("float64",)
        if self.dtype.name not in allowed:
            raise ValueError(f"{path}: expected {', '.join(allowed)}, got {self.dtype}")
        if len(shape) != 1 + len(row) or shape[1:] != row or (fortran_order and row):
            order = " in Fortran order" if fortran_order else ""
            raise ValueError(
                f"{path}: expected shape {check.shape_text((None, *row))} by its meta.json, got {shape}{order}"
            )
        self.shape, self.header_rows = row, int(shape[0])
        row_bytes = _num_bytes(row, self.dtype)
        self.num_rows = num_bytes // row_bytes if row_bytes else None  # no bodies: any number of rows

    def read(self, num_rows: int, mmap: bool) -> NDArray[Any]:
        shape = (num_rows, *self.shape)
        if mmap and num_rows > 0:
            return np.memmap(self.path, self.dtype, "r", self._offset, shape)
        count = int(np.prod(shape, dtype=int))
        return np.fromfile(self.path, self.dtype, count, offset=self._offset).reshape(shape)


@dataclass(frozen=True)
class _Meta:
    """What meta.json says."""

    radar: Radar
    source: dict[str, Any]
    num_frames: int | None
    names: tuple[str, ...] | None

    @classmethod
    def parse(cls, data: bytes, where: str) -> _Meta:
        try:
            values = json.loads(data)
        except json.JSONDecodeError as error:
            raise ValueError(f"{where}, line {error.lineno}: {error.msg}") from error
        except UnicodeDecodeError as error:
            raise ValueError(f"{where}: expected UTF-8 text ({error})") from error
        if not isinstance(values, dict) or values.get("format") != FORMAT:
            got = values.get("format") if isinstance(values, dict) else type(values).__name__
            raise ValueError(f"{where}: expected format {FORMAT!r}, got {got!r}")
        if not isinstance(version := values.get("version"), int) or version > VERSION:
            raise ValueError(
                f"{where}: expected version {VERSION} (or older), got {version!r}; a newer radarcore wrote it"
            )
        try:
            names = values["truth"]
            return cls(
                radar=Radar.from_dict(values["radar"]),
                source=dict(values["source"]),
                num_frames=None if values["num_frames"] is None else check.count("num_frames", values["num_frames"], 0),
                names=None if names is None else tuple(map(str, names)),
            )
        except KeyError as error:
            raise ValueError(f"{where}: expected the key {error}, got none") from error
        except (TypeError, ValueError, AttributeError) as error:
            raise ValueError(f"{where}: {error}") from error


def _meta_text(radar: Radar, source: dict[str, Any], num_frames: int | None, kind: Kind | None) -> str:
    values = {
        "format": FORMAT,
        "version": VERSION,
        "radar": radar.to_dict(),
        "source": source,
        "units": UNITS | {"cube": source.get("cube_unit", UNITS["cube"])},
        "num_frames": num_frames,
        "truth": None if kind is None or kind[1] is None else list(kind[1]),
    }
    try:
        return json.dumps(values, indent=2, allow_nan=False) + "\n"
    except (TypeError, ValueError) as error:
        raise type(error)(f"source: expected what JSON can hold, got {source!r} ({error})") from error


def _make_room(path: Path, overwrite: bool) -> None:
    """An empty directory at `path`, or one with other people's files only where a recording was."""
    if path.exists() and not path.is_dir():
        raise _exists(path, "a file, not a directory")
    if path.is_dir() and any(path.iterdir()):
        try:
            is_recording = json.loads((path / "meta.json").read_bytes()).get("format") == FORMAT
        except (OSError, ValueError, AttributeError):
            is_recording = False
        if not is_recording:
            raise _exists(path, "a directory that is not empty and no recording")
        if not overwrite:
            raise _exists(path, "a recording; overwrite=True replaces it")
        for name in ("cube", "time", *_TRUTH_FILES):
            (path / f"{name}.npy").unlink(missing_ok=True)
    path.mkdir(parents=True, exist_ok=True)


def _write_whole(path: Path, data: bytes) -> None:
    """Write a small file so that it is there whole or not at all."""
    partial = path.with_name(path.name + ".part")
    with _naming(path):
        partial.write_bytes(data)
        partial.replace(path)


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Gives an OSError the path that the system left out (disk full and the like)."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            raise type(error)(error.errno, error.strerror, str(path)) from error
        raise


def _exists(path: Path, what: str) -> FileExistsError:
    return FileExistsError(errno.EEXIST, f"expected no such path, got {what}", str(path))


def _format(path: Path, given: str | None) -> str:
    """Format by name, else by the suffix of the path."""
    if given is not None:
        return check.choice("format", given, ("npz",))
    if path.suffix in (".zarr", ".h5", ".hdf5", ".npy", ".mat"):
        raise ValueError(f"path: expected a directory or an .npz file, got {str(path)!r}")
    # Any other name is that of a directory: dates and versions have dots.
    return "npz" if path.suffix == ".npz" else "directory"


def _frame_shape(radar: Radar) -> tuple[int, int, int]:
    return radar.num_channels, radar.waveform.num_chirps, radar.waveform.num_samples


def _num_bytes(row: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    return int(np.prod(row, dtype=int)) * dtype.itemsize


def _truth_arrays(truth: Truth | None) -> dict[str, NDArray[np.float64]]:
    return {} if truth is None else {f"truth_{name}": getattr(truth, name) for name in TRUTH_FIELDS}


def _kind(cube: NDArray[Any], truth: Truth | None) -> Kind:
    """What all frames of a recording share besides the radar."""
    return cube.dtype, None if truth is None else truth.names


def _check_frame(name: str, frame: object) -> None:
    if not isinstance(frame, Frame):
        raise TypeError(f"{name}: expected Frame, got {type(frame).__name__}")


def _check_alike(name: str, frame: Frame, radar: Radar, kind: Kind | None) -> None:
    _check_frame(name, frame)
    if frame.radar is not radar and frame.radar != radar:
        raise ValueError(f"{name}: expected a frame of the recording's radar, got one of another")
    if kind is not None and (given := _kind(frame.cube, frame.truth)) != kind:
        expected, got = (f"{dtype} with truth of {names}" for dtype, names in (kind, given))
        raise ValueError(f"{name}: expected {expected} as in the first frame, got {got}")


def _check_radar(radar: object) -> None:
    if not isinstance(radar, Radar):
        raise TypeError(f"radar: expected Radar, got {type(radar).__name__}")


def _checked_cube(cube: object, shape: tuple[int | None, ...]) -> NDArray[Any]:
    samples = np.asarray(cube)
    if samples.dtype.name not in _CUBE_TYPES:
        raise TypeError(f"cube: expected {', '.join(_CUBE_TYPES)}, got {samples.dtype}")
    fits = len(samples.shape) == len(shape) and all(
        want is None or want == got for want, got in zip(shape, samples.shape, strict=True)
    )
    if not fits:
        axes = ", ".join(("frame", "channel", "chirp", "sample")[-len(shape) :])
        raise ValueError(f"cube: expected shape {check.shape_text(shape)} [{axes}] of the radar, got {samples.shape}")
    return samples


def _check_truth(truth: object, frames: tuple[int, ...]) -> None:
    """Truth of one frame, ``frames = ()``, or of ``frames = (n,)``."""
    if truth is None:
        return
    if not isinstance(truth, Truth):
        raise TypeError(f"truth: expected Truth, got {type(truth).__name__}")
    if truth.range.shape != (expected := (*frames, len(truth.names))):
        raise ValueError(f"truth: expected arrays of shape {expected}, got {truth.range.shape}")
