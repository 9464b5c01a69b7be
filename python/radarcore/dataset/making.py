"""Datasets made: samples simulated shard by shard, by processes or any executor, and runs resumed."""

from __future__ import annotations

import errno
import json
import multiprocessing
import os
import pickle
import signal
from collections.abc import Generator, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, as_completed, wait
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import zip_longest
from os import PathLike
from pathlib import Path
from threading import Thread, get_ident
from typing import Any

from radarcore import check, notice
from radarcore.dataset.labels import Labels, labels_of
from radarcore.dataset.reading import Dataset, open_dataset
from radarcore.dataset.store import (
    STATUS,
    Layout,
    Rows,
    attributes_of,
    attrs_of,
    clear_partial,
    coordinates_of,
    create,
    layout_of,
    opened,
    put,
    stored_parameters,
    stored_samples,
    writable,
    write_shard,
    zarr,
)
from radarcore.dataset.variation import Variation
from radarcore.output import Lock, already_exists, is_empty
from radarcore.recording.frame import Frame

_TRIES = 20
"""Samples that are tried for the first one that can be simulated."""


def make(
    scene: str | PathLike[str] | Variation,
    path: str | PathLike[str],
    *,
    count: int,
    seed: int = 1,
    workers: int | None = None,
    executor: Executor | None = None,
    resume: bool = False,
    labels: Labels | None = None,
    samples_per_shard: int | None = None,
    progress: bool = True,
) -> Dataset:
    """Simulate samples of a scene that varies, and store them with their labels.

    Scene, seed and index decide a sample: every bit is the same for any number of workers and any order. Files are
    equal for one version of zarr, and of scipy if the scene has normal distributions. A sample that cannot be simulated
    is recorded and left out. A dataset whose making was interrupted or killed opens with what is complete.

    Parameters
    ----------
    scene : path or Variation
        Scene file in which values may be distributions.
    path : path
        Directory to make: a Zarr group, which other libraries read as well.
    count : int
        Samples.
    seed : int
        Seed of all draws.
    workers : int, optional
        Processes of this machine, each with one thread if there are enough samples for all cores; 1: this process.
        Default: one per core.
    executor : Executor, optional
        Executor of `concurrent.futures`, in place of processes of this machine. All its workers must reach `path`.
    resume : bool
        Continue a dataset that was interrupted: complete shards are kept.
    labels : Labels, optional
        Labels of every frame; default: the truth of every body.
    samples_per_shard : int, optional
        Consecutive samples in one file per variable, which are one piece of work. Default: at most 32 MB, and at least
        64 shards if there are enough samples.
    progress : bool
        Show a progress bar when run in a terminal.

    Returns
    -------
    Dataset

    Raises
    ------
    FileExistsError
        If `path` exists and is not resumed.
    BlockingIOError
        If another process is making it; the lock ends with its process.
    ValueError
        If a dataset is resumed with other settings or versions, which it names; the error of the first sample if none
        can be simulated.
    ChildProcessError
        If a worker was lost; complete shards stay.
    OSError
        If a file cannot be written; complete shards stay.

    See Also
    --------
    Variation : A varied scene.
    Labels : Possible labels of frames.
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
    cores = num_cores()
    workers = cores if workers is None else check.count("workers", workers)
    threads = 1 if count >= cores else max(1, cores // min(workers, count))
    recipe = Recipe(variation, check.count("seed", seed, 0), labels or Labels(), threads)

    before = _settings_before(target, resume)
    if before is not None and samples_per_shard is None:
        samples_per_shard = before["samples_per_shard"]
    frames = recipe.first_frames(count)
    layout = layout_of(variation, variation.label_names, recipe.labels, frames, count, samples_per_shard)
    radar = frames[0].radar
    attrs = attributes_of(variation, layout, recipe.seed, recipe.labels, radar)
    if before is None:
        create(target, layout, coordinates_of(radar, variation.label_names, layout), attrs)
    with ExitStack() as stack:
        stack.enter_context(Lock(target))
        if before is not None:
            _check_same(target, before, json.loads(attrs["settings"]))
        clear_partial(target, layout)
        stack.callback(clear_partial, target, layout)
        shards = layout.shards
        missing = [shard for shard in range(shards.number) if layout.missing_file(target, shard) is not None]
        made = _made(Worker(pickle.dumps((target, recipe, layout))), missing, workers, executor)
        bar = stack.enter_context(notice.progress(None, "making", "sample", total=count, shown=progress))
        bar.initial = bar.n = count - sum(len(shards.samples(shard)) for shard in missing)
        new = notice.NewKinds()
        for shard, warnings in stack.enter_context(closing(made)):
            if (file := layout.missing_file(target, shard)) is not None:
                text = "expected the file that a worker has written; all workers must reach the same directory"
                raise OSError(errno.ENOENT, text, str(file))
            bar.update(len(shards.samples(shard)))
            new.warn(warnings)
    return open_dataset(target)


@dataclass(frozen=True)
class Recipe:
    """Everything that decides the samples of a dataset, and the threads of a simulator, which do not."""

    variation: Variation
    seed: int
    labels: Labels
    threads: int

    def first_frames(self, count: int) -> list[Frame]:
        """Frames of the first sample that can be simulated; the error of the first sample if none can."""
        error: Exception | None = None
        for index in range(min(count, _TRIES)):
            try:
                with notice.gathered():
                    return list(self.variation.sample(index, seed=self.seed).frames(threads=self.threads))
            except Exception as failure:
                error = error or failure
        assert error is not None  # as there is at least one sample
        raise error

    def fill(self, rows: Rows, layout: Layout, index: int) -> None:
        """Simulate a sample into its rows, which have fill values; leave these, and its error, if that fails."""
        try:
            sample = self.variation.sample(index, seed=self.seed)
            for name, value in stored_parameters(sample.values, layout).items():
                rows[name][...] = value
            simulator, frames = sample.simulated(threads=self.threads)
            for number, frame in enumerate(frames):
                put(rows, "cube", number, stored_samples(frame))
                rows["time"][number] = frame.time
                for name, label in labels_of(simulator, frame, self.variation.label_names, self.labels).items():
                    put(rows, name, number, label.values)
            rows["status"][...] = STATUS["made"]
        except Exception as error:
            for name, variable in layout.variables.items():
                if variable.dims:
                    rows[name][...] = variable.fill
            rows["status"][...] = STATUS["failed"]
            rows["error"][...] = f"{type(error).__name__}: {error}"


@dataclass(frozen=True)
class Worker:
    """Makes shards, in whatever process it is sent to, which loads the recipe once.

    Meshes and other things that the scenes have in common are made once per process and thread.
    """

    work: bytes
    """Path of the dataset, recipe and layout."""

    def __call__(self, shard: int) -> tuple[int, tuple[str, ...]]:
        """Make a shard; its number, and the warnings of its samples."""
        path, recipe, layout, arrays = _loaded(self.work, get_ident())
        rows, warnings = layout.empty_rows(shard), []
        for k, index in enumerate(layout.shards.samples(shard)):
            with notice.gathered() as messages:
                recipe.fill({name: values[k, ...] for name, values in rows.items()}, layout, index)
            warnings += [f"sample {index}: {message}" for message in messages]
        write_shard(path, arrays, layout, shard, rows)
        return shard, tuple(warnings)


@lru_cache(maxsize=32)
def _loaded(work: bytes, thread: int) -> tuple[Path, Recipe, Layout, dict[str, Any]]:  # noqa: ARG001  # part of the key
    path, recipe, layout = pickle.loads(work)
    return path, recipe, layout, writable(path)


def num_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _made(
    worker: Worker, shards: list[int], workers: int, executor: Executor | None
) -> Generator[tuple[int, tuple[str, ...]], None, None]:
    """Shards as they are completed, here, by processes of this machine, or by an executor."""
    if executor is None and (workers == 1 or not shards):
        yield from map(worker, shards)
        return
    with ExitStack() as stack:
        pool = executor or stack.enter_context(_processes(min(workers, len(shards))))
        futures: list[Future[tuple[int, tuple[str, ...]]]] = []
        try:
            futures += [pool.submit(worker, shard) for shard in shards]
            for future in as_completed(futures):
                yield future.result()
        except (BrokenExecutor, CancelledError) as error:
            raise ChildProcessError(
                "a worker was lost (killed, or out of memory); complete shards stay; resume=True continues the rest"
            ) from error
        finally:
            running = [future for future in futures if not future.cancel()]
            if executor is not None:
                wait(running)


@contextmanager
def _processes(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with the block, at once if it was interrupted.

    They are spawned: a fork would copy locks that other threads hold, for example in the Rust core.
    """
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    """Begin a worker: Ctrl-C is for its parent, and it ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)


def _refuse_in_worker() -> None:
    """Refuse to make a dataset while a worker loads a script without a main guard: each would make it again."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise RuntimeError('make: expected in a script below `if __name__ == "__main__":`, as each process loads it')


def _settings_before(target: Path, resume: bool) -> dict[str, Any] | None:
    """Settings of the dataset that is to be resumed; None if there is none yet."""
    if not target.exists() or (target.is_dir() and is_empty(target)):
        return None
    attrs = attrs_of(target) if target.is_dir() else None
    if attrs is None:
        what = "a directory that is not empty and no dataset" if target.is_dir() else "a file, not a directory"
        raise already_exists(target, what)
    if not resume:
        raise already_exists(target, "a dataset; resume=True continues it")
    opened(target)  # refuses a damaged one
    settings: dict[str, Any] = json.loads(attrs["settings"])
    return settings


def _check_same(target: Path, before: dict[str, Any], now: dict[str, Any]) -> None:
    """Refuse to continue with other settings; a ValueError names the differences."""
    differing: list[str] = []
    for name, old in before.items():
        new: Any = now.get(name)
        if name == "scene" and old != new:
            lines = enumerate(zip_longest(old.splitlines(), str(new).splitlines(), fillvalue=""), 1)
            number, (was, line) = next((k, pair) for k, pair in lines if pair[0] != pair[1])
            differing.append(f"another scene (line {number}: {line.strip()!r}, not {was.strip()!r})")
        elif name == "files":
            differing += [f"another file {key}" for key in sorted({*old, *new}) if old.get(key) != new.get(key)]
        elif isinstance(old, dict):
            differing += [f"{name}.{key} = {new[key]!r}, not {old[key]!r}" for key in old if old[key] != new[key]]
        elif old != new:
            differing.append(f"{name} = {new!r}, not {old!r}")
    if differing:
        raise ValueError(f"{target}: expected the settings that it was begun with, got {'; '.join(differing)}")
