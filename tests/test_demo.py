"""The demo command, run as a user does, without and with the real robot meshes."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from radarcore import cli, demo
from radarcore.models import robots

needs_robots = pytest.mark.skipif(
    not robots.is_available(), reason="needs the extra `robots`: pip install radarcore[robots]"
)


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "radarcore", *arguments], capture_output=True, text=True, check=False, timeout=300
    )


def test_demo_writes_a_recording_and_a_picture_and_meets_its_bounds(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    lines: list[str] = []
    comparisons = demo.run(tmp_path, duration=0.1, resolution=192, with_robots=False, say=lines.append)
    for c in comparisons:
        assert c.num_frames == c.num_range_within == c.num_velocity_within == 4, c
    assert [c.name for c in comparisons] == list(demo.REFLECTORS)
    recording = rc.Recording.load(tmp_path / "recording")
    assert recording.cube.shape == (4, 3, 64, 128)
    assert recording.cube.dtype == np.float32
    assert (tmp_path / "overview.png").read_bytes().startswith(b"\x89PNG")
    assert any("ms per frame" in line for line in lines)


@needs_robots
def test_demo_with_robots_reads_the_real_meshes_through_obj(tmp_path: Path) -> None:
    place = demo.scene(tmp_path)
    triangles = [len(body.mesh.triangles) for body in place.bodies if isinstance(body, rc.Body)]
    assert len(list(tmp_path.glob("ur10/*.obj"))) == 7
    assert len(list(tmp_path.glob("human/*.obj"))) == 23
    assert sum(triangles[4:11]) == 5862  # the UR10's collision meshes, none degenerate
    # Every part of arm and man is seen where the model puts it, in front of the back wall at 4.5 m.
    image = rc.Simulator(
        place, demo.radar(), radar_motion=demo.sensor_motion(), resolution=(96, 128), field_of_view_deg=(80.0, 60.0)
    ).depth_image()
    parts = image.body >= 4
    assert parts.sum() > 100
    assert image.distance[parts].max() < 4.5 * 2.0**0.5


@needs_robots
def test_demo_with_robots_runs(tmp_path: Path) -> None:
    comparisons = demo.run(tmp_path, duration=0.025, resolution=96, with_robots=True, say=lambda _: None)
    assert all(c.num_frames == 1 for c in comparisons)


@needs_robots
def test_human_stands_upright_on_the_floor() -> None:
    corners = np.concatenate([link.vertices @ link.pose[:3, :3].T + link.pose[:3, 3] for link in robots.human_links()])
    assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    assert 1.6 < corners[:, 2].max() < 1.9


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--resolution", "0"], "resolution: expected at least 1, got 0"),
        (["--duration", "-1"], "stop: expected a time after start"),
        (["-o", "/dev/null/demo"], "/dev/null/demo"),
    ],
)
def test_bad_input_is_one_line_without_a_traceback(arguments: list[str], message: str) -> None:
    done = run("demo", "--no-robots", *arguments)
    assert done.returncode == 1
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr


def test_help_names_the_commands_and_no_command_is_an_error() -> None:
    assert "demo" in run("--help").stdout
    assert run().returncode == 2


def test_interrupt_leaves_a_readable_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = iter(range(2))
    original = rc.Simulator.frame

    def interrupted(self: rc.Simulator, time: float = 0.0) -> rc.Frame:
        if next(frames, None) is None:
            raise KeyboardInterrupt
        return original(self, time)

    monkeypatch.setattr(rc.Simulator, "frame", interrupted)
    assert cli.main(["demo", "--no-robots", "--resolution", "32", "-o", str(tmp_path)]) == 130
    with pytest.warns(UserWarning, match="2 of 40 planned frames"):
        assert len(rc.Recording.load(tmp_path / "recording")) == 2
