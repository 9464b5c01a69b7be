"""Bare samples: arrays of NPY and MAT files and raw numbers, and the files with the settings of their radar.

The user describes them: the radar, and the names of the axes in the order of the file. Axes are ``frame``, ``chirp``,
``sample``, ``rx``, ``tx`` (channels are ``tx * num_rx + rx``), ``channel`` (or ``rx`` alone) for all channels, and
``iq`` for an axis of two, real and imaginary part. Without names they are ``channel, chirp, sample``, with ``frame``
before and ``iq`` behind if there are more.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.recfunctions import structured_to_unstructured
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.recording import infineon, matlab
from radarcore.recording.frame import COUNTS, CUBE_TYPES, FULL_SCALE, frame_shape, to_samples
from radarcore.recording.native import Stored, is_native, parsed_json
from radarcore.recording.npy import Converted, npz_shapes, read_npz, readable
from radarcore.recording.ti import capture, commands, studio
from radarcore.recording.ti.configuration import radar_and_capture


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
    iq_order : "IQ" or "QI", optional
        Which of I and Q comes first in a capture of TI, whatever its configuration says.
    """

    radar: Radar | None = None
    config: str | PathLike[str] | None = None
    shape: str | Sequence[str] | None = None
    dtype: str | None = None
    variable: str | None = None
    iq_order: str | None = None

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
"""Default axes of arrays."""


def parsed_axes(shape: str | Sequence[str]) -> tuple[str, ...]:
    """Names of axes, of a text like ``"frame,rx,chirp,sample"`` or one by one."""
    names = tuple(str(name).strip() for name in (shape.split(",") if isinstance(shape, str) else shape))
    for name in names:
        if name not in NAMES:
            raise ValueError(f"shape: expected names of axes, got {name!r}; {check.near_names(name, NAMES)}")
        if names.count(name) > 1:
            raise ValueError(f"shape: expected every axis once, got {name!r} twice in {shape!r}")
    if "tx" in names and "rx" not in names:
        raise ValueError(f"shape: expected rx beside tx, got {shape!r}")
    if "channel" in names and "rx" in names:
        raise ValueError(f"shape: expected either channel or rx, got {shape!r}")
    if "sample" not in names:
        raise ValueError(f"shape: expected an axis sample, got {shape!r}")
    return names


def _lengths(names: tuple[str, ...], radar: Radar) -> tuple[int | None, ...]:
    """Lengths of axes by the radar; None for any number of frames."""
    lengths = {
        "tx": len(radar.tx),
        "rx": len(radar.rx) if "tx" in names else radar.num_channels,
        "channel": radar.num_channels,
        "chirp": radar.num_chirps,
        "sample": radar.waveform.num_samples,
        "iq": 2,
    }
    return tuple(lengths.get(name) for name in names)


def _with_axes(
    values: NDArray[Any], shape: str | Sequence[str] | None, radar: Radar, path: Path
) -> tuple[NDArray[Any], tuple[str, ...]]:
    """The array and the names of its axes; numbers one after the other get the axes of `shape`."""
    names = _WITHOUT_NAMES.get(values.ndim, _WITHOUT_NAMES[4]) if shape is None else parsed_axes(shape)
    lengths = _lengths(names, radar)
    expected = f"{path}: expected shape {check.shape_text(lengths)} [{', '.join(names)}] of the radar"
    if shape is not None and values.ndim == 1 and len(names) > 1:
        try:
            return values.reshape([-1 if length is None else length for length in lengths]), names
        except ValueError:
            raise ValueError(f"{expected}, got {len(values)} numbers") from None
    if not check.fits(values.shape, lengths):
        advice = "; name its axes in their order, as shape='frame,rx,chirp,sample', --shape" if shape is None else ""
        raise ValueError(f"{expected}, got {values.shape}{advice}")
    return values, names


def in_order(values: NDArray[Any], axes: tuple[str, ...]) -> NDArray[Any]:
    """View of an array as (frame, tx, rx, chirp, sample), and iq behind where there is one; channels count as rx."""
    names = ["rx" if name == "channel" else name for name in axes]
    order = [names.index(name) for name in NAMES if name in names]
    missing = [place for place, name in enumerate(("frame", "tx", "rx", "chirp", "sample")) if name not in names]
    return np.expand_dims(values.transpose(order), missing)


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
    """Frames of a file at the frame interval; numbers become samples, `Converted`, on access."""
    if description.radar is not None:
        check.instance("radar", description.radar, Radar)
        description.refuse(path, "described by its radar already", "config")
    found, is_array = _configuration(path, description), path.suffix.lower() in _ARRAYS
    if found is not None and found.capture is not None and not is_array:
        description.refuse(path, "a capture that its configuration describes", "shape", "dtype", "variable")
        return capture.opened(path, found.radar, _with_order(found.capture, description.iq_order))
    description.refuse(path, "no capture of TI", "iq_order")
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


def _with_order(order: capture.Capture, iq_order: str | None) -> capture.Capture:
    """The order of a capture with I and Q as the user says."""
    if iq_order is None:
        return order
    if order.is_real:
        raise ValueError(f"iq_order: expected none for real samples, got {iq_order!r}")
    return replace(order, has_q_first=check.choice("iq_order", iq_order, ("IQ", "QI")) == "QI")


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
        with readable(path, "an NPY file"):
            return np.lib.format.open_memmap(path, mode="r")
    if suffix == ".npz":
        name = matlab.chosen(path, npz_shapes(path), description.variable)
        return read_npz(path, (name,))[name]
    if suffix == ".mat":
        return matlab.array(path, description.variable)
    return _raw(path, description.dtype or "uint8")


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
        shape = _WITHOUT_NAMES[4] if shape is None else shape
        values = _whole_frames(path, values, parsed_axes(shape), radar)
    values, names = _with_axes(values, shape, radar, path)
    view, has_parts = in_order(values, names), "iq" in names
    if [name[:1].lower() for name in view.dtype.names or ()] in (["r", "i"], ["i", "q"]):
        view, has_parts = structured_to_unstructured(view), True
    is_integer = view.dtype.kind in "iu"
    if not is_integer and view.dtype.name not in ("float16", *(CUBE_TYPES[:2] if has_parts else CUBE_TYPES)):
        raise ValueError(f"{path}: expected integers or {', '.join(CUBE_TYPES)}, got {view.dtype}")
    is_code = found.has_codes and view.dtype.kind == "u" and not has_parts
    real = np.dtype(np.float32) if is_integer else np.promote_types(view.dtype, np.float32)
    dtype = np.promote_types(real, np.complex64) if has_parts else real
    radar = _receiving(radar, dtype, path)
    row = frame_shape(radar)

    def samples(part: NDArray[Any]) -> NDArray[Any]:
        """Samples of a few frames of the view."""
        converted = to_samples(part) if is_code else np.ascontiguousarray(part, real).view(dtype)
        return converted.reshape(len(part), *row)

    cube: Any = Converted(view, samples, path, row, dtype)
    if dtype == view.dtype and view.shape[1] == 1:  # as they are: no copy of them
        cube = view[:, 0]
    source = {"file": path.name, "cube_unit": FULL_SCALE if is_code else COUNTS if is_integer else UNKNOWN}
    time = radar.waveform.frame_interval * np.arange(len(view), dtype=np.float64)
    return Stored(cube, time, radar, None, source)


def _whole_frames(path: Path, values: NDArray[Any], names: tuple[str, ...], radar: Radar) -> NDArray[Any]:
    """Numbers of the whole frames; a last frame that is cut is left out with a warning."""
    length = math.prod(length for length in _lengths(names, radar) if length is not None)
    num_frames = len(values) // length
    num_bytes = path.stat().st_size - num_frames * length * values.dtype.itemsize
    if names[0] != "frame" or num_frames == 0 or num_bytes == 0:
        return values
    notice.warn(f"{path}: {num_frames} frames, the last {num_bytes} bytes are no whole frame")
    return values[: num_frames * length]


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


def _size_text(path: Path) -> str:
    return f"{path.stat().st_size} bytes"


@dataclass(frozen=True)
class Configuration:
    """Description of samples by a configuration file.

    Parameters
    ----------
    radar : Radar
    capture : Capture, optional
        Order of the numbers of a raw capture, of TI's files.
    has_codes : bool
        True where unsigned numbers are codes of the ADC of an Infineon chip.
    """

    radar: Radar
    capture: capture.Capture | None = None
    has_codes: bool = False


def is_setup(path: Path) -> bool:
    """True for the file with which mmWave Studio describes a capture."""
    return path.name.lower().endswith(studio.SETUP_SUFFIX)


def configuration(path: Path) -> Configuration:
    """Content of a scene file, of the JSON of a radar or recording, of a chip's settings, by Infineon or TI.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    ValueError
        For another suffix, and one line per fault of the file.
    """
    suffix = path.suffix.lower()
    if suffix == ".toml":
        # Scene files lie above recordings, which need none of them but here.
        import radarcore

        return Configuration(radarcore.load_radar(path))
    if suffix == ".cfg":
        text = path.read_bytes().decode("utf-8-sig", "replace")  # comments may be in any encoding
        return Configuration(*radar_and_capture(commands.settings(text, str(path)), str(path)))
    if suffix != ".json":
        raise ValueError(
            f"{path}: expected a scene file (.toml) or the meta.json of a recording, or the settings of a chip "
            f"(config.json, .mmwave.json, .setup.json, .cfg), got {path.suffix!r}"
        )
    if is_setup(path):
        settings_file, files, device = studio.setup_files(path)
        radar, order = radar_and_capture(studio.settings(settings_file, device), str(settings_file))
        return Configuration(radar, None if order is None else replace(order, files=files))
    data = path.read_bytes()
    values = parsed_json(data, str(path))
    keys = values.keys() if isinstance(values, dict) else ()
    if "mmWaveDevices" in keys:
        return Configuration(*radar_and_capture(studio.settings(path, studio.device_beside(path)), str(path)))
    if infineon.is_config(values):
        return Configuration(infineon.radar_of(data.decode("utf-8-sig", "replace"), str(path)), has_codes=True)
    with check.located(path):
        return Configuration(Radar.from_dict(values.get("radar", values)))
