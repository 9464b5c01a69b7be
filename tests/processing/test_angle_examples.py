"""The examples on angles and beams: what they print is right and on the page, and they make a picture."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import radarcore

ROOT = Path(__file__).resolve().parents[2]


def output(name: str, *arguments: str) -> str:
    """What a fresh interpreter prints."""
    path = os.pathsep.join([str(Path(radarcore.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-W", "error", str(ROOT / "examples" / name), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | {"PYTHONPATH": path})
    return done.stdout


def test_angles_of_the_array_are_found_and_on_the_page(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    printed = output("mimo_angles.py", str(tmp_path / "angles.png"))
    assert (tmp_path / "angles.png").read_bytes()[:4] == b"\x89PNG"
    assert printed in (ROOT / "docs" / "angles.md").read_text(encoding="utf-8")
    lines = dict(line.split(maxsplit=1) for line in printed.splitlines())
    truth = np.array(lines["truth"].split()[:-1], dtype=float)
    np.testing.assert_allclose(np.array(lines["music"].split(), dtype=float), truth, atol=1.0)


def test_simulated_echoes_follow_the_steered_pattern_and_the_page() -> None:
    printed = output("beam_steering.py")
    assert printed in (ROOT / "docs" / "angles.md").read_text(encoding="utf-8")
    found = re.findall(r"steered to +(\d+): loudest target at \+(\d+) degrees, .* within ([\d.]+) dB", printed)
    assert [steer for steer, _, _ in found] == [loudest for _, loudest, _ in found] == ["0", "15", "30"]
    assert max(float(error) for _, _, error in found) < 0.1  # wave fronts over 15 m bend by 1e-3 turns
