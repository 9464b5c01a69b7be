"""Unit of work: one shard of a dataset, made by whoever is free."""

from __future__ import annotations

import json
import pickle
import time
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from threading import get_ident

from radarcore.dataset.layout import Layout
from radarcore.dataset.notices import gathered, kind_of
from radarcore.dataset.recipe import Failed, Recipe, made
from radarcore.dataset.shardfile import ShardFiles


@dataclass(frozen=True)
class Done:
    """A shard that is complete.

    Parameters
    ----------
    shard : int
        Its number.
    files : dict
        Size [bytes] and SHA-256 of every file, by its path relative to the dataset.
    failed : tuple of Failed
        Samples that could not be simulated.
    warnings : dict
        Of every kind of warning the first sample and its text.
    seconds : float
        Time that it took [s].
    """

    shard: int
    files: dict[str, tuple[int, str]]
    failed: tuple[Failed, ...] = ()
    warnings: dict[str, tuple[int, str]] = field(default_factory=dict)
    seconds: float = 0.0

    def line(self) -> str:
        """Line of ``progress.jsonl``."""
        return json.dumps(asdict(self)) + "\n"

    @classmethod
    def from_line(cls, line: str) -> Done:
        """The shard of a line; a ValueError, TypeError or KeyError for one that is not whole."""
        values = json.loads(line)
        return cls(
            shard=int(values["shard"]),
            files={str(name): (int(size), str(digest)) for name, (size, digest) in values["files"].items()},
            failed=tuple(Failed(**failed) for failed in values["failed"]),
            warnings={str(kind): (int(sample), str(text)) for kind, (sample, text) in values["warnings"].items()},
            seconds=float(values["seconds"]),
        )


@dataclass(frozen=True)
class Work:
    """Work of a dataset: enough to make any of its shards.

    Parameters
    ----------
    path : str
        The dataset: an absolute path, which all workers share.
    recipe : Recipe
    layout : Layout
    """

    path: str
    recipe: Recipe
    layout: Layout

    def make(self, shard: int) -> Done:
        """Make a shard; an OSError names the file that cannot be written."""
        began = time.perf_counter()
        failed: list[Failed] = []
        warned: dict[str, tuple[int, str]] = {}
        with ShardFiles(Path(self.path), self.layout, shard) as files:
            for index in self.layout.samples_of(shard):
                with gathered() as texts:
                    rows, failure = made(self.recipe, self.layout, index)
                for text in texts:
                    warned.setdefault(kind_of(text), (index, text))
                failed += [] if failure is None else [failure]
                files.append(rows)
            written = files.finish()
        return Done(shard, written, tuple(failed), warned, round(time.perf_counter() - began, 3))


@dataclass(frozen=True)
class Worker:
    """Makes shards of some work, wherever it is sent: with every shard to another process, where the work is kept.

    What scenes have in common, such as meshes of people, is made once per process and thread.
    """

    work: bytes

    @classmethod
    def of(cls, work: Work) -> Worker:
        """Worker of some work."""
        return cls(pickle.dumps(work))

    def __call__(self, shard: int) -> Done:
        """Make a shard."""
        return _loaded(self.work, get_ident()).make(shard)


@lru_cache(maxsize=32)
def _loaded(work: bytes, thread: int) -> Work:  # noqa: ARG001  # part of the key: threads share no work
    loaded: Work = pickle.loads(work)
    return loaded
