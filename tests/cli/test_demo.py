"""The demo command, run as a user does, without and with the real robot meshes."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from arms import needs_robots
from radarcore.cli import demo
from radarcore.cli.main import main

KINDS = ("median_bins", "percentile_95_bins", "largest_bins")


def run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> dict[str, Any]:
    assert main(["demo", *map(str, words), "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_demo_writes_scene_recording_and_picture_and_meets_its_bounds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    cylinder, person = run(capsys, "-o", tmp_path, "--no-robots")["targets"]
    page = (Path(__file__).parents[2] / "docs" / "demo.md").read_text(encoding="utf-8")
    for name, target in (("cylinder", cylinder), ("person", person)):
        (row,) = re.findall(rf"^{name} +(.*)", page, flags=re.MULTILINE)
        counts = [
            target[f"num_{kind}"] for kind in ("frames", "tracked", "predicted", "range_within", "velocity_within")
        ]
        errors = [target[f"{of}_error"][kind] for of in ("range", "velocity") for kind in KINDS]
        expected = [*map(str, counts[:3]), *(f"{error:.3f}" for error in errors), *map(str, counts[3:])]
        assert row.split() == expected, "docs/demo.md"
    assert cylinder["num_frames"] == cylinder["num_range_within"] == cylinder["num_velocity_within"] == 200
    assert (person["num_frames"], person["num_tracked"], person["num_predicted"], person["num_tracks"]) == (
        200,
        200,
        0,
        1,
    )
    assert person["range_error"]["median_bins"] <= 0.3
    assert person["range_error"]["percentile_95_bins"] <= 1.5
    assert person["velocity_error"]["percentile_95_bins"] <= 2.0
    recording = rc.Recording.load(tmp_path / "recording")
    assert recording.cube.shape == (200, 3, 64, 128)
    assert (tmp_path / "experiment.png").read_bytes().startswith(b"\x89PNG")
    assert rc.load_scene(tmp_path / "scene.toml").run.stop == 5.0  # the whole experiment, to be changed and run again


def test_arm_of_the_experiment_carries_the_radar_at_250_mm_per_s_towards_the_cylinder(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(demo.scene_text(with_robots=False))
    simulation = rc.load_scene(tmp_path / "scene.toml")
    rate = simulation.radar_motion.rate_at(2.5)
    np.testing.assert_allclose(rate[:, 3], [0.25, 0.0, 0.0], atol=1e-4)  # the line's own bound
    np.testing.assert_allclose(simulation.radar_motion.at(2.5).rotation, np.eye(3), atol=1e-3)  # angles of 3 digits


@needs_robots
def test_demo_with_robots_moves_the_real_meshes(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(demo.scene_text(with_robots=True))
    simulation = rc.load_scene(tmp_path / "scene.toml")
    arm = [b for b in simulation.scene.bodies if isinstance(b, rc.Body) and str(b.name).startswith("arm/")]
    num_triangles = sum(len(body.mesh.triangles) for body in arm)
    assert num_triangles == 5862
    assert simulation.scene.num_triangles > num_triangles + 100_000, "of the person"
    truth = simulation.simulator().frame(0.1).truth
    assert truth is not None
    assert np.isfinite(truth.select(["cylinder"]).range).all()
