"""Recordings of a sensor: codes of its ADC and counts of lost frames, in memory and on disk."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from radarcore.recording.native import RecordingWriter
from radarcore.recording.recording import Recording
from recordings import CODES, CUBE, FRAME_TIMES, RADAR, SENSOR, recording, sensor_frame


@pytest.mark.parametrize("where", ["rec", "rec.npz"])
def test_frames_of_a_sensor_are_in_full_scale_on_disk_too(tmp_path: Path, where: str) -> None:
    if where == "rec":
        with RecordingWriter(tmp_path / where, SENSOR, source={"port": "usb:1-2"}) as writer:
            for index in range(4):
                writer.append(sensor_frame(index))
        assert json.loads((tmp_path / "rec/meta.json").read_text())["units"]["cube"] == "full scale"
    else:
        Recording.from_frames(map(sensor_frame, range(4)), {"port": "usb:1-2"}).save(tmp_path / where)
    rec = Recording.load(tmp_path / where)
    assert rec.source == {"port": "usb:1-2", "cube_unit": "full scale"}
    assert rec.time.tolist() == FRAME_TIMES
    np.testing.assert_array_equal(rec.raw, CODES)
    for index, one in enumerate(rec.frames()):
        np.testing.assert_array_equal(one.raw, CODES[index])


def test_samples_in_watts_have_no_codes() -> None:
    assert recording(dtype="float32").raw is None
    assert recording(dtype="float32")[0].raw is None
    unit = {"cube_unit": "full scale"}
    assert Recording(CUBE[None], np.zeros(1), RADAR, source=unit).raw is None  # I/Q
    assert Recording(np.zeros((1, 2, 4, 16)), np.zeros(1), RADAR, source=unit).raw is not None


# Lost frames.


@pytest.mark.parametrize("where", ["rec", "rec.npz", "written", "late"])
def test_lost_frames_are_counted_on_disk(tmp_path: Path, where: str) -> None:
    lost = [0, 0, 5, 1]
    frames = [sensor_frame(i, lost_before=n) for i, n in enumerate(lost)]
    if where == "late":  # a sensor that says so only where frames were lost
        frames[:2] = [sensor_frame(0), sensor_frame(1)]
    if where in ("written", "late"):
        with RecordingWriter(tmp_path / where, SENSOR) as writer:
            for one in frames:
                writer.append(one)
    else:
        Recording.from_frames(frames).save(tmp_path / where)
    rec = Recording.load(tmp_path / where)
    assert rec.lost is not None
    assert rec.lost.dtype == np.int32
    assert rec.lost.tolist() == lost
    assert [one.stats["lost_before"] for one in rec.frames()] == lost
    assert Recording.from_frames(rec.frames()).lost.tolist() == lost  # type: ignore[union-attr]


def test_where_nobody_counted_lost_frames_there_is_no_file(tmp_path: Path) -> None:
    rec = Recording.from_frames([sensor_frame(0, lost_before=2)])
    rec.save(tmp_path / "rec")
    assert (tmp_path / "rec/lost.npy").is_file()
    recording().save(tmp_path / "rec", overwrite=True)
    assert not (tmp_path / "rec/lost.npy").exists()
    loaded = Recording.load(tmp_path / "rec")
    assert loaded.lost is None
    assert "lost_before" not in loaded[0].stats
