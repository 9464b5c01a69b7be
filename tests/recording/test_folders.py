"""Folders of several recordings or sensors: their contents, and the choice of one."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from infineon_folders import FOLDER, folder
from radarcore.cli.main import main
from radarcore.recording.recording import recordings_in
from recordings import CODES, recording, refused


@pytest.fixture
def several(tmp_path: Path) -> Path:
    """A native recording, one of Infineon's tools, one file, bare samples, and what is none."""
    place = tmp_path / "all"
    board = {"name": "Radar Baseboard MCU7", "firmware": "2.6.0", "port": "/dev/ttyACM0"}
    replace(recording(3), source={"sensor": board}).save(place / "b")  # as `Sensor.record` has it
    recording(2).save(place / "c.npz")
    folder(place / "a")
    np.save(place / "d.npy", CODES)
    (place / "notes.txt").write_text("measured on a table")
    (place / "pictures").mkdir()
    return place


def test_recordings_of_a_folder_are_found(several: Path) -> None:
    assert [place.name for place in recordings_in(several)] == ["a", "b", "c.npz", "d.npy"]
    for one in ("a", "b", "c.npz", "pictures", "none"):
        assert recordings_in(several / one) == []


def test_folder_of_recordings_is_refused_with_their_names(several: Path) -> None:
    message = rf"all: expected one recording, got a folder with a, b, c\.npz, d\.npy; give one of these, as {several}/a"
    refused(message, several)
    for index in range(12):
        recording(1).save(several / f"r{index:02}")
    refused("r03 and 8 more; give one of these", several)


def test_info_lists_the_recordings_of_a_folder(several: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(several)]) == 0
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == f"folder {several}"
    assert lines[1] == "a 5 frames of 3 x 4 x 16, 0.386 s, 58 GHz, BGT60TR13C FMCW Radar Sensor, firmware 2.6.0"
    assert lines[2].startswith("b 3 frames of 2 x 4 x 16, 0.05")
    assert lines[2].endswith(" GHz, Radar Baseboard MCU7, firmware 2.6.0")
    assert lines[4].startswith("d.npy expected the radar's settings, got an array (4, 3, 4, 16) of uint16")
    scene = several / "scene.toml"
    scene.write_text('[radar]\npreset = "bgt60tr13c"\nnum_chirps = 4\nnum_samples = 16\n')
    assert main(["info", str(several), "--config", str(scene)]) == 0
    assert "d.npy 4 frames of 3 x 4 x 16, 0.1 s, 60 GHz" in " ".join(capsys.readouterr().out.split())


def test_sensors_of_a_recording_are_listed_and_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder(tmp_path / "rec")
    shutil.copytree(path / FOLDER, path / "RadarIfxAvian_01")
    refused(rf"got {FOLDER}, RadarIfxAvian_01; give one of these, as {path / FOLDER}", path)
    assert len(rc.Recording.load(path / "RadarIfxAvian_01")) == 5
    assert main(["info", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["folder", FOLDER, "RadarIfxAvian_01"]
    assert "5 frames of 3 x 4 x 16" in lines[2]
