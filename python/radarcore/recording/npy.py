"""NPY files that grow frame by frame, readable at any length."""

from __future__ import annotations

import math
import os
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
from numpy.lib import format as npy
from numpy.typing import DTypeLike, NDArray

from radarcore import check
from radarcore.output import naming, new_file

_LONGEST_HEADER = 1 << 16
"""Bytes of a header that are read: NumPy refuses more than 10 000."""

_CHUNK_ROWS = 64
"""Frames that are converted at once."""

_LONGEST_REASON = 200
"""Characters of another library's message."""


class GrowingFile:
    """An NPY file that grows along its first axis; NumPy leaves room in the header for any length of it.

    Parameters
    ----------
    path : Path
    dtype : dtype
        Written little-endian.
    row : tuple of int
        Shape of what is appended.
    first : (row, ...) array, optional
        Rows that are there from the start.
    """

    def __init__(
        self, path: Path, dtype: np.dtype[Any], row: tuple[int, ...], first: NDArray[Any] | None = None
    ) -> None:
        self.path: Path = path
        self.dtype: np.dtype[Any] = dtype.newbyteorder("<")
        self.row: tuple[int, ...] = row
        header = self._header(0)
        self._offset = len(header)
        with new_file(path, overwrite=True) as part:
            part.write_bytes(header + (b"" if first is None else self._bytes(first)))
        self._file = path.open("r+b", buffering=0)  # the system has every frame at once, killed or not
        self._file.seek(0, os.SEEK_END)

    def append(self, values: NDArray[Any]) -> None:
        """Write one row."""
        self._write(self._bytes(values))

    def close(self, num_rows: int) -> None:
        """Put the number of rows into the header and drop what follows them."""
        with self._file, naming(self.path):
            self._file.truncate(self._offset + num_rows * _num_bytes(self.row, self.dtype))
            self._file.seek(0)
            self._write(memoryview(self._header(num_rows)))

    def _bytes(self, values: NDArray[Any]) -> memoryview:
        return np.ascontiguousarray(values, dtype=self.dtype).reshape(-1).view(np.uint8).data

    def _write(self, data: memoryview) -> None:
        with naming(self.path):
            while len(data) > 0:
                data = data[self._file.write(data) :]

    def _header(self, num_rows: int) -> bytes:
        text = BytesIO()
        shape = (num_rows, *self.row)
        npy.write_array_header_1_0(
            text, {"descr": npy.dtype_to_descr(self.dtype), "fortran_order": False, "shape": shape}
        )
        return text.getvalue()


class ArrayFile:
    """Header and whole rows of an NPY file, whatever number of rows the header says.

    Parameters
    ----------
    path : Path
    row : tuple of int
        Shape of a row.
    dtypes : tuple of str
        Names of the dtypes it may have.
    described_by : str
        File that says what the shape should be, for messages.
    """

    def __init__(self, path: Path, row: tuple[int, ...], dtypes: tuple[str, ...], described_by: str) -> None:
        self.path = path
        with path.open("rb") as file:
            self.dtype: np.dtype[Any]
            shape, fortran_order, self.dtype = read_header(file, path)
            self._offset = file.tell()
            file.seek(0)
            self.header: bytes = file.read(self._offset)
            num_bytes = file.seek(0, os.SEEK_END) - self._offset
        if self.dtype.name not in dtypes:
            raise ValueError(f"{path}: expected {', '.join(dtypes)}, got {self.dtype}")
        if len(shape) != 1 + len(row) or shape[1:] != row or (fortran_order and row):
            order = " in Fortran order" if fortran_order else ""
            raise ValueError(
                f"{path}: expected shape {check.shape_text((None, *row))} by its {described_by}, got {shape}{order}"
            )
        self.shape: tuple[int, ...] = row
        self.header_rows: int = int(shape[0])
        row_bytes = _num_bytes(row, self.dtype)
        self.num_rows: int | None = num_bytes // row_bytes if row_bytes else None  # rows of nothing: any number of them

    def read(self, num_rows: int, mmap: bool) -> NDArray[Any]:
        """The first rows, copied or mapped."""
        shape = (num_rows, *self.shape)
        if mmap and num_rows > 0:
            return np.memmap(self.path, self.dtype, "r", self._offset, shape)
        return np.fromfile(self.path, self.dtype, math.prod(shape), offset=self._offset).reshape(shape)


class Rows(Protocol):
    """Rows on disk: an array, or one that lies in several files."""

    def __len__(self) -> int: ...
    def __getitem__(self, rows: slice, /) -> NDArray[Any]: ...


class Converted:
    """Array on disk whose rows become samples on access.

    Parameters
    ----------
    stored : (row, ...) array
    convert : function
        Of a few rows; a ValueError gets the path and the first of them.
    path : Path
        For messages.
    row : tuple of int, optional
        Shape of a row of samples; default: the stored shape.
    dtype : dtype
        Of the samples.
    """

    def __init__(
        self,
        stored: Rows,
        convert: Callable[[NDArray[Any]], NDArray[Any]],
        path: Path,
        row: tuple[int, ...] | None = None,
        dtype: DTypeLike = np.float32,
    ) -> None:
        self._stored, self._convert, self._path = stored, convert, path
        self.shape: tuple[int, ...] = (len(stored), *(stored[:0].shape[1:] if row is None else row))
        self.dtype: np.dtype[Any] = np.dtype(dtype)

    def __len__(self) -> int:
        return len(self._stored)

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        chosen = range(len(self))[rows]
        samples = np.empty((len(chosen), *self.shape[1:]), self.dtype)
        for first in range(0, len(chosen), _CHUNK_ROWS):
            part = slice(chosen.start + first, min(chosen.start + first + _CHUNK_ROWS, chosen.stop))
            try:
                samples[first : first + _CHUNK_ROWS] = self._convert(self._stored[part])
            except ValueError as error:
                raise ValueError(f"{self._path}, from frame {part.start}: {error}") from error
        return samples


def read_header(file: IO[bytes], path: object) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, Fortran order and dtype at the start of an NPY file; ValueError, with the path, for a damaged one."""
    readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    with readable(path, "an NPY file"):
        # No more than NumPy takes for a header is read, whatever length it says; old names of dtypes are refused later.
        place, start = file.tell(), BytesIO(file.read(_LONGEST_HEADER))
        version = npy.read_magic(start)
        if version not in readers:
            raise ValueError(f"NPY version {version}")
        with warnings.catch_warnings(action="ignore"):
            shape, fortran_order, dtype = readers[version](start)
        file.seek(place + start.tell())
        return shape, fortran_order, dtype


def npz_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays of an .npz file by name; ValueError, with the path, for a damaged one."""
    shapes = {}
    with path.open("rb") as file, readable(path, "an .npz file"), zipfile.ZipFile(file) as archive:
        for info in archive.infolist():
            with archive.open(info) as member:
                shapes[info.filename.removesuffix(".npy")] = read_header(member, info.filename)[0]
    return shapes


def read_npz(path: Path, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Arrays of an .npz file that have one of some names; ValueError, with the path, for a damaged one.

    Arrays are made only after a check that the file is large enough.
    """
    with path.open("rb") as file, readable(path, "an .npz file"), zipfile.ZipFile(file) as archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        return {name: _member(archive, members[name]) for name in names if name in members}


@contextmanager
def readable(path: object, kind: str) -> Iterator[None]:
    """Turns all errors of other libraries for damaged bytes into a ValueError with the path."""
    try:
        yield
    except (FileNotFoundError, PermissionError):
        raise
    except Exception as error:
        raise ValueError(f"{path}: damaged or not {kind} ({str(error)[:_LONGEST_REASON]})") from error


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    """Array of a file in an archive."""
    with archive.open(info) as file:
        shape, _, dtype = read_header(file, info.filename)
        if _num_bytes(shape, dtype) > info.file_size:
            raise ValueError(f"{info.filename}: expected the samples of shape {shape}, got {info.file_size} bytes")
        file.seek(0)
        values: NDArray[Any] = npy.read_array(file, allow_pickle=False)
        return values


def _num_bytes(row: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    return math.prod(row) * dtype.itemsize
