"""Reader of scene files: tables from text, and errors, one line per fault."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, get_args

from pydantic import ValidationError

from radarcore import check
from radarcore.scenefile.tables import RECORDS, SceneTable, Table, keys_of

Location = tuple[str | int, ...]

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


def change(values: dict[str, Any], text: str) -> None:
    """Change a value of a file's tables: ``run.stop=2``, with keys and value in TOML.

    Entries of lists go by name or index: ``point.ball.rcs=0.1``, ``point.0.position.2=1.5``.
    """
    path, _, value = text.partition("=")
    try:
        keys, new = tomllib.loads(f"{path}=0"), tomllib.loads(f"value={value}")["value"]
    except tomllib.TOMLDecodeError as error:
        hint = "texts, and names with spaces, need quotes: 'radar.preset=\"bgt60tr13c\"'"
        raise ValueError(f"changes: expected KEY=VALUE in TOML, got {text!r}, {error}; {hint}") from None
    names = list[str]()
    while isinstance(keys, dict):
        ((name, keys),) = keys.items()
        names.append(name)
    at: Any = values
    for name in names[:-1]:
        at = at.setdefault(name, {}) if isinstance(at, dict) else at[_index(at, name, text)]
    at[names[-1] if isinstance(at, dict) else _index(at, names[-1], text)] = new


def _index(entries: object, name: str, text: str) -> int:
    """Index of an entry of a list by its name or index."""
    if not isinstance(entries, list):
        raise ValueError(f"changes: expected a table before {name!r} in {text!r}, got {_value_text(entries)}")
    known = {str(k): k for k in range(len(entries))}
    known |= {str(one["name"]): k for k, one in enumerate(entries) if isinstance(one, dict) and "name" in one}
    if name not in known:
        raise ValueError(f"changes: expected an entry in {text!r}, got {unknown(name, known)}")
    return known[name]


def tables_of(values: dict[str, Any], file: Path) -> SceneTable:
    """The tables of what stands in a file, with every key known and of the right type."""
    try:
        # Strict validation takes arrays for tuples only in JSON.
        return SceneTable.model_validate_json(json.dumps(values, default=str))
    except ValidationError as error:
        raise ValueError("\n".join(f"{file}: {line}" for line in _lines(error, values))) from None


def unknown(name: str, known: Iterable[str]) -> str:
    """Text about an unknown name, with near ones that are known."""
    return f"{name!r}; {check.near_names(name, known)}"


def place(kind: str, index: int, name: object) -> str:
    """A table of an array as messages name it: ``body[2] 'table'``."""
    return f"{kind}[{index}]" + (f" {name!r}" if isinstance(name, str) else "")


def kind_of(table: type) -> str:
    """The `kind` that selects a table, or ""."""
    field = keys_of(table).get("kind")
    return "" if field is None else str(get_args(field.annotation)[0])


def unit_of(description: str | None) -> str:
    """The unit at the end of a key's description, or ""."""
    match = re.search(r"\[([^\]]+)\]$", description or "")
    return match.group(1) if match else ""


def unit_at(location: Location) -> str:
    """The unit of the key at a place of a file, or ""."""
    return _Place.of(location, None).unit


def tables_in(annotation: Any) -> list[type]:
    """Tables and records that a type is made of."""
    if isinstance(annotation, type) and (annotation in RECORDS or issubclass(annotation, Table)):
        return [annotation]
    return [table for part in get_args(annotation) for table in tables_in(part)]


class _Place(NamedTuple):
    """Expected value at a place of a file."""

    unit: str
    """Unit of the key."""
    known: list[str]
    """Keys of the table that the key is in."""
    tables: list[type]
    """Tables that the key may have."""

    @classmethod
    def of(cls, path: Location, values: object) -> _Place:
        """A place of a file, whose values decide which of several tables is meant."""
        unit = ""
        holders: list[type] = [SceneTable]
        tables = holders
        for part in path:
            if isinstance(part, str):
                kind = values.get("kind") if isinstance(values, dict) else None
                holders = [table for table in tables if kind is None or kind_of(table) == kind] or tables
                keys = [keys_of(table)[part] for table in holders if part in keys_of(table)]
                if keys:
                    unit, tables = unit_of(keys[0].description), tables_in(keys[0].annotation)
            values = _at(values, part)
        return cls(unit, list(dict.fromkeys(name for table in holders for name in keys_of(table))), tables)


def _at(values: object, part: str | int) -> object:
    """An entry of a table or a list; None if there is none."""
    if isinstance(values, dict):
        return values.get(part)
    return values[part] if isinstance(values, list) and isinstance(part, int) and part < len(values) else None


def _path_of(location: Location, is_missing: bool, values: object) -> Location:
    """Keys and indices of a pydantic location, without the names of types, which the file lacks."""
    path = list[str | int]()
    for number, part in enumerate(location):
        is_last = number == len(location) - 1
        if _at(values, part) is not None or (is_missing and is_last):
            path.append(part)
            values = _at(values, part)
    return tuple(path)


class _Fault(NamedTuple):
    """Fault at a place of the file: the expected and the given value, or a message."""

    path: Location
    expected: str = ""
    unit: str = ""
    got: str = ""
    message: str = ""


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
        fault = _fault(details, values)
        if (other := faults.get(fault.path)) is not None:  # a value of one of several types
            fault = fault._replace(expected=f"{other.expected} or {fault.expected}")
        faults[fault.path] = fault
    misspelt = {path[:-1] for path, fault in faults.items() if fault.message.startswith("unknown key")}
    for path, fault in faults.items():
        if fault.got == "none" and path[:-1] in misspelt:
            continue  # missing, as its name is wrong
        # For a union of types the fault inside says more than the outer one.
        if any(path == other[: len(path)] for other in faults if len(other) > len(path)):
            continue
        place = path[:-1] if path[:-1] in misspelt and fault.message else path
        unit = f" [{fault.unit}]" if fault.unit else ""
        message = fault.message or f"expected {fault.expected}{unit}, got {fault.got}"
        yield ": ".join(filter(None, [_path_text(place, values), message]))


def _fault(details: Any, values: dict[str, Any]) -> _Fault:
    kind, value, context = details["type"], details["input"], details.get("ctx", {})
    path = _path_of(details["loc"], kind == "missing", values)
    at = _Place.of(path, values)
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        name = str(path[-1])
        if name in DISTRIBUTIONS and len(path) > 1:
            return _Fault(path[:-1], "a table", got=_DISTRIBUTION)
        is_distribution = check.near(name, DISTRIBUTIONS) and not check.near(name, at.known)
        return _Fault(path, message=f"unknown key {unknown(name, DISTRIBUTIONS if is_distribution else at.known)}")
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        # The place is the table; its kind is wrong.
        kinds = ", ".join(repr(kind_of(table)) for table in at.tables)
        return _Fault((*path, "kind"), f"one of {kinds}", got=repr(context["tag"]) if "tag" in context else "none")
    if kind == "value_error":  # of a record of settings, about one of its keys
        name, _, message = str(context["error"]).partition(": ")
        return _Fault((*path, name), message=message)
    if kind == "literal_error":
        return _Fault(path, context["expected"], got=repr(value))
    if kind in ("too_long", "too_short"):
        number = context.get("max_length", context.get("min_length"))
        return _Fault(path, f"{number} values", at.unit, str(context["actual_length"]))
    expected = _EXPECTED.get(kind, details["msg"][0].lower() + details["msg"][1:])
    return _Fault(path, expected, at.unit, "none" if kind == "missing" else _value_text(value))


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


@contextmanager
def located(prefix: str) -> Iterator[None]:
    """Put a place in the file in front of the messages of errors."""
    try:
        yield
    except OSError as error:
        text = str(error) if error.filename is None else f"{error.strerror}: {error.filename}"
        raise type(error)(prefix + check.printable(text)) from error
    except (ValueError, TypeError, KeyError, ImportError) as error:
        text = str(error.args[0]) if isinstance(error, KeyError) else str(error)
        kind = ImportError if isinstance(error, ImportError) else ValueError
        raise kind(prefix + check.printable(" ".join(text.split()))) from error
