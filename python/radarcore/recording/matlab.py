"""Arrays of MAT files: MATLAB's own format up to version 7.2, and HDF5 of version 7.3.

MathWorks, "MAT-File Format". `scipy.io.loadmat` reads the older files too, but damaged ones can crash the interpreter.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.recording.npy import readable

_HEADER_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
_IS_COMPLEX = 0x0800
_START_BYTES = 1024
"""Bytes of an array that are unpacked for its shape and name."""

_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types of stored numbers by MathWorks's codes."""

_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
"""Classes of arrays of numbers; others, as cells and texts, are no samples."""


class Variable(NamedTuple):
    """An array in a file: where it is, and what its start says."""

    shape: tuple[int, ...]
    start: int
    stop: int
    is_compressed: bool


class MatFile:
    """Arrays of numbers in a file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    ValueError
        For damaged files, and for other versions.
    """

    def __init__(self, path: Path) -> None:
        self._bytes: Any = np.memmap(path, np.uint8, "r") if path.stat().st_size else np.empty(0, np.uint8)
        mark = self._bytes[_HEADER_BYTES - 2 : _HEADER_BYTES].tobytes()
        if mark not in (b"IM", b"MI"):
            raise ValueError("no mark of its byte order, as versions 5 to 7.2 have")
        self._order = "<" if mark == b"IM" else ">"
        self.variables: dict[str, Variable] = dict(self._variables())

    def read(self, name: str) -> NDArray[Any]:
        """The array of a name."""
        variable = self.variables[name]
        data = self._bytes[variable.start : variable.stop].tobytes()
        if variable.is_compressed:
            # Numbers take at most twice 8 bytes each, and the start is short.
            data = zlib.decompressobj().decompress(data, _START_BYTES + 16 * math.prod(variable.shape))[8:]
        flags, shape, _, *parts = self._elements(data, 5)
        kind = np.dtype(_CLASSES[int(flags[0]) & 0xFF])
        if math.prod(shape.tolist()) != parts[0].size or any(part.size != parts[0].size for part in parts):
            raise ValueError(f"{parts[0].size} numbers for the shape {tuple(shape.tolist())}")
        if not int(flags[0]) & _IS_COMPLEX:
            return parts[0].astype(kind).reshape(shape, order="F")
        values = np.empty(parts[0].shape, np.complex64 if kind.itemsize <= 4 else np.complex128)
        values.real, values.imag = parts
        return values.reshape(shape, order="F")

    def _variables(self) -> Iterator[tuple[str, Variable]]:
        """Names and places of the arrays of numbers."""
        place = _HEADER_BYTES
        while place + 8 <= len(self._bytes):
            code, size = self._tag(self._bytes[place : place + 8].tobytes())
            start, stop = place + 8, place + 8 + size
            if stop > len(self._bytes):
                raise ValueError(f"an array of {size} bytes in the last {len(self._bytes) - start}")
            data = self._bytes[start : min(stop, start + _START_BYTES)].tobytes()
            is_compressed = code == _COMPRESSED
            if is_compressed:
                data = zlib.decompressobj().decompress(data, _START_BYTES)
                code, data = self._tag(data)[0], data[8:]
            if code == _MATRIX and len(data) > 0:
                flags, shape, name = self._elements(data, 3)
                if int(flags[0]) & 0xFF in _CLASSES:
                    lengths = tuple(int(length) for length in shape)
                    if not lengths or min(lengths) < 0:
                        raise ValueError(f"an array of shape {lengths}")
                    yield name.tobytes().decode("latin-1"), Variable(lengths, start, stop, is_compressed)
            place = stop

    def _tag(self, data: bytes) -> tuple[int, int]:
        """Code and size of an element."""
        code, size = np.frombuffer(data[:8], f"{self._order}u4", 2).tolist()
        return code, size

    def _elements(self, data: bytes, most: int) -> list[NDArray[Any]]:
        """Numbers of the elements of an array: flags, shape, name, and the real and imaginary parts."""
        found: list[NDArray[Any]] = []
        place = 0
        while place + 8 <= len(data) and len(found) < most:
            code, size = self._tag(data[place : place + 8])
            start = place + 8
            if code >> 16:  # up to four bytes in the tag itself
                code, size, start = code & 0xFFFF, code >> 16, place + 4
            kind = np.dtype(f"{self._order}{_STORED[code]}") if code in _STORED else None
            if kind is None or start + size > len(data):
                raise ValueError(f"an element of type {code} and {size} bytes")
            found.append(np.frombuffer(data, kind, size // kind.itemsize, start))
            place = start + 4 if start == place + 4 else start + size + -size % 8
        if len(found) < 3 or (most > 3 and len(found) < 4) or found[0].size == 0:
            raise ValueError(f"{len(found)} elements of an array")
        return found


_HDF5 = b"\x89HDF\r\n\x1a\n"
_USER_BLOCK_BYTES = 512
"""Bytes that MATLAB puts before what is HDF5."""

_LEAST_AXES = 3
"""Axes of samples: channels, chirps, samples."""


def array(path: Path, variable: str | None) -> NDArray[Any]:
    """The named array of a file, or the only one of three axes or more."""
    with path.open("rb") as file:
        start = file.read(_USER_BLOCK_BYTES + len(_HDF5))
    if _HDF5 in (start[: len(_HDF5)], start[_USER_BLOCK_BYTES:]):
        return _of_hdf5(path, variable)
    with readable(path, "a MAT file"):
        found = MatFile(path)
    name = chosen(path, {name: entry.shape for name, entry in found.variables.items()}, variable)
    with readable(path, "a MAT file"):
        return found.read(name)


def _of_hdf5(path: Path, variable: str | None) -> NDArray[Any]:
    """Array of a file of version 7.3, whose axes HDF5 has in the other direction."""
    try:
        import h5py
    except ImportError as error:
        raise ImportError(
            f"{path}: MAT files of version 7.3 need h5py: pip install radarcore[mat] "
            "(or save them with '-v7' in MATLAB)"
        ) from error
    with readable(path, "a MAT file"), h5py.File(path, "r") as file:
        shapes = {name: tuple(item.shape[::-1]) for name, item in file.items() if isinstance(item, h5py.Dataset)}
    name = chosen(path, shapes, variable)
    with readable(path, "a MAT file"), h5py.File(path, "r") as file:
        values: NDArray[Any] = file[name][()]
    return values.transpose()


def chosen(path: Path, shapes: dict[str, tuple[int, ...]], variable: str | None) -> str:
    """Name of the variable with the samples."""
    text = ", ".join(f"{name} {check.shape_text(shape)}" for name, shape in shapes.items()) or "none"
    if variable is not None:
        if variable not in shapes:
            raise ValueError(f"{path}: expected the variable {variable!r}, got {text}")
        return variable
    large = [name for name, shape in shapes.items() if len(shape) >= _LEAST_AXES]
    if len(large) != 1:
        raise ValueError(f"{path}: expected one array of samples, got {text}; pass variable=..., --variable NAME")
    return large[0]
