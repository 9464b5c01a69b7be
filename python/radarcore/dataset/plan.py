"""Plan of a dataset, from its first sample: variables, axes and attributes."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.dataset.files import digests_of
from radarcore.dataset.joints import JOINTS
from radarcore.dataset.labels import dims_of
from radarcore.dataset.layout import STATUS, TEXT, Layout, Variable, samples_per_shard
from radarcore.dataset.notices import gathered
from radarcore.dataset.recipe import AXES, Recipe, cube_of, parameters_of, simulated
from radarcore.radar.radar import Radar
from radarcore.recording.frame import NUM_CODES, Frame, unit_of

FORMAT, VERSION = "radarcore dataset", 1

SIGNS = "range rate is positive when receding; the sensor looks along +x, azimuth is positive to the left, elevation up"

NO_CODE = 2**16 - 1
"""In place of codes of samples that are not there; an ADC has codes of 12 bits."""

_TRIES = 20
"""Samples that are tried for one that shows what all have in common."""


@dataclass(frozen=True)
class Coordinate:
    """Values along an axis.

    Parameters
    ----------
    dims : tuple of str
        The axis.
    values : array
    attrs : dict
        Unit and meaning.
    """

    dims: tuple[str, ...]
    values: NDArray[Any]
    attrs: dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """Plan of a dataset.

    Parameters
    ----------
    layout : Layout
    coordinates : dict
        By their names.
    attrs : dict
        Of the dataset, `settings` among them.
    """

    layout: Layout
    coordinates: dict[str, Coordinate]
    attrs: dict[str, Any]


def settings_of(recipe: Recipe, count: int, samples_of_shard: int | None) -> dict[str, Any]:
    """Settings that results follow from, as JSON holds them; they are compared when a run is resumed."""
    return {
        "scene": recipe.variation.path.read_text(encoding="utf-8"),
        "count": count,
        "seed": recipe.seed,
        "labels": asdict(recipe.labels),
        "samples_per_shard": samples_of_shard,
        "files": digests_of(recipe.variation.path),
        "radarcore": _core.__version__,
    }


def planned(recipe: Recipe, count: int, given_samples_per_shard: int | None) -> Plan:
    """Simulate samples until there is one, the first as a rule, and see what it has; its error if there is none."""
    error: Exception | None = None
    for index in range(min(count, _TRIES)):
        try:
            with gathered():
                sample = recipe.sample(index)
                frames = [frame for _, frame in simulated(recipe, sample)]
            break
        except Exception as failure:
            error = error or failure
    else:
        assert error is not None  # as there is at least one sample
        raise error

    radar = frames[0].radar
    variables = {**_results(recipe, frames), **_parameters(recipe), "status": _status()}
    sample_bytes = sum(variable.row_bytes for variable in variables.values())
    layout = Layout(count, samples_per_shard(count, sample_bytes, given_samples_per_shard), variables)
    for name, value in parameters_of(sample, layout).items():
        variables[name].row(value)
    varies = any(parameter.path.partition(".")[0] == "radar" for parameter in recipe.variation.parameters)
    settings = settings_of(recipe, count, layout.samples_per_shard)
    attrs = {
        "format": FORMAT,
        "version": VERSION,
        "scene_path": str(recipe.variation.path.absolute()),
        **{name: value for name, value in settings.items() if name not in ("labels", "samples_per_shard", "files")},
        "radar": json.dumps(radar.to_dict()),
        "radar_varies": varies,
        "signs": SIGNS,
        "settings": json.dumps(settings),
    }
    return Plan(layout, _coordinates(radar, recipe.body_names, variables), attrs)


def _results(recipe: Recipe, frames: list[Frame]) -> dict[str, Variable]:
    """Samples, times and labels."""
    first, num_frames = frames[0], len(frames)
    cube = cube_of(first)
    axes, shape = ("frame", "channel", "chirp", "fast_time"), (num_frames, *cube.shape)
    names = {"coordinates": "time slow_time", "long_name": "beat signal"}
    if first.raw is not None:
        # As CF conventions and xarray have it: value = code * scale_factor + add_offset.
        scale = {"scale_factor": 2.0 / (NUM_CODES - 1), "add_offset": -1.0, "_FillValue": NO_CODE}
        attrs = {"units": "full scale", **names, **scale}
        variables = {"cube": Variable(axes, shape, "uint16", NO_CODE, attrs, compressed=True)}
    else:
        attrs = {"units": unit_of(first) or "sqrt(W)", **names}
        variables = {"cube": Variable(axes, shape, cube.dtype.name, np.nan, attrs)}
    time = {"units": "s", "long_name": "start of the first chirp"}
    variables["time"] = Variable(("frame",), (num_frames,), "float64", np.nan, time)
    labels = dims_of(first.radar, recipe.body_names, recipe.labels)
    for name, (dims, lengths, dtype, attrs) in labels.items():
        named = ("frame", *(AXES.get(axis, axis) for axis in dims))
        is_map = len(dims) > 1 and np.dtype(dtype).kind in "iub"
        variables[name] = Variable(
            named, (num_frames, *lengths), np.dtype(dtype).name, _fill_of(np.dtype(dtype), attrs), dict(attrs), is_map
        )
    return variables


def _fill_of(dtype: np.dtype[Any], attrs: dict[str, Any]) -> Any:
    """Fill value: NaN, of integers the one that attributes name, or -1."""
    if dtype.kind in "fc":
        return np.nan
    return attrs.get("_FillValue", -1 if dtype.kind == "i" else 0)


def _parameters(recipe: Recipe) -> dict[str, Variable]:
    """A variable per parameter that varies."""
    variables: dict[str, Variable] = {}
    for parameter in recipe.variation.parameters:
        # Zarr's names are those of folders.
        name = f"parameter.{parameter.path}".replace("/", "_")
        if (other := variables.get(name)) is not None:
            paths = f"{other.attrs['path']!r} and {parameter.path!r}"
            raise ValueError(f"{recipe.variation.path}: expected names that differ in more than / and _, got {paths}")
        attrs = {"path": parameter.path, "distribution": parameter.kind}
        if parameter.unit:
            attrs["units"] = parameter.unit
        dtype, fill = ("float64", np.nan) if parameter.is_number else (TEXT, "")
        variables[name] = Variable((), (), dtype, fill, attrs)
    return variables


def _status() -> Variable:
    """Attributes of the flag `status`, by the CF conventions."""
    attrs = {"flag_values": list(STATUS.values()), "flag_meanings": " ".join(STATUS)}
    return Variable((), (), "int8", STATUS["missing"], attrs)


def _coordinates(radar: Radar, body_names: tuple[str, ...], variables: dict[str, Variable]) -> dict[str, Coordinate]:
    """Names along axes, and the axes of the samples and their transforms, which are the same in all samples.

    Of several waveforms, each has its own.
    """
    named = {"body": body_names, "joint": JOINTS, "xyz": ("x", "y", "z")}
    used = {"body", *(axis for variable in variables.values() for axis in variable.dims)}
    coordinates = {
        axis: Coordinate((axis,), np.array(names, np.dtypes.StringDType()), {})
        for axis, names in named.items()
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
