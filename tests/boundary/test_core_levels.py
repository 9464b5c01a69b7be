"""Instruction sets of the compiled core: the variable that limits them, and equal results at each, on small stacks."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).parents[1]
LEVELS = ("baseline", "avx2", "avx512")
PRINT_LEVELS = "from radarcore import _core; print(*_core.levels())"


def run(*arguments: str, level: str) -> subprocess.CompletedProcess[str]:
    """Python in a process with a highest level, and 512 kB of stack for the threads of the core."""
    environment = os.environ | {"RADARCORE_SIMD": level, "RUST_MIN_STACK": str(512 * 1024)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def results(level: str, folder: Path) -> dict[str, Any]:
    """Results of every kernel at a level."""
    done = run(str(TESTS / "every_kernel.py"), str(folder), level=level)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads((folder / "found.json").read_text())
    return found


def test_every_level_gives_the_same_results_in_512_kb_of_stack(tmp_path: Path) -> None:
    machine = run("-c", PRINT_LEVELS, level="").stdout.split()
    assert machine == list(LEVELS[: len(machine)])
    for level in LEVELS[len(machine) :]:
        assert run("-c", PRINT_LEVELS, level=level).stdout.split() == machine
    levels = {level: results(level, tmp_path) for level in machine}
    baseline = levels["baseline"]
    for level, found in levels.items():
        assert found["level"] == level
        assert found["worst"] <= 1.0
        for engine, precision in product(("chirp-wise NUFFT", "range-Doppler NUFFT"), ("single", "double")):
            widths = {width for *kind, width in found["kernels"] if kind == [engine, precision]}
            assert len(widths) >= 2, (engine, precision, widths)
        for name in ("hits", "noise", "direct"):
            assert found[name] == baseline[name], (level, name)
        # Multiplication and addition are fused above the baseline: samples in units of their rms differ by rounding.
        if level != "baseline":
            assert found["frames"] == levels["avx2"]["frames"]
        for name, (_, samples) in baseline["frames"].items():
            assert samples == pytest.approx(found["frames"][name][1], abs=1e-5), name


def test_unknown_level_is_an_error() -> None:
    done = run("-c", "import radarcore as rc; rc.Simulator", level="AVX2")
    expected = "ValueError: RADARCORE_SIMD: expected 'baseline', 'avx2' or 'avx512', got \"AVX2\""
    assert done.stderr.splitlines()[-1:] == [expected]
