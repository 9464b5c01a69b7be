"""Checks of datasets: files as they were written, numbers, and a sample simulated once more."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, check, notice
from radarcore.dataset.journal import Journal
from radarcore.dataset.notices import gathered
from radarcore.dataset.opened import Dataset
from radarcore.dataset.recipe import Failed, Recipe, cube_of, simulated
from radarcore.dataset.shards import Done

_BLOCK = 1 << 20
"""Bytes of a file that are read at once."""

_THREADS = 4
"""Files that are read side by side: reading and sums do not hold each other up."""


@dataclass(frozen=True)
class Verified:
    """Findings of a check of a dataset.

    Parameters
    ----------
    samples, missing : int
        Samples that it is to have, and those that are still to be made.
    files, bytes : int
        Files that were compared with their checksums, and their size.
    failed : tuple of Failed
        Samples that could not be simulated when it was made.
    faults : tuple of str
        What is wrong, a line each; none: all is well.
    again : tuple of int
        Samples that were simulated once more and are the same to the bit.
    made_by : str
        Version of radarcore that made it; with another one none is simulated again.

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
    files: int
    bytes: int
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
            f"{self.files} files, {self.bytes / 1e6:.1f} MB",
            *(f"sample {sample} simulated again: the same to the bit" for sample in self.again),
            *(() if self.made_by == _core.__version__ else (f"no sample simulated again: made by {self.made_by}",)),
            *(f"fault: {fault}" for fault in self.faults),
        ]
        return "\n".join(lines)


def verify(path: str | PathLike[str], *, again: int = 1, progress: bool = True) -> Verified:
    """Check a dataset: checksums of its files, its numbers, and samples simulated once more.

    Parameters
    ----------
    path : path
        Directory that `make` has made, complete or not.
    again : int
        Samples that are simulated once more, spread over those that are there; every bit must be the same.
    progress : bool
        Show a progress bar when run in a terminal.

    Raises
    ------
    FileNotFoundError, ValueError
        As `open_dataset`.

    See Also
    --------
    make : Makes a dataset, and completes one.
    dataset.Verified : What it returns.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.02", "[[point]]"]
    >>> np.savetxt("scene.toml", [*lines, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1)
    >>> print(rc.dataset.verify("out"))
    2 of 2 samples, 0 failed
    18 files, 0.2 MB
    sample 0 simulated again: the same to the bit
    """
    dataset = Dataset(path)
    again = check.count("again", again, 0)
    shards = Journal(dataset.path).lines()
    files = {name: size for done in shards.values() for name, (size, _) in done.files.items()}
    faults, bad = [], set()
    with notice.progress(None, "verifying", "file", total=len(files), shown=progress) as bar:
        for name, fault in _checked_files(dataset.path, shards):
            bar.update()
            if fault is not None:
                faults.append(f"{dataset.path / name}: {fault}")
                bad.add(name)
    made = []
    for number, done in shards.items():
        # What is damaged is not read.
        if bad.isdisjoint(done.files):
            for sample, values in dataset.of_shard(number):
                made.append(sample)
                faults += _faults_of_numbers(sample, values)
    same = []
    if (made_by := dataset.attrs["radarcore"]) == _core.__version__ and made:
        for k in dict.fromkeys(np.linspace(0, len(made) - 1, min(again, len(made))).astype(int).tolist()):
            if (fault := _fault_of_sample(dataset, made[k])) is None:
                same.append(made[k])
            else:
                faults.append(f"sample {made[k]}: {fault}")
    return Verified(
        samples=len(dataset),
        missing=len(dataset) - sum(len(dataset.samples_of(number)) for number in shards),
        files=len(files),
        bytes=sum(files.values()),
        failed=tuple(failed for done in shards.values() for failed in done.failed),
        faults=tuple(faults),
        again=tuple(same),
        made_by=made_by,
    )


def _checked_files(path: Path, shards: dict[int, Done]) -> Iterator[tuple[str, str | None]]:
    """Every file of the shards, with what is wrong with it."""
    files = [(name, size, digest) for done in shards.values() for name, (size, digest) in done.files.items()]
    with ThreadPoolExecutor(_THREADS) as pool:
        faults = pool.map(lambda file: _fault_of_file(path / file[0], file[1], file[2]), files)
        yield from zip((name for name, _, _ in files), faults, strict=True)


def _fault_of_file(path: Path, size: int, digest: str) -> str | None:
    try:
        if (got := path.stat().st_size) != size:
            return f"expected {size} bytes, got {got}"
        found = hashlib.sha256()
        with path.open("rb") as file:
            while block := file.read(_BLOCK):
                found.update(block)
    except OSError as error:
        return f"expected a file, got none ({error.strerror})"
    return None if found.hexdigest() == digest else "expected the content that was written, got another checksum"


def _faults_of_numbers(sample: int, values: dict[str, NDArray[Any]]) -> Iterator[str]:
    """Variables of a sample with values that are not finite."""
    for name in ("cube", "time"):
        if not np.isfinite(values[name]).all():
            yield f"sample {sample}: expected finite numbers in {name}, got others"


def _fault_of_sample(dataset: Dataset, index: int) -> str | None:
    """Simulate a sample once more and compare its samples."""
    recipe = Recipe(dataset.variation, dataset.seed, dataset.labels, threads=1)
    stored = dataset.stored(index)
    try:
        with gathered():
            frames = [cube_of(frame) for _, frame in simulated(recipe, recipe.sample(index))]
    except Exception as error:
        return f"simulated again: {type(error).__name__}: {error}"
    if stored.tobytes() != np.stack(frames).tobytes():
        return "expected the same bits when simulated again, got others"
    return None
