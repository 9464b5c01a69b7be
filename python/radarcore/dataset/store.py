"""Zarr groups of datasets: variables planned from the first sample, created once, then written shard by shard.

A shard is some consecutive samples, with one file per variable. Its `status` is written last: a shard that has all of
its files is complete. Every file is written beside its place and renamed, so none is ever half there.
"""

from __future__ import annotations

import errno
import json
import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radarcore import _core, check
from radarcore.dataset.labels import JOINTS, Labels, dims_of
from radarcore.dataset.sample import digests_of, keep
from radarcore.dataset.variation import Variation
from radarcore.output import PartFolder, already_exists, check_folder_name, is_empty, naming
from radarcore.radar.radar import Radar
from radarcore.recording.frame import NUM_CODES, Frame, unit_of

Rows = dict[str, NDArray[Any]]
"""Arrays of every variable, of a shard or of a sample."""

_LEVEL = 1
"""Level of Zstandard: higher ones take longer, and compress ADC codes hardly better."""

_PARTIAL = re.compile(r".*\.[0-9a-f]{32}\.partial")
"""Names of the files that Zarr is writing."""

_ARRAYS, _ATTRIBUTES = ("cube", "status", "error"), ("scene_path", "scene", "seed", "radar", "settings")
"""Arrays and attributes of every dataset."""

_LONGEST_REASON = 200
"""Characters of another library's message."""

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
"""Smallest number of shards, if there are enough samples, and largest number of samples in a shard."""

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


@dataclass(frozen=True)
class Shards:
    """Samples of a dataset in shards."""

    count: int
    """Samples."""
    size: int
    """Consecutive samples of a shard; the last one may have fewer."""

    @property
    def number(self) -> int:
        """Number of shards."""
        return -(-self.count // self.size)

    def samples(self, shard: int) -> range:
        """Indices of the samples of a shard."""
        return range(shard * self.size, min(self.count, (shard + 1) * self.size))


@dataclass(frozen=True)
class Layout:
    """Shards of a dataset, and its variables by their names; `status` is the last."""

    shards: Shards
    variables: dict[str, Variable]

    def empty_rows(self, shard: int) -> Rows:
        """Fill values of a shard."""
        number = len(self.shards.samples(shard))
        return {
            name: np.full((number, *each.shape), each.fill, object if each.dtype == TEXT else each.dtype)
            for name, each in self.variables.items()
        }

    def missing_file(self, path: Path, shard: int) -> Path | None:
        """The first file of a shard that is not there; None if the shard is complete."""
        files = (path / file_of(name, shard, len(each.shape)) for name, each in self.variables.items())
        return next((file for file in files if not file.is_file()), None)


def put(rows: Rows, name: str, frame: int, value: NDArray[Any]) -> None:
    """Put a value of a frame into the rows of a sample; refuse a shape or type that other samples do not have."""
    row = rows[name][frame]
    if (value.shape, value.dtype) != (row.shape, row.dtype):
        expected, got = (f"{each.dtype} of shape {each.shape}" for each in (row, value))
        raise ValueError(f"{name}: expected {expected} as in all samples, got {got}")
    row[...] = value


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
    variation: Variation | None,
    names: tuple[str, ...],
    labels: Labels,
    frames: list[Frame],
    count: int,
    samples_per_shard: int | None,
) -> Layout:
    """Variables and shards of a dataset whose samples have frames like these, and bodies of these names.

    A recording has no variation.
    """
    variables = {
        **_frame_variables(frames),
        **_label_variables(frames, names, labels),
        **({} if variation is None else _parameter_variables(variation)),
        "error": Variable((), (), TEXT, "", {"long_name": "why the sample could not be simulated"}),
        "status": Variable(
            *((), (), "int8", STATUS["missing"]),
            {"flag_values": list(STATUS.values()), "flag_meanings": " ".join(STATUS)},  # by the CF conventions
        ),
    }
    sample_bytes = sum(variable.row_bytes for variable in variables.values())
    return Layout(Shards(count, samples_in_shard(count, sample_bytes, samples_per_shard)), variables)


def samples_in_shard(count: int, sample_bytes: int, given: int | None) -> int:
    """Samples of a shard: as given, or so that there are many shards and none is large."""
    if given is not None:
        return check.count("samples_per_shard", given)
    return max(1, min(_SHARD_BYTES // max(1, sample_bytes), -(-count // _SHARDS), _MAX_SAMPLES))


def attributes_of(
    variation: Variation | None, layout: Layout, seed: int, labels: Labels, radar: Radar
) -> dict[str, Any]:
    """Attributes of a dataset; a resumed run compares `settings`. The text of the scene is empty for a recording."""
    parameters = () if variation is None else variation.parameters
    settings = {
        "scene": "" if variation is None else variation.path.read_text(encoding="utf-8"),
        "count": layout.shards.count,
        "seed": seed,
        "labels": asdict(labels),
        "samples_per_shard": layout.shards.size,
        "files": {} if variation is None else digests_of(variation.path),
        "radarcore": _core.__version__,
        "zarr": zarr().__version__,
    }
    if any(parameter.kind == "normal" for parameter in parameters):
        settings["scipy"] = scipy.__version__
    return {
        "format": FORMAT,
        "version": VERSION,
        "scene_path": "" if variation is None else str(variation.path.absolute()),
        **{name: settings[name] for name in ("scene", "count", "seed", "radarcore")},
        "radar": json.dumps(radar.to_dict()),
        # A number, as netCDF has no truth values.
        "radar_varies": int(any(parameter.path.startswith("radar.") for parameter in parameters)),
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
        if (path := variable.attrs.get("path", "")) in values:
            needs_json = variable.dtype == TEXT and not isinstance(values[path], str)
            stored[name] = json.dumps(values[path]) if needs_json else values[path]
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
    has_codes = first.raw is not None
    if has_codes:
        # As CF conventions and xarray have it: value = code * scale_factor + add_offset.
        attrs |= {"scale_factor": 2.0 / (NUM_CODES - 1), "add_offset": -1.0, "_FillValue": NO_CODE}
    variable = Variable(axes, shape, cube.dtype.name, NO_CODE if has_codes else np.nan, attrs, has_codes)
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


def zarr() -> Any:
    """The package, or an ImportError that names the extra."""
    try:
        import zarr as package
    except ImportError as error:
        raise ImportError("datasets need zarr and xarray: pip install radarcore[zarr]") from error
    return package


def create(path: Path, layout: Layout, coordinates: dict[str, Coordinate], attrs: dict[str, Any]) -> None:
    """Make the group with all its variables, whole or not at all."""
    check_folder_name(path)
    with PartFolder(path) as part:
        if path.exists() and not (path.is_dir() and is_empty(path)):
            raise already_exists(path, "a dataset that another process has made meanwhile; resume=True continues it")
        partial = part.folder / path.name
        group = zarr().create_group(partial, attributes=attrs)
        for name, variable in layout.variables.items():
            _create_variable(group, name, variable, layout)
        for name, coordinate in coordinates.items():
            array = group.create_array(
                name,
                shape=coordinate.values.shape,
                dtype=str if coordinate.values.dtype.kind == "T" else coordinate.values.dtype,
                dimension_names=coordinate.dims,
                attributes=coordinate.attrs,
                compressors=None,
            )
            array[...] = coordinate.values
        with warnings.catch_warnings():
            # Zarr warns that other libraries may not know consolidated metadata; they read the metadata of each array.
            warnings.filterwarnings("ignore", message="Consolidated metadata")
            zarr().consolidate_metadata(partial)
        if attrs["scene"]:
            keep(Path(attrs["scene_path"]), partial)
        part.put(partial)


def _create_variable(group: Any, name: str, variable: Variable, layout: Layout) -> None:
    from zarr.codecs import Crc32cCodec, ZstdCodec

    rows = (layout.shards.size, *variable.shape)
    group.create_array(
        name,
        shape=(layout.shards.count, *variable.shape),
        chunks=(1, *variable.shape) if variable.is_large else rows,
        shards=rows if variable.is_large else None,
        dtype=str if variable.dtype == TEXT else variable.dtype,
        fill_value=variable.fill,
        compressors=[ZstdCodec(level=_LEVEL), Crc32cCodec()] if variable.compressed else [Crc32cCodec()],
        dimension_names=("sample", *variable.dims),
        attributes=variable.attrs,
    )


def writable(path: Path) -> dict[str, Any]:
    """The arrays of a dataset, to be written."""
    # A shard of fill values has a file as well: that tells it from one that is missing.
    config = {"write_empty_chunks": True}
    return {name: array.with_config(config) for name, array in zarr().open_group(path, mode="r+").arrays()}


def write_shard(path: Path, arrays: dict[str, Any], layout: Layout, shard: int, rows: Rows) -> None:
    """Write the samples of a shard, `status` last; an OSError names the file that cannot be written."""
    samples = layout.shards.samples(shard)
    for name, variable in layout.variables.items():
        with naming(path / file_of(name, shard, len(variable.shape))):
            arrays[name][samples.start : samples.stop] = rows[name]


def clear_partial(path: Path, layout: Layout) -> None:
    """Delete the unfinished files of writers that were killed."""
    for name in layout.variables:
        for file in (path / name / "c").rglob("*.partial"):
            if _PARTIAL.fullmatch(file.name):
                file.unlink(missing_ok=True)


def opened(path: Path) -> Any:
    """The Zarr group of a dataset; a ValueError if it is none."""
    package = zarr()
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, "expected a dataset, got no such path", str(path))
    attrs = attrs_of(path)
    if attrs is None:
        what = "a folder without one" if path.is_dir() else "a file, no folder"
        raise ValueError(f"{path}: expected a dataset, got {what}")
    if attrs["version"] != VERSION:
        raise ValueError(f"{path}: expected version {VERSION} of datasets, got {attrs['version']!r}")
    try:
        group = package.open_group(path, mode="r")
        arrays = dict(group.arrays())
    except Exception as error:  # zarr raises many kinds for damaged metadata
        text = " ".join(str(error).split())[:_LONGEST_REASON]
        raise ValueError(f"{path}: expected a dataset, got a damaged one ({text or type(error).__name__})") from error
    missing = [name for name in _ARRAYS if name not in arrays] + [name for name in _ATTRIBUTES if name not in attrs]
    missing += [f"axes of {name}" for name, array in arrays.items() if not array.metadata.dimension_names]
    if missing:
        raise ValueError(f"{path}: expected a dataset, got a damaged one without {', '.join(missing)}")
    return group


def attrs_of(path: Path) -> dict[str, Any] | None:
    """Attributes of the dataset at a path; None if there is none."""
    try:
        attrs = json.loads((path / "zarr.json").read_bytes())["attributes"]
        is_ours = attrs["format"] == FORMAT and isinstance(attrs["version"], int)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return dict(attrs) if is_ours else None
