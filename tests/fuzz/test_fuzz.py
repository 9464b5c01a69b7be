"""Damaged files and bytes are read or refused by name: a few of each kind, drawn alike in every run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from fuzz.cases import next_case, size_of, write
from fuzz.judge import MOST_MEMORY, judge
from fuzz.targets import TARGETS

NUM_INPUTS = {"obj": 90, "scene": 5, "pattern": 90, "robot": 30, "directory": 18, "npz": 30, "infineon": 18}
NUM_INPUTS |= {"stream": 60, "capture": 12, "bag": 60}
"""Less than a third of a second each; `python -m tests.fuzz` draws for as long as one likes."""


@pytest.mark.parametrize("name", TARGETS)
def test_inputs_are_read_or_refused_by_name(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target, random = TARGETS[name], Random(f"{name} tests")
    seeds = list(target.seeds())
    with monkeypatch.context() as patience:
        patience.setattr("fuzz.streams.QUICK", 0.3)  # on a busy machine an answer that is there may take its time
        for case in seeds[-3:]:
            write(case, tmp_path)
            target.read(tmp_path)
    for _ in range(NUM_INPUTS[name]):
        case = next_case(target, seeds, random)
        write(case, tmp_path)
        verdict = judge(target.read, tmp_path, size_of(case))
        assert not verdict.fault, f"{verdict.fault}\n{verdict.trace}"


def refuse(error: BaseException) -> Callable[[Path], Any]:
    def read(folder: Path) -> None:
        error.args = tuple(str(arg).replace("FOLDER", str(folder)) for arg in error.args)
        raise error

    return read


@pytest.mark.parametrize(
    ("read", "fault"),
    [
        (lambda folder: None, ""),
        (refuse(ValueError("FOLDER/mesh.obj:3: expected three numbers")), ""),
        (refuse(FileNotFoundError("FOLDER/mesh.obj")), ""),
        (refuse(ValueError("expected three numbers")), "names no file"),
        (refuse(ValueError("FOLDER: expected text, got \0")), "long or unprintable"),
        (refuse(KeyError("FOLDER")), "KeyError"),
        (refuse(BaseException("FOLDER")), "BaseException"),
        (refuse(MemoryError("FOLDER")), "MemoryError"),
        (lambda folder: b"\xff".decode(), "UnicodeDecodeError"),
        (lambda folder: np.empty(MOST_MEMORY + 2000, np.uint8), "took 512 MiB for 10 bytes"),
        (lambda folder: np.float64(1e300) ** 2, "RuntimeWarning"),
    ],
)
def test_verdicts(read: Callable[[Path], Any], fault: str, tmp_path: Path) -> None:
    found = judge(read, tmp_path, 10).fault
    assert found.startswith(fault)
    assert bool(found) == bool(fault)
