"""`radarcore convert`: every format gives back every bit, and nothing is replaced unasked."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from infineon_folders import array, folder, some_codes
from radarcore.cli.main import main
from radarcore.cli.sources import WHOLE
from radarcore.recording.frame import to_samples, unit_of
from recordings import assert_same, real_recording, recording, sensor_frame

NEEDS = {".mcap": "rosbags", ".db3": "rosbags", ".zarr": "zarr"}
SUFFIXES = ("", ".npz", ".mcap", ".db3", ".zarr")


def convert(source: Path, output: Path, *words: str) -> rc.Recording:
    pytest.importorskip(NEEDS.get(output.suffix, "numpy"))
    assert main(["convert", str(source), str(output), *words]) == 0
    return WHOLE.load(output)


def of_sensor() -> rc.Recording:
    """Codes at irregular times, with lost frames."""
    return rc.Recording.from_frames([sensor_frame(index, lost_before=3 * index) for index in range(4)])


def made(kind: str) -> rc.Recording:
    if kind == "sensor":
        return of_sensor()
    if kind == "between codes":  # samples in full scale that no code gives
        return replace(of_sensor(), cube=np.float32(0.7) * of_sensor().cube)
    return recording(dtype=kind) if kind != "float32" else recording(dtype=kind, names=None)


@pytest.mark.parametrize("kind", ["complex64", "complex128", "float32", "float64", "sensor", "between codes"])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_way_through_a_format_and_back_changes_no_bit(kind: str, suffix: str, tmp_path: Path) -> None:
    given = made(kind)
    given.save(tmp_path / "given")
    once = convert(tmp_path / "given", tmp_path / f"once{suffix}")
    again = convert(tmp_path / f"once{suffix}", tmp_path / "again")
    for found in (once, again):
        assert_same(found, given)
        assert (found.lost is None) == (given.lost is None)
        if given.lost is not None:
            np.testing.assert_array_equal(found.lost, given.lost)


def test_dataset_of_a_recording_has_its_codes_truth_and_radar(tmp_path: Path) -> None:
    convert(folder(tmp_path / "rec"), tmp_path / "set.zarr")
    dataset = rc.dataset.open_dataset(tmp_path / "set.zarr")
    assert (len(dataset), dataset.has_codes, dataset.body_names) == (1, True, ())
    assert not [name for name in dataset.names if name.startswith("true_")]
    np.testing.assert_array_equal(dataset.stored(0), some_codes())
    assert dataset.radar == rc.Recording.load(tmp_path / "rec").radar
    ((cube, labels), *others) = dataset.frames()
    assert (labels["frame"], len(others)) == (0, 4)
    np.testing.assert_array_equal(cube, rc.Recording.load(tmp_path / "rec").cube[0])

    recording().save(tmp_path / "true")
    convert(tmp_path / "true", tmp_path / "true.zarr")
    (sample,) = rc.dataset.open_dataset(tmp_path / "true.zarr")
    truth = recording().truth
    assert truth is not None
    np.testing.assert_array_equal(sample["true_range"], truth.range)
    np.testing.assert_array_equal(sample["true_elevation"], truth.elevation)


def test_dataset_of_a_recording_is_verified_and_has_no_scene_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording().save(tmp_path / "rec")
    convert(tmp_path / "rec", tmp_path / "set.zarr")
    found = rc.dataset.verify(tmp_path / "set.zarr", progress=False)
    assert (found.samples, found.missing, found.faults, found.again) == (1, 0, (), ())
    assert main(["info", str(tmp_path / "set.zarr")]) == 0
    capsys.readouterr()
    assert main(["dataset", "scene", str(tmp_path / "set.zarr"), "0"]) == 1
    assert "expected a dataset with a scene file, got one made from a recording" in capsys.readouterr().err


def test_folder_of_infineon_comes_back_byte_by_byte(tmp_path: Path) -> None:
    given = folder(tmp_path / "given")
    convert(given, tmp_path / "native")
    found = convert(tmp_path / "native", tmp_path / "again", "--format", "infineon")
    assert_same(found, rc.Recording.load(given))
    name = "RadarIfxAvian_00/radar.npy"
    assert (tmp_path / "again" / name).read_bytes() == (given / name).read_bytes()


def test_real_recording_keeps_every_bit_through_every_format(tmp_path: Path) -> None:
    given = source = real_recording()
    for suffix in SUFFIXES:
        found = convert(source, target := tmp_path / f"step{suffix}")
        assert_same(found, rc.Recording.load(given))
        source = target
    convert(source, tmp_path / "last", "--format", "infineon")
    for file in ("radar.npy", "config.json", "meta.json"):
        name = Path("RadarIfxAvian_00") / file
        assert (tmp_path / "last" / name).read_bytes() == (given / name).read_bytes()


WAVE = rc.Waveform(start_frequency=60e9, slope=1e14, sample_rate=2e6, num_samples=16, num_chirps=4, adc_delay=3.1125e-6)
RADARS = {
    "got CW": (WAVE.replace(slope=0.0),),
    "expected one waveform": (WAVE, WAVE.replace(slope=-1e14, chirp_times=WAVE.chirp_times + 1e-3)),
}


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("message", RADARS)
def test_every_radar_passes_but_into_the_folder_of_infineon(
    message: str, suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    radar = rc.Radar(RADARS[message], rx=rc.bgt60tr13c().rx)
    cube = to_samples(np.arange(2 * 3 * radar.num_chirps * 16).reshape(2, 3, -1, 16))
    given = rc.Recording(cube, [0.0, 1.0], radar, source={"cube_unit": "full scale"})
    given.save(tmp_path / "given")
    assert_same(convert(tmp_path / "given", tmp_path / f"found{suffix}"), given)
    capsys.readouterr()
    refused = tmp_path / "refused"
    assert main(["convert", str(tmp_path / "given"), str(refused), "--format", "infineon"]) == 1
    assert message in capsys.readouterr().err
    assert not refused.exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("rec new.h5", "new.h5: expected a recording (no suffix, .npz), a bag (.mcap, .db3) or a dataset (.zarr), got"),
        ("rec new.npz --format infineon", "new.npz: expected a folder for Infineon's tools (no suffix), got"),
        ("rec new --format infineon", 'cube: expected real samples in full scale (source["cube_unit"] = '),
        ("between new --format infineon", "new: expected codes of an ADC for Infineon's tools, got samples between"),
        ("rec rec --overwrite", "OUT: expected a place outside the source, got rec, the source itself"),
        ("none new", "none: no such recording"),
        ("empty new.mcap", "new.mcap: expected at least one frame for a .mcap file, got none"),
        ("empty new.zarr", "new.zarr: expected at least one frame for a .zarr file, got none"),
    ],
)
def test_faults_are_one_line_and_nothing_is_written(
    words: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    recording().save("rec")
    recording()[:0].save("empty")
    made("between codes").save("between")
    before = sorted(tmp_path.rglob("*"))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="empty: a recording without frames")
        assert main(["convert", *words.split()]) == 1
    assert message in (line := capsys.readouterr().err.splitlines()[-1])
    assert line.startswith("radarcore: ")
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("suffix", [*SUFFIXES, " for Infineon"])
def test_only_overwrite_replaces_and_a_dataset_never(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--format", "infineon"] if "Infineon" in suffix else []
    output = tmp_path / f"out{suffix}"
    rec, other = (folder(tmp_path / name, radar_npy=array(some_codes(count))) for name, count in (("a", 2), ("b", 3)))
    assert len(convert(rec, output, *words)) == 2
    call = ["convert", str(other), str(output), *words]
    assert main(call) == 1
    assert "expected no such path, got a" in capsys.readouterr().err
    status = main([*call, "--overwrite"])
    assert (status, len(WHOLE.load(output))) == ((1, 2) if suffix == ".zarr" else (0, 3))


def test_dataset_of_several_samples_is_no_recording(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("zarr")
    dataset = rc.dataset.make(scene, tmp_path / "set", count=2, workers=1, progress=False)
    assert main(["convert", str(tmp_path / "set"), str(tmp_path / "new")]) == 1
    assert "expected a recording, or a dataset of one sample, got 2 samples" in capsys.readouterr().err
    expected = dataset.sample(1).simulation().record(progress=False)
    assert_same(found := dataset.recording(1), replace(expected, source=found.source))


def test_frames_of_a_dataset_keep_the_unit_of_their_samples(tmp_path: Path) -> None:
    replace(recording(), source={"cube_unit": "counts"}).save(tmp_path / "rec")
    convert(tmp_path / "rec", tmp_path / "set.zarr")
    units = []

    def seen(frame: rc.Frame) -> np.ndarray:
        units.append(unit_of(frame))
        return frame.cube

    frames = list(rc.dataset.open_dataset(tmp_path / "set.zarr").frames(output=seen))
    assert units == ["counts"] * len(frames) == ["counts"] * 3
