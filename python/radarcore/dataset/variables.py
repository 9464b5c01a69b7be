"""Variables of a dataset: axes, types, units and coordinates, planned from its first sample."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radarcore import _core, check
from radarcore.dataset.bodies import JOINTS
from radarcore.dataset.files import digests_of
from radarcore.dataset.labels import Labels, dims_of
from radarcore.dataset.variation import Variation
from radarcore.radar.radar import Radar
from radarcore.recording.frame import NUM_CODES, Frame, unit_of
from radarcore.scenefile.read import located

FORMAT, VERSION = "radarcore dataset", 2

SIGNS = "range rate is positive when receding; the sensor looks along +x, azimuth is positive to the left, elevation up"

STATUS = {"missing": 0, "made": 1, "failed": 2}
"""Values of the variable `status`."""

TEXT = "str"
"""Type of a variable of texts."""

NO_CODE = 2**16 - 1
"""Fill value of ADC codes, which have 12 bits."""

_LARGE_ROW = 4096
"""A variable whose samples have at least this size has a chunk per sample, others have one per shard [bytes]."""

_SHARD_BYTES = 1 << 25
"""Largest size of a shard of more than one sample [bytes]."""

_SHARDS, _MAX_SAMPLES = 64, 1024
"""Smallest number of shards, if there are as many samples, and largest number of samples in a shard."""

_AXES = {"doppler": "velocity"}
"""Axes of labels that a dataset calls by the name of their coordinate."""


@dataclass(frozen=True)
class Variable:
    """A variable of a dataset.

    Parameters
    ----------
    dims : tuple of str
        Names of its axes after `sample`.
    shape : tuple of int
        Their lengths.
    dtype : str
        As NumPy names it, or ``"str"``.
    fill : number or str
        Value of samples that failed or are still missing.
    attrs : dict
        Unit and meaning, as JSON holds them.
    compressed : bool
        Compressed by Zstandard: everything that is not mostly noise.
    """

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: str
    fill: Any
    attrs: dict[str, Any] = field(default_factory=dict)
    compressed: bool = False

    @property
    def is_large(self) -> bool:
        """True if every sample is a chunk of its own in the file of its shard."""
        return self.dtype != TEXT and self.row_bytes >= _LARGE_ROW

    @property
    def row_bytes(self) -> int:
        """Size of a sample before compression [bytes]."""
        return math.prod(self.shape) * (16 if self.dtype == TEXT else np.dtype(self.dtype).itemsize)

    def row(self, value: Any = None) -> NDArray[Any]:
        """Values of a sample as an array of this shape and type; None gives the fill value."""
        dtype = object if self.dtype == TEXT else np.dtype(self.dtype)
        if value is None:
            return np.full(self.shape, self.fill, dtype)
        row = np.asarray(value)
        if row.shape != self.shape:
            raise ValueError(f"expected shape {self.shape} {list(self.dims)} as in all samples, got {row.shape}")
        if self.dtype != TEXT and row.dtype != dtype:
            raise ValueError(f"expected {self.dtype} as in all samples, got {row.dtype}")
        return row.astype(dtype, copy=False)


@dataclass(frozen=True)
class Layout:
    """Variables of a dataset, and its samples in shards.

    Parameters
    ----------
    count : int
        Samples.
    samples_per_shard : int
        Consecutive samples of a shard; the last one may have fewer.
    variables : dict
        By their names; `status` is the last.
    """

    count: int
    samples_per_shard: int
    variables: dict[str, Variable]

    @property
    def num_shards(self) -> int:
        """Number of shards."""
        return -(-self.count // self.samples_per_shard)

    def samples_of(self, shard: int) -> range:
        """Indices of the samples of a shard."""
        start = shard * self.samples_per_shard
        return range(start, min(self.count, start + self.samples_per_shard))

    def rows(self, values: dict[str, Any]) -> dict[str, NDArray[Any]]:
        """A sample's row of every variable: fill values if there are none."""
        rows = {}
        for name, variable in self.variables.items():
            with located(f"{name}: "):
                rows[name] = variable.row(values.get(name))
        return rows

    def files_of(self, shard: int) -> dict[str, str]:
        """File of every variable for a shard, relative to the dataset, as Zarr names its chunks."""
        return {name: file_of(name, shard, len(variable.shape)) for name, variable in self.variables.items()}


def file_of(name: str, shard: int, num_axes: int) -> str:
    """File of a variable with further axes after `sample`, as Zarr names the chunks of a shard."""
    return "/".join([name, "c", str(shard), *["0"] * num_axes])


@dataclass(frozen=True)
class Coordinate:
    """Values along an axis, with unit and meaning."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    attrs: dict[str, Any]


def layout_of(
    variation: Variation,
    names: tuple[str, ...],
    labels: Labels,
    frames: list[Frame],
    count: int,
    samples_per_shard: int | None,
) -> Layout:
    """Variables and shards of a dataset whose samples have frames like these, and bodies of these names."""
    variables = {
        **_frame_variables(frames),
        **_label_variables(frames, names, labels),
        **_parameter_variables(variation),
        "error": Variable((), (), TEXT, "", {"long_name": "why the sample could not be simulated"}),
        "status": Variable(
            *((), (), "int8", STATUS["missing"]),
            {"flag_values": list(STATUS.values()), "flag_meanings": " ".join(STATUS)},  # by the CF conventions
        ),
    }
    sample_bytes = sum(variable.row_bytes for variable in variables.values())
    return Layout(count, samples_in_shard(count, sample_bytes, samples_per_shard), variables)


def samples_in_shard(count: int, sample_bytes: int, given: int | None) -> int:
    """Samples of a shard: as given, or so that there are many shards and none is large."""
    if given is not None:
        return check.count("samples_per_shard", given)
    return max(1, min(_SHARD_BYTES // max(1, sample_bytes), -(-count // _SHARDS), _MAX_SAMPLES))


def attributes_of(variation: Variation, layout: Layout, seed: int, labels: Labels, radar: Radar) -> dict[str, Any]:
    """Attributes of a dataset; a resumed run compares `settings`."""
    import zarr

    settings = {
        "scene": variation.path.read_text(encoding="utf-8"),
        "count": layout.count,
        "seed": seed,
        "labels": asdict(labels),
        "samples_per_shard": layout.samples_per_shard,
        "files": digests_of(variation.path),
        "radarcore": _core.__version__,
        "zarr": zarr.__version__,
    }
    if any(parameter.kind == "normal" for parameter in variation.parameters):
        settings["scipy"] = scipy.__version__
    return {
        "format": FORMAT,
        "version": VERSION,
        "scene_path": str(variation.path.absolute()),
        **{name: settings[name] for name in ("scene", "count", "seed", "radarcore")},
        "radar": json.dumps(radar.to_dict()),
        # A number, as netCDF has no truth values.
        "radar_varies": int(any(parameter.path.startswith("radar.") for parameter in variation.parameters)),
        "signs": SIGNS,
        "settings": json.dumps(settings),
    }


def stored_samples(frame: Frame) -> NDArray[Any]:
    """Samples of a frame as a dataset stores them: codes if the receiver has an ADC of 12 bits."""
    return frame.cube if frame.raw is None else frame.raw


def stored_parameters(values: Mapping[str, Any], layout: Layout) -> dict[str, Any]:
    """Drawn values by the names of their variables; true and false become texts."""
    stored: dict[str, float | str] = {}
    for name, variable in layout.variables.items():
        path = variable.attrs.get("path")
        if path is None or path not in values:
            continue
        value = values[path]
        if variable.dtype != TEXT:
            stored[name] = float(value)
        else:
            stored[name] = value if isinstance(value, str) else json.dumps(value)
    return stored


def _frame_variables(frames: list[Frame]) -> dict[str, Variable]:
    """Samples and times."""
    first, num_frames = frames[0], len(frames)
    cube = stored_samples(first)
    axes, shape = ("frame", "channel", "chirp", "fast_time"), (num_frames, *cube.shape)
    attrs: dict[str, Any] = {
        "units": unit_of(first) or "sqrt(W)",
        "coordinates": "time slow_time",
        "long_name": "beat signal",
    }
    variable = Variable(axes, shape, cube.dtype.name, np.nan, attrs)
    if first.raw is not None:
        # As CF conventions and xarray have it: value = code * scale_factor + add_offset.
        scale = {"scale_factor": 2.0 / (NUM_CODES - 1), "add_offset": -1.0, "_FillValue": NO_CODE}
        attrs |= {"units": "full scale", **scale}
        variable = Variable(axes, shape, "uint16", NO_CODE, attrs, compressed=True)
    time = {"units": "s", "long_name": "start of the first chirp"}
    return {"cube": variable, "time": Variable(("frame",), (num_frames,), "float64", np.nan, time)}


def _label_variables(frames: list[Frame], names: tuple[str, ...], labels: Labels) -> dict[str, Variable]:
    variables = {}
    for name, (dims, lengths, dtype, attrs) in dims_of(frames[0].radar, names, labels).items():
        axes = ("frame", *(_AXES.get(axis, axis) for axis in dims))
        is_integer = dtype.kind == "i"
        fill = -1 if is_integer else np.nan
        variables[name] = Variable(axes, (len(frames), *lengths), dtype.name, fill, dict(attrs), is_integer)
    return variables


def _parameter_variables(variation: Variation) -> dict[str, Variable]:
    """A variable per parameter that varies."""
    variables: dict[str, Variable] = {}
    for parameter in variation.parameters:
        name = f"parameter.{parameter.path}".replace("/", "_")  # Zarr's names are names of folders
        if (other := variables.get(name)) is not None:
            paths = f"{other.attrs['path']!r} and {parameter.path!r}"
            raise ValueError(f"{variation.path}: expected names that differ in more than / and _, got {paths}")
        attrs = {"path": parameter.path, "distribution": parameter.kind}
        if parameter.unit:
            attrs["units"] = parameter.unit
        dtype, fill = ("float64", np.nan) if parameter.is_number else (TEXT, "")
        variables[name] = Variable((), (), dtype, fill, attrs)
    return variables


def coordinates_of(radar: Radar, names: tuple[str, ...], layout: Layout) -> dict[str, Coordinate]:
    """Names along axes, and the axes of the samples and of their transforms, if the radar has one waveform."""
    texts = {"body": names, "joint": JOINTS, "xyz": ("x", "y", "z")}
    used = {"body", *(axis for variable in layout.variables.values() for axis in variable.dims)}
    coordinates = {
        axis: Coordinate((axis,), np.array(values, np.dtypes.StringDType()), {})
        for axis, values in texts.items()
        if axis in used
    }
    if len(radar.waveforms) > 1:
        return coordinates
    wf = radar.waveform
    fast = np.arange(wf.num_samples) / wf.sample_rate
    slow = {"units": "s", "long_name": "start of a chirp in its frame"}
    coordinates["fast_time"] = Coordinate(("fast_time",), fast, {"units": "s"})
    coordinates["slow_time"] = Coordinate(("chirp",), np.asarray(wf.chirp_times), slow)
    if wf.is_cw:
        return coordinates
    ranges = wf.range_axis()
    if radar.is_real:
        ranges = ranges[: wf.num_samples // 2 + 1]
    velocity = {"units": "m/s", "long_name": "range rate, receding positive"}
    coordinates["range"] = Coordinate(("range",), ranges, {"units": "m", "long_name": "range"})
    coordinates["velocity"] = Coordinate(("velocity",), wf.velocity_axis(), velocity)
    return coordinates
