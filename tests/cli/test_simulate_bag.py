"""`radarcore simulate --bag`: motions of a recorded bag in, a radar recording out, with ranges known on paper."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

import radarcore as rc
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.poses import to_pose_stamped, to_transforms
from radarcore.cli.main import main
from ros_bags import EVERY_NS, START_NS, write_bag

RADAR = """
[radar]
preset = "bgt60tr13c"
num_chirps = 32
frame_interval = 0.025
"""

MOVING = """
[sensor]
motion = { kind = "bag", topic = "/robot/pose" }

[[body]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
motion = { kind = "bag", frame = "ball", within = "world" }

[run]
rate = 20
resolution = 96
"""


def test_poses_of_a_bag_move_the_bodies_and_the_sensor_of_a_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The ball comes at 0.6 m/s, the radar goes towards it at 0.3 m/s."""
    bag, scene, output = tmp_path / "bag", tmp_path / "scene.toml", tmp_path / "recording"
    with BagWriter(bag) as written:
        types = written.types
        for k in range(21):
            stamp, t = START_NS + k * EVERY_NS, 0.025 * k
            moved = {"ball": rc.Pose([2.0 - 0.6 * t, 0.0, 1.0])}
            written.write("/tf", to_transforms(moved, time_ns=stamp, types=types), stamp)
            robot = to_pose_stamped(rc.Pose([0.3 * t, 0.0, 1.0]), time_ns=stamp + 7, types=types)
            written.write("/robot/pose", robot, stamp)
    scene.write_text(RADAR + MOVING)
    assert main(["simulate", "--bag", str(bag), str(scene), "-o", str(output)]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(f"{output}: 10 frames of ")
    assert err == ""
    recording = rc.Recording.load(output)
    np.testing.assert_allclose(recording.time, 7e-9 + 0.05 * np.arange(10), atol=1e-12)
    wf = recording.radar.waveform
    assert recording.truth is not None
    for frame in recording.frames():
        at_middle = frame.time + 0.5 * wf.chirp_times[-1]
        peak = rc.strongest_peak(frame)
        assert peak is not None
        assert abs(peak.range - (1.9 - 0.9 * at_middle)) < 0.1 * wf.range_resolution
        assert abs(peak.velocity + 0.9) < 0.1 * wf.velocity_resolution
        assert frame.truth is not None
        assert frame.truth.velocity[0] == pytest.approx(-0.9, abs=1e-5)  # the nearest point that a ray hit
        assert frame.truth.range[0] == pytest.approx(1.9 - 0.9 * at_middle, abs=2e-4)
    assert recording.source["bag"] == {"path": str(bag), "start_ns": START_NS}


# --- info


def test_info_lists_topics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write_bag(tmp_path / "take.mcap", "mcap", 6)
    assert main(["info", str(bag)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["/arm/pose", "6", "geometry_msgs/msg/PoseStamped"] in lines
    assert ["start", "2023-11-14T22:13:20+00:00"] in lines
    assert main(["info", str(bag), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["topics"]["/array"] == "6 std_msgs/msg/Int16MultiArray"
    assert (facts["ROS"], facts["messages"], facts["start [ns]"]) == (2, 12, START_NS)


# --- The page


def test_commands_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "bags.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for kind, text in blocks:
        if 'BagWriter("take")' in text:
            exec(text.partition("\nwith ros.BagReader")[0], names)
        elif kind == "toml":
            Path("scene.toml").write_text(text, encoding="utf-8")
    lines = [line.split() for kind, text in blocks if kind == "console" for line in text.splitlines()]
    assert [line[1] for line in lines] == ["info", "simulate", "process", "process"]
    for _, *arguments in lines:
        assert main(arguments) == 0, capsys.readouterr().err
    assert capsys.readouterr().err == ""
    assert len(rc.Recording.load("out/take")) == 10
