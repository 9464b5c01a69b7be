"""Keys of a scene file: as text for people, as JSON schema for editors."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from radarcore.scenefile.read import kind_of, tables_in
from radarcore.scenefile.tables import RECORDS, SceneTable, keys_of


def text() -> str:
    """Keys with unit, meaning and default, one per line."""
    return "\n".join(_lines(SceneTable, ""))


def json_schema() -> dict[str, Any]:
    """The JSON schema of scene files."""
    found = {"$schema": "https://json-schema.org/draft/2020-12/schema", **SceneTable.model_json_schema()}
    for record in RECORDS:
        described = found["$defs"][record.__name__]
        described["description"] = _first_line(record)
        for name, key in keys_of(record).items():
            described["properties"][name]["description"] = key.description
    return found


def _lines(table: type, prefix: str) -> Iterator[str]:
    """Lines of a table and of the tables in it."""
    for name, field in keys_of(table).items():
        if name == "kind":
            continue
        inner = tables_in(field.annotation)
        is_list = get_origin(field.annotation) is list
        key = f"{prefix}{name}" + ("[]" if is_list and inner else "")
        yield f"{key:<44} {field.description}{_default(field)}{_choices(field.annotation)}"
        for part in inner:
            if kind := kind_of(part):
                yield f'{f"{key}.kind":<44} "{kind}": {_first_line(part)}'
            yield from _lines(part, f"{key}.")


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "; required"
    if isinstance(field.default, BaseModel) or "default: " in (field.description or ""):
        return ""  # the text of its keys; or said already
    return f"; default: {json.dumps(field.default) if field.default not in (None, []) else 'none'}"


def _choices(annotation: Any) -> str:
    """The words that a key may have."""
    words = [
        value for part in (annotation, *get_args(annotation)) for value in get_args(part) if isinstance(value, str)
    ]
    return f" ({' | '.join(json.dumps(word) for word in dict.fromkeys(words))})" if words else ""


def _first_line(table: type) -> str:
    first = (table.__doc__ or "").strip().splitlines()[0].rstrip(".")
    return first[0].lower() + first[1:]
