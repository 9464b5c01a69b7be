"""Frames and recordings, in memory and saved as a whole."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.native import RecordingWriter
from radarcore.recording.recording import Recording
from recordings import CUBE, FILES, RADAR, assert_same, frame, recording


def test_recording_gives_its_frames_back() -> None:
    rec = recording()
    assert len(rec) == 3
    for index, one in enumerate(rec.frames()):
        np.testing.assert_array_equal(one.cube, frame(index).cube)
        assert one.truth is not None
        np.testing.assert_array_equal(one.truth.range, frame(index).truth.range)  # type: ignore[union-attr]
    assert rec[-1].time == rec[2].time == 0.05
    assert np.shares_memory(rec[1].cube, rec.cube)
    assert [one.time for one in rec] == [0.0, 0.025, 0.05]
    assert isinstance(rec, Iterable)
    with pytest.raises(IndexError, match="3 frames, got 3"):
        rec[3]
    with pytest.raises(TypeError, match="frame_index: expected an integer"):
        rec["first"]  # type: ignore[index]


def test_slice_is_the_recording_of_its_frames() -> None:
    rec = replace(recording(5), lost=np.array([0, 2, 0, 1, 0]))
    some = rec[1:4]
    assert_same(some, Recording.from_frames(list(rec.frames())[1:4], rec.source))
    assert np.shares_memory(some.cube, rec.cube)
    assert len(rec[:0]) == 0
    assert len(rec[-2:]) == 2
    with pytest.raises(ValueError, match="frames that follow each other, got step 2"):
        rec[::2]


def test_arrays_of_a_frame_and_a_recording_are_their_samples() -> None:
    for one in (recording(), frame(0)):
        samples = np.asarray(one)
        assert np.shares_memory(samples, one.cube)
        assert samples.shape == one.cube.shape
        assert np.asarray(one, dtype=np.complex128).dtype == np.complex128
        assert not np.shares_memory(np.array(one), one.cube)
    assert np.array_equal(recording(), recording())  # == tells whether it is the same object
    assert recording() != recording()


@pytest.mark.parametrize("where", ["deep/down/rec", "rec.npz"])
@pytest.mark.parametrize("dtype", ["complex64", "complex128", "float32", "float64"])
@pytest.mark.parametrize("names", [None, ("arm", "wall"), ()])
def test_what_is_saved_is_loaded_bit_for_bit(tmp_path: Path, where: str, dtype: str, names: Any) -> None:
    rec = recording(dtype=dtype, names=names)
    rec.save(tmp_path / where)
    assert_same(Recording.load(tmp_path / where), rec)
    assert_same(Recording.load(str(tmp_path / where), mmap=False), rec)
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.parametrize("where", ["rec", "rec.npz"])
def test_recording_without_frames_is_a_recording_and_says_so(tmp_path: Path, where: str) -> None:
    truth = Truth(("arm",), *np.zeros((4, 0, 1)))
    rec = Recording(np.zeros((0, 2, 4, 16), np.float32), np.zeros(0), RADAR, truth)
    rec.save(tmp_path / where)
    with pytest.warns(UserWarning, match=f"{where}: a recording without frames$") as caught:
        loaded = Recording.load(tmp_path / where)
    assert_same(loaded, rec)
    assert [warning.filename for warning in caught] == [__file__]


def test_nan_of_a_body_out_of_sight_survives(tmp_path: Path) -> None:
    nan = [np.nan]
    one = Frame(frame(0).cube, 0.0, RADAR, Truth(("arm",), nan, nan, nan, nan))  # type: ignore[arg-type]
    Recording.from_frames([one]).save(tmp_path / "rec")
    loaded = Recording.load(tmp_path / "rec").truth
    assert loaded is not None
    assert np.isnan(loaded.range).all()


def test_directory_is_plain_npy_and_json(tmp_path: Path) -> None:
    rec = recording()
    rec.save(tmp_path / "rec")
    assert sorted(path.name for path in (tmp_path / "rec").iterdir()) == sorted([*FILES, "meta.json"])
    np.testing.assert_array_equal(np.load(tmp_path / "rec/cube.npy", mmap_mode="r"), rec.cube)
    np.testing.assert_array_equal(np.load(tmp_path / "rec/time.npy"), rec.time)
    meta = json.loads((tmp_path / "rec/meta.json").read_text())
    assert (meta["format"], meta["version"], meta["num_frames"]) == ("radarcore recording", 1, 3)
    assert (meta["truth"], meta["source"], meta["units"]["cube"]) == (["arm", "wall"], {"kind": "test"}, "sqrt(W)")
    assert Radar.from_dict(meta["radar"]) == RADAR


def test_cube_is_mapped_read_only_unless_asked_otherwise(tmp_path: Path) -> None:
    recording().save(tmp_path / "rec")
    mapped = Recording.load(tmp_path / "rec").cube
    assert isinstance(mapped.base, np.memmap)
    assert not mapped.flags.writeable
    assert Recording.load(tmp_path / "rec", mmap=False).cube.flags.writeable


def test_format_keyword_goes_before_the_suffix(tmp_path: Path) -> None:
    recording().save(tmp_path / "rec.bin", format="npz")
    assert_same(Recording.load(tmp_path / "rec.bin"), recording())


def test_existing_recording_is_replaced_only_when_asked(tmp_path: Path) -> None:
    for where in ("rec", "rec.npz"):
        path = tmp_path / where
        recording(3).save(path)
        with pytest.raises(FileExistsError, match=f"overwrite=True.*{where}"):
            recording(2).save(path)
        assert_same(Recording.load(path), recording(3))
        recording(2, names=None, dtype="float32").save(path, overwrite=True)
        assert_same(Recording.load(path), recording(2, names=None, dtype="float32"))


def test_recording_can_be_saved_over_the_files_it_is_mapped_from(tmp_path: Path) -> None:
    recording().save(tmp_path / "rec")
    Recording.load(tmp_path / "rec").save(tmp_path / "rec", overwrite=True)
    assert_same(Recording.load(tmp_path / "rec"), recording())


@pytest.mark.parametrize("meta", [None, "not json", '{"format": "something else"}', "[]"])
def test_directory_that_is_no_recording_is_never_written_into(tmp_path: Path, meta: str | None) -> None:
    place = tmp_path / "thesis"
    place.mkdir()
    (place / "cube.npy").write_text("precious")
    if meta is not None:
        (place / "meta.json").write_text(meta)
    with pytest.raises(FileExistsError, match=r"not empty and no recording.*thesis"):
        recording().save(place, overwrite=True)
    assert (place / "cube.npy").read_text() == "precious"


def test_overwriting_leaves_other_files_of_the_directory_alone(tmp_path: Path) -> None:
    recording().save(tmp_path / "rec")
    (tmp_path / "rec/notes.txt").write_text("precious")
    recording(2).save(tmp_path / "rec", overwrite=True)
    assert (tmp_path / "rec/notes.txt").read_text() == "precious"


def test_place_that_cannot_be_written_fails_before_the_first_frame(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError, match="file"):
        RecordingWriter(tmp_path / "file" / "rec", RADAR)
    with pytest.raises(FileExistsError, match="file"):
        recording().save(tmp_path / "file" / "rec.npz")
    with pytest.raises(FileExistsError, match=r"got a file, not a directory.*file"):
        RecordingWriter(tmp_path / "file", RADAR, overwrite=True)
    (tmp_path / "dir.npz").mkdir()
    with pytest.raises(FileExistsError, match=r"got a directory.*dir\.npz"):
        recording().save(tmp_path / "dir.npz", overwrite=True)


@pytest.mark.parametrize("path", ["rec.zarr", "rec.h5"])
def test_suffix_without_a_format_is_refused(tmp_path: Path, path: str) -> None:
    with pytest.raises(ValueError, match=r"expected a directory or an .npz file, got .*" + path):
        recording().save(tmp_path / path)
    with pytest.raises(ValueError, match="expected a directory"):
        RecordingWriter(tmp_path / path, RADAR)
    with pytest.raises(ValueError, match="format: expected one of 'npz', 'infineon', got 'zarr'"):
        recording().save(tmp_path / path, format="zarr")
    with pytest.raises(ValueError, match="to write frame by frame"):
        RecordingWriter(tmp_path / "rec.npz", RADAR)


@pytest.mark.parametrize("source", [{"array": np.zeros(3)}, {"level": float("nan")}])
def test_source_that_json_cannot_hold_is_refused_before_anything_is_made(tmp_path: Path, source: Any) -> None:
    for where in ("rec", "rec.npz"):
        rec = Recording(CUBE[None], np.zeros(1), RADAR, source=source)
        with pytest.raises((TypeError, ValueError), match="source: expected what JSON can hold"):
            rec.save(tmp_path / where)
        assert not (tmp_path / where).exists()
