"""Samples: the scene files that a variation draws, and the files that these name, which a dataset keeps copies of."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from radarcore.dataset.distributions import is_distribution
from radarcore.models.robots.named import arm_names
from radarcore.output import write_text
from radarcore.recording.frame import Frame
from radarcore.scenefile.build.cache import BuildCache
from radarcore.scenefile.load import Simulation, simulation
from radarcore.scenefile.read import tables_of, values_of
from radarcore.simulate.simulator import Simulator

FOLDER = "files"
"""Folder of a dataset with copies of the files that its scene names."""

_BARE = re.compile(r"[A-Za-z0-9_-]+")
"""Keys that need no quotes."""

_MOST_NAMED = 4
"""Drawn values that an error names."""


@dataclass(frozen=True, eq=False, repr=False)
class Sample:
    """One draw of all values of a variation: an ordinary scene file. `Variation.sample` makes it.

    Attributes
    ----------
    index, seed : int
        Number of the sample, and of the series.
    values : mapping of str to value
        What was drawn, by the paths of `Variation.parameters`; of a choice of tables or lists the number of the
        option. Parameters of copies, or within options, that this sample does not have are missing.
    path : Path
        The file of the variation.

    See Also
    --------
    dataset.Variation : Draws it.
    Simulation : The result.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "[[point]]", "position = [2.0, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", [*lines, "rcs = { log_uniform = [0.01, 1.0] }"], fmt="%s")
    >>> sample = rc.dataset.Variation.load("scene.toml").sample(0, seed=1)
    >>> sample
    <Sample 0 of scene.toml, seed 1: 2 values>
    >>> list(sample.values)
    ['point.point 0.rcs', 'run.seed']
    """

    index: int
    seed: int
    values: Mapping[str, Any]
    path: Path
    _tables: dict[str, Any]
    _kept: BuildCache = field(default_factory=BuildCache)

    @property
    def text(self) -> str:
        """The scene file, which makes the same frames alone; its paths are relative to the file of the variation."""
        return self._written(self._tables)

    def _written(self, tables: dict[str, Any]) -> str:
        """Scene file whose first line names the sample."""
        return f"# Sample {self.index} of {self.path.name}, seed {self.seed}.\n{toml_text(tables)}"

    def simulation(self) -> Simulation:
        """Scene, radar and run of the sample; meshes of people, arms and files are made once per process.

        The number of reflections is stated, by default one: the search for corners that return more takes as long as a
        frame, and is left to `load_scene`.

        Raises
        ------
        ValueError
            When a value is no possible one, or some are not together: names the sample, the key and what was drawn.

        See Also
        --------
        Simulation.record : All frames of it.
        dataset.Sample.frames : One by one.

        Examples
        --------
        >>> lines = ['radar.preset = "bgt60tr13c"', "[[point]]", "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"]
        >>> np.savetxt("scene.toml", lines, fmt="%s")
        >>> rc.dataset.Variation.load("scene.toml").sample(0).simulation().scene
        <Scene: point 0>
        """
        try:
            tables = tables_of(self._tables, self.path)
        except ValueError as error:
            raise ValueError(self._with_drawn(str(error), self._named(str(error)))) from error
        try:
            return simulation(tables, self.path, kept=self._kept)
        except ValueError as error:
            drawn = self._named(str(error)) or [path for path in self.values if _entry(path) in str(error)]
            raise ValueError(self._with_drawn(str(error), drawn)) from error

    def frames(self, *, threads: int | None = 1) -> Iterator[Frame]:
        """Frames of the run, one by one.

        See Also
        --------
        dataset.stream : Frames of many samples.

        Examples
        --------
        >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]", "position = [2.0, 0.0, 0.0]"]
        >>> np.savetxt("scene.toml", lines, fmt="%s")
        >>> sample = rc.dataset.Variation.load("scene.toml").sample(0)
        >>> [f"{frame.time:.3f}" for frame in sample.frames()]
        ['0.000', '0.025', '0.050', '0.075']
        """
        return self.simulated(threads=threads)[1]

    def simulated(self, *, threads: int | None = 1) -> tuple[Simulator, Iterator[Frame]]:
        """The simulator of the sample, and its frames one by one."""
        found = self.simulation()
        simulator = found.simulator(threads=threads)
        return simulator, map(simulator.frame, found.run.times)

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write the scene file, for `load_scene` and the command line.

        Files that it names are then found from where it is written to.

        Parameters
        ----------
        path : path
        overwrite : bool
            Replace an existing file.

        Raises
        ------
        FileExistsError
            When the file exists and `overwrite` is False.

        See Also
        --------
        load_scene : Reads it.

        Examples
        --------
        >>> lines = ['radar.preset = "bgt60tr13c"', "[[point]]", "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"]
        >>> np.savetxt("scene.toml", lines, fmt="%s")
        >>> rc.dataset.Variation.load("scene.toml").sample(5).save("sample 5.toml")
        >>> rc.load_scene("sample 5.toml").scene
        <Scene: point 0>
        """
        target = Path(path)
        source, folder = self.path.absolute().parent, target.absolute().parent

        def moved(name: str, _: bool) -> str:
            return name if Path(name).is_absolute() else Path(os.path.relpath(source / name, folder)).as_posix()

        write_text(target, self._written(renamed(self._tables, moved)), overwrite=overwrite)

    def is_about(self, path: str, message: str) -> bool:
        """True if a message names the key at a path, and the value that was drawn for it."""
        value = self.values.get(path)
        text = f"{value:g}" if isinstance(value, float) else str(value)
        return _names(path, message) and (re.search(rf"(?<![\w.]){re.escape(text)}(?![\w.]*\d)", message) is not None)

    def _named(self, message: str) -> list[str]:
        """Paths whose key a message names."""
        return [path for path in self.values if _entry(path) in message and _names(path, message)]

    def _with_drawn(self, message: str, paths: list[str]) -> str:
        """A message with the number of the sample, and what was drawn at some paths."""
        values = {path: self.values[path] for path in paths[:_MOST_NAMED]}
        texts = [f"{path} = {f'{v:g}' if isinstance(v, float) else repr(v)}" for path, v in values.items()]
        more = f" and {len(paths) - _MOST_NAMED} more" if len(paths) > _MOST_NAMED else ""
        drawn = f"; drawn: {', '.join(texts)}{more}" if texts else ""
        return f"sample {self.index} of seed {self.seed}: {message}{drawn}"

    def __repr__(self) -> str:
        return f"<Sample {self.index} of {self.path.name}, seed {self.seed}: {len(self.values)} values>"


def _entry(path: str) -> str:
    """Name of the entry of a value, in quotes as in messages; the name of the table, if it has none."""
    first, second, *_ = [*path.split(".", 2), ""]
    return first if first in ("radar", "sensor", "run") else repr(second)


def _names(path: str, message: str) -> bool:
    """True if a message names the key of a value, or the very place of a value in a list."""
    key, _, place = re.sub(r"\{\d+\}", "", path).rpartition(".")[2].partition("[")
    exact = rf"|\[{re.escape(place)}" if place else ""
    return re.search(rf"\b{re.escape(key)}(?!\w)(?:(?!\[){exact})", message) is not None


def renamed(values: Any, name_of: Callable[[str, bool], str], key: str = "") -> Any:
    """Tables with other names of files; the function gets a name, and True for the model of an arm."""
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

    Files named by these files, such as meshes of arm models, are not included.
    """
    return {name: _digest(scene.parent / name) for name in _files_of(scene)}


def keep(scene: Path, dataset: Path) -> None:
    """Copy the files that a scene file names into a dataset; models of arms, which are many files, are left out."""
    for name, is_model in _files_of(scene).items():
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


def _files_of(scene: Path) -> dict[str, bool]:
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

    Tables of the top level, and arrays of them, have headers; their contents are inline.
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
    """Basic string; JSON writes all of its escapes but one, of a control character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
