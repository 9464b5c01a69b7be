"""Bare samples: arrays of NPY and MAT files and raw numbers, which say nothing of their radar."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.output import naming
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.recording import axes, dca1000, matlab
from radarcore.recording.codes import to_samples
from radarcore.recording.configuration import Configuration, configuration, is_setup
from radarcore.recording.description import Description
from radarcore.recording.frame import COUNTS, CUBE_TYPES, FULL_SCALE, check_radar, frame_shape
from radarcore.recording.native import Stored, is_native
from radarcore.recording.npy import HEADER_ERRORS, Converted, npz_shapes, read_npz

UNKNOWN = "unknown"
"""``source["cube_unit"]`` of samples that were no integers: nothing says that they are in sqrt(W)."""

_ARRAYS = (".npy", ".mat", ".npz")
"""Suffixes of files that say what their numbers are."""

_SEVERAL = (".mat", ".npz")
"""Suffixes of files of several arrays."""

_RAW = (".bin", ".raw", ".dat")
"""Suffixes of raw files; others are raw where they are described."""


def is_bare(path: Path, description: Description) -> bool:
    """True for files that need a description."""
    suffix = path.suffix.lower()
    if not path.is_file():
        return False
    if suffix == ".npz":  # a recording, unless it has a description and is none
        return bool(description.given) and not is_native(path)
    if description.given or suffix in _ARRAYS or is_setup(path):
        return True
    return suffix in _RAW and not zipfile.is_zipfile(path)  # a recording may have any name


def opened(path: Path, description: Description) -> Stored:
    """Frames of a file, a frame interval apart; numbers become samples, `Converted`, when they are asked for."""
    if description.radar is not None:
        check_radar(description.radar)
        description.refuse(path, "described by its radar already", "config")
    found, is_array = _configuration(path, description), path.suffix.lower() in _ARRAYS
    if found is not None and found.capture is not None and not is_array:
        description.refuse(path, "a capture that its configuration describes", "shape", "dtype", "variable")
        return dca1000.opened(path, found.radar, found.capture)
    values = _array(path, description)
    if found is None:
        got = f"an array {values.shape} of {values.dtype}" if is_array else _size_text(path)
        raise ValueError(
            f"{path}: expected the radar's settings, got {got} without any; pass config=... or radar=..., --config FILE"
        )
    if not is_array and description.dtype is None:
        raise ValueError(
            f"{path}: expected the type of its numbers, got {_size_text(path)}; pass dtype='int16' or 'uint16', --dtype"
        )
    return _stored(path, values, found, description)


def _configuration(path: Path, description: Description) -> Configuration | None:
    if description.radar is not None:
        return Configuration(description.radar)
    if description.config is not None:
        return configuration(Path(description.config))
    return configuration(path) if is_setup(path) else None


def _array(path: Path, description: Description) -> NDArray[Any]:
    """Array of a file, mapped into memory where that can be; all numbers of a raw one, or its bytes."""
    suffix = path.suffix.lower()
    if suffix not in _SEVERAL:
        description.refuse(path, "no .mat file and no .npz file", "variable")
    if suffix in _ARRAYS:
        description.refuse(path, f"a {suffix} file, which has the type of its numbers", "dtype")
    if suffix == ".npy":
        return _npy(path)
    if suffix == ".npz":
        name = matlab.chosen(path, npz_shapes(path), description.variable)
        return read_npz(path, (name,))[name]
    if suffix == ".mat":
        return matlab.array(path, description.variable)
    return _raw(path, description.dtype or "uint8")


def _npy(path: Path) -> NDArray[Any]:
    with naming(path):
        try:
            values: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
        except HEADER_ERRORS as error:
            raise ValueError(f"{path}: damaged or not an NPY file ({error})") from error
    return values


def _raw(path: Path, dtype: str) -> NDArray[Any]:
    """All numbers of a file without a header."""
    try:
        kind = np.dtype(dtype)
    except (TypeError, ValueError, SyntaxError) as error:
        raise ValueError(f"dtype: expected the name of a type of numbers, as 'int16', got {dtype!r}") from error
    if kind.kind not in "iufc":
        raise ValueError(f"dtype: expected integers, real or complex numbers, got {dtype!r}")
    if (num_values := path.stat().st_size // kind.itemsize) == 0:
        raise ValueError(f"{path}: expected samples, got {_size_text(path)}")
    return np.memmap(path, kind, "r", shape=(num_values,))


def _stored(path: Path, values: NDArray[Any], found: Configuration, description: Description) -> Stored:
    """Frames of an array with its radar."""
    radar, shape = found.radar, description.shape
    if description.dtype is not None:
        shape = "frame,channel,chirp,sample" if shape is None else shape
        values = _whole_frames(path, values, shape, radar)
    order = axes.of_array(values.shape, shape, radar, path)
    view = axes.in_order(values.reshape([axis.length or 0 for axis in order]), order)
    has_parts = any(axis.name == "iq" for axis in order)
    convert, unit = _conversion(path, values.dtype, has_parts, found.has_codes)
    dtype = convert(view[:0]).dtype
    radar = _receiving(radar, dtype, path)
    row = frame_shape(radar)
    source: dict[str, Any] = {"file": path.name, "cube_unit": unit}
    cube: Any = Converted(view, lambda part: convert(part).reshape(len(part), *row), path, row, dtype)
    if dtype == values.dtype and view.shape[1] == 1:  # as they are: no copy of them
        cube = view[:, 0]
    time = radar.waveform.frame_interval * np.arange(len(view), dtype=np.float64)
    return Stored(cube, time, radar, None, source)


def _whole_frames(path: Path, values: NDArray[Any], shape: Any, radar: Radar) -> NDArray[Any]:
    """Numbers without those of a last frame that is not whole, of which the user is told."""
    order = axes.parsed(shape)
    num_parts = 2 if any(axis.name == "iq" for axis in order) else 1
    length = int(np.prod(frame_shape(radar))) * num_parts
    left_over = len(values) % length
    if order[0].name != "frame" or len(values) < length:
        return values
    if left_over or path.stat().st_size % values.dtype.itemsize:
        num_bytes = path.stat().st_size - (len(values) - left_over) * values.dtype.itemsize
        notice.warn(f"{path}: {len(values) // length} frames, the last {num_bytes} bytes are no whole frame")
    return values[: len(values) - left_over]


def _conversion(
    path: Path, dtype: np.dtype[Any], has_parts: bool, has_codes: bool
) -> tuple[Callable[[NDArray[Any]], NDArray[Any]], str]:
    """Function from stored numbers to samples, and their unit."""
    is_pair = dtype.names is not None and [name[:1].lower() for name in dtype.names] in (["r", "i"], ["i", "q"])
    parts = dtype[0] if is_pair else dtype
    if has_parts and parts.kind not in "iuf":
        raise ValueError(f"{path}: expected real numbers on the axis iq, got {dtype}")
    if is_pair or has_parts:
        unit = COUNTS if parts.kind in "iu" else UNKNOWN
        first, second = (dtype.names or (0, 1)) if is_pair else (0, 1)

        def joined(values: NDArray[Any]) -> NDArray[Any]:
            pair = (values[first], values[second]) if is_pair else (values[..., 0], values[..., 1])
            wide = np.complex128 if parts.itemsize > 4 and parts.kind == "f" else np.complex64
            samples = np.empty(pair[0].shape, wide)
            samples.real, samples.imag = pair
            return samples

        return joined, unit
    if dtype.kind in "iu":
        return (to_samples, FULL_SCALE) if has_codes and dtype.kind == "u" else (_as_float, COUNTS)
    if dtype.name == "float16":
        return _as_float, UNKNOWN
    if dtype.name not in CUBE_TYPES:
        raise ValueError(f"{path}: expected integers or {', '.join(CUBE_TYPES)}, got {dtype}")
    return _as_they_are, UNKNOWN


def _receiving(radar: Radar, dtype: np.dtype[Any], path: Path) -> Radar:
    """The radar, whose receiver gives samples of the kind that there are."""
    is_real = dtype.kind == "f"
    if radar.receiver is None:
        return replace(radar, receiver=Receiver(output="real")) if is_real else radar
    if is_real != radar.is_real:
        kinds = ("real samples", "I/Q samples")
        expected, got = kinds if radar.is_real else kinds[::-1]
        raise ValueError(f"{path}: expected {expected} of the radar's receiver, got {got} ({dtype})")
    return radar


def _as_float(values: NDArray[Any]) -> NDArray[np.float32]:
    return values.astype(np.float32)


def _as_they_are(values: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(values)


def _size_text(path: Path) -> str:
    return f"{path.stat().st_size} bytes"
