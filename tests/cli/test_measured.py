"""`radarcore info` of what a board measured: how, with what, and when."""

from __future__ import annotations

import json
import os
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from boards import Numbered
from radarcore.cli.main import main
from radarcore.cli.measured import measured_facts
from radarcore.sensor import virtual_board
from radarcore.sensor.emulator.pty import PtyPort


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five frames of an emulated board, of its first and third receiver at 40 dB."""
    pytest.importorskip("serial", reason="needs the extra `usb`: pip install radarcore[usb]")
    path = tmp_path_factory.mktemp("recorded") / "recording"
    with virtual_board(Numbered(), speed=4.0) as board, PtyPort(board) as port:
        settings = ["--rx", "1,3", "--gain", "40", "--power", "9", "--chirps", "4", "--samples", "32"]
        assert main(["sensor", "record", port.path, "-o", str(path), "--frames", "5", *settings]) == 0
    return path


def facts(path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["info", str(path), "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_recording_and_its_copy_in_the_layout_of_infineon_tell_how_they_were_measured(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rc.Recording.load(recorded).save(tmp_path / "folder", format="infineon")
    native, folder = facts(recorded, capsys), facts(tmp_path / "folder", capsys)
    for found in (native, folder):
        assert found["RX antennas"] == [1, 3]
        assert found["IF gain [dB]"] == 40
        assert found["transmit power level"] == 9
        assert "BGT60TR13C" in found["sensor"] or "Baseboard" in found["sensor"]
        assert "firmware 2.6.0" in found["sensor"]
        age = datetime.now().astimezone() - datetime.fromisoformat(found["date"])
        assert timedelta(0) <= age < timedelta(minutes=5)
    assert native["lost frames"] == 0
    assert folder["lost frames"] == "not counted", "such a folder does not hold it"


def test_lost_frames_are_added_up(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    some = rc.Recording.load(recorded)
    rc.Recording(some.cube, some.time, some.radar, source=some.source, lost=np.array([0, 2, 0, 1, 0])).save(
        tmp_path / "recording"
    )
    assert facts(tmp_path / "recording", capsys)["lost frames"] == 3


def test_text_is_in_units_that_people_write(recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["info", str(recorded)]) == 0
    lines = dict(line.split("  ", 1) for line in capsys.readouterr().out.splitlines())
    shown = {name: text.strip() for name, text in lines.items()}
    assert shown["IF gain"] == "40 dB"
    assert shown["RX antennas"] == "1, 3"
    assert shown["sample rate"] == "2 MHz"
    assert shown["start frequency"] == "60 GHz"
    assert shown["slope"].endswith("MHz/us")
    assert shown["high-pass"] == "80 kHz"


def test_folder_of_a_real_sensor_tells_how_it_was_measured(capsys: pytest.CaptureFixture[str]) -> None:
    beside = Path(__file__).resolve().parents[3] / "shared" / "recordings"
    path = Path(os.environ.get("RADARCORE_RECORDINGS", beside)) / "bgt60tr13c-8chirp"
    if not path.exists():
        pytest.skip(f"no recording of a real sensor at {path} (see CONTRIBUTING.md: RADARCORE_RECORDINGS)")
    found = facts(path, capsys)
    assert found["sensor"] == "BGT60TR13C FMCW Radar Sensor, firmware 2.6.0"
    assert found["date"] == "2026-01-06T15:16:15+0800"
    assert (found["IF gain [dB]"], found["RX antennas"], found["transmit power level"]) == (23, [1, 2, 3], 31)
    assert (found["high-pass [Hz]"], found["low-pass [Hz]"]) == (80e3, 500e3)


@pytest.mark.parametrize(
    "source",
    [
        {},
        {"infineon": None},
        {"infineon": {"texts": None}},
        {"infineon": {"texts": {"RadarIfxAvian_00/config.json": "{", "meta.json": "[]", "note.txt": "mine"}}},
        {"infineon": {"texts": {"RadarIfxAvian_00/config.json": '{"device_config": 3}'}}},
    ],
)
def test_sources_that_tell_nothing_have_no_facts(source: dict[str, Any]) -> None:
    assert measured_facts(source) == {}
