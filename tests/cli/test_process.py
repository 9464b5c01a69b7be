"""The command `process`: detections and tracks of recordings, as files and as a summary."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.cli import process
from radarcore.cli.main import main

RADAR = rc.bgt60tr13c()


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two points; one recedes."""
    path = tmp_path_factory.mktemp("recorded") / "recording"
    points = [rc.PointTarget([1.5, 0.3, 0.0], velocity=[0.8, 0.0, 0.0]), rc.PointTarget([4.0, 0.0, 0.5], rcs=3.0)]
    rc.Simulator(rc.Scene(points), RADAR).record(0.0, 0.3, 40.0, path=path, progress=False)
    return path


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_files_hold_what_detect_and_tracker_give(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["process", str(recording), "-o", str(tmp_path / "new" / "out")]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""  # no progress bar beside a terminal
    assert "12 frames, 24 detections, 2 tracks" in printed.out
    detections, tracks = (rows(tmp_path / "new" / "out" / name) for name in process.FILES)
    tracker = rc.Tracker(velocity_ambiguity=2.0 * RADAR.max_velocity)
    expected_tracks = []
    k = 0
    for index, frame in enumerate(rc.Recording.load(recording).frames()):
        found = rc.detect(frame)
        for j in range(len(found)):
            row = detections[k]
            assert int(row["frame"]) == index
            for name in ("range", "velocity", "snr_db"):
                assert float(row[name]) == pytest.approx(getattr(found, name)[j], rel=1e-5, abs=1e-9)
            assert np.deg2rad(float(row["azimuth_deg"])) == pytest.approx(found.azimuth[j], rel=1e-5)
            k += 1
        expected_tracks += [(index, state.id, state.range) for state in tracker.update(found) if state.is_confirmed]
    assert k == len(detections) == 24
    assert [(int(r["frame"]), int(r["track"])) for r in tracks] == [(index, i) for index, i, _ in expected_tracks]
    np.testing.assert_allclose([float(r["range"]) for r in tracks], [r for *_, r in expected_tracks], rtol=1e-5)


def test_people_are_tracked_without_things_at_rest(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["process", str(recording), "--people", "--json", "-o", str(tmp_path)]) == 0
    (moving,) = json.loads(capsys.readouterr().out)["tracks"]
    assert moving["farthest"] == pytest.approx(np.hypot(1.5 + 0.8 * 0.285, 0.3), abs=0.05)
    last = rows(tmp_path / "tracks.csv")[-1]
    assert float(last["nearest"]) == pytest.approx(float(last["range"]), abs=0.05)


def test_summary_is_json_for_machines(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["process", str(recording), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["frames"], summary["detections"]) == (12, 24)
    near, far = summary["tracks"]
    assert (near["last_frame"], near["hits"]) == (11, 12)
    assert near["farthest"] == pytest.approx(np.hypot(1.5 + 0.8 * 0.285, 0.3), abs=0.02)
    assert far["nearest"] == pytest.approx(far["farthest"], abs=0.02)
    assert summary["seconds"] > 0.0


def test_options_choose_what_is_detected(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def number(*options: str) -> int:
        assert main(["process", str(recording), "--json", *options]) == 0
        return int(json.loads(capsys.readouterr().out)["detections"])

    assert number("--max-range", "3") == number("--min-range", "3") == 12
    # Over a third of a second the point that recedes hardly stands still; the other does.
    assert number("--subtract-mean", "--min-range", "3") == 0
    # The mean of so short a recording has a little of it, which stands still in all frames then.
    assert 12 <= number("--subtract-mean", "--max-range", "3") < 24
    assert number("--range-only", "--max-range", "3") == 12
    assert number("--false-alarm-rate", "1e-3") > 24


@pytest.mark.parametrize(
    "waveform", [{"num_chirps": 1}, {"chirp_times": 400e-6 * np.arange(8) ** 1.1, "num_chirps": 8}]
)
def test_radars_without_velocities_are_processed_too(tmp_path: Path, waveform: dict[str, Any]) -> None:
    radar = rc.bgt60tr13c(**waveform)
    scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], rcs=100.0)])
    rc.Simulator(scene, radar).record(0.0, 0.2, 40.0, path=tmp_path / "rec", progress=False)
    assert main(["process", str(tmp_path / "rec"), "-o", str(tmp_path / "out")]) == 0
    detections, tracks = (rows(tmp_path / "out" / name) for name in process.FILES)
    assert {row["velocity"] for row in detections} == {""}
    assert {row["track"] for row in tracks} == {"0"}


def test_sub_sequences_are_processed_one_at_a_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    up, down = RADAR.waveform.replace(num_chirps=32, chirp_interval=600e-6).alternating()
    radar = rc.Radar([up, down], receiver=RADAR.receiver)
    scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], rcs=10.0)])
    rc.Simulator(scene, radar, field_of_view_deg=(60.0, 60.0)).record(
        0.0, 0.1, 40.0, path=tmp_path / "rec", progress=False
    )
    for sequence in ("0", "1"):
        assert main(["process", str(tmp_path / "rec"), "--json", "--sequence", sequence]) == 0
        assert json.loads(capsys.readouterr().out)["detections"] == 4
    assert main(["process", str(tmp_path / "rec"), "--sequence", "2"]) == 1
    assert "sequence: expected an index below 2, got 2" in capsys.readouterr().err


def test_results_are_replaced_only_when_told_to(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "detections.csv").write_text("mine\n")
    assert main(["process", str(recording), "-o", str(tmp_path)]) == 1
    message = capsys.readouterr().err
    assert "detections.csv: expected no such path, got a file; --overwrite replaces it" in message
    assert (tmp_path / "detections.csv").read_text() == "mine\n"
    assert main(["process", str(recording), "-o", str(tmp_path), "--overwrite"]) == 0
    assert len(rows(tmp_path / "detections.csv")) == 24


def test_interrupt_leaves_the_frames_before_it(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    frames = iter(range(6))  # the first one twice: settings are tried before a file is made

    def interrupted(frame: rc.Frame, **options: Any) -> rc.Detections:
        if next(frames, None) is None:
            raise KeyboardInterrupt
        return rc.detect(frame, **options)

    monkeypatch.setattr(process, "detect", interrupted)
    assert main(["process", str(recording), "-o", str(tmp_path)]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert {row["frame"] for row in rows(tmp_path / "detections.csv")} == set("01234")
