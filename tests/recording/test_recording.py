"""Frames and recordings, in memory and on disk, whole and interrupted."""

from __future__ import annotations

import itertools
import json
import shutil
import signal
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarcore.radar.pattern import GaussianPattern
from radarcore.radar.presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.recording.codes import to_samples
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording
from radarcore.recording.writer import RecordingWriter

WAVEFORM = Waveform(start_frequency=60e9, slope=1e14, sample_rate=2e6, num_samples=16, num_chirps=4)
RADAR = Radar(
    WAVEFORM,
    rx=[[0.0, 0.0, 0.0], [0.0, 0.1 + 0.2, 0.0]],  # 0.30000000000000004 must come back as it is
    pattern=GaussianPattern(5.0, 60.0, 30.0),
    receiver=Receiver(noise_figure_db=12.0),
)
FILES = ["cube.npy", "time.npy", "truth_range.npy", "truth_velocity.npy", "truth_azimuth.npy", "truth_elevation.npy"]


def frame(index: int, *, dtype: str = "complex64", names: tuple[str, ...] | None = ("arm", "wall")) -> Frame:
    """A frame that differs from all others."""
    rng = np.random.default_rng(index)
    cube = rng.standard_normal((2, 4, 16)) + (1j * rng.standard_normal((2, 4, 16)) if "complex" in dtype else 0.0)
    truth = None if names is None else Truth(names, *rng.standard_normal((4, len(names))))
    return Frame(cube.astype(dtype), 0.025 * index, RADAR, truth, {"rays_cast": index})


def recording(num_frames: int = 3, **options: Any) -> Recording:
    return Recording.from_frames((frame(i, **options) for i in range(num_frames)), source={"kind": "test"})


def assert_same(given: Recording, expected: Recording, num_frames: int | None = None) -> None:
    n = len(expected) if num_frames is None else num_frames
    assert len(given) == n
    assert given.cube.dtype == expected.cube.dtype
    np.testing.assert_array_equal(given.cube, expected.cube[:n])
    np.testing.assert_array_equal(given.time, expected.time[:n])
    assert given.radar == expected.radar
    assert given.source == expected.source
    assert (given.truth is None) == (expected.truth is None)
    if given.truth is not None and expected.truth is not None:
        assert given.truth.names == expected.truth.names
        for name in ("range", "velocity", "azimuth", "elevation"):
            np.testing.assert_array_equal(getattr(given.truth, name), getattr(expected.truth, name)[:n])


def test_recording_gives_its_frames_back() -> None:
    rec = recording()
    assert len(rec) == 3
    for index, one in enumerate(rec.frames()):
        np.testing.assert_array_equal(one.cube, frame(index).cube)
        assert one.truth is not None
        np.testing.assert_array_equal(one.truth.range, frame(index).truth.range)  # type: ignore[union-attr]
    assert rec[-1].time == rec[2].time == 0.05
    assert np.shares_memory(rec[1].cube, rec.cube)
    assert [one.time for one in rec] == [0.0, 0.025, 0.05]  # type: ignore[attr-defined]
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


@pytest.mark.parametrize("where", ["rec", "deep/down/rec", "rec.npz", "deep/rec.npz"])
@pytest.mark.parametrize("dtype", ["complex64", "complex128", "float32", "float64"])
@pytest.mark.parametrize("names", [None, ("arm", "wall"), ()])
def test_what_is_saved_is_loaded_bit_for_bit(tmp_path: Path, where: str, dtype: str, names: Any) -> None:
    rec = recording(dtype=dtype, names=names)
    rec.save(tmp_path / where)
    assert_same(Recording.load(tmp_path / where), rec)
    assert_same(Recording.load(str(tmp_path / where), mmap=False), rec)
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.parametrize("where", ["rec", "rec.npz"])
def test_recording_without_frames_is_a_recording(tmp_path: Path, where: str) -> None:
    truth = Truth(("arm",), *np.zeros((4, 0, 1)))
    rec = Recording(np.zeros((0, 2, 4, 16), np.float32), np.zeros(0), RADAR, truth)
    rec.save(tmp_path / where)
    assert_same(Recording.load(tmp_path / where), rec)


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


def test_recording_is_readable_after_every_frame(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "rec", RADAR, num_frames=3, source={"kind": "test"}) as writer:
        for index in range(4):
            if index < 3:
                with pytest.warns(UserWarning, match=f"rec: {index} of 3 planned frames, its writer was interrupted"):
                    partial = Recording.load(tmp_path / "rec")
                assert len(partial) == index
                if index > 0:
                    assert_same(partial, recording(), index)
                writer.append(frame(index))
            else:
                assert_same(Recording.load(tmp_path / "rec"), recording())
    assert_same(Recording.load(tmp_path / "rec"), recording())


def test_unplanned_number_of_frames_warns_only_until_closed(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "rec", RADAR, source={"kind": "test"})
    writer.append(frame(0))
    with pytest.warns(UserWarning, match=r"rec: 1 frames, its writer was interrupted"):
        Recording.load(tmp_path / "rec")
    writer.close()
    writer.close()
    assert_same(Recording.load(tmp_path / "rec"), recording(1))


def test_interrupt_from_the_keyboard_leaves_the_frames_so_far(tmp_path: Path) -> None:
    def interrupted() -> None:
        with RecordingWriter(tmp_path / "rec", RADAR, num_frames=100, source={"kind": "test"}) as writer:
            writer.append(frame(0))
            writer.append(frame(1))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert np.load(tmp_path / "rec/cube.npy").shape == (2, 2, 4, 16)  # headers are right too
    with pytest.warns(UserWarning, match="2 of 100 planned frames"):
        assert_same(Recording.load(tmp_path / "rec"), recording(2))


APPEND_UNTIL_KILLED = """
import sys
import numpy as np
from radarcore import Frame, Radar, RecordingWriter, Truth, Waveform

waveform = Waveform(start_frequency=60e9, slope=1e14, sample_rate=2e7, num_samples=256, num_chirps=64)
radar = Radar(waveform, rx=np.zeros((4, 3)))
with RecordingWriter(sys.argv[1], radar, num_frames=10**6) as writer:
    print("ready", flush=True)
    for index in range(10**6):
        cube = np.full((4, 64, 256), index, np.complex64)
        writer.append(Frame(cube, float(index), radar, Truth(("arm",), *np.full((4, 1), float(index)))))
        print(index, flush=True)
"""


@pytest.mark.parametrize("num_seen", [0, 1, 2, 5, 11])
def test_killed_process_leaves_every_frame_it_had_finished(tmp_path: Path, num_seen: int) -> None:
    path = tmp_path / "rec"
    command = [sys.executable, "-c", APPEND_UNTIL_KILLED, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = list(itertools.islice(process.stdout, 1 + num_seen))
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert len(lines) == 1 + num_seen
    with pytest.warns(UserWarning, match=r"rec: \d+ of 1000000 planned frames"):
        rec = Recording.load(path)
    assert len(rec) >= num_seen
    for index, one in enumerate(rec.frames()):
        assert (one.cube == index).all()
        assert one.time == index
        assert one.truth is not None
        assert one.truth.elevation == [index]


FILL_UP = """
import resource, sys
import numpy as np
from radarcore import Frame, Radar, RecordingWriter, Waveform

radar = Radar(Waveform(start_frequency=60e9, slope=1e14, sample_rate=2e7, num_samples=256, num_chirps=64))
resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000))  # room for 3.8 frames of 131072 bytes
with RecordingWriter(sys.argv[1], radar) as writer:
    for index in range(10):
        writer.append(Frame(np.full((1, 64, 256), index, np.complex64), float(index), radar))
"""


def test_full_disk_keeps_the_whole_frames_and_names_the_file(tmp_path: Path) -> None:
    command = [sys.executable, "-c", FILL_UP, str(tmp_path / "rec")]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert result.stderr.splitlines()[-1].startswith("OSError: [Errno 27]")
    assert result.stderr.splitlines()[-1].endswith("rec/cube.npy'")
    rec = Recording.load(tmp_path / "rec")
    assert rec.time.tolist() == [0.0, 1.0, 2.0]
    assert (rec.cube == np.arange(3)[:, None, None, None]).all()
    assert len(np.load(tmp_path / "rec/cube.npy")) == 3


def cut(path: Path, num_bytes: int) -> None:
    with path.open("r+b") as file:
        file.truncate(num_bytes)


@pytest.mark.parametrize("name", FILES)
def test_file_cut_short_gives_the_whole_frames_that_all_files_share(tmp_path: Path, name: str) -> None:
    rec = recording()
    rec.save(tmp_path / "rec")
    header = 128  # of NumPy's format, for arrays of these few dimensions
    whole = (tmp_path / "rec" / name).stat().st_size
    row = (whole - header) // 3
    # Before the last byte, at the end of a frame, one byte on either side of it, within the first, none left.
    for size in (whole - 1, header + 2 * row, header + 2 * row + 1, header + 2 * row - 1, header + 1, header):
        cut(tmp_path / "rec" / name, size)
        num_frames = (size - header) // row
        with pytest.warns(UserWarning, match=f"rec: {num_frames} of 3 planned frames"):
            assert_same(Recording.load(tmp_path / "rec"), rec, num_frames)
        rec.save(tmp_path / "rec", overwrite=True)
    for size in (header - 1, 20, 9, 5, 0):
        cut(tmp_path / "rec" / name, size)
        with pytest.raises(ValueError, match=rf"{name}: damaged or not an NPY file"):
            Recording.load(tmp_path / "rec")


def test_header_that_counts_fewer_frames_than_are_there_is_not_believed(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "rec", RADAR, num_frames=3, source={"kind": "test"})
    for index in range(3):
        writer.append(frame(index))
    assert len(np.load(tmp_path / "rec/cube.npy")) == 0  # not closed: the header still says none
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # all planned frames are there
        assert_same(Recording.load(tmp_path / "rec"), recording())
    writer.close()


@pytest.mark.parametrize("name", FILES)
def test_missing_file_is_named(tmp_path: Path, name: str) -> None:
    recording().save(tmp_path / "rec")
    (tmp_path / "rec" / name).unlink()
    with pytest.raises(ValueError, match=f"got one without {name}"):
        Recording.load(tmp_path / "rec")


def edited(values: dict[str, Any], **changes: Any) -> str:
    return json.dumps(values | changes)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda meta: json.dumps(meta, indent=1)[:40], r"meta\.json, line \d"),
        (lambda meta: "", r"meta\.json, line 1"),
        (lambda meta: "[1, 2]", "expected format 'radarcore recording', got 'list'"),
        (lambda meta: edited(meta, format="HDF5"), "expected format 'radarcore recording', got 'HDF5'"),
        (lambda meta: edited(meta, version=2), r"expected version 1 \(or older\), got 2; a newer radarcore wrote it"),
        (lambda meta: edited(meta, version=None), "expected version 1"),
        (lambda meta: json.dumps({key: meta[key] for key in meta if key != "radar"}), "expected the key 'radar'"),
        (lambda meta: edited(meta, radar=7), r"meta\.json: "),
        (lambda meta: edited(meta, radar=meta["radar"] | {"tx_power_dbm": "loud"}), "tx_power_dbm: expected a number"),
        (lambda meta: edited(meta, num_frames=-1), "num_frames: expected at least 0"),
        (lambda meta: edited(meta, truth=["arm"]), r"truth_range\.npy: expected shape \(n, 1\).*got \(3, 2\)"),
        (
            lambda meta: edited(meta, radar=meta["radar"] | {"rx": [[0, 0, 0]]}),
            r"cube\.npy: expected shape \(n, 1, 4, 16\) by its meta\.json, got \(3, 2, 4, 16\)",
        ),
    ],
)
def test_damaged_meta_is_refused_with_its_place(tmp_path: Path, edit: Any, message: str) -> None:
    recording().save(tmp_path / "rec")
    path = tmp_path / "rec/meta.json"
    path.write_text(edit(json.loads(path.read_text())))
    with pytest.raises(ValueError, match=message) as error:
        Recording.load(tmp_path / "rec")
    assert str(tmp_path / "rec") in str(error.value)


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("cube", np.zeros((3, 2, 4, 16), np.int16), "cube.npy: expected float32, float64, .*got int16"),
        ("cube", np.zeros((3, 2, 4), np.float32), r"cube.npy: expected shape \(n, 2, 4, 16\).*got \(3, 2, 4\)"),
        ("cube", np.asfortranarray(np.zeros((3, 2, 4, 16), np.float32)), "got .* in Fortran order"),
        ("time", np.zeros(3, np.float32), "time.npy: expected float64, got float32"),
        ("time", np.full(3, np.nan), "rec: time: expected finite numbers"),
    ],
)
def test_array_that_does_not_fit_is_refused(tmp_path: Path, name: str, array: Any, message: str) -> None:
    recording().save(tmp_path / "rec")
    np.save(tmp_path / f"rec/{name}.npy", array)
    with pytest.raises(ValueError, match=message):
        Recording.load(tmp_path / "rec")


def test_what_is_no_recording_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no such recording.*nowhere"):
        Recording.load(tmp_path / "nowhere")
    with pytest.raises(ValueError, match="got a directory without meta"):
        Recording.load(tmp_path)
    np.save(tmp_path / "alone.npy", np.zeros(3))
    with pytest.raises(ValueError, match=r"alone\.npy: expected a recording's directory or \.npz file"):
        Recording.load(tmp_path / "alone.npy")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match=r"other\.npz: expected a recording with meta, time, cube, got one without"):
        Recording.load(tmp_path / "other.npz")
    recording().save(tmp_path / "rec.npz")
    cut(tmp_path / "rec.npz", 3000)
    with pytest.raises(ValueError, match=r"rec\.npz: .*damaged"):
        Recording.load(tmp_path / "rec.npz")


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


def test_writer_refuses_frames_that_do_not_fit_and_keeps_those_that_do(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "rec", RADAR, num_frames=2, source={"kind": "test"})
    writer.append(frame(0))
    sensor = bgt60tr13c()
    other = Frame(np.zeros((3, 64, 64), np.float32), 0.0, sensor)
    with pytest.raises(ValueError, match="frame: expected a frame of the recording's radar"):
        writer.append(other)
    with pytest.raises(ValueError, match=r"frame: expected complex64 with truth of .*got float32"):
        writer.append(frame(1, dtype="float32"))
    with pytest.raises(ValueError, match=r"frame: expected .*'arm', 'wall'.*got complex64 with truth of None"):
        writer.append(frame(1, names=None))
    with pytest.raises(TypeError, match="frame: expected Frame, got ndarray"):
        writer.append(np.zeros((2, 4, 16)))  # type: ignore[arg-type]
    writer.append(frame(1))
    with pytest.raises(ValueError, match="expected num_frames = 2 frames, got one more"):
        writer.append(frame(2))
    writer.close()
    with pytest.raises(ValueError, match="expected an open recording, got one that is closed"):
        writer.append(frame(2))
    assert_same(Recording.load(tmp_path / "rec"), recording(2))


CUBE = np.zeros((2, 4, 16), np.complex64)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Frame(CUBE[:1], 0.0, RADAR), ValueError, r"\(2, 4, 16\) \[channel, chirp, sample\].*got \(1, 4, 16\)"),
        (lambda: Frame(CUBE[None], 0.0, RADAR), ValueError, r"got \(1, 2, 4, 16\)"),
        (lambda: Frame(CUBE.real.astype(int), 0.0, RADAR), TypeError, "cube: expected float32, .*got int64"),
        (lambda: Frame(CUBE, np.nan, RADAR), ValueError, "time: expected a finite number"),
        (lambda: Frame(CUBE, 0.0, WAVEFORM), TypeError, "radar: expected Radar, got Waveform"),  # type: ignore[arg-type]
        (lambda: Frame(CUBE, 0.0, RADAR, recording().truth), ValueError, r"arrays of shape \(2,\), got \(3, 2\)"),
        (lambda: Frame(CUBE, 0.0, RADAR, "truth"), TypeError, "truth: expected Truth, got str"),  # type: ignore[arg-type]
        (lambda: Recording(CUBE, [0.0], RADAR), ValueError, r"\(n, 2, 4, 16\) \[frame, .*got \(2, 4, 16\)"),  # type: ignore[arg-type]
        (lambda: Recording(CUBE[None], [0.0, 1.0], RADAR), ValueError, r"time: expected shape \(1,\)"),  # type: ignore[arg-type]
        (lambda: Recording.from_frames([]), ValueError, "frames: expected at least one frame"),
        (lambda: Recording.from_frames([frame(0), CUBE]), TypeError, r"frames\[1\]: expected Frame"),  # type: ignore[list-item]
        (lambda: Recording.from_frames([CUBE]), TypeError, r"frames\[0\]: expected Frame"),  # type: ignore[list-item]
        (
            lambda: Recording.from_frames([frame(0), frame(1, names=None)]),
            ValueError,
            r"frames\[1\]: expected complex64",
        ),
        (lambda: Truth(("a",), *np.zeros((4, 2))), ValueError, r"range: expected shape \(1,\) or \(frame, 1\).*\(2,\)"),
        (lambda: Truth("arm", *np.zeros((4, 3))), TypeError, "names: expected one name per body"),  # type: ignore[arg-type]
        (
            lambda: Truth(("a",), np.zeros(1), np.zeros(2), np.zeros(1), np.zeros(1)),
            ValueError,
            r"velocity: expected shape \(1,\) as range, got \(2,\)",
        ),
        (lambda: Truth(("a",), ["x"], *np.zeros((3, 1))), TypeError, "range: expected numbers"),  # type: ignore[arg-type]
    ],
)
def test_silly_input_is_refused_by_name(make: Any, error: Any, message: str) -> None:
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize("source", [{"array": np.zeros(3)}, {"level": float("nan")}])
def test_source_that_json_cannot_hold_is_refused_before_anything_is_made(tmp_path: Path, source: Any) -> None:
    for where in ("rec", "rec.npz"):
        rec = Recording(CUBE[None], np.zeros(1), RADAR, source=source)
        with pytest.raises((TypeError, ValueError), match="source: expected what JSON can hold"):
            rec.save(tmp_path / where)
        assert not (tmp_path / where).exists()


# Codes of an ADC.

SENSOR = bgt60tr13c(num_samples=16, num_chirps=4)
CODES = np.random.default_rng(3).integers(0, 4096, (4, 3, 4, 16), dtype=np.uint16)
FRAME_TIMES = [1.7e9, 1.7e9 + 0.031, 1.7e9 + 0.0999, 1.7e9 + 7.0]  # by the clock of a host: irregular


def sensor_frame(index: int, **stats: int) -> Frame:
    return Frame(to_samples(CODES[index]), FRAME_TIMES[index], SENSOR, stats=stats, raw=CODES[index])


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


@pytest.mark.parametrize(
    ("raw", "error", "message"),
    [
        (CODES[0].astype(np.int32), TypeError, "raw: expected uint16, got int32"),
        (CODES, ValueError, r"raw: expected shape \(3, 4, 16\) as the cube, got \(4, 3, 4, 16\)"),
    ],
)
def test_codes_that_do_not_fit_the_samples_are_refused(raw: Any, error: Any, message: str) -> None:
    with pytest.raises(error, match=message):
        Frame(to_samples(CODES[0]), 0.0, SENSOR, raw=raw)


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


def test_lost_frames_are_readable_while_they_are_written(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "rec", SENSOR, num_frames=4)
    for index, num_lost in enumerate((None, 0, 3)):
        writer.append(sensor_frame(index) if num_lost is None else sensor_frame(index, lost_before=num_lost))
        with pytest.warns(UserWarning, match=f"{index + 1} of 4 planned frames"):
            rec = Recording.load(tmp_path / "rec")
        assert (None if rec.lost is None else rec.lost.tolist()) == (None, [0, 0], [0, 0, 3])[index]
    writer.close()


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda lost: Recording(CUBE[None], [0.0], RADAR, lost=lost), ValueError, r"lost: expected shape \(1,\)"),  # type: ignore[arg-type]
        (
            lambda lost: Recording(CUBE[None], [0.0], RADAR, lost=[-1]),
            ValueError,
            "lost: expected .* from 0 on, got -1",
        ),  # type: ignore[arg-type]
        (lambda lost: Recording(CUBE[None], [0.0], RADAR, lost=[2**31]), ValueError, "lost: expected numbers"),  # type: ignore[arg-type]
        (lambda lost: Recording(CUBE[None], [0.0], RADAR, lost=[0.5]), TypeError, "lost: expected integers"),  # type: ignore[arg-type]
        (lambda lost: Recording.from_frames([sensor_frame(0, lost_before=-1)]), ValueError, "lost_before.*at least 0"),
        (lambda lost: Recording.from_frames([sensor_frame(0, lost_before=2**31)]), ValueError, "lost_before.*at most"),
        (lambda lost: Recording(CUBE[None], [0.0], RADAR, source=None), TypeError, "source: expected a dict"),  # type: ignore[arg-type]
    ],
)
def test_silly_counts_are_refused_by_name(make: Any, error: Any, message: str) -> None:
    with pytest.raises(error, match=message):
        make([0, 0])


@pytest.mark.parametrize("array", [np.zeros(4, np.int64), np.zeros((4, 1), np.int32), np.full(4, -3, np.int32)])
def test_lost_frames_on_disk_that_do_not_fit_are_refused(tmp_path: Path, array: Any) -> None:
    Recording.from_frames([sensor_frame(index, lost_before=0) for index in range(4)]).save(tmp_path / "rec")
    np.save(tmp_path / "rec/lost.npy", array)
    with pytest.raises(ValueError, match="lost"):
        Recording.load(tmp_path / "rec")


def test_writer_refuses_a_count_that_is_none_before_anything_is_written(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "rec", SENSOR) as writer:
        writer.append(sensor_frame(0))
        with pytest.raises(TypeError, match=r'stats\["lost_before"\]: expected an integer'):
            writer.append(sensor_frame(1, lost_before=1.5))  # type: ignore[arg-type]
        writer.append(sensor_frame(2))
    assert Recording.load(tmp_path / "rec").time.tolist() == [FRAME_TIMES[0], FRAME_TIMES[2]]


# Interruptions.

INTERRUPT_AT_ANY_MOMENT = """
import signal, sys, warnings
import numpy as np
from radarcore import Frame, Recording, RecordingWriter, bgt60tr13c
from radarcore.recording.codes import to_samples

warnings.simplefilter("ignore")
radar = bgt60tr13c(num_samples=64, num_chirps=16)
codes = [np.full((3, 16, 64), index % 4096, np.uint16) for index in range(4096)]
frames = [Frame(to_samples(c), float(i), radar, stats={"lost_before": i} if i > 2 else {}, raw=c)
          for i, c in enumerate(codes)]
signal.signal(signal.SIGALRM, signal.default_int_handler)  # raises KeyboardInterrupt, as Ctrl-C does
total = 0
for trial in range(60):
    path = f"{sys.argv[1]}/{trial}"
    try:
        with RecordingWriter(path, radar) as writer:
            if trial % 2:  # else it may come before there is any frame
                writer.append(frames[0])
            signal.setitimer(signal.ITIMER_REAL, 1e-4 * 1.06**trial)
            for frame in (frames * 10)[trial % 2 :]:
                writer.append(frame)
    except KeyboardInterrupt:
        pass
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    rec = Recording.load(path)
    assert rec.time.tolist() == [float(i) for i in range(len(rec))], rec.time
    assert rec.lost is None or rec.lost.tolist() == [i if i > 2 else 0 for i in range(len(rec))]
    assert all((rec.raw[i] == codes[i]).all() for i in range(len(rec))) if len(rec) else True
    total += len(rec)
print(total)
"""


def test_interrupt_at_any_moment_leaves_the_whole_frames(tmp_path: Path) -> None:
    command = [sys.executable, "-c", INTERRUPT_AT_ANY_MOMENT, str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.stderr == ""
    assert int(result.stdout) >= 30


WRITE_UNTIL_FULL = """
import errno, sys, warnings
import numpy as np
from radarcore import Frame, Recording, RecordingWriter, bgt60tr13c
from radarcore.recording.codes import to_samples

warnings.simplefilter("ignore")
radar = bgt60tr13c(num_samples=64, num_chirps=64)  # frames of 48 KiB
codes = [np.full((3, 64, 64), index, np.uint16) for index in range(100)]
try:
    with RecordingWriter(sys.argv[1] + "/rec", radar, num_frames=100) as writer:
        for index, c in enumerate(codes):
            writer.append(Frame(to_samples(c), float(index), radar, stats={"lost_before": index}, raw=c))
except OSError as error:
    assert error.errno == errno.ENOSPC, error
    assert error.filename.startswith(sys.argv[1]), error
rec = Recording.load(sys.argv[1] + "/rec")
assert rec.lost.tolist() == rec.time.tolist() == list(range(len(rec)))
assert (rec.raw == np.array(codes[: len(rec)])).all()
assert np.load(sys.argv[1] + "/rec/cube.npy").shape[0] == len(rec)
before = Recording.load(sys.argv[1] + "/rec", mmap=False)
try:
    before.save(sys.argv[1] + "/again", format="infineon")
except OSError as error:
    assert error.errno == errno.ENOSPC, error
else:
    raise AssertionError("there was room")
import pathlib
assert [path.name for path in pathlib.Path(sys.argv[1]).iterdir()] == ["rec"]
print(len(rec))
"""


def test_disk_without_room_keeps_the_whole_frames(tmp_path: Path) -> None:
    place = tmp_path / "small"
    place.mkdir()
    mount = 'mount -t tmpfs -o size=1m none "$0" && exec "$@"'
    inside = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", mount, str(place)]
    if shutil.which("unshare") is None or subprocess.run([*inside, "true"], capture_output=True).returncode != 0:
        pytest.skip("no small disk can be mounted here (unshare --user --mount)")
    command = [sys.executable, "-c", WRITE_UNTIL_FULL, str(place)]
    result = subprocess.run([*inside, *command], capture_output=True, text=True, check=False)
    assert result.stderr == ""
    assert 18 <= int(result.stdout) <= 21  # 1 MiB has room for 21 of 48 KiB and a page for each of the other files


# Replay.


class Clock:
    """A clock that goes on only when someone sleeps, or is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        assert duration > 0.0
        self.now += duration


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    result = Clock()
    monkeypatch.setattr("time.monotonic", result)
    monkeypatch.setattr("time.sleep", result.sleep)
    return result


def of_times(*times: float) -> Recording:
    return Recording(np.zeros((len(times), 2, 4, 16), np.complex64), np.array(times), RADAR)


@pytest.mark.parametrize(("speed", "scale"), [(1.0, 1.0), (4.0, 0.25), (0.5, 2.0)])
def test_frames_are_replayed_when_they_are_due(clock: Clock, speed: float, scale: float) -> None:
    times = [7.0, 7.1, 7.15, 27.0]
    due = []
    for one in of_times(*times).replay(speed=speed):
        due.append((one.time, clock.now))
        clock.now += 0.005  # what the consumer takes does not add up
    assert [time for time, _ in due] == times
    np.testing.assert_allclose([now for _, now in due], 100.0 + scale * (np.array(times) - 7.0), atol=1e-9)


def test_late_consumer_does_not_wait_until_it_has_caught_up(clock: Clock) -> None:
    seen = []
    for one in of_times(0.0, 0.1, 0.2, 0.3, 0.4).replay():
        seen.append(clock.now)
        clock.now += 0.25 if one.time == 0.0 else 0.0
    np.testing.assert_allclose(seen, [100.0, 100.25, 100.25, 100.3, 100.4], atol=1e-9)


def test_first_frame_comes_at_once_whenever_it_is_asked_for(clock: Clock) -> None:
    frames = of_times(5.0, 6.0).replay()
    clock.now = 200.0
    next(frames)
    assert clock.now == 200.0
    next(frames)
    assert clock.now == 201.0


@pytest.mark.parametrize("speed", [None, 1.0])
def test_replay_in_a_loop_goes_on_in_time(clock: Clock, speed: float | None) -> None:
    frames = list(itertools.islice(of_times(2.0, 2.1, 2.2).replay(speed=speed, loop=True), 8))
    np.testing.assert_allclose([one.time for one in frames], 2.0 + 0.1 * np.arange(8))
    assert clock.now == pytest.approx(100.0 if speed is None else 100.7)


def test_loop_of_a_single_frame_has_the_interval_of_the_radar() -> None:
    frames = list(itertools.islice(of_times(2.0).replay(speed=None, loop=True), 3))
    np.testing.assert_allclose([one.time for one in frames], 2.0 + WAVEFORM.frame_interval * np.arange(3))


def test_times_that_go_back_are_not_waited_for(clock: Clock) -> None:
    frames = list(itertools.islice(of_times(3.0, 1.0, 2.0).replay(loop=True), 6))
    assert [one.time for one in frames[:3]] == [3.0, 1.0, 2.0]
    assert frames[3].time > 3.0


def test_replay_without_waiting_gives_what_frames_gives() -> None:
    rec = recording()
    replayed = Recording.from_frames(rec.replay(speed=None), rec.source)
    assert_same(replayed, rec)
    assert list(of_times().replay(speed=None, loop=True)) == []
    assert list(of_times().replay()) == []


def test_replay_by_the_real_clock_ends() -> None:
    assert len(list(of_times(0.0, 0.01, 0.02).replay())) == 3


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_speed_that_is_none_is_refused_at_once(speed: float) -> None:
    with pytest.raises(ValueError, match="speed: expected"):
        recording().replay(speed=speed)
