"""Values of a varied scene file: what is drawn in place, under paths such as ``human.person 0.speed``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, get_args

from radarcore.dataset.distributions import Choice, Distribution, distribution_of, is_distribution
from radarcore.scenefile.read import located
from radarcore.scenefile.tables import SceneTable

KINDS = ("body", "point", "human", "arm", "interferer")
"""Arrays of tables whose entries have names and may be repeated."""

Pick = Callable[[str, Distribution], tuple[Any, int | None]]
"""Value drawn for a path, and the number of the option of a choice."""

_MOST_COPIES = 1000

_SHAPE = "the shape of the cube"
_AXES = "the axes of the cube"
_FIXED = {
    **dict.fromkeys(("preset", "num_samples", "num_chirps", "alternating", "sequences", "chirp_times"), _SHAPE),
    **dict.fromkeys(("max_range", "range_resolution", "max_velocity", "velocity_resolution", "rate"), _SHAPE),
    **dict.fromkeys(("start_frequency", "stop_frequency", "slope", "sample_rate"), _AXES),
    **dict.fromkeys(("chirp_interval", "frame_interval", "adc_delay"), _AXES),
}
"""Keys of the radar that are the same in all samples, and what they decide."""

_OF_ANGLES = ("azimuth_deg", "elevation_deg", "phases_deg")
"""Keys of a schedule that decide neither shape nor axes."""


@dataclass(frozen=True)
class Varied:
    """A value that is drawn, at its place in the tables."""

    distribution: Distribution


@dataclass(frozen=True)
class Repeated:
    """An entry of an array of tables that comes in copies, as many as its distribution says."""

    name: str
    count: Distribution
    table: dict[str, Any]


@dataclass(frozen=True)
class Found:
    """A distribution at a path, the options of choices around it, (path, number of the option), and of which copy."""

    path: str
    distribution: Distribution
    within: tuple[tuple[str, int], ...] = ()
    copy: int = 0


def varies(values: object) -> bool:
    """True for tables of a scene file with a distribution, or an entry that comes in copies."""
    if isinstance(values, dict):
        return is_distribution(values) or "repeat" in values or any(map(varies, values.values()))
    return isinstance(values, list) and any(map(varies, values))


def prepared(values: dict[str, Any]) -> dict[str, Any]:
    """The tables with `Varied` and `Repeated` in the place of what stands for them, and a name for every entry.

    A ValueError names the path of what is wrong.
    """
    result: dict[str, Any] = {}
    for key, value in values.items():
        if is_distribution(value):
            raise ValueError(f"{key}: expected distributions of values in it, got one of the whole")
        if key in (*KINDS, "material") and isinstance(value, list):
            result[key] = [_entry(key, i, table) for i, table in enumerate(value)]
        else:
            result[key] = _varied(value, key)
    return result


def _entry(kind: str, index: int, table: Any) -> Any:
    """An entry of an array of tables."""
    if not isinstance(table, dict) or is_distribution(table):
        got = repr(table) if not isinstance(table, dict) else "a distribution"
        raise ValueError(f"{kind}[{index}]: expected a table, got {got}")
    name = table.get("name", _default_name(kind) or f"{kind} {index}")
    if not isinstance(name, str):
        raise ValueError(f"{kind}[{index}]: name: expected text, the same in all samples, got {name!r}")
    if kind == "material":
        return {key: _varied(value, f"{kind}.{name}.{key}") for key, value in table.items()}
    path = f"{kind}.{name}"
    own = {"name": name, **{key: _varied(value, f"{path}.{key}") for key, value in table.items() if key != "repeat"}}
    return Repeated(name, _count(table["repeat"], f"{path}.repeat"), own) if "repeat" in table else own


def _default_name(kind: str) -> str | None:
    (table,) = get_args(SceneTable.model_fields[kind].annotation)  # of a list of tables
    default = table.model_fields["name"].default
    return default if isinstance(default, str) else None


def _count(value: Any, path: str) -> Distribution:
    with located(f"{path}: "):
        found = distribution_of(value) if is_distribution(value) else Choice([value])
        if any(isinstance(end, bool) or not isinstance(end, int) for end in found.ends):
            raise ValueError(f"expected an integer, or a distribution of integers, got {value!r}")
        if min(found.ends) < 0 or max(found.ends) > _MOST_COPIES:
            raise ValueError(f"expected 0 to {_MOST_COPIES} copies, got {value!r}")
    return found


def _varied(value: Any, path: str) -> Any:
    if is_distribution(value):
        _check_may_vary(path)
        with located(f"{path}: "):
            found = distribution_of(value)
        if isinstance(found, Choice):
            options = tuple(_varied(option, f"{path}{{{k}}}") for k, option in enumerate(found.values))
            found = Choice(options, found.weights)
        return Varied(found)
    if isinstance(value, dict):
        return {key: _varied(entry, f"{path}.{key}") for key, entry in value.items()}
    if isinstance(value, list):
        return [_varied(entry, f"{path}[{i}]") for i, entry in enumerate(value)]
    return value


def _check_may_vary(path: str) -> None:
    """Refuse to vary what all samples of a dataset share."""
    table, _, rest = path.partition(".")
    key = rest.partition(".")[0].partition("[")[0].partition("{")[0]
    reason = None
    if table == "radar":
        reason = _FIXED.get(key)
        if rest in ("tx", "rx", "tx_patterns", "rx_patterns", "receiver.output"):
            reason = _SHAPE
        elif key == "schedule" and not rest.removeprefix("schedule.").startswith(_OF_ANGLES):
            reason = _AXES
    elif table == "run" and key in ("start", "stop", "rate"):
        reason = "the number of frames"
    if reason is not None:
        raise ValueError(shared(path, reason))


def shared(path: str, reason: str) -> str:
    """Error of a distribution for a value that all samples share."""
    return f"{path}: expected one value for all samples, as it decides {reason}, got a distribution"


def resolved(tables: dict[str, Any], pick: Pick) -> tuple[dict[str, Any], dict[str, Any]]:
    """Tables with a value in every place, and the values that were drawn by path.

    Of a choice of tables or lists the number of the option counts as the value.
    """
    drawn: dict[str, Any] = {}

    def value_of(value: Any, path: str) -> Any:
        if isinstance(value, Varied):
            found, number = pick(path, value.distribution)
            if number is not None and isinstance(found, dict | list | Varied):
                drawn[path] = number
                return value_of(found, f"{path}{{{number}}}")
            drawn[path] = found
            return found
        if isinstance(value, dict):
            return {key: value_of(entry, f"{path}.{key}") for key, entry in value.items()}
        if isinstance(value, list):
            return [value_of(entry, f"{path}[{i}]") for i, entry in enumerate(value)]
        return value

    def entries_of(kind: str, entry: Any) -> Iterator[dict[str, Any]]:
        if not isinstance(entry, Repeated):
            yield value_of(entry, f"{kind}.{entry.get('name')}")
            return
        path = f"{kind}.{entry.name}.repeat"
        count = entry.count.ends[0]
        if len(set(entry.count.ends)) > 1:
            count = drawn[path] = pick(path, entry.count)[0]
        for k in range(count):
            name = f"{entry.name} {k}"
            yield value_of({**entry.table, "name": name}, f"{kind}.{name}")

    result: dict[str, Any] = {}
    for key, value in tables.items():
        if key in (*KINDS, "material") and isinstance(value, list):
            result[key] = [table for entry in value for table in entries_of(key, entry)]
        else:
            result[key] = value_of(value, key)
    return result, drawn


def found_in(tables: dict[str, Any]) -> Iterator[Found]:
    """All distributions, those of copies once for every copy that there may be."""
    for key, value in tables.items():
        if key not in (*KINDS, "material") or not isinstance(value, list):
            yield from _found(value, key, ())
            continue
        for entry in value:
            if not isinstance(entry, Repeated):
                yield from _found(entry, f"{key}.{entry.get('name')}", ())
                continue
            if len(set(entry.count.ends)) > 1:
                yield Found(f"{key}.{entry.name}.repeat", entry.count)
            for k in range(max(entry.count.ends)):
                for each in _found(entry.table, f"{key}.{entry.name} {k}", ()):
                    yield replace(each, copy=k)


def _found(value: Any, path: str, within: tuple[tuple[str, int], ...]) -> Iterator[Found]:
    if isinstance(value, Varied):
        yield Found(path, value.distribution, within)
        if isinstance(value.distribution, Choice):
            for k, option in enumerate(value.distribution.values):
                yield from _found(option, f"{path}{{{k}}}", (*within, (path, k)))
    elif isinstance(value, dict):
        for key, entry in value.items():
            yield from _found(entry, f"{path}.{key}", within)
    elif isinstance(value, list):
        for i, entry in enumerate(value):
            yield from _found(entry, f"{path}[{i}]", within)
