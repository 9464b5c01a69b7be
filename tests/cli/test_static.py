"""Recordings of a sensor through the commands: neither its leakage nor what stands still, unless asked for."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.cli.main import main
from radarcore.plot.live.stream import Stream

START, SPEED, WALL = 2.0, 0.8, 3.0
"""Range [m] and velocity [m/s] of what moves, and range of what stands still and echoes more [m]."""


@pytest.fixture(autouse=True)
def working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures with relative names stay out of the checkout."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def simulated() -> rc.Recording:
    """Half a second of the chip's whole chain."""
    radar = rc.bgt60tr13c(receiver="measured", if_gain_db=33, num_chirps=16)
    points = [rc.PointTarget([START, 0.0, 0.0], velocity=[SPEED, 0.0, 0.0]), rc.PointTarget([WALL, 0.5, 0.0], rcs=9.0)]
    return rc.Simulator(rc.Scene(points), radar).record(0.0, 0.5, progress=False)


@pytest.fixture(scope="module")
def leaky(simulated: rc.Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as a sensor's recording: codes, and no truth."""
    path = tmp_path_factory.mktemp("leaky") / "recording"
    replace(simulated, truth=None).save(path)
    return path


@pytest.fixture(scope="module")
def faint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four frames at the default gain of the commands, of what echoes as a person far away does."""
    path = tmp_path_factory.mktemp("faint") / "recording"
    radar = rc.bgt60tr13c(receiver="measured", if_gain_db=23, num_chirps=64, max_range=10.0)
    person = rc.PointTarget([START, 0.0, 0.0], velocity=[SPEED, 0.0, 0.0], rcs=0.02)
    recording = rc.Simulator(rc.Scene([person]), radar).record(0.0, 0.1, progress=False)
    replace(recording, truth=None).save(path)
    return path


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Figures that are saved."""
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    from matplotlib.figure import Figure

    saved: list[Any] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: saved.append(figure))
    return saved


def range_of_brightest(picture: Any) -> float:
    """Range of the brightest row of an image over range [m]."""
    values: NDArray[np.float64] = np.ma.filled(picture.get_array(), -np.inf)
    _, _, low, high = picture.get_extent()
    row = int(np.argmax(values.max(axis=1)))
    return float(low + (row + 0.5) * (high - low) / len(values))


def at(frame: int) -> float:
    """Range of what moves in the middle of a frame [m]; frames are 25 ms apart."""
    return START + SPEED * 25e-3 * frame


@pytest.mark.parametrize("kind", ["overview", "detections"])
def test_map_of_a_sensors_frame_shows_what_moves(leaky: Path, figures: list[Any], kind: str) -> None:
    arguments = ["plot", str(leaky), "-o", "picture.png", "--overwrite", "--kind", kind, "--frame", "12"]
    assert main(arguments) == main([*arguments, "--keep-static"]) == 0
    bin_width = rc.Recording.load(leaky).radar.waveform.range_resolution
    moving, everything = (next(ax for ax in figure.axes if ax.images) for figure in figures)
    assert abs(range_of_brightest(moving.images[0]) - at(12)) < bin_width
    assert "static echoes removed" in moving.get_title()
    assert range_of_brightest(everything.images[0]) < bin_width, "the leakage"
    assert "static" not in everything.get_title()


def test_history_and_profile_of_a_sensors_recording_show_what_moves(leaky: Path, figures: list[Any]) -> None:
    for kind in ("range-time", "range-profile"):
        assert main(["plot", str(leaky), "-o", "picture.png", "--overwrite", "--kind", kind, "--frame", "12"]) == 0
    history, profile = (figure.axes[0] for figure in figures)
    bin_width = rc.Recording.load(leaky).radar.waveform.range_resolution
    assert START - bin_width < range_of_brightest(history.images[0]) < at(20) + bin_width
    ranges, levels = profile.lines[0].get_data()
    assert abs(ranges[np.argmax(levels)] - at(12)) < bin_width


@pytest.mark.parametrize("kind", ["overview", "range-time", "range-profile"])
def test_offsets_of_chirps_are_not_what_is_seen_first(kind: str, faint: Path, figures: list[Any]) -> None:
    """At the default gain they are louder than a person, at 0 m and all velocities, and differ from chirp to chirp."""
    assert main(["plot", str(faint), "-o", "picture.png", "--overwrite", "--kind", kind, "--frame", "2"]) == 0
    drawn = next(ax for ax in figures[0].axes if kind != "overview" or ax.images)
    if kind == "range-profile":
        ranges, levels = drawn.lines[0].get_data()
        seen = float(ranges[np.argmax(levels)])
    else:
        seen = range_of_brightest(drawn.images[0])
    assert abs(seen - START) < 2.0 * rc.Recording.load(faint).radar.waveform.range_resolution


def test_live_view_leaves_out_offsets_of_chirps(faint: Path) -> None:
    frames = list(rc.Recording.load(faint).frames())
    stream = Stream(frames[0].radar)
    for frame in frames:
        stream.take(frame)
    assert abs(stream.ranges[np.argmax(stream.level.max(axis=0))] - START) < 0.3
    kept = Stream(frames[0].radar, remove_static=False)
    kept.take(frames[0])
    assert kept.ranges[np.argmax(kept.level.max(axis=0))] < 0.3, "the leakage"


def test_samples_of_a_sensor_are_drawn_as_they_are(leaky: Path, figures: list[Any]) -> None:
    assert main(["plot", str(leaky), "-o", "picture.png", "--overwrite", "--kind", "chirp", "--frame", "3"]) == 0
    drawn = figures[0].axes[0].lines[0].get_ydata()
    np.testing.assert_allclose(drawn, 1e3 * rc.Recording.load(leaky).cube[3, 0, 0], rtol=1e-6)


def test_tracks_of_a_sensors_recording_are_what_moves(leaky: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def tracks(*options: str) -> list[dict[str, float]]:
        assert main(["process", str(leaky), "--range-only", "--json", *options]) == 0
        found: list[dict[str, float]] = json.loads(capsys.readouterr().out)["tracks"]
        return found

    (person,) = tracks()
    assert person["hits"] == 20, "in every frame"
    assert START - 0.02 < person["nearest"] < at(3), "confirmed after a few"
    assert abs(person["farthest"] - at(19)) < 0.02
    both = tracks("--keep-static")
    assert len(both) == 2
    assert any(abs(track["nearest"] - np.hypot(WALL, 0.5)) < 0.05 for track in both), "what stands still"


def test_what_stands_still_in_a_simulation_stays(simulated: rc.Recording, figures: list[Any], tmp_path: Path) -> None:
    """It was put there; the truth of the recording tells."""
    simulated.save(tmp_path / "recording")
    assert main(["plot", str(tmp_path / "recording"), "-o", "picture.png", "--overwrite", "--kind", "map"]) == 0
    assert "static" not in figures[0].axes[0].get_title()


def test_single_chirp_of_a_sensor_is_drawn(leaky: Path, figures: list[Any], tmp_path: Path) -> None:
    """There is nothing that it could be compared with."""
    some = rc.Recording.load(leaky)[:1]
    radar = replace(some.radar, waveform=some.radar.waveform.replace(num_chirps=1, frame_interval=25e-3))
    rc.Recording(some.cube[:, :, :1], some.time, radar, source=some.source).save(tmp_path / "one")
    assert main(["plot", str(tmp_path / "one"), "-o", "picture.png", "--overwrite", "--kind", "range-profile"]) == 0
    assert "static" not in figures[0].axes[0].get_title()
