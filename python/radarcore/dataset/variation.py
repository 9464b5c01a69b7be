"""Variations: scene files in which values are drawn anew for every sample."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from os import PathLike
from pathlib import Path
from typing import Any, get_args

from radarcore import check, notice
from radarcore.dataset.distributions import Choice, Distribution, Integers, distribution_of, is_distribution
from radarcore.dataset.sample import Sample
from radarcore.radar.radar import Radar
from radarcore.scenefile.build.cache import BuildCache
from radarcore.scenefile.load import Simulation
from radarcore.scenefile.read import located, unit_at, values_of
from radarcore.scenefile.tables import RunTable, SceneTable

_KINDS = ("body", "point", "human", "arm", "interferer")
"""Arrays of tables whose entries have names and may be repeated."""

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
"""Keys of a schedule without effect on shape and axes."""

_SEED_PATH = "run.seed"
_NUM_SEEDS = 2**53

_OF_NAMES = ("model", "meshes", "materials", "shape", "path")
"""Keys whose choices change the names of bodies."""

_TRIED_SAMPLES = 20
"""Number of first samples; one of them must be possible."""


@dataclass(frozen=True)
class Varied:
    """A value that is drawn, at its place in the tables, under a path such as ``human.person 0.speed``."""

    path: str
    distribution: Distribution


@dataclass(frozen=True)
class Repeated:
    """An entry of an array of tables with copies: their number, and the largest possible number of them."""

    count: int | Varied
    copies: list[dict[str, Any]]


_Pick = Callable[[Varied], tuple[Any, int | None]]
"""Value drawn, and the number of the option of a choice."""


def varies(values: object) -> bool:
    """True for tables of a scene file with a distribution, or an entry that comes in copies."""
    if isinstance(values, dict):
        return is_distribution(values) or "repeat" in values or any(map(varies, values.values()))
    return isinstance(values, list) and any(map(varies, values))


def _prepared(values: dict[str, Any]) -> dict[str, Any]:
    """The tables with `Varied` and `Repeated` in the place of what stands for them, and a name for every entry.

    A ValueError names the path of what is wrong.
    """
    result: dict[str, Any] = {}
    for key, value in values.items():
        if is_distribution(value):
            raise ValueError(f"{key}: expected distributions of values in it, got one of the whole")
        if key in (*_KINDS, "material") and isinstance(value, list):
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
    path = f"{kind}.{name}"
    if kind == "material":
        return _varied(table, path)
    if "repeat" not in table:
        return _varied({"name": name, **table}, path)
    count, most = _count(table["repeat"], f"{path}.repeat")
    one = {"name": name, **{key: value for key, value in table.items() if key != "repeat"}}
    return Repeated(count, [_varied({**one, "name": f"{name} {k}"}, f"{path} {k}") for k in range(most)])


def _default_name(kind: str) -> str | None:
    (table,) = get_args(SceneTable.model_fields[kind].annotation)  # of a list of tables
    default = table.model_fields["name"].default
    return default if isinstance(default, str) else None


def _count(value: Any, path: str) -> tuple[int | Varied, int]:
    """Number of copies, and the largest that there may be."""
    with located(f"{path}: "):
        found = distribution_of(value) if is_distribution(value) else Choice([value])
        if any(isinstance(end, bool) or not isinstance(end, int) for end in found.ends):
            raise ValueError(f"expected an integer, or a distribution of integers, got {value!r}")
        if min(found.ends) < 0 or max(found.ends) > _MOST_COPIES:
            raise ValueError(f"expected 0 to {_MOST_COPIES} copies, got {value!r}")
    return Varied(path, found) if len(set(found.ends)) > 1 else int(found.ends[0]), int(max(found.ends))


def _varied(value: Any, path: str) -> Any:
    if is_distribution(value):
        _check_may_vary(path)
        with located(f"{path}: "):
            found = distribution_of(value)
        if isinstance(found, Choice):
            options = tuple(_varied(option, f"{path}{{{k}}}") for k, option in enumerate(found.values))
            found = Choice(options, found.weights)
        return Varied(path, found)
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
        raise ValueError(_shared(path, reason))


def _shared(path: str, reason: str) -> str:
    """Error of a distribution for a value that all samples share."""
    return f"{path}: expected one value for all samples, as it decides {reason}, got a distribution"


def _resolved(tables: dict[str, Any], pick: _Pick) -> tuple[dict[str, Any], dict[str, Any]]:
    """Tables with a value in every place, and the values that were drawn by path.

    Of a choice of tables or lists the number of the option counts as the value.
    """
    drawn: dict[str, Any] = {}

    def value_of(value: Any) -> Any:
        if isinstance(value, Varied):
            found, number = pick(value)
            drawn[value.path] = number if isinstance(found, dict | list | Varied) else found
            return value_of(found)
        if isinstance(value, dict):
            return {key: value_of(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return [value_of(each) for entry in value for each in entries_of(entry)]
        return value

    def entries_of(entry: Any) -> list[Any]:
        return entry.copies[: value_of(entry.count)] if isinstance(entry, Repeated) else [entry]

    return value_of(tables), drawn


def _found(value: Any, most_copies: int | None = None) -> Iterator[Varied]:
    """All distributions, in copies once for every copy that there may be, or for the first ones."""
    inner: Iterable[Any] = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    if isinstance(value, Varied):
        yield value
        inner = value.distribution.values if isinstance(value.distribution, Choice) else ()
    elif isinstance(value, Repeated):
        inner = [value.count, *value.copies[:most_copies]]
    for entry in inner:
        yield from _found(entry, most_copies)


def _around(path: str) -> dict[str, int]:
    """Paths of the choices around a path, and the numbers of their options that it lies in."""
    return {path[: option.start()]: int(option[1]) for option in re.finditer(r"\{(\d+)\}", path)}


@dataclass(frozen=True)
class Parameter:
    """A value that varies from sample to sample.

    Attributes
    ----------
    path : str
        Its place: array, name and keys, such as ``human.person 0.speed`` or ``body.box.pose.position[0]``. Values
        within option 2 of a choice have the path of the choice with ``{2}`` appended.
    kind : str
        ``"uniform"``, ``"normal"``, ``"log_uniform"``, ``"integers"`` or ``"choice"``.
    ends : tuple
        Smallest and largest value; of a normal distribution the bounds and the mean; of a choice all that may be
        drawn. For a choice of tables or lists the numbers of the options.

    See Also
    --------
    dataset.Variation : Lists them.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "[[point]]", "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", lines, fmt="%s")
    >>> rc.dataset.Variation.load("scene.toml").parameters[0]
    Parameter(path='point.point 0.position[0]', kind='uniform', ends=(1.0, 3.0))
    """

    path: str
    kind: str
    ends: tuple[Any, ...]

    @property
    def unit(self) -> str:
        """Unit that `radarcore schema` has for the key, such as ``"m"``; empty for none."""
        kind, *keys = re.sub(r"[{\[]\d+[}\]]", "", self.path).split(".")
        # The name of an entry stands before its keys, and may have dots itself.
        units = (unit_at((kind, *keys[first:])) for first in range(len(keys)))
        return next(filter(None, units), "")

    @property
    def is_number(self) -> bool:
        """True if all values are numbers; choices may be of words, or of true and false."""
        return not any(isinstance(end, str | bool) for end in self.ends)


@dataclass(frozen=True, eq=False, repr=False)
class Variation:
    """A scene file in which values are drawn anew for every sample.

    Any value may be a distribution, in place: ``{ uniform = [0.5, 2.0] }``, ``{ normal = [1.2, 0.1], min = 0.8 }``,
    ``{ log_uniform = [1e-3, 1] }``, ``{ integers = [1, 4] }`` or ``{ choice = ["metal", "wood"], weights = [3, 1] }``;
    `step` rounds to a grid. ``repeat = 3``, or a distribution of integers, in a ``[[body]]``, ``[[point]]``,
    ``[[human]]``, ``[[arm]]`` or ``[[interferer]]`` makes copies, called ``NAME 0``, ``NAME 1``, ..., with draws of
    their own. The seed of noise and speckle, `run.seed`, is drawn as well where the file has none.

    Draws depend on the seed, the number of the sample and the place of the value alone: a further distribution leaves
    the others as they are, and samples can be made in any order, anywhere. `load` makes it.

    Attributes
    ----------
    path : Path
        The scene file.
    parameters : tuple of Parameter
        Varied values in the order of the file, with the largest number of copies.
    body_names : tuple of str
        Names of all bodies that may occur, in the order of scenes.
    run : RunTable
        Times of the frames: start, stop and rate hold for all samples.

    See Also
    --------
    dataset.Sample : One draw of all values.
    dataset.stream : Frames of samples, for training.
    load_scene : A scene file without distributions.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[human]]", "repeat = { integers = [0, 2] }",
    ...          "speed = { uniform = [0.5, 1.5] }", "path = [[4.0, 0.0], [1.0, 0.0]]"]
    >>> np.savetxt("scene.toml", lines, fmt="%s")
    >>> variation = rc.dataset.Variation.load("scene.toml")
    >>> variation
    <Variation scene.toml: 4 parameters, 32 bodies>
    >>> [variation.sample(index, seed=1).values["human.human.repeat"] for index in range(6)]
    [1, 0, 0, 0, 1, 1]
    """

    path: Path
    parameters: tuple[Parameter, ...]
    body_names: tuple[str, ...]
    run: RunTable
    _tables: dict[str, Any]
    _kept: BuildCache = field(default_factory=BuildCache)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Variation:
        """Read a scene file with distributions, or one without: then only the seed of the noise varies.

        Ends of distributions are tried, each with the other values of one sample.

        Raises
        ------
        FileNotFoundError
            When the file, or a mesh it names, does not exist.
        ValueError
            For what is no distribution, for one of a value that all samples have in common (it decides shape or axes
            of the cube, or the number of frames), and for ends that the scene file may not have; names file and key.

        See Also
        --------
        load_scene : A scene file without distributions.

        Examples
        --------
        >>> lines = ['radar.preset = "bgt60tr13c"', "[[point]]", 'position = [{ unifrom = [1.0, 3.0] }, 0.0, 0.0]']
        >>> np.savetxt("scene.toml", lines, fmt="%s")
        >>> try:
        ...     rc.dataset.Variation.load("scene.toml")
        ... except ValueError as error:
        ...     print(error)
        scene.toml: point[0] 'point 0': position[0]: expected a number [m], got a table, and no distribution 'unifrom';
        did you mean 'uniform' or 'log_uniform'?
        """
        file = Path(path)
        values = values_of(file)
        with located(f"{file}: "):
            tables = _prepared(values)
        run = tables.setdefault("run", {})
        if isinstance(run, dict):
            run.setdefault("seed", Varied(_SEED_PATH, Integers(0, _NUM_SEEDS - 1)))
        found = list(_found(tables))
        with notice.gathered():  # warnings come with the samples
            trials = _Trials(file, tables)
            trials.check_ends()
            names = trials.body_names()
        return cls(file, tuple(map(_parameter, found)), names, trials.run, tables)

    @property
    def label_names(self) -> tuple[str, ...]:
        """Names of the axis `body` of labels: a person, an arm and a mesh file of several materials have one each."""
        return tuple(dict.fromkeys(name.partition("/")[0] for name in self.body_names))

    def sample(self, index: int, *, seed: int = 0) -> Sample:
        """The scene file of one sample.

        Parameters
        ----------
        index : int
            Number of the sample, from 0 without an end.
        seed : int
            Number of the whole series.

        See Also
        --------
        dataset.Sample.simulation : Its scene, radar and run.

        Examples
        --------
        >>> lines = ['radar.preset = "bgt60tr13c"', "[[point]]", "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"]
        >>> np.savetxt("scene.toml", lines, fmt="%s")
        >>> sample = rc.dataset.Variation.load("scene.toml").sample(3, seed=1)
        >>> print(sample.text)
        # Sample 3 of scene.toml, seed 1.
        ...
        [[point]]
        name = "point 0"
        position = [..., 0.0, 0.0]
        ...
        """
        number, series = check.count("index", index, 0), check.count("seed", seed, 0)

        tables, values = _resolved(self._tables, lambda value: _drawn(value, series, number))
        return Sample(number, series, values, self.path, tables, self._kept)

    def __reduce__(self) -> tuple[Any, ...]:
        return Variation, (self.path, self.parameters, self.body_names, self.run, self._tables)

    def __repr__(self) -> str:
        numbers = f"{len(self.parameters)} parameters, {len(self.body_names)} bodies"
        return f"<Variation {self.path.name}: {numbers}>"


def share_of(seed: int, index: int, path: str) -> float:
    """Share of a distribution that the draw of a place lies at, 0 <= share < 1.

    The first 53 bits of the BLAKE2b hash, 8 bytes long, of ``seed/index/path``: equal on every machine.
    """
    digest = blake2b(f"{seed}/{index}/{path}".encode(), digest_size=8).digest()
    return float((int.from_bytes(digest, "big") >> 11) * 2.0**-53)


def _drawn(value: Varied, seed: int, index: int) -> tuple[Any, int | None]:
    distribution, share = value.distribution, share_of(seed, index, value.path)
    if isinstance(distribution, Choice):
        number = distribution.number_at(share)
        return distribution.values[number], number
    return distribution.at(share), None


def _parameter(found: Varied) -> Parameter:
    ends = found.distribution.ends
    if isinstance(found.distribution, Choice):
        values = found.distribution.values
        ends = tuple(k if isinstance(end, dict | list | Varied) else end for k, end in enumerate(values))
    return Parameter(found.path, found.distribution.kind, ends)


class _Trials:
    """Samples that are tried when a variation is loaded: one, and that with every end of every distribution."""

    def __init__(self, file: Path, tables: dict[str, Any]) -> None:
        self._file, self._tables, self._kept = file, tables, BuildCache()
        # All copies have the distributions of the first.
        self._found = list(_found(tables, most_copies=1))
        self._index = 0
        possible = self._possible()
        self._names, self.run, self._radar = possible.scene.names, possible.run, possible.radar

    def _possible(self) -> Simulation:
        """The first possible sample, with the largest number of copies."""
        errors: list[ValueError] = []
        for index in range(_TRIED_SAMPLES):
            self._index = index
            try:
                return self._sample({}).simulation()
            except ValueError as error:
                errors.append(error)
        cause = errors[0].__cause__
        # A mistake for all draws is a fault of the file, not of a sample.
        is_of_file = len({str(error.__cause__) for error in errors}) == 1 or "; drawn: " not in str(errors[0])
        raise errors[0] if cause is None or not is_of_file else cause

    def _sample(self, forced: Mapping[str, int], most_copies: int | None = None) -> Sample:
        """A sample with the largest number of copies, or fewer, and at some paths an extreme value, by its number."""

        def pick(value: Varied) -> tuple[Any, int | None]:
            if value.path in forced:
                end = forced[value.path]
                return _values(value.distribution)[end], end
            if value.path.endswith(".repeat"):
                number = int(max(value.distribution.ends))
                return number if most_copies is None else min(number, most_copies), None
            return _drawn(value, 0, self._index)

        tables, values = _resolved(self._tables, pick)
        return Sample(self._index, 0, values, self._file, tables, self._kept)

    def check_ends(self) -> None:
        """Refuse a distribution with an end that is no value of its key; the error then names both."""
        for found in self._found:
            if found.path == _SEED_PATH or found.path.endswith(".repeat"):
                continue
            for number, end in enumerate(_values(found.distribution)):
                sample = self._sample({**_around(found.path), found.path: number}, most_copies=1)
                try:
                    radar = sample.simulation().radar
                    if _shape_of(radar) != _shape_of(self._radar):
                        raise ValueError(f"{self._file}: {_shared(found.path, 'the shape of the cube')}")
                except ValueError as error:
                    if error.__cause__ is None:
                        raise
                    if sample.is_about(found.path, str(error)):
                        kind, fault = found.distribution.kind, str(error.__cause__).removeprefix(f"{self._file}: ")
                        raise ValueError(f"{self._file}: {found.path}: {kind} may be {_text(end)}; {fault}") from error

    def body_names(self) -> tuple[str, ...]:
        """Names of all bodies that may occur: with every option of the choices that names depend on."""
        names = list(self._names)
        for found in self._found:
            key = re.split(r"[.\[{]", found.path)
            if not isinstance(found.distribution, Choice) or not set(_OF_NAMES) & set(key):
                continue
            for number in range(len(found.distribution.values)):
                try:
                    others = self._sample({**_around(found.path), found.path: number}).simulation().scene.names
                except ValueError:  # together with the other values of this sample
                    continue
                place = 0
                for name in others:
                    if name not in names:
                        names.insert(place, name)
                    place = names.index(name) + 1
        return tuple(names)


def _shape_of(radar: Radar) -> tuple[int, int, int, bool]:
    """Shape of the cube, and whether its samples are complex."""
    is_complex = radar.receiver is None or radar.receiver.output == "iq"
    return radar.num_channels, radar.num_chirps, radar.waveform.num_samples, is_complex


def _values(distribution: Distribution) -> tuple[Any, ...]:
    """Ends of a distribution, and all options of a choice, also without weight."""
    return tuple(distribution.values) if isinstance(distribution, Choice) else distribution.ends


def _text(end: Any) -> str:
    return f"{end:g}" if isinstance(end, float) else repr(end)
