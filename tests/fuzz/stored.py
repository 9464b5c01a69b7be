"""Inputs of recordings: our directories, our .npz files, and folders of Infineon's tools."""

from __future__ import annotations

import io
import json
import tempfile
import warnings
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from fuzz.cases import Case, damaged_tree, json_bytes, read_back
from infineon_folders import folder as infineon_folder
from radarcore.recording.recording import Recording
from recordings import npy, recording, sensor_frame


def _saved(save: Callable[[Path], Any], name: str) -> Case:
    """The files that a function writes to a path of some name."""
    with tempfile.TemporaryDirectory() as directory:
        save(Path(directory) / name)
        return read_back(Path(directory))


@cache
def _recordings() -> list[Recording]:
    measured = Recording.from_frames([sensor_frame(index, lost_before=index) for index in range(4)])
    return [recording(), recording(dtype="float32", names=None), measured]


@cache
def directory_seeds() -> list[Case]:
    return [_saved(rec.save, "rec") for rec in _recordings()]


@cache
def npz_seeds() -> list[Case]:
    return [_saved(rec.save, "rec.npz") for rec in _recordings()]


@cache
def infineon_seeds() -> list[Case]:
    return [_saved(infineon_folder, "rec")]


def make_directory(random: Random) -> Case:
    case = dict(random.choice(directory_seeds()))
    if random.random() < 0.5:
        case["rec/meta.json"] = _other_json(case["rec/meta.json"], random)
    else:
        name = random.choice([name for name in case if name.endswith(".npy")])
        case[name] = _other_npy(case[name], random)
    return case


def make_npz(random: Random) -> Case:
    with zipfile.ZipFile(io.BytesIO(random.choice(npz_seeds())["rec.npz"])) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = random.choice(sorted(members))
    if random.random() < 0.1:
        del members[name]
    elif name == "meta.npy" and random.random() < 0.7:
        text = str(np.load(io.BytesIO(members[name])))
        members[name] = npy(np.array(_other_json(text.encode(), random).decode(errors="replace")))
    else:
        members[name] = _other_npy(members[name], random)
    file = io.BytesIO()
    with (
        warnings.catch_warnings(action="ignore"),
        zipfile.ZipFile(file, "w", random.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive,
    ):
        for name, data in members.items():
            archive.writestr(random.choice((name,) * 200 + ("x", "cube", "meta.npy", "/", "time.npy")), data)
    return {"rec.npz": file.getvalue()}


def make_infineon(random: Random) -> Case:
    case = dict(infineon_seeds()[0])
    name = random.choice(sorted(case))
    if name.endswith(".json"):
        case[name] = _other_json(case[name], random)
    elif name.endswith(".npy"):
        case[name] = _other_npy(case[name], random)
    else:
        case[name] = random.choice((b"", b"2.0.0", b"1", b"\xff", b"x", b"1." * 9999))
    return case


def _other_json(data: bytes, random: Random) -> bytes:
    tree = json.loads(data)
    part = random.choice(sorted(tree))
    if random.random() < 0.3:
        return json_bytes(damaged_tree(tree, random))
    return json_bytes(tree | damaged_tree({part: tree[part]}, random))


def _other_npy(data: bytes, random: Random) -> bytes:
    """An array of another shape or type, or a header that says so of the same samples."""
    array = np.load(io.BytesIO(data))
    dtypes = ["<f8", ">f8", "<f4", "<f2", "<i4", "<u2", "<i8", "|b1", "<c8", "<c16", "|S4", "<U2"]
    lengths = (0, 1, 2, 3, 2**31, 2**40, 2**62, 2**64, -1, array.size)
    shape = tuple(random.choice(lengths) if random.random() < 0.4 else length for length in array.shape)
    shape = random.choice((shape, shape, (*shape, 1), shape[1:], ()))
    if random.random() < 0.5 and all(0 <= length < 100 for length in shape) and int(np.prod(shape)) < 1 << 16:
        with warnings.catch_warnings(action="ignore"):
            values = np.resize(array, shape) if array.dtype.kind in "fciu" else np.zeros(shape)
            filled = values.astype(random.choice(dtypes[:10]))
            if filled.dtype.kind in "fc" and filled.size and random.random() < 0.3:
                filled.flat[random.randrange(filled.size)] = random.choice((np.nan, np.inf, -np.inf, 1e30))
        return npy(np.asfortranarray(filled) if random.random() < 0.2 else filled)
    descr = random.choice((np.lib.format.dtype_to_descr(array.dtype), random.choice(dtypes), [("a", "<f4")], "|O", 7))
    header: Any = {"descr": descr, "fortran_order": random.choice((False, False, True, 1)), "shape": shape}
    if random.random() < 0.2:
        del header[random.choice(sorted(header))]
    words = random.choice((repr(header), repr(header), "(" * 300, "9" * 5000, "{}", "1/0", "-" * 500 + "1"))
    version = random.choice((b"\1\0", b"\1\0", b"\2\0", b"\3\0", b"\t\t"))
    length = len(words) + 1 if random.random() < 0.9 else random.choice((0, 65535))
    size = length.to_bytes(2 if version == b"\1\0" else 4, "little")
    return b"\x93NUMPY" + version + size + words.encode() + b"\n" + data[128:]


def read_directory(folder: Path) -> None:
    _read(folder / "rec")


def read_npz(folder: Path) -> None:
    _read(folder / "rec.npz")


def _read(path: Path) -> None:
    rec = Recording.load(path)
    waveform = rec.radar.waveform
    assert rec.cube.shape == (len(rec), rec.radar.num_channels, waveform.num_chirps, waveform.num_samples)
    is_sound = np.isfinite(rec.cube).all(axis=(1, 2, 3))
    for number in np.flatnonzero(is_sound)[:10]:
        assert rec[int(number)].time == rec.time[number]
