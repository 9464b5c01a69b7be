"""Arrays of MAT files: MATLAB's own format up to version 7.2, read by scipy, and HDF5 of version 7.3."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.recording.npy import readable

_NUMBERS = ("double", "single", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
"""Classes of arrays of numbers; others, as cells and texts, are no samples."""

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
    from scipy.io import loadmat, whosmat

    with readable(path, "a MAT file"):
        found = {name: (shape, kind) for name, shape, kind in whosmat(path) if kind in _NUMBERS}
    name = chosen(path, {name: shape for name, (shape, _) in found.items()}, variable)
    with readable(path, "a MAT file"):
        values: NDArray[Any] = loadmat(path, variable_names=[name])[name]
    # MATLAB stores doubles as shorter numbers where they fit.
    return values if np.iscomplexobj(values) else values.astype(found[name][1])


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
