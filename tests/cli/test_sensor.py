"""The commands `radarcore sensor`, as typed: boards, recordings, settings and the self-test."""

from __future__ import annotations

import json
import re
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from cyclopts import App

import radarcore as rc
from doubles.boards import CLI, SWING, Numbered, python
from doubles.comlib_boards import ComLibDouble
from radarcore.cli import view
from radarcore.cli.board_settings import NOT_SET, BoardSettings, radar_of, sight
from radarcore.cli.main import main
from radarcore.sensor import open_sensor, virtual_board
from radarcore.sensor.bgt60.settings import Settings
from radarcore.sensor.device import Sensor
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.strata import CdcBoard
from radarcore.sensor.transport import ports
from selftest_boards import Receivers, controller, noise_codes

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a pty")


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
    assert main(["info", port]) == 0
    text = capsys.readouterr().out
    for part in (port, "strata", "BGT60TR13C", "2.6.0", "24.9"):
        assert part in text
    assert main(["info", port, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["chip"] == "BGT60TR13C"


def test_list_without_boards_says_so(capsys, monkeypatch):
    monkeypatch.setattr(ports, "find_ports", lambda **_: [])
    assert main(["sensor", "list"]) == 1
    assert "no radar board answers" in capsys.readouterr().err


def test_list_names_boards_and_what_else_was_asked(port, capsys, monkeypatch):
    found = ports.Port("serial", port, 0x058B, 0x0251, "IFX_CDC", "", "Radar Baseboard MCU7")
    gone = ports.Port("serial", "/dev/none", 0x058B, 0x0251, "IFX_CDC", "", "Radar Baseboard MCU7")
    monkeypatch.setattr(ports, "find_ports", lambda **_: [gone, found])
    assert main(["sensor", "list"]) == 0
    header, board = capsys.readouterr().out.splitlines()
    assert header.split() == ["port", "board", "chip", "firmware", "serial", "number"]
    assert re.match(rf"{port}  Radar Baseboard MCU7 \(MCU A\)  BGT60TR13C  2\.6\.0 +0000", board)
    assert main(["sensor", "list", "--json"]) == 0
    assert [entry["port"] for entry in json.loads(capsys.readouterr().out)] == [port]


def test_record_writes_frames_with_the_settings_asked_for(port, capsys, tmp_path, scene):
    output = tmp_path / "rec"
    arguments = ["--rate", "20", "--chirps", "8", "--samples", "32", "--gain", "24", "--power", "9", "--frames", "7"]
    assert main(["sensor", "record", port, "-o", str(output), *arguments]) == 0
    text = capsys.readouterr().out
    assert "BGT60TR13C, firmware 2.6.0" in text
    assert "frame interval      50 ms asked, 50.0" in text  # the nearest that the chip's timers can do
    assert re.search(r"IF gain +24 dB asked, 23 dB achieved", text)
    assert "7 frames in " in text
    assert "sees 10 m in steps of 62.7 cm, +-4.15 m/s in steps of 1.04 m/s, at 20 Hz" in text
    recording = rc.Recording.load(output)
    assert recording.cube.shape == (7, 3, 8, 32)
    settings = recording.source["infineon"]
    assert (settings["if_gain_dB"], settings["tx_power_level"]) == (23, 9)

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


def check_pictures(folder):
    sizes = [picture.stat().st_size for picture in folder.glob("*.png")]
    assert min(sizes) > 10_000, "not blank"


@pytest.mark.filterwarnings("ignore::radarcore.sensor.FramesLostWarning")  # drawing may be slower than frames come
def test_view_writes_pictures_of_a_port_and_a_scene(port, capsys, tmp_path, scene):
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    for name, source in (("port", port), ("scene", scene)):
        output = tmp_path / name
        assert main(["view", str(source), "-o", str(output), "--frames", "2"]) == 0
        assert str(output) in capsys.readouterr().out
        check_pictures(output)
        assert main(["view", str(source), "-o", str(output), "--frames", "2"]) == 1
        assert "got a picture of an earlier view; --overwrite replaces it" in capsys.readouterr().err


@pytest.mark.filterwarnings("ignore::radarcore.sensor.FramesLostWarning")
def test_view_of_a_port_in_a_file_for_rerun_ends_at_ctrl_c(port, capsys, tmp_path, monkeypatch):
    pytest.importorskip("rerun", reason="needs the extra `rerun`: pip install radarcore[rerun]")
    found = []

    def detected(frame):
        found.append(rc.detect(frame))
        if len(found) == 4:
            raise KeyboardInterrupt
        return found[-1]

    monkeypatch.setattr(view, "detect", detected)
    call = ["view", port, "-o", str(tmp_path / "run.rrd"), "--chirps", "8"]
    assert main([*call, "--frames", "3"]) == 0
    assert f"BGT60TR13C on {port}: 3 frames in {tmp_path / 'run.rrd'}" in capsys.readouterr().out
    assert main([*call, "--overwrite"]) == 0
    assert f": 0 frames in {tmp_path / 'run.rrd'}" in capsys.readouterr().out
    assert main(call) == 1
    assert "--overwrite replaces it" in capsys.readouterr().err


def test_gain_is_refused_where_a_board_has_none(capsys, tmp_path):
    with PtyPort(ComLibDouble()) as port:
        assert main(["sensor", "record", port.path, "-o", str(tmp_path / "rec"), "--frames", "1", "--gain", "33"]) == 1
    expected = "radarcore: --gain: expected an option of BGT60TR24B (rx_mask or tx_power), got 33\n"
    assert capsys.readouterr().err == expected


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


def test_cube_of_a_view_may_be_any(tmp_path):
    """A window follows whatever a recording holds: one chirp, I/Q; and its range may be cut."""
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    waveform = rc.bgt60tr13c().waveform.replace(num_chirps=1)
    cube = np.random.default_rng(0).normal(size=(1, 1, 1, 128)).astype(np.complex64)
    rc.Recording(cube, np.zeros(1), rc.Radar(waveform)).save(tmp_path / "rec")
    assert main(["view", str(tmp_path / "rec"), "-o", str(tmp_path / "out"), "--max-range", "2"]) == 0
    check_pictures(tmp_path / "out")


# --- Settings of a board


def radar(words: str = "") -> rc.Radar:
    """The radar of options, which the chip can be."""
    app = App(result_action="return_value")

    @app.default
    def command(settings: BoardSettings = NOT_SET) -> BoardSettings:
        return settings

    found = radar_of(app(words.split(), exit_on_error=False, print_error=False))
    Settings.from_radar(found)  # refuses what the chip cannot do
    return found


@pytest.mark.parametrize(
    "words", ["", "--samples 64", "--samples 32", "--chirps 16", "--bandwidth 5.4GHz", "--rate 10", "--rx 1"]
)
def test_board_sees_a_room_and_a_person_who_walks_unless_asked_otherwise(words: str) -> None:
    found = radar(words)
    assert found.max_unambiguous_range >= 5.0
    assert found.max_velocity >= 2.5


@pytest.mark.parametrize(
    ("words", "receivers"), [("3", [0, 1, 2]), ("2", [0, 2]), ("1", [0]), ("1,3", [0, 2]), ("3,2", [1, 2]), ("2,", [1])]
)
def test_receivers_are_those_of_a_list_or_as_many_as_a_number(words: str, receivers: list[int]) -> None:
    found = radar(f"--rx {words}")
    np.testing.assert_array_equal(found.rx, rc.bgt60tr13c().rx[receivers])
    assert Settings.from_radar(found).rx_indices == tuple(receivers)


WEIGHTS = "channel_weights = [[1, 0], [0, 1], [0.5, 0]]"


def test_radar_of_a_scene_keeps_its_waveform_phases_and_weights(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(re.sub("^receiver = .*$", "measured_receiver = true\n" + WEIGHTS, SWING, flags=re.MULTILINE))
    scene = rc.load_scene(path).radar
    found = radar(f"--radar {path} --rx 2,3 --rate 10")
    assert found.waveform == scene.waveform.replace(frame_interval=0.1)
    assert found.receiver is not None
    assert found.receiver.rx_phase_deg == (-75.0, 0.0)
    assert found.channel_weights is not None
    assert found.channel_weights.tolist() == [1j, 0.5]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        # 64 samples of 2 MHz that see 20 m: c 64 / (4 * 20 m), less the step of slopes.
        ("--samples 64 --max-range 20 --bandwidth 1GHz", "bandwidth: expected at most 239.1 MHz with max_range = 20 m"),
        ("--max-velocity 100", "max_velocity: expected at most 31.08 m/s with max_range = 10 m at 4 MHz, got 100"),
        ("--rate 1000 --chirps 64", "rate: expected at most 390 Hz with num_chirps = 64 and max_range = 10 m at"),
        ("--samples 5000", "num_samples: expected at most 3266, got 5000"),
        ("--bandwidth 4", "bandwidth: expected a frequency with its unit, as 1.5GHz or 500MHz, got '4'"),
        ("--rx 1,1", "rx: expected some of 1,2,3"),
    ],
)
def test_what_cannot_be_had_is_named_with_what_it_was_asked_beside(words: str, message: str) -> None:
    with pytest.raises(ValueError, match="expected") as caught:
        radar(words)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_requirements_do_not_change_the_waveform_of_a_scene(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SWING)
    with pytest.raises(ValueError, match="max_range: expected none beside --radar"):
        radar(f"--radar {path} --max-range 5")


def test_sight_is_in_numbers_that_people_write() -> None:
    both, neither = radar("--max-range 5 --max-velocity 3 --rate 20"), rc.bgt60tr13c().waveform.replace(slope=0.0)
    assert sight(both) == "sees 5.01 m in steps of 7.82 cm, +-3.01 m/s in steps of 9.41 cm/s, at 20 Hz"
    assert sight(rc.Radar(neither.replace(num_chirps=1))) == "sees neither range nor velocity, at 40 Hz"


# --- The self-test


@pytest.fixture
def tested_port():
    board = controller()
    with PtyPort(CdcBoard(board)) as pty:
        yield pty.path
    board.close()


def test_healthy_board_has_a_line_for_every_check_and_passes(tested_port, capsys):
    only = ["--only", "identity", "--only", "registers", "--only", "noise"]
    assert main(["sensor", "selftest", tested_port, *only]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"PASS  open                   {tested_port} answers strata in ")
    assert [line[:4] for line in lines[1:-1]] == ["PASS"] * 14
    assert "PASS  chip id                0x000303, BGT60TR13C (expected 0x000303, BGT60TR13C, twice)" in lines
    assert "PASS  registers              36 as written, twice (expected all as written, but for reserved bits)" in lines
    assert lines[-1].startswith("15 passed, 0 failed, 0 skipped in ")
    assert main(["sensor", "selftest", tested_port, "--only", "identity", "--json"]) == 0
    results = json.loads(capsys.readouterr().out)
    assert results["board"]["port"] == tested_port
    assert {check["result"] for check in results["checks"]} == {"PASS"}


def test_board_with_a_fault_fails_and_says_how_to_report_it(capsys, tmp_path):
    board = controller(Receivers(leaks=False))
    report = tmp_path / "report.json"
    with PtyPort(CdcBoard(board)) as pty:
        assert main(["sensor", "selftest", pty.path, "--only", "noise"]) == 1
        lines = capsys.readouterr().out.splitlines()
        assert [line.split("  ")[1] for line in lines if line.startswith("FAIL")] == ["leakage, 23 dB, TX on"]
        assert lines[-2].startswith("6 passed, 1 failed, 0 skipped in ")
        assert lines[-1].startswith(f"to report: `radarcore sensor selftest {pty.path} -o report.json`")

        capture = tmp_path / "capture.jsonl"
        more = ["--only", "pattern", "-o", str(report), "--capture", str(capture)]
        assert main(["sensor", "selftest", pty.path, *more]) == 0
        assert f"{report}: attach it to an issue" in capsys.readouterr().out
    board.close()
    results = json.loads(report.read_text())
    assert {"radarcore", "system", "seconds", "board", "checks"} <= results.keys()
    assert results["board"]["chip"] == "BGT60TR13C"
    assert [check["name"] for check in results["checks"]] == ["open", "test pattern"]
    assert results["checks"][1]["values"]["num_words"] == 24576
    assert "usb" in results or "errors" in results, "descriptors, or why there are none"
    # The same again, without the board.
    again = tmp_path / "again.json"
    assert main(["sensor", "selftest", f"capture:{capture}", "--only", "pattern", "-o", str(again)]) == 0
    assert json.loads(again.read_text())["checks"][1] == results["checks"][1]


def test_board_with_comlib_is_tested_as_far_as_its_protocol_goes(capsys):
    with PtyPort(ComLibDouble(noise_codes, clock=time.monotonic)) as pty:
        main(["sensor", "selftest", pty.path, "--duration", "0.4"])  # a busy host may see another rate
    text = capsys.readouterr().out
    assert "SKIP  registers              not in the protocol of this board\n" in text
    assert "PASS  noise                  " in text
    assert re.search(r"  frame rate +\d+\.\d+ Hz by the host's clock", text)


def test_port_without_a_board_fails_and_is_reported(capsys, tmp_path):
    report = tmp_path / "report.json"
    assert main(["sensor", "selftest", "/dev/none", "-o", str(report)]) == 1
    assert "FAIL  open                   /dev/none: there is no such port" in capsys.readouterr().out
    results = json.loads(report.read_text())
    assert (results["board"], results["checks"][0]["result"]) == (None, "FAIL")


def test_interrupted_test_leaves_a_board_that_does_not_measure():
    pytest.importorskip("serial", reason="needs the extra `usb`: pip install radarcore[usb]")
    board = controller(speed=1.0)
    with PtyPort(CdcBoard(board)) as pty, python(CLI, "sensor", "selftest", pty.path, "--only", "noise") as process:
        while not process.stdout.readline().startswith("PASS  noise, 23 dB, TX off"):
            assert process.poll() is None
        time.sleep(0.15)  # the next measurement is under way
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=20)
        assert process.returncode == 130
        assert errors == "radarcore: interrupted\n"
        counted = board.num_sent
        time.sleep(0.1)
        assert board.num_sent == counted
        # The next one may begin at once.
        with open_sensor(pty.path, protocol="strata") as sensor:
            assert [check.result for check in sensor.selftest("pattern")] == ["PASS"]
    board.close()
