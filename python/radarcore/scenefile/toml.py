"""Writer of scene files: tables as TOML."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from math import isnan

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(values: Mapping[str, object]) -> str:
    """Text that reads back as the same tables: numbers to the last bit, keys in their order.

    Tables of the top level, and arrays of them, have headers; what they hold stands in line.
    """
    return "\n".join(_lines(values))


def _lines(values: Mapping[str, object]) -> Iterator[str]:
    # Behind a header all keys would belong to its table.
    tables = {name: value for name, value in values.items() if _is_table(value) or _is_array_of_tables(value)}
    yield from (f"{_key(name)} = {_value(value)}" for name, value in values.items() if name not in tables)
    for name, value in tables.items():
        header = f"[{_key(name)}]" if _is_table(value) else f"[[{_key(name)}]]"
        for table in [value] if isinstance(value, Mapping) else value:  # type: ignore[attr-defined]  # a list of them
            yield from ("", header)
            yield from (f"{_key(key)} = {_value(entry)}" for key, entry in table.items())
    yield ""


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _is_array_of_tables(value: object) -> bool:
    return isinstance(value, list) and len(value) > 0 and all(map(_is_table, value))


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _string(name)


def _value(value: object) -> str:
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return "nan" if isnan(value) else repr(value)
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(name)} = {_value(entry)}" for name, entry in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return str(value)  # integers, dates and times


def _string(text: str) -> str:
    """Basic string; JSON writes all of its escapes but that of one control character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
