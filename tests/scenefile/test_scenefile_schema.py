"""The schema of scene files: every key with unit and default, none missing and no other."""

import importlib.util
import json
import tomllib
from collections.abc import Iterator
from typing import Any, get_args, get_origin

import pytest

from radarcore.scenefile import schema, tables
from radarcore.scenefile.read import tables_in
from scene_files import EXAMPLES


def all_keys(table: type = tables.SceneTable, prefix: str = "") -> Iterator[str]:
    for name, field in tables.keys_of(table).items():
        if name == "kind":
            continue
        inner = tables_in(field.annotation)
        key = prefix + name + ("[]" if inner and get_origin(field.annotation) is list else "")
        yield key
        for part in inner:
            yield from all_keys(part, f"{key}.")


def test_schema_lists_every_key_with_unit_and_default() -> None:
    lines = schema.text().splitlines()
    listed = {line.split()[0] for line in lines}
    assert set(all_keys()) <= listed
    assert len(set(all_keys())) > 100
    for line in lines:
        key, text = line.split(maxsplit=1)
        if not key.endswith(".kind") and key not in ("sensor", "run") and not key.endswith(".pose"):
            assert "default: " in text or "required" in text, line
        if key.endswith("_deg"):
            assert "[degrees" in text or "; metres" in text, line
        for unit, ends in {"Hz": "frequency", "s": "_interval", "m": "position"}.items():
            if key.endswith(ends):
                assert f"[{unit}]" in text, line


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    """The JSON schema."""
    return schema.json_schema()


def test_json_schema_has_the_same_keys_and_forbids_others(found: dict[str, Any]) -> None:
    assert json.loads(json.dumps(found)) == found
    by_name = {"SceneTable": found, **found["$defs"]}

    def every(table: type) -> Iterator[type]:
        yield table
        for field in tables.keys_of(table).values():
            for part in tables_in(field.annotation):
                yield from every(part)

    for table in every(tables.SceneTable):
        described: dict[str, Any] = by_name[table.__name__]
        assert set(described["properties"]) == set(tables.keys_of(table))
        assert described["additionalProperties"] is False
        required = {name for name, field in tables.keys_of(table).items() if field.is_required()}
        assert set(described.get("required", [])) == required
        assert all(
            get_args(field.annotation) or "description" in described["properties"][name]
            for name, field in tables.keys_of(table).items()
        )


@pytest.mark.skipif(importlib.util.find_spec("jsonschema") is None, reason="needs jsonschema")
def test_json_schema_accepts_the_examples(found: dict[str, Any]) -> None:
    import jsonschema

    validator = jsonschema.Draft202012Validator(found)
    for path in EXAMPLES:
        validator.validate(tomllib.loads(path.read_text()))
