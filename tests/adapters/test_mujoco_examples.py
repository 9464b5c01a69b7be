"""The example and the page on MuJoCo run, and what they print is right."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from mujoco_models import skip_without_graphics

ROOT = Path(__file__).resolve().parents[2]


def test_example_finds_the_box_where_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(ROOT / "examples" / "mujoco_arm.py"), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 6
    found = [re.findall(r"[-+]?\d+\.\d+", line) for line in lines[1:]]
    for _, distance, velocity, true_distance, true_velocity in np.array(found, dtype=float):
        assert abs(distance - true_distance) < 0.075  # half a resolution cell
        assert abs(velocity - true_velocity) < 0.06  # half a velocity bin


def test_arm_stops_for_a_person_and_swings_when_nobody_is_there() -> None:
    names = runpy.run_path(str(ROOT / "examples" / "stop_for_people.py"))
    person = rc.models.Human(height=1.75, speed=1.4, path=[[2.4, 0.3], [0.3, 0.0]])
    distances, standing = [], False
    for moment in names["run"]([person], 3.0):
        distances.append(names["true_distance"](person, moment))
        standing = moment.is_stopping and moment.speed < 0.01
        if standing or distances[-1] < 0.0:
            break
    assert standing
    assert distances[0] > 1.2
    assert distances[-1] > 0.3  # 0.11 m are required of an arm that stands
    assert not any(moment.is_stopping for moment in names["run"]([], 0.3))


def test_page_on_rendered_depth_runs() -> None:
    skip_without_graphics()
    text = (ROOT / "docs" / "mujoco.md").read_text(encoding="utf-8")
    first, *_ = re.findall(r"^```python\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)
    (drawn,) = re.findall(r"^```py\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)
    names: dict[str, object] = {}
    exec(compile(first + drawn, "mujoco.md", "exec"), names)
    frame = names["frame"]
    assert isinstance(frame, rc.Frame)
    assert frame.truth is not None
    # Past the loop of 75 ms: at 2 m/s from 2.8 m, and up to half of a frame.
    assert frame.truth.range[1] == pytest.approx(2.8 - 2.0 * frame.time, abs=0.03)
    assert frame.truth.velocity[1] == pytest.approx(-2.0, abs=0.05)
