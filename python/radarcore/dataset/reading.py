"""Datasets read: samples as arrays, their scene files, and checks of what is stored."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, check, notice
from radarcore.dataset.labels import Labels
from radarcore.dataset.sample import Sample, digests_of, with_copies
from radarcore.dataset.store import STATUS, Shards, file_of, opened, stored_samples
from radarcore.dataset.training import Frames, Output, output_of
from radarcore.dataset.variation import Variation
from radarcore.radar.radar import Radar
from radarcore.recording.frame import NUM_CODES, TRUTH_FIELDS, Frame, Truth, to_samples
from radarcore.recording.native import UNITS
from radarcore.recording.recording import Recording


@dataclass(frozen=True)
class Failed:
    """A sample that could not be simulated.

    Attributes
    ----------
    sample : int
        Its index.
    seed : int
        Seed of the dataset, which with the index gives the same sample again.
    error : str
        Kind and message of its error.
    """

    sample: int
    seed: int
    error: str


class Dataset:
    """Frames of many samples with their labels, on disk.

    An index gives a sample as a dictionary of arrays without the axis `sample`; iteration gives the stored samples, in
    order. Whatever reads Zarr, such as ``xarray.open_zarr``, reads the directory as well.

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
        self.shards: Shards = Shards(self.sizes["sample"], int(self._arrays["status"].chunks[0]))
        self._kept: dict[int, dict[str, NDArray[Any]]] = {}

    def __repr__(self) -> str:
        _, frames, channels, chirps, samples = self._arrays["cube"].shape
        made = len(self.made)
        count = f"{made} samples" if made == len(self) else f"{made} of {len(self)} samples"
        dtype = "ADC codes" if self.has_codes else self._arrays["cube"].dtype
        cube = f"{channels} channels x {chirps} chirps x {samples} samples"
        return f"<Dataset of {count} x {frames} frames: {cube}, {dtype}>"

    def __len__(self) -> int:
        return int(self.sizes["sample"])

    def __getitem__(self, index: int) -> dict[str, NDArray[Any]]:
        number = check.index("index", index, len(self))
        shard, place = divmod(number, self.shards.size)
        small = self._small_of(shard)
        sample = {
            name: np.asarray(small[name][place] if name in small else array[number])
            for name, array in self._arrays.items()
        }
        return sample | {"cube": self._samples(sample["cube"])}

    def __iter__(self) -> Iterator[dict[str, NDArray[Any]]]:
        """The samples that were made, in order."""
        for index in self.made.tolist():
            yield self[index]

    def _small_of(self, shard: int) -> dict[str, NDArray[Any]]:
        """Variables with one chunk per shard; the last complete shard stays in memory."""
        if shard in self._kept:
            return self._kept[shard]
        values = {name: self.read(name, shard) for name, array in self._arrays.items() if array.shards is None}
        if (values["status"] != STATUS["missing"]).all():
            self._kept = {shard: values}
        return values

    def frames(self, *, output: str | Output = "cube") -> Frames:
        """Frames one by one with their labels, as `stream` has them: a sequence for training.

        Samples that failed or are missing are left out. Drawn values are as stored: numbers as float, true and false
        as text.

        Parameters
        ----------
        output : "cube", "range_doppler" or function
            As of `stream`.

        See Also
        --------
        dataset.Frames : The result.
        dataset.stream : Frames that are simulated on access.

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
        samples, num_frames = tuple(self.made.tolist()), int(self.sizes["frame"])
        return Frames(self._frames_of, samples, num_frames, output_of(output), self.path.name)

    def _frames_of(self, sample: int, numbers: Sequence[int]) -> Iterator[tuple[Frame, dict[str, Any]]]:
        """Frames of a sample that have some numbers, with their labels."""
        arrays = self[sample]
        paths = {name: path for name in self.names if (path := self.attributes(name).get("path")) is not None}
        drawn = {path: arrays[name].item() for name, path in paths.items()}
        others = {"cube", "time", "status", "error", *paths}
        recording = self._recording(sample, arrays)
        for number in numbers:
            frame = recording[number]
            labels = {"sample": sample, "frame": number, "time": frame.time, **drawn}
            labels |= {name: values[number] for name, values in arrays.items() if name not in others}
            yield frame, labels

    def recording(self, index: int) -> Recording:
        """A sample as a recording in memory, with its truth if the dataset has it: for pictures, processing and files.

        Raises
        ------
        ValueError
            If the sample failed or is missing.

        See Also
        --------
        Recording.save : Other formats.

        Examples
        --------
        >>> scene = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "name = 'ball'"]
        >>> np.savetxt("scene.toml", [*scene, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
        >>> rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1).recording(1)
        <Recording of 2 frames in 0.025 s: 3 channels x 64 chirps x 128 samples, float32, truth of ball>
        """
        if self.status[check.index("index", index, len(self))] != STATUS["made"]:
            raise ValueError(f"index: expected a sample that was made, got {index}, which failed or is missing")
        return self._recording(index, self[index])

    def _recording(self, index: int, arrays: dict[str, NDArray[Any]]) -> Recording:
        """The recording of a sample's arrays."""
        truth = None
        if all(f"true_{name}" in arrays for name in TRUTH_FIELDS):
            truth = Truth(self.body_names, *(arrays[f"true_{name}"] for name in TRUTH_FIELDS))
        source = json.loads(self.attrs.get("source", "{}"))
        if (unit := self.attributes("cube")["units"]) != UNITS["cube"]:
            source.setdefault("cube_unit", unit)
        lost = arrays.get("lost_before")
        return Recording(arrays["cube"], arrays["time"], self.radar_of(index), truth, source, lost)

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

    def attributes(self, name: str) -> dict[str, Any]:
        """Unit and meaning of a variable or coordinate."""
        return dict((self._arrays | self._coordinates)[name].attrs)

    def read(self, name: str, shard: int) -> NDArray[Any]:
        """A variable of a shard as it is stored."""
        samples = self.shards.samples(shard)
        return np.asarray(self._arrays[name][samples.start : samples.stop])

    def file_of(self, name: str, shard: int) -> Path:
        """File of a variable for a shard."""
        return self.path / file_of(name, shard, self._arrays[name].ndim - 1)

    @property
    def has_codes(self) -> bool:
        """True if codes of an ADC are stored; `cube` converts them to samples."""
        return bool(self._arrays["cube"].dtype == np.uint16)

    @property
    def status(self) -> NDArray[np.int8]:
        """(sample,) 0: still missing, 1: made, 2: failed."""
        return np.asarray(self._arrays["status"][...])

    @property
    def made(self) -> NDArray[np.intp]:
        """Indices of the samples that were made."""
        return np.flatnonzero(self.status == STATUS["made"])

    @property
    def failed(self) -> tuple[Failed, ...]:
        """Samples that could not be simulated, and why."""
        failed, errors = np.flatnonzero(self.status == STATUS["failed"]).tolist(), self.values("error")
        return tuple(Failed(sample, self.seed, str(errors[sample])) for sample in failed)

    @cached_property
    def variation(self) -> Variation:
        """The scene file with its distributions: where it was, or if it is gone or has changed, a copy of it.

        The same holds for the files that it names, but models of arms, which have no copies.
        """
        file, text = Path(self.attrs["scene_path"]), self.attrs["scene"]
        if not text:
            raise ValueError(f"{self.path}: expected a dataset with a scene file, got one made from a recording")
        digests = json.loads(self.attrs["settings"])["files"]
        try:
            if file.read_text(encoding="utf-8") == text and digests == digests_of(file):
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

    def radar_of(self, index: int) -> Radar:
        """Radar of a sample: the scene may vary it."""
        return self.sample(index).simulation().radar if self.attrs["radar_varies"] else self.radar

    @cached_property
    def labels(self) -> Labels:
        """Which labels there are."""
        return Labels(**json.loads(self.attrs["settings"])["labels"])

    @cached_property
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
        If there is no such directory.
    ValueError
        If it is no dataset, or of another version of the format.

    See Also
    --------
    make : Makes it.
    Dataset : The result.

    Examples
    --------
    >>> scene = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]"]
    >>> np.savetxt("scene.toml", [*scene, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1)
    >>> [sample["time"].tolist() for sample in rc.dataset.open_dataset("out")]
    [[0.0, 0.025, 0.05, 0.075], [0.0, 0.025, 0.05, 0.075]]
    """
    return Dataset(path)


@dataclass(frozen=True)
class Verified:
    """Findings of a check of a dataset.

    Attributes
    ----------
    samples, missing : int
        Samples that it is to have, and samples that are still missing.
    failed : tuple of Failed
        Samples that could not be simulated when it was made.
    faults : tuple of str
        What is wrong, a line each; empty if all is well.
    again : tuple of int
        Samples that were simulated once more and are the same to the bit.
    made_by : str
        Version of radarcore that made it; if it differs, no sample is simulated again.

    See Also
    --------
    dataset.verify : Makes it.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.02", "[[point]]"]
    >>> np.savetxt("scene.toml", [*lines, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, workers=1)
    >>> rc.dataset.verify("out").is_good
    True
    """

    samples: int
    missing: int
    failed: tuple[Failed, ...]
    faults: tuple[str, ...]
    again: tuple[int, ...]
    made_by: str

    @property
    def is_good(self) -> bool:
        """True if nothing is wrong; samples may be missing, or have failed."""
        return not self.faults

    def __str__(self) -> str:
        lines = [
            f"{self.samples - self.missing} of {self.samples} samples, {len(self.failed)} failed",
            *(f"sample {sample} simulated again: the same to the bit" for sample in self.again),
            *(() if self.made_by == _core.__version__ else (f"no sample simulated again: made by {self.made_by}",)),
            *(f"fault: {fault}" for fault in self.faults),
        ]
        return "\n".join(lines)


def verify(path: str | PathLike[str], *, again: int = 1, progress: bool = True) -> Verified:
    """Check a dataset: read every file with its checksum, check its numbers, and simulate samples once more.

    Parameters
    ----------
    path : path
        Directory that `make` has made, complete or not.
    again : int
        Number of stored samples, evenly spread, to simulate again; every bit must be equal.
    progress : bool
        Show a progress bar when run in a terminal.

    Raises
    ------
    FileNotFoundError, ValueError
        As `open_dataset`.

    See Also
    --------
    make : Makes a dataset, and completes one.
    dataset.Verified : The result.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.02", "[[point]]"]
    >>> np.savetxt("scene.toml", [*lines, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1)
    >>> print(rc.dataset.verify("out"))
    2 of 2 samples, 0 failed
    sample 0 simulated again: the same to the bit
    """
    dataset = Dataset(path)
    again = check.count("again", again, 0)
    faults: list[str] = []
    failed: list[Failed] = []
    made: list[int] = []
    missing = 0
    for shard in notice.progress(range(dataset.shards.number), "verifying", "shard", shown=progress):
        samples = dataset.shards.samples(shard)
        if not dataset.file_of("status", shard).is_file():
            missing += len(samples)
            continue
        values, damage = _read_shard(dataset, shard)
        faults += damage
        if damage:
            continue
        for k, sample in enumerate(samples):
            if values["status"][k] == STATUS["failed"]:
                failed.append(Failed(sample, dataset.seed, str(values["error"][k])))
                continue
            made.append(sample)
            # Codes are integers, which always are finite.
            names = [name for name in ("cube", "time") if not np.isfinite(values[name][k]).all()]
            faults += [f"sample {sample}: expected finite numbers in {name}, got others" for name in names]
    same = []
    made_by, is_simulated = dataset.attrs["radarcore"], bool(dataset.attrs["scene"])
    if made_by == _core.__version__ and is_simulated and made:
        for k in dict.fromkeys(np.linspace(0, len(made) - 1, min(again, len(made))).astype(int).tolist()):
            if (fault := _fault_of_sample(dataset, made[k])) is None:
                same.append(made[k])
            else:
                faults.append(f"sample {made[k]}: {fault}")
    return Verified(len(dataset), missing, tuple(failed), tuple(faults), tuple(same), made_by)


def _read_shard(dataset: Dataset, shard: int) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """All variables of a shard, and what is wrong with their files."""
    values, faults = {}, []
    for name in dataset.names:
        if not (file := dataset.file_of(name, shard)).is_file():
            faults.append(f"{file}: expected a file, got none")
            continue
        try:
            values[name] = dataset.read(name, shard)
        except Exception as error:  # zarr raises many kinds for damaged files
            faults.append(f"{file}: expected the content that was written, got a damaged file ({error})")
    return values, faults


def _fault_of_sample(dataset: Dataset, index: int) -> str | None:
    """Simulate a sample once more and compare its samples."""
    stored = dataset.stored(index)
    try:
        with notice.gathered():
            frames = [stored_samples(frame) for frame in dataset.sample(index).frames()]
    except Exception as error:
        return f"simulated again: {type(error).__name__}: {error}"
    if stored.tobytes() != np.stack(frames).tobytes():
        return "expected the same bits when simulated again, got others"
    return None
