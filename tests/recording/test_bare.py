"""Bare samples: arrays in any order of axes, MAT files, raw numbers; errors name missing facts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

import radarcore as rc
from infineon_folders import config, some_codes
from recordings import CODES, RADAR, SENSOR, recording, refused

SLOW = replace(RADAR.waveform, chirp_interval=20e-6, chirp_times=None, frame_interval=1e-3)
TDM = rc.Radar(SLOW, tx=[[0, 0, 0], [0, 0.01, 0]], rx=RADAR.rx, schedule=rc.Schedule.tdm(10e-6, [0, 1]))
"""Two transmitters and two receivers, 4 chirps of 16 samples."""
CUBE = recording(3).cube
"""(3, 2, 4, 16) complex64."""


def saved(path: Path, values: np.ndarray[Any, Any], name: str = "a.npy") -> Path:
    np.save(path / name, values)
    return path / name


@pytest.mark.parametrize(
    ("shape", "order"),
    [
        ("frame,rx,chirp,sample", "fcms"),
        ("frame, chirp, rx, sample", "fmcs"),
        ("sample,chirp,channel,frame", "smcf"),
        ("chirp,sample,rx,frame", "mscf"),
        (("frame", "sample", "chirp", "rx"), "fsmc"),
    ],
)
def test_axes_come_into_the_order_of_a_recording(tmp_path: Path, shape: Any, order: str) -> None:
    path = saved(tmp_path, CUBE.transpose(["fcms".index(letter) for letter in order]))
    loaded = rc.Recording.load(path, radar=RADAR, shape=shape)
    np.testing.assert_array_equal(loaded.cube, CUBE)
    assert loaded.cube.dtype == np.complex64
    np.testing.assert_array_equal([f.cube for f in rc.Recording.load(path, radar=RADAR, shape=shape)], CUBE)


@pytest.mark.parametrize("order", ["frame,chirp,tx,rx,sample", "frame,tx,rx,chirp,sample", "rx,frame,sample,chirp,tx"])
def test_transmitters_and_receivers_become_channels(tmp_path: Path, order: str) -> None:
    cube = np.random.default_rng(0).standard_normal((3, 2, 2, 4, 16)).astype(np.complex64)
    letters = {"frame": 0, "tx": 1, "rx": 2, "chirp": 3, "sample": 4}
    path = saved(tmp_path, cube.transpose([letters[name] for name in order.split(",")]))
    loaded = rc.Recording.load(path, radar=TDM, shape=order)
    assert loaded.cube.shape == (3, 4, 4, 16)
    for tx in range(2):
        for rx in range(2):
            np.testing.assert_array_equal(loaded.cube[:, 2 * tx + rx], cube[:, tx, rx])


@pytest.mark.parametrize("dtype", ["int16", "float32", "float64", ">i2"])
def test_parts_of_iq_become_complex(tmp_path: Path, dtype: str) -> None:
    parts = np.random.default_rng(0).integers(-500, 500, (3, 2, 4, 16, 2)).astype(dtype)
    path = saved(tmp_path, parts)
    loaded = rc.Recording.load(path, radar=RADAR, shape="frame,rx,chirp,sample,iq")
    np.testing.assert_array_equal(loaded.cube, parts[..., 0] + 1j * parts[..., 1])
    assert loaded.cube.dtype == (np.complex128 if dtype == "float64" else np.complex64)
    assert loaded.source["cube_unit"] == ("counts" if dtype.endswith(("int16", "i2")) else "unknown")


def test_one_frame_and_one_receiver_need_no_axis(tmp_path: Path) -> None:
    loaded = rc.Recording.load(saved(tmp_path, CUBE[1]), radar=RADAR)
    np.testing.assert_array_equal(loaded.cube, CUBE[1:2])
    alone = rc.Radar(RADAR.waveform)
    loaded = rc.Recording.load(saved(tmp_path, CUBE[:, 0]), radar=alone, shape="frame,chirp,sample")
    np.testing.assert_array_equal(loaded.cube, CUBE[:, :1])


def test_real_samples_get_a_real_receiver(tmp_path: Path) -> None:
    path = saved(tmp_path, CUBE.real)
    plain = rc.Radar(RADAR.waveform, rx=RADAR.rx)
    loaded = rc.Recording.load(path, radar=plain)
    assert loaded.radar.is_real
    assert loaded.radar.max_unambiguous_range == plain.max_unambiguous_range / 2.0
    refused(r"a\.npy: expected I/Q samples of the radar's receiver, got real samples", path, radar=RADAR)
    other = saved(tmp_path, CODES.astype(np.complex64), "b.npy")
    refused(r"b\.npy: expected real samples of the radar's receiver, got I/Q samples", other, radar=SENSOR)


def test_codes_of_infineons_recorder_are_those_of_its_folder(tmp_path: Path) -> None:
    codes = some_codes()
    path = saved(tmp_path, codes, "radar.npy")
    (tmp_path / "config.json").write_bytes(config())
    loaded = rc.Recording.load(path, config=tmp_path / "config.json")
    assert loaded.source["cube_unit"] == "full scale"
    np.testing.assert_array_equal(loaded.raw, codes)
    assert loaded.radar == rc.load_radar(tmp_path / "config.json")
    assert loaded.radar.waveform.num_samples == 16


def test_settings_come_from_a_scene_a_radar_and_a_recording(tmp_path: Path) -> None:
    path = saved(tmp_path, CODES)
    (tmp_path / "scene.toml").write_text('[radar]\npreset = "bgt60tr13c"\nnum_chirps = 4\nnum_samples = 16\n')
    (tmp_path / "radar.json").write_text(json.dumps(SENSOR.to_dict()))
    rc.Recording.load(path, radar=SENSOR).save(tmp_path / "rec")
    for name in ("scene.toml", "radar.json", "rec/meta.json"):
        assert rc.Recording.load(path, config=tmp_path / name).radar == SENSOR


# --- raw files


@pytest.mark.parametrize(("dtype", "name"), [("<u2", "uint16"), (">i2", ">i2"), ("<i2", "int16")])
def test_numbers_without_a_header_are_frames(tmp_path: Path, dtype: str, name: str) -> None:
    CODES.astype(dtype).tofile(tmp_path / "a.raw")
    loaded = rc.Recording.load(tmp_path / "a.raw", radar=SENSOR, dtype=name)
    np.testing.assert_array_equal(loaded.cube, CODES)
    assert loaded.source == {"file": "a.raw", "cube_unit": "counts"}
    CODES.transpose(0, 2, 3, 1).astype(dtype).tofile(tmp_path / "b.bin")
    loaded = rc.Recording.load(tmp_path / "b.bin", radar=SENSOR, dtype=name, shape="frame,chirp,sample,rx")
    np.testing.assert_array_equal(loaded.cube, CODES)


def test_rest_of_a_raw_file_is_left_out_with_a_warning(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(CODES.tobytes()[:-5])
    with pytest.warns(UserWarning, match=r"a\.bin: 3 frames, the last 379 bytes are no whole frame"):
        loaded = rc.Recording.load(tmp_path / "a.bin", radar=SENSOR, dtype="uint16")
    np.testing.assert_array_equal(loaded.cube, CODES[:3])


# --- MAT files


@pytest.mark.parametrize("is_packed", [False, True])
@pytest.mark.parametrize("dtype", ["complex128", "complex64", "int16", "uint8", "float64"])
def test_variable_of_a_mat_file_is_loaded(tmp_path: Path, dtype: str, is_packed: bool) -> None:
    cube = (CUBE if dtype.startswith("complex") else 100 * abs(CUBE)).astype(dtype)
    others = {"fs": 2e6, "who": "me", "cells": np.array([1, "a"], object), "made": {"by": 3.0}}
    savemat(tmp_path / "a.mat", {**others, "adc": cube.transpose(3, 2, 1, 0)}, do_compression=is_packed)
    radar = RADAR if dtype.startswith("complex") else rc.Radar(RADAR.waveform, rx=RADAR.rx)
    loaded = rc.Recording.load(tmp_path / "a.mat", radar=radar, shape="sample,chirp,rx,frame")
    np.testing.assert_array_equal(loaded.cube, cube)


def test_mat_file_of_another_byte_order_with_short_numbers_is_loaded(tmp_path: Path) -> None:
    """Doubles that are stored as bytes, as MATLAB does where they fit, by the bytes of MathWorks's document."""
    shape, numbers = (2, 4, 16), np.arange(128, dtype=">i1")
    parts = [
        np.array([6, 8, 6, 0], ">u4").tobytes(),  # flags: uint32, 8 bytes, class double
        np.array([5, 12, *shape, 0], ">u4").tobytes(),  # shape: int32, 12 bytes, padded to 16
        np.array([3 << 16 | 1], ">u4").tobytes() + b"adc\0",  # name: three bytes in the tag itself
        np.array([1, 128], ">u4").tobytes() + numbers.tobytes(),
    ]
    body = b"".join(parts)
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI"
    (tmp_path / "a.mat").write_bytes(header + np.array([14, len(body)], ">u4").tobytes() + body)
    loaded = rc.Recording.load(tmp_path / "a.mat", radar=rc.Radar(RADAR.waveform, rx=RADAR.rx))
    assert loaded.cube.dtype == np.float64
    np.testing.assert_array_equal(loaded.cube[0], numbers.reshape(shape, order="F"))


@pytest.mark.parametrize("is_packed", [False, True])
def test_damaged_mat_file_is_a_value_error_or_a_recording(tmp_path: Path, is_packed: bool) -> None:
    savemat(tmp_path / "good.mat", {"adc": CUBE, "fs": 2e6}, do_compression=is_packed)
    good, rng, messages = (tmp_path / "good.mat").read_bytes(), np.random.default_rng(5), []
    for _ in range(60):
        data = bytearray(good)
        for at in rng.integers(0, 400, 3):
            data[int(at)] = int(rng.integers(256))
        (tmp_path / "a.mat").write_bytes(data)
        try:
            rc.Recording.load(tmp_path / "a.mat", radar=RADAR)
        except ValueError as error:
            messages.append(str(error))
    assert len(messages) > 10
    assert all(message.startswith(str(tmp_path / "a.mat")) for message in messages)


def test_several_variables_of_a_mat_file_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"one": CUBE, "two": 2.0 * CUBE, "fs": 2e6})
    every = r"got one \(3, 2, 4, 16\), two \(3, 2, 4, 16\), fs \(1, 1\)"
    refused(rf"a\.mat: expected one array of samples, {every}; pass variable=..., --var", path, radar=RADAR)
    refused(rf"a\.mat: expected the variable 'three', {every}", path, radar=RADAR, variable="three")
    loaded = rc.Recording.load(path, radar=RADAR, variable="two")
    np.testing.assert_array_equal(loaded.cube, 2.0 * CUBE)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_variables_of_an_npz_file_are_loaded_and_named(tmp_path: Path, save: Any) -> None:
    path = tmp_path / "a.npz"
    save(path, adc=CUBE, fs=2e6)
    np.testing.assert_array_equal(rc.Recording.load(path, radar=RADAR).cube, CUBE)
    save(path, one=CUBE.transpose(0, 2, 1, 3), two=CUBE, fs=2e6)
    loaded = rc.Recording.load(path, radar=RADAR, shape="frame,chirp,rx,sample", variable="one")
    np.testing.assert_array_equal(loaded.cube, CUBE)
    every = r"got one \(3, 4, 2, 16\), two \(3, 2, 4, 16\), fs \(\)"
    refused(rf"a\.npz: expected one array of samples, {every}; pass variable=..., --var", path, radar=RADAR)
    refused(rf"a\.npz: expected the variable 'three', {every}", path, radar=RADAR, variable="three")
    refused(r"without cube; for other arrays pass config=\.\.\. .*-variable NAME", path)
    path.write_bytes(path.read_bytes()[:-30])
    refused(r"a\.npz: ", path, radar=RADAR, variable="two")
    # A recording has its radar.
    recording(3).save(path, overwrite=True)
    refused(r"variable: expected none, as .*a\.npz is no bare file, got 'cube'", path, TypeError, variable="cube")


def test_npy_file_that_is_an_archive_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "renamed.npy"
    np.savez(packed := tmp_path / "a.npz", x=np.ones(3))
    for content in (packed.read_bytes(), b"PK\x03\x04"):
        path.write_bytes(content)
        refused(r"renamed\.npy: damaged or not an NPY file", path, radar=rc.bgt60tr13c())


def test_mat_file_that_is_none_is_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "good.mat", {"adc": CUBE}, do_compression=True)
    good = (tmp_path / "good.mat").read_bytes()
    for data in (b"", b"nonsense" * 100, good[:-500], good[:200] + b"?" * 100 + good[300:]):
        (tmp_path / "a.mat").write_bytes(data)
        refused(r"a\.mat: damaged or not a MAT file", tmp_path / "a.mat", radar=RADAR)


def test_mat_file_of_version_73_needs_h5py(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n" + bytes(100))
    refused(r"a\.mat: .* 7\.3 need h5py: pip install radarcore\[mat\]", path, ImportError, radar=RADAR)


@pytest.mark.parametrize("dtype", ["complex64", "complex128"])
def test_mat_file_of_version_73_has_its_axes_in_matlabs_order(tmp_path: Path, dtype: str) -> None:
    h5py = pytest.importorskip("h5py", reason="needs the extra `mat`: pip install radarcore[mat]")
    part = "f4" if dtype == "complex64" else "f8"
    stored = np.empty(CUBE.T.shape, [("real", part), ("imag", part)])
    stored["real"], stored["imag"] = CUBE.real.T, CUBE.imag.T  # MATLAB has the last axis first
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["adc"] = stored
        file["fs"] = [[2e6]]
    loaded = rc.Recording.load(tmp_path / "a.mat", radar=RADAR)
    np.testing.assert_array_equal(loaded.cube, CUBE)
    assert loaded.cube.dtype == np.dtype(dtype)


# --- what is missing or wrong


def test_what_is_missing_is_asked_for_by_name(tmp_path: Path) -> None:
    path = saved(tmp_path, CODES)
    without = r"a\.npy: expected the radar's settings, got an array \(4, 3, 4, 16\) of uint16 without any; pass config="
    refused(without, path)
    (tmp_path / "a.bin").write_bytes(CODES.tobytes())
    refused(r"a\.bin: expected the radar's settings, got 1536 bytes without any", tmp_path / "a.bin")
    refused(r"a\.bin: expected the type of its numbers, got 1536 bytes; pass dtype=", tmp_path / "a.bin", radar=SENSOR)
    turned = saved(tmp_path, np.concatenate([CODES, CODES[:1]]).transpose(0, 2, 3, 1), "turned.npy")
    refused(r"got \(5, 4, 16, 3\); name its axes in their order, as shape=", turned, radar=SENSOR)


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"shape": "frame,rx,chirp,smaple"}, ValueError, "names of axes, got 'smaple'; did you mean 'sample'"),
        ({"shape": "frame,rx,rx,sample"}, ValueError, "every axis once, got 'rx' twice"),
        ({"shape": "frame,tx,chirp,sample"}, ValueError, "expected rx beside tx"),
        ({"shape": "frame,rx,chirp"}, ValueError, "expected an axis sample"),
        ({"shape": "frame,rx,chirp,sample,iq"}, ValueError, r"expected shape \(n, 3, 4, 16, 2\)"),
        ({"dtype": "int16"}, TypeError, "dtype: expected none, as .* is a .npy file, .*, got 'int16'"),
        ({"variable": "x"}, TypeError, "variable: expected none, as .* is no .mat file"),
        ({"config": "x.toml"}, TypeError, "config: expected none, as .* is described by its radar"),
    ],
)
def test_wrong_descriptions_are_refused(
    tmp_path: Path, given: dict[str, Any], error: type[Exception], message: str
) -> None:
    refused(message, saved(tmp_path, CODES), error, radar=SENSOR, **given)


def test_wrong_types_of_numbers_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(CODES.tobytes())
    for dtype, message in (("number", "name of a type"), ("U2", "expected integers, real or")):
        refused(message, tmp_path / "a.bin", radar=SENSOR, dtype=dtype)
