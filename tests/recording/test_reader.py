"""Recordings read frame by frame, and bare files of samples."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from dca1000_files import Scene, commands
from infineon_folders import array, folder, some_codes
from radarcore.radar.waveform import Waveform
from recordings import CODES, RADAR, SENSOR, recording, refused


@pytest.mark.parametrize("form", ["directory", "npz", "infineon", "npy", "counts"])
def test_reader_yields_the_frames_of_the_recording(tmp_path: Path, form: str) -> None:
    radar, path = None, tmp_path / "rec"
    if form in ("directory", "npz"):
        path = tmp_path / ("rec.npz" if form == "npz" else "rec")
        recording(40).save(path)
    elif form == "infineon":
        folder(path, radar_npy=array(some_codes(40)))
    else:
        path, radar = tmp_path / "rec.npy", RADAR if form == "npy" else SENSOR
        np.save(path, recording(40).cube if form == "npy" else np.tile(CODES, (10, 1, 1, 1)))
    whole, reader = rc.Recording.load(path, radar=radar), rc.Recording.load(path, radar=radar)
    assert len(reader) == len(whole) == 40
    assert (reader.radar, reader.source) == (whole.radar, whole.source)
    frames = list(reader)
    assert [frame.time for frame in frames] == list(whole.time)
    for frame, expected in zip(frames, whole.frames(), strict=True):
        assert frame.cube.dtype == expected.cube.dtype
        np.testing.assert_array_equal(frame.cube, expected.cube)
        if expected.truth is not None:
            assert frame.truth is not None
            np.testing.assert_array_equal(frame.truth.range, expected.truth.range)
    assert [frame.time for frame in reader] == list(whole.time)  # once more


def test_bare_file_has_the_times_of_its_radar_and_counts_as_numbers(tmp_path: Path) -> None:
    np.save(tmp_path / "codes.npy", CODES)
    loaded = rc.Recording.load(tmp_path / "codes.npy", radar=SENSOR)
    assert loaded.cube.dtype == np.float32
    np.testing.assert_array_equal(loaded.cube, CODES)
    np.testing.assert_allclose(loaded.time, SENSOR.waveform.frame_interval * np.arange(4), rtol=1e-15)
    assert loaded.source == {"file": "codes.npy", "cube_unit": "counts"}
    np.save(tmp_path / "one.npy", recording(1).cube[0])
    one = rc.Recording.load(tmp_path / "one.npy", radar=RADAR)
    assert len(one) == 1
    assert isinstance(one.cube.base, np.memmap) or isinstance(one.cube, np.memmap)


LARGE = """
import resource, sys
import radarcore as rc
recording = rc.Recording.load(sys.argv[1], config=sys.argv[2])
next(iter(recording))
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
total = sum(float(abs(frame.cube).max()) for frame in recording)
print(len(recording), (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024)
"""


def large_codes(folder: Path) -> tuple[Path, Path]:
    """79 MB of codes, 157 MB as float32."""
    wf = Waveform(start_frequency=60e9, slope=1e12, sample_rate=2e6, num_samples=512, num_chirps=64)
    (folder / "radar.json").write_text(json.dumps(rc.Radar(wf, rx=SENSOR.rx).to_dict()))
    codes = np.lib.format.open_memmap(folder / "codes.npy", "w+", np.uint16, (400, 3, 64, 512))
    codes[::100] = 7
    return folder / "codes.npy", folder / "radar.json"


def large_capture(folder: Path) -> tuple[Path, Path]:
    """52 MB of a capture of TI, 105 MB as complex64."""
    (folder / "profile.cfg").write_text(commands(Scene(masks=(1,), num_loops=128)))
    with (folder / "adc_data.bin").open("wb") as file:
        file.truncate(400 * 131072)
    return folder / "adc_data.bin", folder / "profile.cfg"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="ru_maxrss is in kibibytes on Linux alone")
@pytest.mark.parametrize("make", [large_codes, large_capture])
def test_memory_does_not_grow_with_the_length_of_a_recording(tmp_path: Path, make: Any) -> None:
    path, config = make(tmp_path)
    command = [sys.executable, "-c", LARGE, str(path), str(config)]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert int(printed[0]) == 400
    # Pages of the file count where they are mapped; its samples would be twice as much more.
    assert int(printed[1]) < 1.3 * path.stat().st_size


def test_silly_bare_files_are_refused_by_name(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((2, 3)))
    refused(r"a\.npy: expected shape \(n, 2, 4, 16\) .* of the radar, got \(2, 3\)", tmp_path / "a.npy", radar=RADAR)
    refused("radar: expected Radar, got dict", tmp_path / "a.npy", TypeError, radar={})
    np.save(tmp_path / "text.npy", np.full((1, 2, 4, 16), "x"))
    refused(r"text\.npy: expected integers or float32, .*, got <U1", tmp_path / "text.npy", radar=RADAR)


def test_faults_of_a_radars_file_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('[radar]\npreset = "bgt60tr13c"\nnum_chirp = 8\n')
    with pytest.raises(ValueError, match=r"a\.toml: radar: unknown key 'num_chirp'; did you mean 'num_chirps'"):
        rc.load_radar(tmp_path / "a.toml")
    (tmp_path / "b.toml").write_text('[radar]\npreset = "bgt60tr13c"\nnum_chirps = 0\n')
    with pytest.raises(ValueError, match=r"b\.toml: radar\.num_chirps: expected at least 1, got 0"):
        rc.load_radar(tmp_path / "b.toml")
    for text, message in (("[1]", "c.json"), ("{}", "expected the key 'receiver'"), ("nonsense", "line 1")):
        (tmp_path / "c.json").write_text(text)
        with pytest.raises(ValueError, match=message):
            rc.load_radar(tmp_path / "c.json")
    with pytest.raises(ValueError, match=r"expected a scene file \(\.toml\) or the meta\.json .*, got '\.x'"):
        rc.load_radar(tmp_path / "radar.x")
    with pytest.raises(FileNotFoundError):
        rc.load_radar(tmp_path / "none.toml")
