"""`radarcore sensor`, as typed."""

import json
import re
import sys

import numpy as np
import pytest

import radarcore as rc
from boards import SWING, Numbered
from radarcore.__main__ import run
from radarcore.cli.main import main
from radarcore.sensor import transport, virtual_board
from radarcore.sensor.device import Sensor
from radarcore.sensor.emulator.pty import PtyPort


@pytest.fixture
def port():
    with virtual_board(Numbered(), speed=4.0) as board, PtyPort(board) as pty:
        yield pty.path


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "swing.toml"
    narrow = SWING.replace('"bgt60tr13c"', '"bgt60tr13c"\nstop_frequency = 59e9')
    path.write_text(
        narrow.replace("stop = 60.0", "stop = 0.2").replace("resolution = 48", "rate = 20.0\nresolution = 16")
    )
    return path


def test_info_says_what_the_board_is(port, capsys):
    assert main(["sensor", "info", port]) == 0
    text = capsys.readouterr().out
    for part in (port, "strata", "BGT60TR13C", "2.6.0", "24.9"):
        assert part in text
    assert main(["sensor", "info", port, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["chip"] == "BGT60TR13C"


def test_list_without_boards_says_so(capsys, monkeypatch):
    monkeypatch.setattr(transport, "find_ports", lambda **_: [])
    assert main(["sensor", "list"]) == 1
    assert "no radar board answers" in capsys.readouterr().err


def test_list_names_boards_and_what_else_was_asked(port, capsys, monkeypatch):
    found = transport.Port("serial", port, 0x058B, 0x0251, "IFX_CDC", "", "Radar Baseboard MCU7")
    gone = transport.Port("serial", "/dev/none", 0x058B, 0x0251, "IFX_CDC", "", "Radar Baseboard MCU7")
    monkeypatch.setattr(transport, "find_ports", lambda **_: [gone, found])
    assert main(["sensor", "list"]) == 0
    assert capsys.readouterr().out.startswith(f"{port}: Radar Baseboard MCU7 (MCU A), BGT60TR13C, firmware 2.6.0")
    assert main(["sensor", "list", "--json"]) == 0
    assert [entry["port"] for entry in json.loads(capsys.readouterr().out)] == [port]


def test_record_writes_frames_with_the_settings_asked_for(port, capsys, tmp_path, scene):
    output = tmp_path / "rec"
    arguments = ["--rate", "20", "--chirps", "8", "--samples", "32", "--gain", "40", "--power", "9", "--frames", "7"]
    assert main(["sensor", "record", port, "-o", str(output), *arguments]) == 0
    text = capsys.readouterr().out
    assert "BGT60TR13C, firmware 2.6.0" in text
    assert "frame interval      50 ms asked, 50.0" in text  # the nearest that the chip's timers can do
    assert "7 frames in " in text
    assert "sees 10 m in steps of 62.7 cm, +-4.15 m/s in steps of 1.04 m/s, at 20 Hz" in text
    recording = rc.Recording.load(output)
    assert recording.cube.shape == (7, 3, 8, 32)
    settings = recording.source["infineon"]
    assert (settings["if_gain_dB"], settings["tx_power_level"]) == (40, 9)

    # Not twice, unless wanted; the radar of a scene file.
    assert main(["sensor", "record", port, "-o", str(output), "--frames", "2"]) == 1
    assert "--overwrite" in capsys.readouterr().err
    again = ["--frames", "2", "--overwrite", "--radar", str(scene), "--chirps", "4"]
    assert main(["sensor", "record", port, "-o", str(output), *again]) == 0
    assert rc.Recording.load(output).cube.shape == (2, 3, 4, 128)
    # Of a recording as well, and of its description.
    for radar in (output, output / "meta.json"):
        same = ["-o", str(tmp_path / "same"), "--overwrite", "--frames", "1", "--radar", str(radar)]
        assert main(["sensor", "record", port, *same]) == 0
        assert rc.Recording.load(tmp_path / "same").cube.shape == (1, 3, 4, 128)


@pytest.mark.filterwarnings("ignore::radarcore.sensor.FramesLostWarning")  # drawing may be slower than frames come
def test_view_writes_pictures_of_a_port_and_a_scene(port, capsys, tmp_path, scene):
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    for name, source in (("port", port), ("scene", scene)):
        output = tmp_path / name
        assert main(["sensor", "view", str(source), "-o", str(output), "--frames", "4"]) == 0
        assert str(output) in capsys.readouterr().out
        pictures = list(output.glob("*.png"))
        assert pictures
        assert all(picture.stat().st_size > 10_000 for picture in pictures), "not blank"


def test_report_is_json(capsys, tmp_path):
    pytest.importorskip("usb", reason="needs the extra `usb`: pip install radarcore[usb]")
    assert main(["sensor", "report"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert {"radarcore", "system", "ports", "usb"} <= report.keys()
    path = tmp_path / "report.json"
    assert main(["sensor", "report", "-o", str(path)]) == 0
    assert json.loads(path.read_text())["radarcore"] == rc.__version__
    assert str(path) in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["info", "/dev/none"], "/dev/none"),
        (["record", "/dev/none", "-o", "rec"], "/dev/none"),
        (["record", "PORT", "-o", "rec", "--rate", "0"], "--rate: expected a positive number"),
        (
            ["record", "PORT", "-o", "rec", "--rate", "1000", "--chirps", "64"],
            "--rate: expected at most 390 Hz beside --chirps 64, got 1 kHz",
        ),
        (["record", "PORT", "-o", "rec", "--gain", "70"], "--gain: expected 18 dB to 60 dB, got 70 dB"),
        (["view", "PORT", "-o", "pictures", "--power", "32"], "--power: expected"),
        (["record", "/dev/none", "-o", "rec", "--duration", "-1"], "--duration: expected a positive number"),
        (["record", "/dev/none", "-o", "rec", "--frames", "0"], "--frames: expected at least 1, got 0"),
        (["record", "/dev/none", "-o", "rec", "--rx", "4"], "--rx: expected some of 1,2,3"),
        (["record", "/dev/none", "-o", "rec.npz"], "expected a directory (no suffix)"),
        (["record", "PORT", "-o", "rec", "--radar", "none.toml"], "none.toml"),
        (["view", "/dev/none", "-o", "pictures", "--frames", "-3"], "--frames: expected at least 1, got -3"),
        (["view", "/dev/none", "-o", "pictures", "--every", "0"], "--every: expected a positive number"),
        (["view", "none.toml"], "none.toml"),
        (["view", "COMPLETE"], "no such recording, scene file or port"),
        (["view", "no/such/recording"], "no such recording, scene file or port"),
        (["serve", "none.toml"], "none.toml"),
        (["serve", "no/such/recording"], "no/such/recording"),
    ],
)
def test_wrong_words_are_one_line(port, arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["sensor", *(port if word == "PORT" else word for word in arguments)]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert message in lines[0]
    assert not (tmp_path / "rec").exists() or not any((tmp_path / "rec").iterdir())


def test_gain_is_refused_where_a_board_has_none(capsys, tmp_path):
    with virtual_board(Numbered(), protocol="comlib", speed=None) as board, PtyPort(board) as port:
        assert main(["sensor", "record", port.path, "-o", str(tmp_path / "rec"), "--frames", "1", "--gain", "33"]) == 1
    expected = "radarcore: --gain: expected an option of BGT60TR24B (rx_mask or tx_power), got 33\n"
    assert capsys.readouterr().err == expected


def test_nearest_gain_is_told(port, capsys, tmp_path):
    record = ["sensor", "record", port, "-o", str(tmp_path / "rec"), "--frames", "1", "--chirps", "1", "--gain", "24"]
    assert main(record) == 0
    assert re.search(r"IF gain +24 dB asked, 23 dB achieved", capsys.readouterr().out)


def test_interrupt_before_the_first_frame_is_one_and_leaves_an_old_recording(port, capsys, tmp_path, monkeypatch):
    rc.Recording(np.zeros((1, 3, 64, 128), "f4"), np.zeros(1), rc.bgt60tr13c()).save(tmp_path / "rec")

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(Sensor, "record", interrupted)
    for name, options in (("new", []), ("rec", ["--overwrite"])):
        assert main(["sensor", "record", port, "-o", str(tmp_path / name), *options]) == 130
        told = capsys.readouterr()
        assert "interrupted" in told.err
        assert " frames in " not in told.out
    assert len(rc.Recording.load(tmp_path / "rec")) == 1


def test_interrupt_while_the_program_is_read_is_a_line(capsys, monkeypatch):
    class Interrupted:
        def __getattr__(self, _):
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "radarcore.cli.main", Interrupted())
    assert run() == 130
    assert capsys.readouterr().err == "radarcore: interrupted\n"


def test_recording_that_is_there_is_told_before_a_board_is_looked_for(capsys, tmp_path):
    recording = rc.Recording(np.zeros((1, 3, 64, 128), "f4"), np.zeros(1), rc.bgt60tr13c())
    recording.save(tmp_path / "rec")
    assert main(["sensor", "record", "/dev/none", "-o", str(tmp_path / "rec"), "--frames", "1"]) == 1
    assert "got a recording; --overwrite replaces it" in capsys.readouterr().err
    assert len(rc.Recording.load(tmp_path / "rec")) == 1


def test_settings_of_a_board_are_refused_beside_a_recording(capsys, tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    wf = rc.bgt60tr13c().waveform.replace(num_chirps=2)
    rc.Recording(np.zeros((2, 1, 2, 128), "f4"), np.arange(2.0), rc.Radar(wf)).save(tmp_path / "rec")
    view = ["sensor", "view", str(tmp_path / "rec"), "-o", str(tmp_path / "out")]
    assert main([*view, "--max-velocity", "2"]) == 1
    assert "--max-velocity: expected a board, which it sets, got " in capsys.readouterr().err


def test_serving_a_simulated_recording_names_what_is_missing(capsys, tmp_path, scene):
    assert main(["simulate", str(scene), "-o", str(tmp_path / "rec")]) == 0
    assert main(["sensor", "serve", str(tmp_path / "rec")]) == 1
    assert "expected at least one frame with codes of an ADC" in capsys.readouterr().err


def test_cube_of_a_view_may_be_any(tmp_path):
    """A window follows whatever a recording holds: one chirp, I/Q; and its range may be cut."""
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    waveform = rc.bgt60tr13c().waveform.replace(num_chirps=1)
    cube = np.random.default_rng(0).normal(size=(3, 1, 1, 128)).astype(np.complex64)
    rc.Recording(cube, np.arange(3.0), rc.Radar(waveform)).save(tmp_path / "rec")
    assert main(["sensor", "view", str(tmp_path / "rec"), "-o", str(tmp_path / "out"), "--max-range", "2"]) == 0
    pictures = list((tmp_path / "out").glob("*.png"))
    assert pictures
    assert all(picture.stat().st_size > 10_000 for picture in pictures), "not blank"
