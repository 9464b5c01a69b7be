"""`--start` and `--duration` of commands that read recordings: which frames they take."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from radarcore.cli.main import main
from recordings import assert_same, recording

FRAMES = 6
"""At 0, 0.025, ... s."""


@pytest.fixture
def given(tmp_path: Path) -> Path:
    recording(FRAMES).save(tmp_path / "given")
    return tmp_path / "given"


@pytest.mark.parametrize(
    ("words", "first", "last"),
    [
        ("--start 0.05", 2, 6),
        ("--start 0.051", 3, 6),
        ("--start -1", 0, 6),
        ("--duration 0.05", 0, 2),
        ("--duration 0.051", 0, 3),
        ("--start 0.025 --duration 0.05", 1, 3),
        ("--start 0.1 --duration 9", 4, 6),
        ("--start -1 --duration 1.03", 0, 2),
    ],
)
@pytest.mark.parametrize("suffix", ["", ".mcap"])
def test_frames_that_begin_within_the_span_are_taken(
    words: str, first: int, last: int, suffix: str, given: Path
) -> None:
    source = given
    if suffix:
        pytest.importorskip("rosbags")
        source = given.with_suffix(suffix)
        assert main(["convert", str(given), str(source)]) == 0
    assert main(["convert", str(source), str(given.parent / "part"), *words.split()]) == 0
    assert_same(rc.Recording.load(given.parent / "part"), recording(FRAMES)[first:last])


def test_span_begins_at_the_first_frame_by_default_wherever_its_clock_is(given: Path) -> None:
    late = rc.Recording(recording(FRAMES).cube, 1.7e9 + 0.025 * np.arange(FRAMES), recording().radar)
    late.save(given.parent / "late")
    assert main(["convert", str(given.parent / "late"), str(given.parent / "part"), "--duration", "0.051"]) == 0
    np.testing.assert_array_equal(rc.Recording.load(given.parent / "part").time, late.time[:3])


@pytest.mark.parametrize(
    ("words", "first", "last"),
    [
        ("--start 0.1 --duration 0.2", 0, 2),  # the sum is 0.30000000000000004
        ("--start 0.8", 3, 4),  # the frame's time 0.7999999999999999
    ],
)
def test_rounded_sums_of_times_neither_add_nor_lose_a_frame(words: str, first: int, last: int, given: Path) -> None:
    assert (0.1 + 0.2, 0.1 + 0.7) == (0.30000000000000004, 0.7999999999999999)
    rounded = rc.Recording(recording(4).cube, [0.1, 0.2, 0.3, 0.1 + 0.7], recording().radar)
    rounded.save(given.parent / "rounded")
    assert main(["convert", str(given.parent / "rounded"), str(given.parent / "part"), *words.split()]) == 0
    np.testing.assert_array_equal(rc.Recording.load(given.parent / "part").time, rounded.time[first:last])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--start 0.126", "--start: expected times with frames, got 0.126 to inf s, which have none"),
        ("--start 0.026 --duration 0.01", "--start: expected times with frames, got 0.026 to 0.036 s, which have none"),
        ("--duration 0", "--duration: expected a positive number [s], got 0.0"),
    ],
)
@pytest.mark.parametrize("suffix", ["", ".mcap"])
def test_span_without_frames_is_an_error(
    words: str, message: str, suffix: str, given: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = given
    if suffix:
        pytest.importorskip("rosbags")
        source = given.with_suffix(suffix)
        assert main(["convert", str(given), str(source)]) == 0
    assert main(["process", str(source), *words.split()]) == 1
    assert message in capsys.readouterr().err


@pytest.mark.filterwarnings("ignore:.*expected at least one track, got none in 2 frames")
def test_compare_takes_a_span_of_both_recordings(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(recording), str(recording), "--start", "0.1", "--json"]) == 0
    assert [one["frames"] for one in json.loads(capsys.readouterr().out)["recordings"]] == [2, 2]


def test_process_plot_and_view_take_a_span_of_a_recording_and_none_of_a_scene(
    recording: Path, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three frames at 0, 0.1 and 0.2 s."""
    assert main(["process", str(recording), "-o", str(tmp_path / "results"), "--start", "0.1"]) == 0
    assert f"{recording}: 2 frames" in capsys.readouterr().out
    rows = csv.DictReader((tmp_path / "results" / "detections.csv").read_text(encoding="utf-8").splitlines())
    starts = {(row["frame"], row["time"][:3]) for row in rows}  # a detection's time is the middle of its frame
    assert starts == {("0", "0.1"), ("1", "0.2")}
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    plot = ["-o", str(tmp_path / "new.png"), "--kind", "map", "--start", "0.1", "--frame"]
    assert main(["plot", str(recording), *plot, "2"]) == 1
    assert "--frame: expected an index below 2, got 2" in capsys.readouterr().err
    assert main(["plot", str(recording), *plot, "1"]) == 0
    pytest.importorskip("rerun", reason="needs the extra `rerun`: pip install radarcore[rerun]")
    assert main(["view", str(recording), "-o", str(tmp_path / "new.rrd"), "--duration", "0.15"]) == 0
    assert ": 2 frames in " in capsys.readouterr().out
    for words in (["view", "-o", str(tmp_path / "other.rrd")], ["plot", "-o", str(tmp_path / "other.png")]):
        assert main([words[0], str(scene), *words[1:], "--start", "0.1"]) == 1
        expected = "expected no option of recordings with a scene file, got --start"
        assert expected in capsys.readouterr().err
