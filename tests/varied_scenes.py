"""Scene files that vary, of frames that take no time, and files of datasets."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

_RADAR = ['radar.preset = "bgt60tr13c"', "radar.num_chirps = 8", "radar.num_samples = 32", "run.stop = 0.05"]
_POINT = [
    "[[point]]",
    'name = "ball"',
    "position = [{ uniform = [1.0, 2.5] }, 0.0, 0.0]",
    "velocity = [{ uniform = [-1.0, 1.0] }, 0.0, 0.0]",
]

HEAD = 'run = { stop = 0.02, resolution = 32 }\n[radar]\npreset = "bgt60tr13c"\nnum_chirps = 8\n'
BALL = """
[[body]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
pose = { position = [{ uniform = [1.0, 3.0] }, { normal = [0.0, 0.2] }, 0.0] }
material = { choice = ["metal", "wood"] }
"""
PERSON = """
[[human]]
name = "person"
repeat = { integers = [0, 3] }
height = { uniform = [1.5, 1.9], step = 0.1 }
speed = { uniform = [0.5, 1.5] }
path = [[4.0, { uniform = [-1.0, 1.0] }], [1.0, 0.0]]
"""


def write_scene(folder: Path, *lines: str) -> Path:
    """Scene file of a ball at a random place, with further lines."""
    file = folder / "scene.toml"
    file.write_text("\n".join([*_RADAR, *_POINT, *lines]) + "\n", encoding="utf-8")
    return file


class Doing(Executor):
    """Executor that does something at every call, at once and in this thread: the call, as a rule."""

    def __init__(self, work: Callable[..., Any]) -> None:
        self._work = work

    def submit(self, function: Callable[..., Any], /, *given: Any) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        try:
            future.set_result(self._work(function, *given))
        except BaseException as error:
            future.set_exception(error)
        return future


def digests(dataset: Path) -> dict[str, str]:
    """SHA-256 of all files of a dataset."""
    files = [file for file in sorted(dataset.rglob("*")) if file.is_file()]
    return {str(file.relative_to(dataset)): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}
