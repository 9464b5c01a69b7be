"""The commands simulate, info and schema: their files and output."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from dca1000_files import Scene, commands
from doubles.boards import Numbered
from radarcore.cli.main import main
from radarcore.sensor import virtual_board
from radarcore.sensor.emulator.pty import PtyPort
from recordings import CODES, assert_same
from scene_files import APPROACHING


def facts(capsys: pytest.CaptureFixture[str], *words: str | Path) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["info", *map(str, words), "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


# --- simulate


def test_simulate_writes_the_recording_and_is_quiet_when_not_in_a_terminal(
    scene: Path, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", str(scene), "-o", str(tmp_path / "new" / "recording"), "--threads", "1"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    (line,) = printed.out.splitlines()
    assert "3 frames of 3 x 8 x 128 samples" in line
    written = rc.Recording.load(tmp_path / "new" / "recording")
    assert np.array_equal(written.cube, rc.Recording.load(recording).cube)


CHANGED = """
[radar]
preset = "bgt60tr13c"
num_chirps = {chirps}
num_samples = 64

[[point]]
name = "ball"
position = [{distance}, 0.0, 0.0]
rcs = 0.1

[[point]]
position = [3.0, 0.0, 0.0]
{motion}

[run]
stop = {stop}
seed = {seed}
"""


def test_set_and_seed_simulate_what_an_edited_file_does(tmp_path: Path) -> None:
    before = {"chirps": 4, "distance": 2.0, "stop": 0.05, "seed": 0, "motion": ""}
    after = {"chirps": 8, "distance": 2.5, "stop": 0.1, "seed": 7, "motion": "velocity = [0.5, 0.0, 0.0]"}
    (tmp_path / "given.toml").write_text(CHANGED.format(**before))
    (tmp_path / "edited.toml").write_text(CHANGED.format(**after))
    changes = ["radar.num_chirps=8", "point.ball.position.0=2.5", "point.1.velocity=[0.5,0,0]", "run.stop = 0.1"]
    words = [word for text in changes for word in ("--set", text)]
    assert main(["simulate", str(tmp_path / "given.toml"), *words, "--seed", "7"]) == 0
    found = rc.Recording.load(tmp_path / "given")  # the default name
    expected = rc.load_scene(tmp_path / "edited.toml").record(progress=False)
    assert_same(found, rc.Recording(expected.cube, expected.time, expected.radar, expected.truth, found.source))
    assert {**found.source, "set": None} == {**expected.source, "set": None}
    assert found.source["set"] == [*changes, "run.seed=7"]
    other = rc.load_scene(tmp_path / "given.toml").record(progress=False)
    assert other.cube.shape != found.cube.shape


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("run.stpo=1", "scene.toml: run: unknown key 'stpo'; did you mean 'stop'?"),
        ("rnu.stop=1", "scene.toml: unknown key 'rnu'; did you mean 'run'?"),
        ("body.bal.mesh=1", "--set: expected an entry in 'body.bal.mesh=1', got 'bal'; did you mean 'ball'?"),
        ("body.3.mesh=1", "--set: expected an entry in 'body.3.mesh=1', got '3'; known: 0, ball"),
        ("radar.preset.name=1", "--set: expected a table before 'name' in 'radar.preset.name=1', got 'bgt60tr13c'"),
        ("radar.preset=bgt60tr13c", "--set: expected KEY=VALUE in TOML, got 'radar.preset=bgt60tr13c', Invalid value"),
        ("run.stop", "--set: expected KEY=VALUE in TOML, got 'run.stop', Invalid value"),
        ("run.stop='far'", "scene.toml: run: stop: expected a number [s], got 'far'"),
    ],
)
def test_set_names_what_is_wrong_and_what_was_meant(
    text: str, message: str, scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", str(scene), "--set", text]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert [place.name for place in scene.parent.iterdir()] == ["scene.toml"]


def test_simulate_prints_json_and_replaces_a_recording_only_when_told_to(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["simulate", str(scene), "-o", str(tmp_path / "recording"), "--json"]
    assert main(arguments) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["frames"], summary["cube_shape"]) == (3, [3, 3, 8, 128])
    assert summary["real_time_factor"] == pytest.approx(0.3 / summary["seconds"])
    before = (tmp_path / "recording" / "cube.npy").stat().st_mtime_ns
    assert main(arguments) == 1
    assert (tmp_path / "recording" / "cube.npy").stat().st_mtime_ns == before
    assert main([*arguments, "--overwrite"]) == 0


def test_a_fault_of_a_scene_is_one_line_and_nothing_is_written(
    tmp_path: Path, scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene.write_text(APPROACHING.replace("radius =", "raduis ="))
    assert main(["simulate", str(scene), "-o", str(tmp_path / "new" / "recording")]) == 1
    expected = "body[0] 'ball': shape: unknown key 'raduis'; did you mean 'radius'?"
    assert capsys.readouterr() == ("", f"radarcore: {scene}: {expected}\n")
    assert list(tmp_path.iterdir()) == [scene]


@pytest.mark.parametrize(
    ("number", "status", "message"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "ended by SIGTERM")]
)
def test_simulation_that_is_told_to_end_leaves_a_readable_recording(
    tmp_path: Path, scene: Path, number: signal.Signals, status: int, message: str
) -> None:
    scene.write_text(APPROACHING.replace("stop = 0.3", "stop = 1000.0").replace("-0.5, 0.0", "0.0, 0.0"))
    output = tmp_path / "recording"
    # A background job of a shell ignores interrupts by default.
    program = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from radarcore.cli.main import main; sys.exit(main())"
    )
    command = [sys.executable, "-c", program, "simulate", str(scene), "-o", str(output)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    row = 3 * 8 * 128 * 4  # bytes of a frame
    deadline = time.monotonic() + 60.0
    while not ((cube := output / "cube.npy").exists() and cube.stat().st_size > 3 * row):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(process.pid, number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == status
    assert errors == f"radarcore: {message}\n"
    with pytest.warns(UserWarning, match="of 10000 planned frames"):
        recording = rc.Recording.load(output)
    assert len(recording) >= 2
    assert recording.cube.any(axis=(1, 2, 3)).all()


# --- info, schema


def test_info_of_a_scene_and_of_its_recording_agree_on_the_radar(
    scene: Path, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    of_scene, of_recording = facts(capsys, scene), facts(capsys, recording)
    assert of_scene["bodies"] == of_recording["bodies"] == ["ball"]
    assert of_scene["frames"] == of_recording["frames"] == 3
    assert of_recording["cube [frame, channel, chirp, sample]"] == [3, 3, 8, 128]
    waveform = rc.load_scene(scene).radar.waveform
    for one in (of_scene, of_recording):
        assert one["range bin [m]"] == waveform.range_resolution
        assert one["samples"] == "real"
        assert one["antenna pattern"] == "Gaussian, 3.5 dBi, 65 x 40 degrees"
    for source in (scene, recording):  # one fact per line, in units that people write
        assert main(["info", str(source)]) == 0
        printed = capsys.readouterr()
        assert printed.err == ""
        lines = dict(line.split("  ", 1) for line in printed.out.splitlines())
        assert lines["bodies"].strip() == "ball"
        assert lines["sample rate"].strip() == "2 MHz"
        assert lines["slope"].endswith("14.9004 MHz/us")


def test_info_of_a_scene_that_varies_lists_what_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(
        """
radar.preset = "bgt60tr13c"
[[body]]
shape = { kind = "box", size = [0.2, 0.2, 0.2] }
material = { choice = ["metal", "wood"] }
repeat = 2
pose = { position = [{ uniform = [1.5, 2.5] }, 0.0, 0.0] }
"""
    )
    found = facts(capsys, scene)
    assert found["bodies"] == ["body 0 0", "body 0 1"]
    assert found["varies"]["body.body 0 1.material"] == "choice metal, wood"
    assert found["varies"]["body.body 0 0.pose.position[0]"] == "uniform 1.5, 2.5 [m]"
    assert main(["info", str(scene)]) == 0
    assert " body.body 0 0.material " in capsys.readouterr().out
    # Where a sample is needed, all lines say so.
    scene.write_text(scene.read_text().replace("repeat = 2\n", ""))
    assert main(["simulate", str(scene), "-o", str(tmp_path / "rec")]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert all(line.endswith("got a distribution, which radarcore.dataset.Variation draws from") for line in lines)


def test_info_of_a_damaged_dataset_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "zarr.json").write_text('{"attributes": {"format": "radarcore dataset", "version": 2}}')
    assert main(["info", str(tmp_path)]) == 1
    assert "expected a dataset, got a damaged one" in capsys.readouterr().err


def test_schema_is_text_or_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert "body[].shape.radius" in capsys.readouterr().out
    assert main(["schema", "--json"]) == 0
    assert {"radar", "sensor", "run", "body", "human", "arm"} <= set(json.loads(capsys.readouterr().out)["properties"])


def test_bare_samples_are_described_by_options(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from scipy.io import savemat

    scene.write_text('[radar]\npreset = "bgt60tr13c"\nnum_chirps = 4\nnum_samples = 16\n')
    turned = CODES.transpose(2, 1, 3, 0)
    np.save(tmp_path / "a.npy", turned)
    turned.tofile(tmp_path / "a.bin")
    savemat(tmp_path / "a.mat", {"adc": turned, "other": turned})
    np.savez(tmp_path / "a.npz", adc=turned.astype(float), other=turned.astype(float))
    for name, more in (
        ("a.npy", []),
        ("a.bin", ["--dtype", "uint16"]),
        ("a.mat", ["--variable", "adc"]),
        ("a.npz", ["--variable", "adc"]),
    ):
        # The number of frames of raw numbers is known by the length of the file alone.
        found = facts(capsys, tmp_path / name, "--config", str(scene), "--shape", "chirp,rx,sample,frame", *more)
        assert found["cube [frame, channel, chirp, sample]"] == [4, 3, 4, 16]
        assert found["source"]["file"] == name
    assert main(["info", str(tmp_path / "a.npz"), "--config", str(scene)]) == 1
    assert "--variable NAME" in capsys.readouterr().err


def test_info_of_a_capture_has_its_radar(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    taken = Scene(num_frames=4)
    taken.numbers("lanes2", q_first=True).tofile(tmp_path / "adc_data.bin")
    (tmp_path / "profile.cfg").write_text(commands(taken))
    found = facts(capsys, tmp_path / "adc_data.bin", "--config", tmp_path / "profile.cfg")
    assert found["cube [frame, channel, chirp, sample]"] == [4, 8, 16, 64]
    assert (found["dtype"], found["transmitters"], found["schedule"]) == ("complex64", 2, "tdm")
    assert found["source"]["capture"]["antennas"] == "xWR1843BOOST"


# --- info of measurements


def test_recording_of_a_board_and_its_copy_in_the_layout_of_infineon_tell_how_they_were_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("serial", reason="needs the extra `usb`: pip install radarcore[usb]")
    path = tmp_path / "recording"
    with virtual_board(Numbered(), speed=4.0) as board, PtyPort(board) as port:
        settings = ["--rx", "1,3", "--gain", "40", "--power", "9", "--chirps", "4", "--samples", "32"]
        assert main(["sensor", "record", port.path, "-o", str(path), "--frames", "5", *settings]) == 0
    taken = rc.Recording.load(path)
    taken.save(tmp_path / "folder", format="infineon")
    native, folder = facts(capsys, path), facts(capsys, tmp_path / "folder")
    for found in (native, folder):
        assert found["RX antennas"] == [1, 3]
        assert found["IF gain [dB]"] == 40
        assert found["transmit power level"] == 9
        assert "firmware 2.6.0" in found["sensor"]
        age = datetime.now().astimezone() - datetime.fromisoformat(found["date"])
        assert timedelta(0) <= age < timedelta(minutes=5)
    assert native["lost frames"] == 0
    assert folder["lost frames"] == "not counted", "such a folder does not hold it"
    lost = np.array([0, 2, 0, 1, 0])
    rc.Recording(taken.cube, taken.time, taken.radar, source=taken.source, lost=lost).save(tmp_path / "some")
    assert facts(capsys, tmp_path / "some")["lost frames"] == 3
