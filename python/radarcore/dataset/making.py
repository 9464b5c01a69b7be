"""Datasets made: planned, worked off shard by shard, and resumed."""

from __future__ import annotations

import errno
import json
import multiprocessing
from collections.abc import Generator
from concurrent.futures import Executor
from contextlib import ExitStack, closing
from os import PathLike
from pathlib import Path
from typing import Any

from radarcore import check, notice
from radarcore.dataset import executors
from radarcore.dataset.journal import Journal
from radarcore.dataset.labels import Labels
from radarcore.dataset.opened import Dataset, open_dataset
from radarcore.dataset.plan import planned
from radarcore.dataset.recipe import Recipe
from radarcore.dataset.shardfile import clear_partial
from radarcore.dataset.shards import Done, Work, Worker
from radarcore.dataset.store import attrs_of, create, opened, zarr
from radarcore.dataset.variation import Variation
from radarcore.output import Lock, already_exists, is_empty


def make(
    scene: str | PathLike[str] | Variation,
    path: str | PathLike[str],
    *,
    count: int,
    seed: int = 1,
    workers: int | None = None,
    executor: Executor | None = None,
    scheduler: str | None = None,
    timeout: float = 10.0,
    resume: bool = False,
    labels: Labels | None = None,
    samples_per_shard: int | None = None,
    progress: bool = True,
) -> Dataset:
    """Simulate samples of a scene that varies, and store them with their labels.

    The samples of a dataset follow from scene, seed and index alone: whoever makes them, however many work, and in
    whatever order, every bit is the same. A sample that cannot be simulated is recorded and left out. A dataset whose
    making was interrupted, or killed, opens with what is complete.

    Parameters
    ----------
    scene : path or Variation
        Scene file in which values may be distributions.
    path : path
        Directory to make: a Zarr group, which other libraries read as well.
    count : int
        Samples.
    seed : int
        Of all draws.
    workers : int, optional
        Processes of this machine, each of which has one thread if there are as many samples as cores; 1: this process.
        Default: one per core.
    executor : Executor, optional
        Of `concurrent.futures`, in place of processes of this machine. All its workers must reach `path`.
    scheduler : str, optional
        Address of a scheduler of dask distributed, ``"tcp://HOST:8786"``, in place of them; all its workers must reach
        `path`.
    timeout : float
        Time within which the scheduler must answer [s].
    resume : bool
        Go on with a dataset that was interrupted: shards that are complete are kept.
    labels : Labels, optional
        What is known of every frame; default: the truth of every body.
    samples_per_shard : int, optional
        Consecutive samples that are one file per variable, and one piece of work. Default: at most 64 MB, and at least
        64 shards where there are as many samples.
    progress : bool
        Show a progress bar when run in a terminal.

    Returns
    -------
    Dataset

    Raises
    ------
    FileExistsError
        When `path` exists, and is not resumed.
    BlockingIOError
        When another process is making it; the lock ends with its process.
    ValueError
        When a dataset is resumed with other settings, which it names; the error of the first sample if none works.
    ConnectionError
        When no scheduler answers, or one without workers.
    ChildProcessError
        When the worker of a shard was lost twice; it names the shard.
    OSError
        When a file cannot be written; what is complete stays.

    See Also
    --------
    Variation : What a scene that varies is.
    Labels : What may be known of frames.
    open_dataset : Opens what is there.
    verify : Checks it.

    Examples
    --------
    >>> scene = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]", "position = [2.0, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", [*scene, "velocity = [{ uniform = [-1.0, 1.0] }, 0.0, 0.0]"], fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=3, seed=1, workers=1)
    >>> dataset
    <Dataset of 3 samples x 4 frames: 3 channels x 64 chirps x 128 samples, float32>
    """
    _refuse_in_worker()
    zarr()
    target = Path(path).absolute()
    variation = scene if not isinstance(scene, str | PathLike) else Variation.load(scene)
    count = check.count("count", count)
    cores = executors.num_cores()
    workers = cores if workers is None else check.count("workers", workers)
    if executor is not None and scheduler is not None:
        raise ValueError("scheduler: expected an executor or the address of a scheduler, got both")
    threads = 1 if count >= cores else max(1, cores // min(workers, count))
    recipe = Recipe(variation, check.count("seed", seed, 0), labels or Labels(), threads)

    with ExitStack() as stack:
        # Before anything is made: who has no workers needs no dataset.
        if scheduler is not None:
            executor = stack.enter_context(executors.dask(scheduler, check.positive("timeout", timeout, "s")))
        before = _settings_before(target, resume)
        if before is not None and samples_per_shard is None:
            samples_per_shard = before["samples_per_shard"]
        plan = planned(recipe, count, samples_per_shard)
        if before is None:
            create(target, plan)
        stack.enter_context(Lock(target))
        if before is not None:
            _check_same(target, before, json.loads(plan.attrs["settings"]))
        work, journal = Worker.of(Work(str(target), recipe, plan.layout)), Journal(target)
        complete = journal.complete()
        left = [shard for shard in range(plan.layout.num_shards) if shard not in complete]
        clear_partial(target)

        def name(shard: int) -> str:
            samples = plan.layout.samples_of(shard)
            numbers = f"samples {samples[0]} to {samples[-1]}" if len(samples) > 1 else f"sample {samples[0]}"
            return f"{target}: shard {shard} ({numbers})"

        def made() -> Generator[Done, None, None]:
            if executor is not None:
                return executors.executed(work, left, executor, name)
            if workers == 1:
                return executors.serial(work, left)
            return executors.processes(work, left, executors.at_most(workers, left), name)

        bar = stack.enter_context(notice.progress(None, "making", "sample", total=count, shown=progress))
        bar.initial = bar.n = sum(len(plan.layout.samples_of(shard)) for shard in complete)
        warned = {kind for done in complete.values() for kind in done.warnings}
        try:
            for done in stack.enter_context(closing(made())) if left else ():
                _check_here(target, journal, done, name)
                journal.append(done)
                bar.update(len(plan.layout.samples_of(done.shard)))
                for kind in done.warnings.keys() - warned:
                    warned.add(kind)
                    sample, text = done.warnings[kind]
                    notice.warn(f"sample {sample}: {text}")
        finally:
            clear_partial(target)
    return open_dataset(target)


def _refuse_in_worker() -> None:
    """A script that makes a dataset without asking who runs it would do so in each of its processes."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise RuntimeError('make: expected in a script below `if __name__ == "__main__":`, as each process loads it')


def _settings_before(target: Path, resume: bool) -> dict[str, Any] | None:
    """Settings of the dataset that is to be resumed; None where there is nothing yet."""
    if not target.exists() or (target.is_dir() and is_empty(target)):
        return None
    attrs = attrs_of(target) if target.is_dir() else None
    if attrs is None:
        what = "a directory that is not empty and no dataset" if target.is_dir() else "a file, not a directory"
        raise already_exists(target, what)
    if not resume:
        raise already_exists(target, "a dataset; resume=True goes on with it")
    opened(target)  # refuses a damaged one
    settings: dict[str, Any] = json.loads(attrs["settings"])
    return settings


def _check_same(target: Path, before: dict[str, Any], now: dict[str, Any]) -> None:
    """Refuse to go on with other settings; a ValueError names those that differ."""
    differing = []
    for name, value in before.items():
        if now[name] == value:
            continue
        if name == "scene":
            differing.append(_differing_line(value, now[name]))
        elif name == "labels":
            names = [key for key in value.keys() | now[name].keys() if value.get(key) != now[name].get(key)]
            differing += [f"labels.{key} = {now[name].get(key)!r}, not {value.get(key)!r}" for key in sorted(names)]
        elif name == "files":
            names = [key for key in value.keys() | now[name].keys() if value.get(key) != now[name].get(key)]
            differing += [f"another file {key}" for key in sorted(names)]
        else:
            differing.append(f"{name} = {now[name]!r}, not {value!r}")
    if differing:
        raise ValueError(f"{target}: expected the settings that it was begun with, got {'; '.join(differing)}")


def _differing_line(before: str, now: str) -> str:
    """The first line of a scene file that has changed."""
    old, new = before.splitlines(), now.splitlines()
    same = next(
        (k for k, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1]), min(len(old), len(new))
    )
    texts = [repr(lines[same].strip()) if same < len(lines) else "nothing" for lines in (new, old)]
    return f"another scene (line {same + 1}: {texts[0]}, not {texts[1]})"


def _check_here(target: Path, journal: Journal, done: Done, name: Any) -> None:
    """Refuse a shard whose files cannot be seen from here: its worker has another disk."""
    if (missing := journal.damaged(done)) is not None:
        raise OSError(
            errno.ENOENT,
            f"expected the file that a worker has written for {name(done.shard).partition(': ')[2]}; "
            "all workers must reach the same directory",
            str(target / missing),
        )
