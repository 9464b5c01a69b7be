"""Bare samples: arrays of NPY and MAT files and raw numbers, which say nothing of their radar.

The user describes them: the radar, and the names of the axes in the order of the file. Axes are ``frame``, ``chirp``,
``sample``, ``rx``, ``tx`` (channels are ``tx * num_rx + rx``), ``channel`` (or ``rx`` alone) for all channels, and
``iq`` for an axis of two, real and imaginary part. ``name=length`` states a length as well. Lengths alone are
``channel, chirp, sample``, with ``frame`` before and ``iq`` behind if there are more.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import permutations
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.output import naming
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.recording import matlab
from radarcore.recording.frame import COUNTS, CUBE_TYPES, FULL_SCALE, check_radar, frame_shape, to_samples
from radarcore.recording.native import Stored, is_native
from radarcore.recording.npy import HEADER_ERRORS, Converted, npz_shapes, read_npz
from radarcore.recording.radar_files import Configuration, configuration, is_setup
from radarcore.recording.ti import capture


@dataclass(frozen=True)
class Description:
    """Description of bare samples by the user.

    Parameters
    ----------
    radar : Radar, optional
        Radar of the samples.
    config : path, optional
        File with their radar, in place of `radar`.
    shape : str or sequence, optional
        Axes of the array, see this module.
    dtype : str, optional
        Type of the numbers of a raw file, as NumPy calls it: ``"int16"``, ``">u2"``.
    variable : str, optional
        Name of the array in a ``.mat`` or ``.npz`` file.
    """

    radar: Radar | None = None
    config: str | PathLike[str] | None = None
    shape: str | Sequence[str | int] | None = None
    dtype: str | None = None
    variable: str | None = None

    @property
    def given(self) -> dict[str, object]:
        """Given parts of the description, by name."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}

    def refuse(self, path: object, what: str, *names: str) -> None:
        """Refuse fields that files of a kind do not need, with a TypeError; all of them without `names`."""
        for name, value in self.given.items():
            if not names or name in names:
                got = type(value).__name__ if isinstance(value, Radar) else repr(str(value))
                raise TypeError(f"{name}: expected none, as {path} is {what}, got {got}")


NO_DESCRIPTION = Description()
"""Description of recordings that need none."""


NAMES = ("frame", "tx", "rx", "channel", "chirp", "sample", "iq")
"""Names in the order that arrays are brought into."""

_WITHOUT_NAMES = {
    3: ("channel", "chirp", "sample"),
    4: ("frame", "channel", "chirp", "sample"),
    5: ("frame", "channel", "chirp", "sample", "iq"),
}
"""Axes of arrays that nobody named."""


class Axis(NamedTuple):
    """An axis by its name, and its length where that was given."""

    name: str
    length: int | None = None


def parsed_axes(shape: str | Sequence[str | int]) -> tuple[Axis, ...]:
    """Axes of a text like ``"frame,rx,chirp,sample"``, ``"frame,rx=3,chirp=64,sample=128"`` or ``"100,3,64,128"``."""
    words = shape.split(",") if isinstance(shape, str) else list(map(str, shape))
    words = [word.strip() for word in words]
    if all(word.lstrip("-").isdigit() for word in words):
        names = _WITHOUT_NAMES.get(len(words))
        if names is None:
            raise ValueError(f"shape: expected 3 to 5 lengths [{', '.join(_WITHOUT_NAMES[5])}], got {shape!r}")
        axes = [Axis(name, _length(word, shape)) for name, word in zip(names, words, strict=True)]
    else:
        pairs = [word.partition("=") for word in words]
        axes = [Axis(name.strip(), _length(text, shape) if is_given else None) for name, is_given, text in pairs]
    names_given = [axis.name for axis in axes]
    for name in names_given:
        if name not in NAMES:
            raise ValueError(f"shape: expected names of axes, got {name!r}; {check.near_names(name, NAMES)}")
        if names_given.count(name) > 1:
            raise ValueError(f"shape: expected every axis once, got {name!r} twice in {shape!r}")
    if "tx" in names_given and "rx" not in names_given:
        raise ValueError(f"shape: expected rx beside tx, got {shape!r}")
    if "channel" in names_given and "rx" in names_given:
        raise ValueError(f"shape: expected either channel or rx, got {shape!r}")
    if "sample" not in names_given:
        raise ValueError(f"shape: expected an axis sample, got {shape!r}")
    return tuple(axes)


def _length(text: str, shape: object) -> int | None:
    """A length of a shape; None for -1: as many as there are."""
    if not text.strip().lstrip("-").isdigit() or (length := int(text)) == 0 or length < -1:
        raise ValueError(f"shape: expected a length, got {text.strip()!r} in {shape!r}")
    return None if length == -1 else length


def axes_of_array(
    shape: tuple[int, ...], given: str | Sequence[str | int] | None, radar: Radar, path: Path
) -> tuple[Axis, ...]:
    """Axes of an array with a shape: those given, else frame, channel, chirp, sample or a frame alone."""
    if given is not None:
        axes = parsed_axes(given)
        expected = tuple(_expected(axis, axes, radar) for axis in axes)
        if len(shape) == 1 and len(axes) > 1:  # numbers one after the other
            return _filled(shape[0], axes, expected, path)
    else:
        names = _WITHOUT_NAMES.get(len(shape), _WITHOUT_NAMES[4])
        axes = tuple(Axis(name) for name in names)
        expected = tuple(_expected(axis, axes, radar) for axis in axes)
    fits = len(shape) == len(axes) and all(
        want is None or want == length for want, length in zip(expected, shape, strict=True)
    )
    if not fits:
        names_text = ", ".join(axis.name for axis in axes)
        raise ValueError(
            f"{path}: expected shape {check.shape_text(expected)} [{names_text}] of the radar, "
            f"got {shape}{_advice(shape, radar) if given is None else ''}"
        )
    return tuple(Axis(axis.name, length) for axis, length in zip(axes, shape, strict=True))


def _filled(num_values: int, axes: tuple[Axis, ...], expected: tuple[int | None, ...], path: Path) -> tuple[Axis, ...]:
    """Axes whose one free length follows from the number of values."""
    rest = math.prod(length for length in expected if length is not None)
    free = [axis.name for axis, length in zip(axes, expected, strict=True) if length is None]
    if len(free) > 1 or num_values % rest or (not free and num_values != rest):
        names = ", ".join(axis.name for axis in axes)
        raise ValueError(f"{path}: expected shape {check.shape_text(expected)} [{names}], got {num_values} numbers")
    return tuple(Axis(axis.name, length or num_values // rest) for axis, length in zip(axes, expected, strict=True))


def _expected(axis: Axis, axes: tuple[Axis, ...], radar: Radar) -> int | None:
    """Length that an axis has by the radar or by what was given; None for any."""
    is_apart = any(other.name == "tx" for other in axes)
    lengths = {
        "tx": len(radar.tx),
        "rx": len(radar.rx) if is_apart else radar.num_channels,
        "channel": radar.num_channels,
        "chirp": radar.num_chirps,
        "sample": radar.waveform.num_samples,
        "iq": 2,
    }
    wanted = lengths.get(axis.name)
    if wanted is not None and axis.length not in (None, wanted):
        raise ValueError(f"shape: expected {axis.name} = {wanted} of the radar, got {axis.length}")
    return axis.length if wanted is None else wanted


def _advice(shape: tuple[int, ...], radar: Radar) -> str:
    """Message about an array in another order, with the order if only one fits."""
    names = _WITHOUT_NAMES.get(len(shape))
    if names is None:
        return "; say what its axes are, as shape='frame,rx,chirp,sample', --shape"
    axes = tuple(Axis(name) for name in names)
    lengths = {axis.name: _expected(axis, axes, radar) for axis in axes}
    fitting = [
        order
        for order in permutations(names)
        if all(lengths[name] in (None, length) for name, length in zip(order, shape, strict=True))
    ]
    if len(fitting) == 1:
        return f"; shape={','.join(fitting[0])!r} (--shape) would fit"
    return f"; say the order of its axes, as shape={','.join(names)!r}, --shape"


def in_order(values: NDArray[Any], axes: tuple[Axis, ...]) -> NDArray[Any]:
    """View of an array as (frame, tx, rx, chirp, sample), and iq behind where there is one; channels count as rx."""
    names = ["rx" if axis.name == "channel" else axis.name for axis in axes]
    order = [names.index(name) for name in NAMES if name in names]
    view = values.transpose(order)
    for place, name in enumerate(("frame", "tx", "rx", "chirp", "sample")):
        if name not in names:
            view = np.expand_dims(view, place)
    return view


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
        return capture.opened(path, found.radar, found.capture)
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
            values: NDArray[Any] = np.lib.format.open_memmap(path, mode="r")
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
    order = axes_of_array(values.shape, shape, radar, path)
    view = in_order(values.reshape([axis.length or 0 for axis in order]), order)
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
    order = parsed_axes(shape)
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
