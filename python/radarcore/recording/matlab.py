"""Arrays of MAT files: those of MATLAB before version 7.3, and of 7.3, which are HDF5."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from radarcore import check
from radarcore.recording.mat5 import MatFile

_HDF5 = b"\x89HDF\r\n\x1a\n"
_HEADER_BYTES = 512
"""Bytes that MATLAB puts before what is HDF5."""

_LONGEST_REASON = 200
"""Characters of another library's message."""

_LEAST_AXES = 3
"""Axes of samples: channels, chirps, samples."""


def array(path: Path, variable: str | None) -> NDArray[Any]:
    """The named array of a file, or the only one of three axes or more."""
    with path.open("rb") as file:
        start = file.read(_HEADER_BYTES + len(_HDF5))
    return (
        _of_hdf5(path, variable) if _HDF5 in (start[: len(_HDF5)], start[_HEADER_BYTES:]) else _of_old(path, variable)
    )


def _of_old(path: Path, variable: str | None) -> NDArray[Any]:
    """Array of a file of version 5 to 7.2."""
    with _readable(path):
        file = MatFile(path)
    name = chosen(path, {name: found.shape for name, found in file.variables.items()}, variable)
    with _readable(path):
        return file.read(name)


def _of_hdf5(path: Path, variable: str | None) -> NDArray[Any]:
    """Array of a file of version 7.3, whose axes HDF5 has in the other direction."""
    try:
        import h5py
    except ImportError as error:
        raise ImportError(
            f"{path}: MAT files of version 7.3 need h5py: pip install radarcore[mat] "
            "(or save them with '-v7' in MATLAB)"
        ) from error
    with _readable(path):
        file = h5py.File(path, "r")
    with file:
        with _readable(path):
            shapes = {name: tuple(item.shape[::-1]) for name, item in file.items() if isinstance(item, h5py.Dataset)}
        name = chosen(path, shapes, variable)
        with _readable(path):
            values: NDArray[Any] = file[name][()]
    return values.transpose()


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Makes a ValueError with the path of whatever other libraries raise for damaged bytes."""
    try:
        yield
    except Exception as error:
        raise ValueError(f"{path}: damaged or not a MAT file ({str(error)[:_LONGEST_REASON]})") from error


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
