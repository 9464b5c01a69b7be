"""`radarcore process --bag`: detections, maps and samples as messages of ROS, and back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

import radarcore as rc
from radarcore.adapters import ros
from radarcore.cli.main import main
from recordings import assert_same
from ros_bags import FORMATS, START_NS

NUM_FRAMES = 4


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two targets; one comes closer. The recording names the bag of its motions."""
    path = tmp_path_factory.mktemp("recording") / "take"
    targets = [rc.PointTarget([2.5, 0.4, 0.0], velocity=[-0.7, 0.0, 0.0]), rc.PointTarget([1.2, -0.3, 0.1])]
    radar = rc.bgt60tr13c(num_chirps=16)
    simulator = rc.Simulator(rc.Scene(targets), radar)
    simulator.record(
        0.1, 0.1 + NUM_FRAMES / 40.0, 40.0, path=path, progress=False, source={"bag": {"start_ns": START_NS}}
    )
    return path


@pytest.mark.parametrize("kind", FORMATS)
def test_detections_come_back_from_scans_and_points(
    recording: Path, tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bag"
    # Folders of ROS 2 are MCAP here; SQLite by the suffix.
    path = path.with_suffix(".db3") if kind == "sqlite3" else path
    assert main(["process", str(recording), "--bag", str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(path)
    frames = list(rc.Recording.load(recording).frames())
    with ros.BagReader(path) as bag:
        scans, points = (list(bag.messages(f"/radar/{name}")) for name in ("scan", "points"))
        maps = list(bag.messages("/radar/map"))
        assert {topic.name for topic in bag.topics.values()} == {"/radar/scan", "/radar/points", "/radar/map"}
    assert len(scans) == len(points) == len(maps) == NUM_FRAMES
    for frame, scan, cloud, image in zip(frames, scans, points, maps, strict=True):
        sent = rc.detect(frame)
        assert len(sent) >= 2
        expected_ns = START_NS + round(1e9 * sent.time)
        assert scan.time_ns == ros.header_nanoseconds(scan.message) == expected_ns
        assert ros.header_nanoseconds(cloud.message) == ros.header_nanoseconds(image.message) == expected_ns
        assert scan.message.header.frame_id == cloud.message.header.frame_id == "radar"
        got = ros.from_radar_scan(scan.message, start_ns=START_NS)
        for name in ("range", "velocity", "azimuth", "elevation", "snr_db"):
            np.testing.assert_array_equal(getattr(got, name), getattr(sent, name).astype(np.float32))
        columns = np.frombuffer(cloud.message.data, np.float32).reshape(-1, 5)
        np.testing.assert_array_equal(columns[:, :3], sent.position.astype(np.float32))
        np.testing.assert_array_equal(columns[:, 3], sent.velocity.astype(np.float32))
        power = (np.abs(rc.range_doppler(frame)) ** 2).sum(axis=0)
        np.testing.assert_array_equal(ros.from_map_image(image.message), (10 * np.log10(power)).astype(np.float32))


def test_a_bag_with_samples_is_a_recording(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "take.mcap"
    assert main(["process", str(recording), "--bag", str(path), "--samples", "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    with ros.BagReader(path) as bag:
        assert_same(ros.BagFrames(bag).recording(), rc.Recording.load(recording))
        assert bag.start_ns == START_NS + 100_000_000
    other = ["--bag", str(tmp_path / "other"), "--samples", "--subtract-mean", "--json"]
    assert main(["process", str(path), *other]) == 0
    moving = json.loads(capsys.readouterr().out)
    with ros.BagReader(tmp_path / "other") as bag:  # samples as they were
        assert_same(ros.BagFrames(bag).recording(), rc.Recording.load(recording))
    assert 0 < moving["detections"] < first["detections"]
    assert main(["process", str(path), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert all(again[name] == first[name] for name in ("frames", "detections", "tracks"))


def test_recording_is_never_replaced_by_its_own_results(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with ros.BagWriter(tmp_path / "take.mcap") as bag:
        ros.write_frames(bag, rc.Recording.load(recording), start_ns=START_NS)
    before = (tmp_path / "take.mcap").read_bytes()
    assert main(["process", f"{tmp_path}/take.mcap", "--bag", f"{tmp_path}/take.mcap", "--overwrite"]) == 1
    assert "--bag: expected a place outside the source, got" in capsys.readouterr().err
    assert (tmp_path / "take.mcap").read_bytes() == before


def test_bad_use_is_refused(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "take.mcap").write_bytes(b"\x89MCAP0\r\n")
    assert main(["process", str(recording), "--bag", str(tmp_path / "take.mcap")]) == 1
    assert "expected no such path, got a file; --overwrite replaces it" in capsys.readouterr().err
    assert main(["process", str(recording), "--bag", str(tmp_path / "take.mcap"), "--overwrite"]) == 0
    assert main(["process", str(tmp_path / "take.mcap")]) == 1
    assert "expected a bag with frames of a radar, got none; there are /radar/map" in capsys.readouterr().err


def test_one_of_several_recordings_in_a_bag_is_chosen_by_its_topic(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "two.mcap"
    taken = rc.Recording.load(recording)
    with ros.BagWriter(path) as bag:
        ros.write_frames(bag, taken, topic="/simulated", start_ns=START_NS)
        ros.write_frames(bag, taken[:2], topic="/measured", start_ns=START_NS)
    assert main(["process", f"{path}:/measured", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 2
    assert main(["info", f"{path}:/simulated", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == NUM_FRAMES
    assert main(["process", str(path)]) == 1
    expected = f"{path}: expected {path}:TOPIC with frames of a radar, of /measured, /simulated"
    assert capsys.readouterr().err == f"radarcore: {expected}\n"
