"""Samples: the scene files that a variation draws."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from radarcore.dataset.files import renamed, toml_text
from radarcore.output import write_text
from radarcore.recording.frame import Frame
from radarcore.scenefile.build.cache import BuildCache
from radarcore.scenefile.load import Simulation, simulation
from radarcore.scenefile.read import tables_of
from radarcore.simulate.simulator import Simulator

_MOST_NAMED = 4
"""Drawn values that an error names."""


@dataclass(frozen=True, eq=False, repr=False)
class Sample:
    """One draw of all values of a variation: an ordinary scene file. `Variation.sample` makes it.

    Attributes
    ----------
    index, seed : int
        Number of the sample, and that of the series.
    values : mapping of str to value
        What was drawn, by the paths of `Variation.parameters`; of a choice of tables or lists the number of the
        option. Parameters of copies, or within options, that this sample does not have are missing.
    path : Path
        The file of the variation.

    See Also
    --------
    dataset.Variation : Draws it.
    Simulation : What it makes.

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
        return f"{self._header}{toml_text(self._tables)}"

    @property
    def _header(self) -> str:
        """First line of the scene file."""
        return f"# Sample {self.index} of {self.path.name}, seed {self.seed}.\n"

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

        tables = renamed(self._tables, moved)
        write_text(target, f"{self._header}{toml_text(tables)}", overwrite=overwrite)

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
    """Name of the entry that a value belongs to, in quotes as messages have it; that of the table, if it has none."""
    first, second, *_ = [*path.split(".", 2), ""]
    return first if first in ("radar", "sensor", "run") else repr(second)


def _names(path: str, message: str) -> bool:
    """True if a message names the key of a value, or the very place of a value in a list."""
    key, _, place = re.sub(r"\{\d+\}", "", path).rpartition(".")[2].partition("[")
    exact = rf"|\[{re.escape(place)}" if place else ""
    return re.search(rf"\b{re.escape(key)}(?!\w)(?:(?!\[){exact})", message) is not None
