"""Datasets that are there: samples as arrays, and what they were made from."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cached_property
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.dataset.files import digests_of, with_copies
from radarcore.dataset.items import Output, checked_output
from radarcore.dataset.journal import Journal
from radarcore.dataset.labels import Labels
from radarcore.dataset.layout import STATUS
from radarcore.dataset.recipe import Failed
from radarcore.dataset.store import opened
from radarcore.dataset.stored import StoredFrames
from radarcore.dataset.variation import Sample, Variation
from radarcore.radar.radar import Radar
from radarcore.recording.frame import NUM_CODES, to_samples


class Dataset:
    """Frames of many samples with their labels, on disk.

    An index gives a sample as a dictionary of arrays without the axis `sample`; iteration gives those that are there,
    in order. Whatever reads Zarr, such as ``xarray.open_zarr``, reads the directory as well.

    Parameters
    ----------
    path : path
        Directory that `make` has made.

    Attributes
    ----------
    path : Path
    attrs : dict
        Scene file, seed, radar and signs.
    sizes : dict
        Lengths of the axes.
    names : tuple of str
        Variables.

    See Also
    --------
    make : Makes it.
    open_dataset : Opens it.
    verify : Checks it.

    Examples
    --------
    >>> scene = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]", "name = 'ball'"]
    >>> np.savetxt("scene.toml", [*scene, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1)
    >>> sample = dataset[0]
    >>> print(sample["cube"].shape, sample["true_range"].shape)  # frames, channels, chirps, samples; frames, bodies
    (4, 3, 64, 128) (4, 1)
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path: Path = Path(path)
        self._group = opened(self.path)
        self.attrs: dict[str, Any] = dict(self._group.attrs)
        arrays = dict(self._group.arrays())
        self.sizes: dict[str, int] = {}
        # The axes of the samples first, in their order.
        for array in (arrays["cube"], *arrays.values()):
            self.sizes |= zip(array.metadata.dimension_names, array.shape, strict=True)
        self._arrays = {name: array for name, array in arrays.items() if array.metadata.dimension_names[0] == "sample"}
        self._coordinates = {name: array for name, array in arrays.items() if name not in self._arrays}
        self.names: tuple[str, ...] = tuple(sorted(self._arrays))

    def __repr__(self) -> str:
        _, frames, channels, chirps, samples = self._arrays["cube"].shape
        made = int((self.status == STATUS["made"]).sum())
        count = f"{made} samples" if made == len(self) else f"{made} of {len(self)} samples"
        dtype = "ADC codes" if self.has_codes else self._arrays["cube"].dtype
        cube = f"{channels} channels x {chirps} chirps x {samples} samples"
        return f"<Dataset of {count} x {frames} frames: {cube}, {dtype}>"

    def __len__(self) -> int:
        return int(self.sizes["sample"])

    def __getitem__(self, index: int) -> dict[str, NDArray[Any]]:
        number = check.index("index", index, len(self))
        sample = {name: np.asarray(array[number]) for name, array in self._arrays.items()}
        return sample | {"cube": self._samples(sample["cube"])}

    def __iter__(self) -> Iterator[dict[str, NDArray[Any]]]:
        """The samples that are there, in order; the labels of a shard are read at once."""
        for number in range(self.num_shards):
            for _, sample in self.of_shard(number):
                yield sample

    def of_shard(self, shard: int) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
        """The samples of a shard that are there, with their indices."""
        samples = self.samples_of(shard)
        start, part = samples.start, slice(samples.start, samples.stop)
        wide = {name: array for name, array in self._arrays.items() if array.shards is not None}
        narrow = {name: np.asarray(array[part]) for name, array in self._arrays.items() if name not in wide}
        for k in np.flatnonzero(narrow["status"] == STATUS["made"]).tolist():
            sample = {name: np.asarray(values[k]) for name, values in narrow.items()}
            sample |= {name: np.asarray(array[start + k]) for name, array in wide.items()}
            yield start + k, sample | {"cube": self._samples(sample["cube"])}

    def frames(self, *, output: str | Output = "cube") -> StoredFrames:
        """Frames one by one with their labels, as `stream` has them.

        Parameters
        ----------
        output : "cube", "range_doppler" or function
            As of `stream`.

        See Also
        --------
        dataset.StoredFrames : What it returns.
        dataset.stream : Frames that are simulated when they are asked for.

        Examples
        --------
        >>> scene = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "name = 'ball'"]
        >>> np.savetxt("scene.toml", [*scene, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
        >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1)
        >>> for cube, labels in dataset.frames():
        ...     print(cube.shape, labels["sample"], labels["frame"], labels["true_range"].round(2))
        (3, 64, 128) 0 0 [1.39]
        (3, 64, 128) 0 1 [1.39]
        (3, 64, 128) 1 0 [2.33]
        (3, 64, 128) 1 1 [2.33]
        """
        return StoredFrames(self, int(self.sizes["frame"]), self.path.name, checked_output(output))

    def cube(self, index: int) -> NDArray[Any]:
        """Samples of the frames of a sample, (frame, channel, chirp, fast_time), to the bit as they were simulated."""
        return self._samples(self.stored(index))

    def stored(self, index: int) -> NDArray[Any]:
        """Samples as they are stored: codes where there was an ADC."""
        return np.asarray(self._arrays["cube"][check.index("index", index, len(self))])

    def values(self, name: str) -> NDArray[Any]:
        """A variable or coordinate as a whole, as it is stored; a KeyError for a name that is not there."""
        arrays = self._arrays | self._coordinates
        if name not in arrays:
            raise KeyError(f"no variable {name!r}; {check.near_names(name, arrays)}")
        return np.asarray(arrays[name][...])

    def axes(self, name: str) -> tuple[str, ...]:
        """Names of the axes of a variable or coordinate."""
        names: tuple[str, ...] = (self._arrays | self._coordinates)[name].metadata.dimension_names
        return names

    def attributes(self, name: str) -> dict[str, Any]:
        """Unit and meaning of a variable or coordinate."""
        return dict((self._arrays | self._coordinates)[name].attrs)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(sorted(self._coordinates))

    @property
    def samples_per_shard(self) -> int:
        """Consecutive samples that are one file per variable."""
        return int(self._arrays["status"].chunks[0])

    def samples_of(self, shard: int) -> range:
        """Indices of the samples of a shard."""
        start = shard * self.samples_per_shard
        return range(start, min(start + self.samples_per_shard, len(self)))

    @property
    def num_shards(self) -> int:
        """Number of shards."""
        return -(-len(self) // self.samples_per_shard)

    @property
    def has_codes(self) -> bool:
        """True where codes of an ADC are stored, of which `cube` makes samples."""
        return bool(self._arrays["cube"].dtype == np.uint16)

    @property
    def status(self) -> NDArray[np.int8]:
        """(sample,) 0: still missing, 1: made, 2: failed."""
        return np.asarray(self._arrays["status"][...])

    @property
    def failed(self) -> tuple[Failed, ...]:
        """Samples that could not be simulated, and why."""
        return tuple(failed for done in Journal(self.path).lines().values() for failed in done.failed)

    @cached_property
    def variation(self) -> Variation:
        """The scene file with its distributions: where it was, or if it is gone or has changed, a copy of it.

        The same holds for the files that it names, but models of arms, which have no copies.
        """
        file, text = Path(self.attrs["scene_path"]), self.attrs["scene"]
        digests = json.loads(self.attrs["settings"]).get("files")  # none where an early version made it
        try:
            if file.read_text(encoding="utf-8") == text and digests in (None, digests_of(file)):
                return Variation.load(file)
        except (OSError, UnicodeDecodeError):
            pass
        if digests:
            text = with_copies(text, file.parent, self.path, digests)
        with TemporaryDirectory() as folder:
            copy = Path(folder) / file.name
            copy.write_text(text, encoding="utf-8")
            return Variation.load(copy)

    @property
    def seed(self) -> int:
        """Seed of all draws."""
        return int(self.attrs["seed"])

    @cached_property
    def radar(self) -> Radar:
        """Radar of the first sample; of all, but where the scene varies it."""
        return Radar.from_dict(json.loads(self.attrs["radar"]))

    @cached_property
    def labels(self) -> Labels:
        """Which labels there are."""
        return Labels(**json.loads(self.attrs["settings"])["labels"])

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names along the axis `body`."""
        return tuple(map(str, self.values("body")))

    def sample(self, index: int) -> Sample:
        """A sample as drawn: the scene file that gives it alone."""
        return self.variation.sample(check.index("index", index, len(self)), seed=self.seed)

    def _samples(self, stored: NDArray[Any]) -> NDArray[Any]:
        """Samples of codes; NaN of a sample that is not there."""
        if not self.has_codes:
            return stored
        is_there = stored < NUM_CODES
        if is_there.all():
            return to_samples(stored)
        return np.where(is_there, to_samples(np.where(is_there, stored, 0)), np.float32(np.nan))


def open_dataset(path: str | PathLike[str]) -> Dataset:
    """Open a dataset, complete or not.

    Parameters
    ----------
    path : path
        Directory that `make` has made.

    Raises
    ------
    FileNotFoundError
        When there is no such directory.
    ValueError
        When it is no dataset, or a newer radarcore wrote it.

    See Also
    --------
    make : Makes it.
    Dataset : What it returns.

    Examples
    --------
    >>> scene = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]"]
    >>> np.savetxt("scene.toml", [*scene, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1)
    >>> [sample["time"].tolist() for sample in rc.dataset.open_dataset("out")]
    [[0.0, 0.025, 0.05, 0.075], [0.0, 0.025, 0.05, 0.075]]
    """
    return Dataset(path)
