"""Reader of scene files: tables from text, and errors, one line per fault."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, get_args

from pydantic import ValidationError

from radarcore import check
from radarcore.scenefile.tables import SceneTable, Table

Location = tuple[str | int, ...]

_MOST_LINES = 50
"""Faults that a message names."""

DISTRIBUTIONS = ("uniform", "normal", "log_uniform", "integers", "choice")
"""Keys of a table that stands for a value of a variation: scene files have no such keys."""

_DISTRIBUTION = "a distribution, which radarcore.dataset.Variation draws from"


def table(file: Path) -> SceneTable:
    """The tables of a file, with every key known and of the right type."""
    return tables_of(values_of(file), file)


def values_of(file: Path) -> dict[str, Any]:
    """Tables of a TOML file."""
    if file.is_dir() or file.suffix == ".npz":
        got = "a folder" if file.is_dir() else "an .npz file"
        raise ValueError(
            f"{file}: expected a scene file (TOML), got {got}; load_radar and --radar read the radar of a recording"
        )
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{file}: not TOML: {error}") from None
    except RecursionError:
        raise ValueError(f"{file}: not TOML: nested too deeply") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{file}: not TOML: expected UTF-8, got byte {error.object[error.start]:#04x}") from None


def tables_of(values: dict[str, Any], file: Path) -> SceneTable:
    """The tables of what stands in a file, with every key known and of the right type."""
    try:
        # Strict validation takes arrays for tuples only in JSON.
        return SceneTable.model_validate_json(json.dumps(values, default=str))
    except ValidationError as error:
        lines = [f"{file}: {line}" for line in _lines(error, values)]
        if len(lines) > _MOST_LINES:
            lines[_MOST_LINES:] = [f"{file}: and {len(lines) - _MOST_LINES} further faults"]
        raise ValueError("\n".join(lines)) from None


def unknown(name: str, known: Iterable[str]) -> str:
    """Text about an unknown name, with near ones that are known."""
    return f"{name!r}; {check.near_names(name, known)}"


def place(kind: str, index: int, name: object) -> str:
    """A table of an array as messages name it: ``body[2] 'table'``."""
    return f"{kind}[{index}]" + (f" {name!r}" if isinstance(name, str) else "")


def kind_of(table: type[Table]) -> str:
    """The `kind` that selects a table, or ""."""
    field = table.model_fields.get("kind")
    return "" if field is None else str(get_args(field.annotation)[0])


def unit_of(description: str | None) -> str:
    """The unit at the end of a key's description, or ""."""
    match = re.search(r"\[([^\]]+)\]$", description or "")
    return match.group(1) if match else ""


def unit_at(location: Location) -> str:
    """The unit of the key at a place of a file, or ""."""
    return _key(location, is_unknown=False).unit


def tables_in(annotation: Any) -> list[type[Table]]:
    """Tables that a type is made of."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return [annotation]
    return [table for part in get_args(annotation) for table in tables_in(part)]


class _Key(NamedTuple):
    """A place in a file."""

    path: Location
    """Keys and indices, as the user wrote them."""
    unit: str
    known: list[str]
    """Keys of the table that the last one is in."""
    kinds: list[str]
    """Kinds of table that may be there."""


class _Fault(NamedTuple):
    """Fault at a place of the file."""

    path: Location
    expected: str
    unit: str
    got: str
    is_unknown_key: bool = False
    meant: Location | None = None
    """The key that an unknown one was probably meant to be."""


# Expected values by pydantic's types of errors.
_EXPECTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "int_type": "an integer",
    "int_from_float": "an integer",
    "int_parsing": "an integer",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "missing": "a value",
}


def _lines(error: ValidationError, values: dict[str, Any]) -> Iterator[str]:
    """Lines of an error message, one per fault: place, expected, got."""
    faults: dict[Location, _Fault] = {}
    for details in error.errors(include_url=False):
        fault = _fault(details)
        if (other := faults.get(fault.path)) is not None:  # a value of one of several types
            fault = fault._replace(expected=f"{other.expected} or {fault.expected}")
        faults[fault.path] = fault
    misspelt = {fault.meant for fault in faults.values()}
    for path, fault in faults.items():
        if path in misspelt and fault.got == "none":
            continue  # missing only because its name is wrong
        # For a union of types the fault inside says more than that of the whole.
        if not any(path == other[: len(path)] for other in faults if len(other) > len(path)):
            unit = f" [{fault.unit}]" if fault.unit else ""
            if fault.is_unknown_key:
                yield ": ".join(filter(None, [_path_text(path[:-1], values), fault.expected]))
            else:
                yield f"{_path_text(path, values)}: expected {fault.expected}{unit}, got {fault.got}"


def _fault(details: Any) -> _Fault:
    kind, value, context = details["type"], details["input"], details.get("ctx", {})
    key = _key(details["loc"], is_unknown=kind == "extra_forbidden")
    if kind == "extra_forbidden":
        name = str(key.path[-1])
        if name in DISTRIBUTIONS and len(key.path) > 1:
            return _Fault(key.path[:-1], "a table", "", _DISTRIBUTION)
        near = check.near(name, key.known)
        meant = (*key.path[:-1], near[0]) if near else None
        known = key.known if near or not check.near(name, DISTRIBUTIONS) else DISTRIBUTIONS
        return _Fault(key.path, f"unknown key {unknown(name, known)}", "", "", is_unknown_key=True, meant=meant)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        # The place is the table; what is wrong is its kind.
        got = repr(context["tag"]) if "tag" in context else "none"
        return _Fault((*key.path, "kind"), f"one of {', '.join(map(repr, key.kinds))}", "", got)
    if kind == "literal_error":
        return _Fault(key.path, context["expected"], "", repr(value))
    if kind in ("too_long", "too_short"):
        number = context.get("max_length", context.get("min_length"))
        return _Fault(key.path, f"{number} values", key.unit, str(context["actual_length"]))
    expected = _EXPECTED.get(kind, details["msg"][0].lower() + details["msg"][1:])
    return _Fault(key.path, expected, key.unit, "none" if kind == "missing" else _value_text(value))


def _value_text(value: object) -> str:
    """A value of the file as text, short."""
    if isinstance(value, dict):
        if any(name in value for name in DISTRIBUTIONS):
            return _DISTRIBUTION
        return f"a table, and no distribution {unknown(next(iter(value)), DISTRIBUTIONS)}" if value else "a table"
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _path_text(path: Location, values: dict[str, Any]) -> str:
    """A place as messages name it: ``body[2] 'table': motion.times[1]``."""
    head, rest = str(path[0]) if path else "", list(path[1:])
    if rest and isinstance(rest[0], int):
        entry = values[head][rest[0]]
        head, rest = place(head, rest[0], entry.get("name") if isinstance(entry, dict) else None), rest[1:]
    if len(rest) > 1 and rest[0] == "shape":
        rest = rest[1:]  # sizes are named as in the messages of the shapes themselves
    tail = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in rest).removeprefix(".")
    return ": ".join(filter(None, [head, tail]))


def _key(location: Location, *, is_unknown: bool) -> _Key:
    """Place of a pydantic location, which also holds names of types and kinds; the last one may be of no known key."""
    tables: list[type[Table]] = [SceneTable]
    holders, path, unit = tables, list[str | int](), ""
    for number, part in enumerate(location):
        is_key = is_unknown and number == len(location) - 1  # whatever else it is the name of
        if isinstance(part, int):
            path.append(part)
            continue
        fields = [table.model_fields[part] for table in tables if part in table.model_fields]
        narrowed = [table for table in tables if part in (table.__name__, kind_of(table)) and not is_key]
        if is_key or fields or not (narrowed or part in _TYPES):
            holders = tables
            path.append(part)
            unit = unit_of(fields[0].description) if fields else ""
            tables = tables_in(fields[0].annotation) if fields else []
        elif narrowed:
            tables = narrowed
    known = dict.fromkeys(name for table in holders for name in table.model_fields)
    return _Key(tuple(path), unit, list(known), [kind_of(table) for table in tables])


# Types that pydantic puts into locations besides keys.
_TYPES = (
    "str",
    "int",
    "float",
    "list[list[float]]",
    "tuple[int, int]",
    "tuple[float, float]",
    "tuple[float, float, float]",
    "literal['vertical','horizontal']",
)
