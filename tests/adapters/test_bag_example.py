"""The example on bags finds the truth."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")


def test_a_bag_of_poses_becomes_a_bag_of_detections(capsys: pytest.CaptureFixture[str]) -> None:
    example = Path(__file__).resolve().parents[2] / "examples" / "bag_to_radar.py"
    runpy.run_path(str(example), run_name="__main__")
    number = r"([-+]?[\d.]+)"
    line = re.compile(rf"{number} s: {number} m at {number} m/s, truth {number} m at {number} m/s")
    rows = [[float(value) for value in found] for found in line.findall(capsys.readouterr().out)]
    assert len(rows) == 5
    for time, distance, velocity, true_distance, true_velocity in rows:
        # The cart comes at 0.5 m/s, the robot goes at 0.2 m/s; the ball's nearest point is 0.2 m before its middle.
        on_paper = ((2.8 - 0.7 * time) ** 2 + (0.3 - 0.2 * time) ** 2) ** 0.5 - 0.2
        assert abs(true_distance - on_paper) < 0.01
        assert abs(distance - true_distance) < 0.03
        assert abs(velocity - true_velocity) < 0.03
