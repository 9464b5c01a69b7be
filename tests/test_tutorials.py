"""Tutorials: as scripts they print what the site shows, and find the truth; as notebooks they run in a kernel."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import runpy
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")

ROOT = Path(__file__).resolve().parents[1]
TUTORIALS = ROOT / "docs" / "tutorials"
NAMES = sorted(path.stem for path in TUTORIALS.glob("*.py"))


def outputs_of(name: str) -> list[list[dict[str, str]]]:
    return json.loads((TUTORIALS / f"{name}.json").read_text(encoding="utf-8"))


def text_of(cells: list[list[dict[str, str]]]) -> str:
    return "".join(output.get("text", "") for cell in cells for output in cell)


Script = Callable[[str], dict[str, Any]]


@pytest.fixture
def script(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Script]:
    """Runs tutorials as scripts in an empty folder, in this process: they must print the outputs on the site."""
    import matplotlib.pyplot as plt

    def names_after(name: str) -> dict[str, Any]:
        found = runpy.run_path(str(TUTORIALS / f"{name}.py"))
        assert capsys.readouterr().out == text_of(outputs_of(name))
        return found

    plt.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    yield names_after
    plt.close("all")


def test_first_frames_find_ball_and_plate(script: Script) -> None:
    found = script("first_frames")
    detections, truth, waveform = found["detections"], found["frame"].truth, found["radar"].waveform
    assert len(detections.range) == 2
    assert abs(detections.range - truth.range).max() < 0.25 * waveform.range_resolution
    assert abs(detections.velocity - truth.velocity).max() < 0.1 * waveform.velocity_resolution


def test_person_is_tracked_from_the_moving_arm(script: Script) -> None:
    found = script("arm_and_person")
    (track,) = found["tracks"]
    assert track.num_hits > 0.7 * len(found["recording"])
    assert abs(track.range - found["trunk"][track.frame]).max() < 0.4  # [m], trunk to limbs


def test_errors_are_at_the_bound_and_velocities_fold(script: Script) -> None:
    found = script("waveform_and_array")
    estimates, truth = found["estimates"], found["recording"].truth
    for name in ("range", "velocity"):
        errors = getattr(estimates, name) - getattr(truth, name)[:, 0]
        # Of 200 frames: their rms error is within 15 % at three standard deviations.
        assert np.sqrt(np.mean(errors**2)) == pytest.approx(getattr(found["bound"], name), rel=0.15)
    assert found["peak"].velocity == pytest.approx(found["folded"], abs=0.1 * found["waveform"].velocity_resolution)
    np.testing.assert_allclose(found["found_deg"], found["true_deg"], atol=0.5)


def test_board_and_simulation_agree(script: Script) -> None:
    found = script("board_and_simulation")
    for errors in found["compared"]["ball"].errors:
        assert errors.num_tracked == errors.num_frames == found["NUM_FRAMES"]
        assert errors.range_share == errors.velocity_share == 1.0


# --- Notebooks and pages


def test_notebook_runs_in_a_kernel_and_puts_out_what_the_site_shows(tmp_path: Path) -> None:
    for package in ("jupytext", "nbclient", "ipykernel"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"needs {package}: pip install -r requirements/test.txt")
    command = [sys.executable, "docs/site/notebooks.py", "first_frames", "--check", "-o", str(tmp_path)]
    home = os.environ | {"HOME": str(tmp_path)}  # where kernels keep their files
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=300, env=home)
    assert result.returncode == 0, result.stderr
    notebook = json.loads((tmp_path / "first_frames.ipynb").read_text(encoding="utf-8"))
    shown = [output for cell in notebook["cells"] for output in cell.get("outputs", []) if "data" in output]
    assert sum("image/png" in output["data"] for output in shown) == 2
    assert sum("text/html" in output["data"] for output in shown) == 2  # the radar and the frame


@pytest.mark.parametrize("name", NAMES)
def test_tutorials_are_short_and_their_pictures_small(name: str) -> None:
    source = (TUTORIALS / f"{name}.py").read_text(encoding="utf-8")
    cells = re.findall(r"^# %%(?! \[markdown\])", source, flags=re.MULTILINE)
    assert 5 <= len(cells) <= 10
    assert len(outputs_of(name)) == len(cells)
    pictures = [output["png"] for cell in outputs_of(name) for output in cell if "png" in output]
    assert sorted(pictures) == sorted(path.name for path in TUTORIALS.glob(f"{name}-*.png")) != []
    assert all((TUTORIALS / picture).stat().st_size < 60_000 for picture in pictures)


def test_links_of_tutorials_lead_somewhere() -> None:
    assert len(NAMES) == 4
    index = (TUTORIALS / "index.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\]\((\w+)\.py\)", index)) == set(NAMES)
    for path in [TUTORIALS / "index.md", *(TUTORIALS / f"{name}.py" for name in NAMES)]:
        for link in re.findall(r"\]\(([^()\s#]+)", path.read_text(encoding="utf-8")):
            assert "://" in link or (TUTORIALS / link).is_file(), f"{path.name}: {link}"
