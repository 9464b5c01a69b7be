"""Scene files of samples: their text, and the files that they name, which a dataset keeps copies of."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from radarcore.dataset.distributions import is_distribution
from radarcore.models.robots.named import arm_names
from radarcore.scenefile.read import values_of

FOLDER = "files"
"""Folder of a dataset with copies of the files that its scene names."""

_BARE = re.compile(r"[A-Za-z0-9_-]+")
"""Keys that need no quotes."""


def renamed(values: Any, name_of: Callable[[str, bool], str], key: str = "") -> Any:
    """Tables with other names of files; the function gets a name, and whether it is that of a model of an arm."""
    if isinstance(values, dict):
        # The options of a choice of names are names.
        keys = dict.fromkeys(values, key) if is_distribution(values) else {name: name for name in values}
        return {name: renamed(value, name_of, keys[name]) for name, value in values.items()}
    if isinstance(values, list):
        return [renamed(value, name_of, key) for value in values]
    if isinstance(values, str) and (key == "path" or (key == "model" and values not in arm_names())):
        return name_of(values, key == "model")
    return values


def digests_of(scene: Path) -> dict[str, str]:
    """SHA-256 of every file that a scene file names, by its name there.

    What such files name in turn, as models of arms name meshes, is not among them.
    """
    return {name: _digest(scene.parent / name) for name in _names(scene)}


def keep(scene: Path, dataset: Path) -> None:
    """Copy the files that a scene file names into a dataset; models of arms, which are many files, are left out."""
    for name, is_model in _names(scene).items():
        if not is_model:
            source = scene.parent / name
            copy = dataset / _copy(name, _digest(source))
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)


def with_copies(text: str, beside: Path, dataset: Path, digests: dict[str, str]) -> str:
    """Text of a scene file that names the copies in a dataset, and files without one where they were."""
    values = tomllib.loads(text)

    def copy(name: str, is_model: bool) -> str:
        kept = dataset.absolute() / _copy(name, digests.get(name, ""))
        return str(kept if not is_model and kept.is_file() else beside / name)

    return toml_text(renamed(values, copy))


def _names(scene: Path) -> dict[str, bool]:
    """Names of files in a scene file that are there, and which of them are models of arms."""
    found: dict[str, bool] = {}

    def note(name: str, is_model: bool) -> str:
        if (scene.parent / name).is_file():
            found[name] = is_model
        return name

    renamed(values_of(scene), note)
    return found


def _digest(file: Path) -> str:
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def _copy(name: str, digest: str) -> str:
    """Path of a copy in a dataset: files in different folders may have one name."""
    return f"{FOLDER}/{digest[:16]}/{Path(name).name}"


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
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(name)} = {_value(entry)}" for name, entry in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)  # numbers, dates and times


def _string(text: str) -> str:
    """Basic string; JSON writes all of its escapes but that of one control character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
