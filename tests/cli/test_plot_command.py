"""The command `plot`: every picture of scenes and recordings, and recordings of sensors without static echoes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from dca1000_files import Scene, commands
from radarcore.cli import plot
from radarcore.cli.main import main
from radarcore.plot.live.stream import Stream
from scene_files import APPROACHING

pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
from matplotlib.figure import Figure

START, SPEED, WALL = 2.0, 0.8, 3.0
"""Range [m] and velocity [m/s] of what moves, and range of what stands still and echoes more [m]."""


@pytest.fixture(autouse=True)
def working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures with relative names stay out of the checkout."""
    monkeypatch.chdir(tmp_path)


def draw(source: Path, kind: str, *words: str) -> None:
    picture = Path("new/picture.png")
    assert main(["plot", str(source), "-o", str(picture), "--overwrite", "--kind", kind, *words]) == 0


@pytest.mark.parametrize("kind", plot.KINDS)
def test_every_picture_of_a_scene(scene: Path, kind: str) -> None:
    draw(scene, kind)
    assert Path("new/picture.png").read_bytes().startswith(b"\x89PNG")


@pytest.fixture(scope="module")
def of_two_sequences(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording of a radar with two sub-sequences."""
    directory = tmp_path_factory.mktemp("sequences")
    radar = 'preset = "bgt60tr24"\nnum_chirps = 8\nalternating = true\nschedule = { kind = "tdm" }\nslope = 20e12\n'
    text = APPROACHING.replace('preset = "bgt60tr13c"\nstop_frequency = 60e9\nnum_chirps = 8\n', radar)
    (directory / "scene.toml").write_text(text)
    rc.load_scene(directory / "scene.toml").record(directory / "recording", progress=False)
    return directory / "recording"


# At 80 GHz the receivers of a BGT60 have a spacing of 0.7 wavelengths.
@pytest.mark.filterwarnings("ignore:radar. expected a channel spacing below")
@pytest.mark.parametrize("kind", [kind for kind in plot.VIEWS if kind not in plot.FIGURES])
def test_pictures_of_a_sub_sequence_take_what_can_be_chosen_of_them(
    of_two_sequences: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    values = {"channel": "1", "false_alarm_rate": "1e-5", "min_range": "0.5", "max_range": "2.5", "max_velocity": "1"}
    words = [word for name in plot.VIEWS[kind] for word in (f"--{name.replace('_', '-')}", values.get(name)) if word]
    draw(of_two_sequences, kind, *words, "--sequence", "1")
    if kind == "chirp":
        second = Path("new/picture.png").read_bytes()
        draw(of_two_sequences, kind, *words)
        assert Path("new/picture.png").read_bytes() != second
        assert main(["plot", str(of_two_sequences), "-o", "a.png", "--sequence", "2"]) == 1
        assert "--sequence: expected an index below 2, got 2" in capsys.readouterr().err


# --- Recordings of sensors: without leakage and static echoes, unless requested


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
    """Range of the moving target in the middle of a frame [m]; the frame interval is 25 ms."""
    return START + SPEED * 25e-3 * frame


@pytest.mark.parametrize("kind", ["overview", "detections"])
def test_map_of_a_sensors_frame_shows_what_moves(leaky: Path, figures: list[Any], kind: str) -> None:
    draw(leaky, kind, "--frame", "12")
    draw(leaky, kind, "--frame", "12", "--keep-mean")
    bin_width = rc.Recording.load(leaky).radar.waveform.range_resolution
    moving, everything = (next(ax for ax in figure.axes if ax.images) for figure in figures)
    assert abs(range_of_brightest(moving.images[0]) - at(12)) < bin_width
    assert "static echoes removed" in moving.get_title()
    assert range_of_brightest(everything.images[0]) < bin_width, "the leakage"
    assert "static" not in everything.get_title()


def test_history_and_profile_of_a_sensors_recording_show_what_moves(leaky: Path, figures: list[Any]) -> None:
    for kind in ("range-time", "range-profile"):
        draw(leaky, kind, "--frame", "12")
    history, profile = (figure.axes[0] for figure in figures)
    bin_width = rc.Recording.load(leaky).radar.waveform.range_resolution
    assert START - bin_width < range_of_brightest(history.images[0]) < at(20) + bin_width
    ranges, levels = profile.lines[0].get_data()
    assert abs(ranges[np.argmax(levels)] - at(12)) < bin_width


@pytest.mark.parametrize("kind", ["overview", "range-time"])
def test_offsets_of_chirps_are_not_what_is_seen_first(kind: str, faint: Path, figures: list[Any]) -> None:
    """At the default gain they are louder than a person, at 0 m and all velocities, and differ from chirp to chirp."""
    draw(faint, kind, "--frame", "2")
    seen = range_of_brightest(next(ax for ax in figures[0].axes if ax.images).images[0])
    assert abs(seen - START) < 2.0 * rc.Recording.load(faint).radar.waveform.range_resolution


def test_live_view_leaves_out_offsets_of_chirps(faint: Path) -> None:
    frames = list(rc.Recording.load(faint).frames())
    stream = Stream(frames[0].radar)
    for frame in frames:
        stream.take(frame)
    assert abs(stream.ranges[np.argmax(stream.level.max(axis=0))] - START) < 0.3
    kept = Stream(frames[0].radar, subtract_mean=False)
    kept.take(frames[0])
    assert kept.ranges[np.argmax(kept.level.max(axis=0))] < 0.3, "the leakage"


def test_samples_of_a_sensor_are_drawn_as_they_are(leaky: Path, figures: list[Any]) -> None:
    draw(leaky, "chirp", "--frame", "3")
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
    both = tracks("--keep-mean")
    assert len(both) == 2
    assert any(abs(track["nearest"] - np.hypot(WALL, 0.5)) < 0.05 for track in both), "what stands still"


def test_simulations_and_single_chirps_stay_as_they_are(
    simulated: rc.Recording, leaky: Path, figures: list[Any], tmp_path: Path
) -> None:
    """Static bodies of a simulation are wanted, and a single chirp has no other to compare with."""
    simulated[:2].save(tmp_path / "recording")
    some = rc.Recording.load(leaky)[:1]
    radar = replace(some.radar, waveform=some.radar.waveform.replace(num_chirps=1, frame_interval=25e-3))
    rc.Recording(some.cube[:, :, :1], some.time, radar, source=some.source).save(tmp_path / "one")
    for name in ("recording", "one"):
        draw(tmp_path / name, "range-profile")
        assert "static" not in figures[-1].axes[0].get_title()


def test_leakage_of_a_capture_is_neither_drawn_nor_the_strongest_peak(tmp_path: Path, figures: list[Any]) -> None:
    scene = Scene(num_frames=4)
    (tmp_path / "profile.cfg").write_text(commands(scene))
    # A tone of a tenth of a range bin, the same in every chirp, 20 dB over the target.
    leak = np.exp(0.2j * np.pi * np.arange(64) / 64.0)
    chirp = np.stack([leak.imag, leak.real], -1).reshape(32, 2, 2).transpose(0, 2, 1)  # Q Q I I
    numbers = scene.numbers("lanes2", q_first=True).reshape(-1, 32, 2, 2)
    (numbers + np.rint(1e4 * chirp).astype("<i2")).tofile(tmp_path / "adc_data.bin")
    frame = rc.Recording.load(tmp_path / "adc_data.bin", config=tmp_path / "profile.cfg")[0]
    loudest, peak = rc.strongest_peak(frame, min_range=0.0), rc.strongest_peak(frame)
    assert loudest is not None
    assert loudest.range_index == 0
    assert peak is not None
    assert peak.range == pytest.approx(scene.range, abs=0.02)
    draw(tmp_path / "adc_data.bin", "map", "--config", str(tmp_path / "profile.cfg"))
    assert "static echoes removed" in figures[0].axes[0].get_title()
