"""Recordings on disk that are cut short, incomplete or damaged: whole frames are read, all else is named."""

from __future__ import annotations

import json
import tracemalloc
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarcore.recording.native import RecordingWriter
from radarcore.recording.recording import Recording
from recordings import RADAR, assert_same, cut, frame, npy, recording, refused, sensor_frame


@pytest.mark.parametrize("name", ["cube.npy", "time.npy", "truth_range.npy"])
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
        refused(rf"{name}: damaged or not an NPY file", tmp_path / "rec")


def test_header_that_counts_fewer_frames_than_are_there_is_not_believed(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "rec", RADAR, num_frames=3, source={"kind": "test"})
    for index in range(3):
        writer.append(frame(index))
    assert len(np.load(tmp_path / "rec/cube.npy")) == 0  # not closed: the header still says none
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # all planned frames are there
        assert_same(Recording.load(tmp_path / "rec"), recording())
    writer.close()


@pytest.mark.parametrize("name", ["cube.npy", "time.npy", "truth_range.npy"])
def test_missing_file_is_named(tmp_path: Path, name: str) -> None:
    recording().save(tmp_path / "rec")
    (tmp_path / "rec" / name).unlink()
    refused(f"got one without {name}", tmp_path / "rec")


def edited(values: dict[str, Any], **changes: Any) -> str:
    return json.dumps(values | changes)


def of_radar(values: dict[str, Any], **changes: Any) -> str:
    return edited(values, radar=values["radar"] | changes)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda meta: json.dumps(meta, indent=1)[:40], r"meta\.json: .*: line \d"),
        (lambda meta: "[1, 2]", "expected format 'radarcore recording', got 'list'"),
        (lambda meta: edited(meta, format="HDF5"), "expected format 'radarcore recording', got 'HDF5'"),
        (lambda meta: edited(meta, version=2), r"expected version 1 \(or older\), got 2; a newer radarcore wrote it"),
        (lambda meta: json.dumps({key: meta[key] for key in meta if key != "radar"}), "expected the key 'radar'"),
        (lambda meta: of_radar(meta, tx_power_dbm="loud"), "tx_power_dbm: expected a number"),
        (lambda meta: of_radar(meta, pattern={"kind": "gaussian", "\b": 1}), r"unexpected keyword argument '\\x08'"),
        (lambda meta: edited(meta, truth=["arm"]), r"truth_range\.npy: expected shape \(n, 1\).*got \(3, 2\)"),
        (lambda meta: of_radar(meta, rx=[[0, 0, 0]]), r"cube\.npy: expected shape \(n, 1, 4, 16\) by its meta\.json"),
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
    refused(message, tmp_path / "rec")


def test_what_is_no_recording_is_refused_by_name(tmp_path: Path) -> None:
    refused(r"no such recording.*nowhere", tmp_path / "nowhere", FileNotFoundError)
    refused("got a directory without meta", tmp_path)
    np.save(tmp_path / "alone.npy", np.zeros(3))
    refused(r"alone\.npy: expected the radar's settings, got an array \(3,\) of float64", tmp_path / "alone.npy")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    refused(r"other\.npz: expected a recording with meta, time, cube, got one without", tmp_path / "other.npz")
    recording().save(tmp_path / "rec.npz")
    cut(tmp_path / "rec.npz", 3000)
    refused(r"rec\.npz: .*damaged", tmp_path / "rec.npz")


@pytest.mark.parametrize("array", [np.zeros(4, np.int64), np.zeros((4, 1), np.int32), np.full(4, -3, np.int32)])
def test_lost_frames_on_disk_that_do_not_fit_are_refused(tmp_path: Path, array: Any) -> None:
    Recording.from_frames([sensor_frame(index, lost_before=0) for index in range(4)]).save(tmp_path / "rec")
    np.save(tmp_path / "rec/lost.npy", array)
    refused("lost", tmp_path / "rec")


def test_header_that_says_four_gigabytes_is_not_read(tmp_path: Path) -> None:
    recording().save(tmp_path / "rec")
    path = tmp_path / "rec/time.npy"
    path.write_bytes(b"\x93NUMPY\2\0\xff\xff\xff\xff" + path.read_bytes())
    tracemalloc.start()
    refused(r"time\.npy: damaged or not an NPY file", tmp_path / "rec")
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert memory < 1 << 20


def test_old_name_of_a_dtype_is_refused_as_any_other(tmp_path: Path) -> None:
    recording().save(tmp_path / "rec")
    (tmp_path / "rec/time.npy").write_bytes(header((3,), "a8"))
    # numpy 2.5 no longer knows the name.
    refused(r"time\.npy: (expected float64, got \|S8|damaged or not an NPY file .*'a8')", tmp_path / "rec")


# Archives.


def header(shape: tuple[int, ...], descr: str = "<c8") -> bytes:
    """An NPY file that says so of what it does not have."""
    words = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\1\0" + len(words).to_bytes(2, "little") + words + bytes(64)


def archive(path: Path, compression: int = zipfile.ZIP_STORED, **members: bytes) -> Path:
    """A recording with some members, by their names, in the place of its own or beside them."""
    recording().save(path / "whole.npz")
    with zipfile.ZipFile(path / "whole.npz") as whole:
        contents = {name.removesuffix(".npy"): whole.read(name) for name in whole.namelist()} | members
    with zipfile.ZipFile(path / "rec.npz", "w", compression) as made:
        for name, data in contents.items():
            made.writestr(f"{name}.npy", data)
    return path / "rec.npz"


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_archive_of_any_tool_is_read(tmp_path: Path, compression: int) -> None:
    cube = npy(np.asfortranarray(recording().cube))
    read = Recording.load(archive(tmp_path, compression, notes=b"not an array", cube=cube))
    assert_same(read, recording())
    read.cube[0] = 0.0  # no view of what cannot be written


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"cube": header((2**31, 2, 4, 16))}, r"cube\.npy: expected the samples of shape .*, got \d+ bytes"),
        ({"time": header((3,), "|O")}, "Object arrays cannot be loaded"),
        ({"time": header((3,))[:40]}, r"time\.npy: damaged or not an NPY file"),
        ({"time": header((3,)).replace(b"}", b"(")}, r"time\.npy: damaged or not an NPY file"),
        ({"time": npy(np.zeros(3, np.complex128))}, "rec.npz, time: expected float64, got complex128"),
        ({"truth_azimuth": npy(np.float64(0.0))}, r"rec.npz, truth: azimuth: expected shape \(3, 2\)"),
    ],
)
@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_archive_whose_arrays_do_not_fit_is_refused(
    tmp_path: Path, members: dict[str, bytes], message: str, compression: int
) -> None:
    path = archive(tmp_path, compression, **members)
    tracemalloc.start()
    refused(rf"rec\.npz.*{message.removeprefix('rec.npz')}", path)
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert memory < 4 << 20  # the file has 20 kB, and says 256 GB


DIRECTORY = b"PK\1\2"
"""Start of an entry in the directory of an archive."""


@pytest.mark.parametrize(
    ("place", "damage"),
    [
        (lambda data: 60, bytes(range(200, 230))),  # deflated bytes
        (lambda data: data.index(DIRECTORY) + 6, b"\xc8"),  # version
        (lambda data: data.index(DIRECTORY) + 8, b"\1"),  # encrypted
        (lambda data: data.rindex(DIRECTORY) + 42, b"\xff\xff\xff\xff"),  # place of a member
        (lambda data: 30, b"\0\1\2\3"),  # name
    ],
)
def test_damaged_archive_is_refused_with_its_name(tmp_path: Path, place: Callable[[bytes], int], damage: bytes) -> None:
    path = archive(tmp_path, zipfile.ZIP_DEFLATED)
    data = bytearray(path.read_bytes())
    data[place(data) : place(data) + len(damage)] = damage
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"rec\.npz: damaged or not an \.npz file \(") as caught:
        Recording.load(path)
    assert len(str(caught.value)) < 500
