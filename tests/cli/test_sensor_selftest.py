"""`radarcore sensor selftest`, as typed."""

import json
import re
import signal
import sys
import time

import pytest

from boards import CLI, python
from radarcore.cli.main import main
from radarcore.sensor import open_sensor
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.strata import CdcBoard
from selftest_boards import Receivers, controller

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a pty")


@pytest.fixture
def port():
    board = controller()
    with PtyPort(CdcBoard(board)) as pty:
        yield pty.path
    board.close()


def test_healthy_board_has_a_line_for_every_check_and_passes(port, capsys):
    assert main(["sensor", "selftest", port, "--only", "identity", "--only", "registers", "--only", "noise"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"PASS  open                   {port} answers strata in ")
    assert [line[:4] for line in lines[1:-1]] == ["PASS"] * 14
    assert "PASS  chip id                0x000303, BGT60TR13C (expected 0x000303, BGT60TR13C, twice)" in lines
    assert "PASS  registers              36 as written, twice (expected all as written, but for reserved bits)" in lines
    assert lines[-1].startswith("15 passed, 0 failed, 0 skipped in ")


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


def test_results_as_json_are_nothing_else(port, capsys):
    assert main(["sensor", "selftest", port, "--only", "identity", "--json"]) == 0
    results = json.loads(capsys.readouterr().out)
    assert results["board"]["port"] == port
    assert {check["result"] for check in results["checks"]} == {"PASS"}
    assert results["checks"][0].keys() == {"name", "result", "measured", "expected", "values"}


def test_board_with_comlib_is_tested_as_far_as_its_protocol_goes(capsys):
    with PtyPort(ComLibEmulator(Receivers(), speed=1.0)) as pty:
        main(["sensor", "selftest", pty.path, "--duration", "0.4"])  # a busy host may see another rate
    text = capsys.readouterr().out
    assert "SKIP  registers              the protocol does not show them\n" in text
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
