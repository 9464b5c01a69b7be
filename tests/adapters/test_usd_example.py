"""The example with a robot cell: a USD stage and radarcore's own bodies are the same to the radar."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

import usd_stages  # noqa: F401  # skips without the extra

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "usd_cell.py"


def test_a_skinned_person_and_an_arm_have_equal_ranges_and_velocities(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runpy.run_path(str(EXAMPLE))["main"](tmp_path / "cell.usdc", num_frames=2, rate=120.0)
    *rows, last = capsys.readouterr().out.splitlines()
    assert [row.split(":")[0] for row in rows] == ["0.1 s, bodies", "0.1 s, stage", "1.3 s, bodies", "1.3 s, stage"]
    assert len(set(rows[0].split(": ")[1].split(";"))) == 3
    millimetres, speed, share = map(float, re.findall(r"[\d.]+", last))
    assert millimetres < 0.1
    assert speed < 2.0  # [mm/s]: of samples at 120 Hz
    assert share < 2.0  # [%]: surfaces that deform are sampled otherwise
