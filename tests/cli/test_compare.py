"""The command `compare`: its output, its files, and its failures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from doubles.motive_files import motive_file
from radarcore.cli.main import main

RADAR = rc.bgt60tr13c(num_chirps=32)
OFFSET = 0.2113


def ball_at(time: float) -> rc.Pose:
    return rc.Pose([2.2 + 0.2 * np.sin(5.0 * time) + 0.1 * time, 0.3, 1.0])


def radar_at(time: float) -> rc.Pose:
    return rc.Pose([0.1 * np.cos(3.0 * time), 0.0, 1.0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording, one that is taken for measured, and motion capture of radar and ball."""
    path = tmp_path_factory.mktemp("compared")
    scene = rc.Scene([rc.Body(rc.shapes.sphere(0.05), motion=ball_at, name="ball")])
    for name, seed, start in (("simulated", 0, 0.0), ("measured", 1, 0.0071)):
        simulator = rc.Simulator(scene, RADAR, radar_motion=radar_at, resolution=32, seed=seed)
        taken = simulator.record(start, 0.8, 40.0, progress=False)
        if name == "measured":
            taken = rc.Recording(taken.cube, taken.time - OFFSET, RADAR)
        taken.save(path / name)
    times = np.arange(0.0, 0.9, 0.01)
    motive_file(path / "take.csv", {"radar": radar_at, "ball": ball_at}, times, hidden={"ball": range(20, 35)})
    return path


def test_tables_are_printed_and_a_picture_is_drawn(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    picture = tmp_path / "new" / "picture.png"
    arguments = ["compare", str(folder / "simulated"), str(folder / "measured"), "--offset", "auto"]
    assert main([*arguments, "--time", "0.4", "--max-range", "4", "-o", str(picture)]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    for text in ("Errors of measured against the truth", "Echoes of measured relative to simulated", str(picture)):
        assert text in printed.out
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_motion_capture_is_the_truth_of_what_it_saw(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = ["--truth", str(folder / "take.csv"), "--radius", "ball=0.05"]
    assert main(["compare", str(folder / "measured"), *truth, "--offset", "auto", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["truth"] == "motions in the world"
    assert facts["recordings"][0]["offset"] == pytest.approx(OFFSET, abs=2e-3)
    (ball,) = facts["targets"]
    (errors,) = ball["errors"]
    # Of 32 frames, the frames in the gap of 160 ms, from 0.19 to 0.35 s, have no truth.
    assert 25 <= errors["num_frames"] <= 26
    assert errors["num_range_within"] == errors["num_velocity_within"] == errors["num_tracked"] == errors["num_frames"]
    assert abs(errors["range_error"]["bias"]) < 2e-3
    assert ball["echo"] is None


def test_options_name_recordings_and_targets(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [str(folder / "simulated"), str(folder / "measured"), "--offset", f"0,{OFFSET}"]
    assert main(["compare", *arguments, "--names", "model,board", "--targets", "thing=ball", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in facts["recordings"]] == ["model", "board"]
    assert [one["offset"] for one in facts["recordings"]] == [0.0, OFFSET]
    assert [one["name"] for one in facts["targets"]] == ["thing"]
    assert facts["targets"][0]["difference"]["num_range_within"] > 25


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["measured"], "recording_b: expected another recording, or a truth to compare with, got neither"),
        (["simulated", "--truth", "take.csv", "--radar", "rader"], "--radar: expected a body of take.csv, got 'rader'"),
        (["simulated", "--truth", "take.csv", "--radius", "ball"], "--radius: expected a number, got 'ball'"),
        (["simulated", "--truth", "measured"], "--truth: expected a recording with truth, got one without"),
    ],
)
def test_bad_input_is_one_line(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(folder)
    assert main(["compare", *arguments]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(f"radarcore: {message}")
    assert len(printed.err.splitlines()) == 1


def test_bag_without_frames_and_capture_of_the_radar_alone_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")
    from radarcore.adapters import ros

    with ros.BagWriter(tmp_path / "poses.mcap") as bag:
        for k in range(3):
            pose = ros.to_pose_stamped(rc.Pose([1.0, 0.0, 0.0]), time_ns=k * 10**8, types=bag.types)
            bag.write("/radar/pose", pose, k * 10**8)
    path = str(tmp_path / "poses.mcap")
    assert main(["compare", path]) == 1
    there = "there are /radar/pose (geometry_msgs/msg/PoseStamped)"
    assert capsys.readouterr().err == f"radarcore: {path}: expected a bag with frames of a radar, got none; {there}\n"
    assert main(["compare", str(folder / "measured"), "--truth", path]) == 1
    expected = f"radarcore: --truth: expected a body of {path} besides the radar 'radar', got none\n"
    assert capsys.readouterr().err == expected
