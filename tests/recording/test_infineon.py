"""Recording folders of Infineon's tools: read and written."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chip_settings import power_up
from full_disk import largest_file
from infineon_folders import FOLDER, OLD_NAMES, SENSOR, SHAPE, array, config, folder, saved, some_codes, text
from radarcore.processing.spectra.spectra import range_profile
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Truth, to_codes, to_samples
from radarcore.recording.recording import Recording
from recordings import real_recording

FULL_SCALE = {"cube_unit": "full scale"}


def contents(path: Path) -> dict[str, bytes]:
    return {str(file.relative_to(path)): file.read_bytes() for file in path.rglob("*") if file.is_file()}


# Reading.


def test_recording_has_samples_radar_and_times(tmp_path: Path) -> None:
    rec = Recording.load(folder(tmp_path / "rec"))
    assert rec.cube.dtype == np.float32
    np.testing.assert_array_equal(rec.cube, to_samples(some_codes()))
    np.testing.assert_array_equal(rec.time, 0.07726884633302689 * np.arange(5))
    assert rec.truth is None
    assert rec.lost is None
    assert rec.source["cube_unit"] == "full scale"
    wf = rec.radar.waveform
    assert wf.slope == pytest.approx(5.5e9 / (16 / 2e6 + 3.1125e-6), rel=1e-12)
    assert (wf.start_frequency, wf.adc_delay, wf.chirp_interval) == (58e9, 3.1125e-6, 0.0005911249900236726)
    assert wf.start_frequency + wf.slope * (wf.sample_times[-1] + 0.5e-6) == pytest.approx(63.5e9, rel=1e-12)
    assert rec.radar.is_real
    np.testing.assert_array_equal(rec.radar.rx, bgt60tr13c().rx)


def test_folder_of_the_sensor_is_the_recording_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder(tmp_path / "rec")
    inner = Recording.load(path / FOLDER)
    assert inner.source == Recording.load(path).source
    monkeypatch.chdir(path / FOLDER)
    assert Recording.load(".").source == inner.source
    # Taken out of its place and renamed, it knows nothing of what is around it.
    shutil.copytree(path / FOLDER, tmp_path / "alone")
    (tmp_path / "meta.json").write_text("something else")
    alone = Recording.load(tmp_path / "alone")
    np.testing.assert_array_equal(alone.cube, inner.cube)
    assert "something else" not in str(alone.source)


@pytest.mark.parametrize(
    ("settings", "rows"),
    [
        (config(rx_antennas=[1, 3]), [0, 2]),
        (config(rx_antennas=[2]), [1]),
        (config(rx_antennas=[3, 1]), [0, 2]),
        (text(OLD_NAMES), [0, 2]),
    ],
)
def test_some_receivers_have_their_places(tmp_path: Path, settings: bytes, rows: list[int]) -> None:
    codes = some_codes(2, (len(rows), 4, 16))
    path = folder(tmp_path / "rec", config_json=settings, radar_npy=array(codes))
    np.testing.assert_array_equal(Recording.load(path).radar.rx, bgt60tr13c().rx[rows])


def test_recorder_that_was_killed_leaves_its_whole_frames(tmp_path: Path) -> None:
    whole = array(some_codes())
    frame = 3 * 4 * 16 * 2
    for num_bytes, num_frames in ((1024 + 4 * frame + 7, 4), (1024 + 1, 0)):
        path = folder(tmp_path / str(num_bytes), radar_npy=whole[:num_bytes])
        with pytest.warns(UserWarning, match=f"{num_bytes}: {num_frames} of 5 planned frames, its writer") as caught:
            rec = Recording.load(path)
        assert caught[0].filename == __file__
        np.testing.assert_array_equal(rec.raw, some_codes()[:num_frames])
    # A header that was not put right at the end.
    late = whole.replace(b"(5, 3, 4, 16)", b"(0, 3, 4, 16)")
    with pytest.warns(UserWarning, match="late: 5 frames, its writer was interrupted"):
        rec = Recording.load(folder(tmp_path / "late", radar_npy=late))
    np.testing.assert_array_equal(rec.raw, some_codes())


def test_sensor_of_another_kind_is_warned_of(tmp_path: Path) -> None:
    path = folder(tmp_path / "rec", meta_json=text(SENSOR | {"description": "BGT60UTR11AIP"}))
    with pytest.warns(UserWarning, match="the sensor is 'BGT60UTR11AIP'; its antennas") as caught:
        Recording.load(path)
    assert caught[0].filename == __file__


def scene_config(name: str) -> bytes:
    return text({"device_config": {name: {}}})


def without(key: str) -> bytes:
    return text({"device_config": {"fmcw_single_shape": {k: v for k, v in SHAPE.items() if k != key}}})


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"config_json": None}, f"rec/{FOLDER}: expected a recording, got one without config.json"),
        ({"config_json": b"{\n  'a'"}, r"config\.json: .*: line 2 "),
        ({"config_json": b"[" * 100_000}, r"config\.json: "),
        ({"config_json": b"{}"}, "expected a device_config of 'fmcw_single_shape', got none"),
        ({"config_json": scene_config("fmcw_scene")}, "of 'fmcw_single_shape', got 'fmcw_scene'"),
        ({"config_json": without("start_frequency_Hz")}, "expected the key 'start_frequency_Hz', got none"),
        ({"config_json": config(sample_rate_Hz="fast")}, r"config\.json: sample_rate_Hz: .*, got 'fast'"),
        ({"config_json": config(sample_rate_Hz=10**400)}, r"config\.json: "),
        ({"config_json": config(rx_antennas=[1, 4])}, r"rx_antennas: .*got \[1, 4\]"),
        ({"config_json": config(mimo_mode="tdm")}, "mimo_mode: expected 'off', got 'tdm'"),
        ({"config_json": config(num_chirps_per_frame=64)}, r"\(n, 3, 64, 16\) by its config\.json, got"),
        ({"meta_json": b"{"}, rf"{FOLDER}/meta\.json: .*: line 1"),
        ({"meta_json": text({"adc_resolution": 10})}, "expected an adc_resolution of 12 bits, got 10"),
        ({"format_version": b"2.0.0\n"}, r"format\.version: expected version 1, got '2.0.0'"),
        ({"radar_npy": array(some_codes())[:500]}, r"radar\.npy: damaged or not an NPY file"),
        ({"radar_npy": saved(to_samples(some_codes()))}, r"radar\.npy: expected uint16, got float32"),
        ({"radar_npy": saved(np.asfortranarray(some_codes()))}, "in Fortran order"),
        ({"radar_npy": array(some_codes() | 4096)}, "from frame 0: codes: expected 0 to 4095, got 8180"),
    ],
)
def test_what_is_damaged_is_refused_by_name(tmp_path: Path, files: Any, message: str) -> None:
    path = folder(tmp_path / "rec", **files)
    with pytest.raises(ValueError, match=message) as error:
        Recording.load(path).cube  # noqa: B018  # codes are read when they are used
    assert str(path) in str(error.value)


# Writing what was read.

WRITTEN_AGAIN: dict[str, dict[str, bytes | None]] = {
    "as the recorder writes": {},
    "unknown key": {"config_json": config(vendor_key="stays")},
    "no frames": {"radar_npy": array(some_codes(0))},
    "one receiver": {"config_json": config(rx_antennas=[2]), "radar_npy": array(some_codes(3, (1, 4, 16)))},
    "one chirp": {"config_json": config(num_chirps_per_frame=1), "radar_npy": array(some_codes(3, (3, 1, 16)))},
}


@pytest.mark.filterwarnings("ignore:.*a recording without frames")
@pytest.mark.parametrize("files", WRITTEN_AGAIN.values(), ids=WRITTEN_AGAIN)
def test_loaded_recording_is_written_to_the_last_byte(tmp_path: Path, files: dict[str, bytes | None]) -> None:
    path = folder(tmp_path / "rec", **files)
    Recording.load(path).save(tmp_path / "again", format="infineon")
    assert contents(tmp_path / "again") == contents(path)
    # Also by way of the other formats.
    for other in ("own", "own.npz"):
        Recording.load(path).save(tmp_path / other)
        Recording.load(tmp_path / other).save(tmp_path / f"by {other}", format="infineon")
        assert contents(tmp_path / f"by {other}") == contents(path)
    # And in its own place.
    before = contents(path)
    Recording.load(path).save(path, format="infineon", overwrite=True)
    assert contents(path) == before


def test_fewer_frames_get_a_header_that_fits(tmp_path: Path) -> None:
    path = folder(tmp_path / "rec", radar_npy=saved(some_codes()))
    rec = Recording.load(path)
    rec[1:3].save(tmp_path / "some", format="infineon")
    assert (tmp_path / "some" / FOLDER / "radar.npy").read_bytes() == array(some_codes()[1:3])
    assert (tmp_path / "some" / FOLDER / "config.json").read_bytes() == config()


def test_settings_that_do_not_fit_a_changed_radar_are_made_anew(tmp_path: Path) -> None:
    given = config(num_chirps_per_frame=4, vendor_key="stays")
    rec = Recording.load(folder(tmp_path / "rec", config_json=given))
    waveform = rec.radar.waveform.replace(num_chirps=2, frame_interval=0.2, chirp_interval=1e-3)
    slower = Radar(waveform, tx=rec.radar.tx, rx=rec.radar.rx[:2], receiver=rec.radar.receiver)
    changed = Recording(rec.cube[:, :2, :2], 0.2 * np.arange(5), slower, None, rec.source)
    changed.save(tmp_path / "new", format="infineon")
    times = {"chirp_repetition_time_s": 1e-3, "frame_repetition_time_s": 0.2}
    expected = config(num_chirps_per_frame=2, rx_antennas=[1, 2], vendor_key="stays", **times)
    assert (tmp_path / "new" / FOLDER / "config.json").read_bytes() == expected
    assert (tmp_path / "new" / FOLDER / "meta.json").read_bytes() == text(SENSOR)
    again = Recording.load(tmp_path / "new")
    assert again.radar.waveform == slower.waveform
    np.testing.assert_array_equal(again.raw, some_codes()[:, :2, :2])
    assert rec.source == Recording.load(tmp_path / "rec").source  # the loaded one is as it was


def test_positions_from_a_calibration_leave_the_texts_as_they_are(tmp_path: Path) -> None:
    path = folder(tmp_path / "rec")
    rec = Recording.load(path)
    moved = replace(rec.radar, rx=rec.radar.rx + 1e-4)
    replace(rec, radar=moved).save(tmp_path / "again", format="infineon")
    assert contents(tmp_path / "again") == contents(path)


def test_source_that_was_tampered_with_writes_nowhere_else(tmp_path: Path) -> None:
    rec = Recording.load(folder(tmp_path / "rec"))
    kept = rec.source["infineon"]
    for changes in (
        {"folder": "../out"},
        {"folder": 7},
        {"rx_antennas": "x"},
    ):
        place = tmp_path / "place" / "again"
        replace(rec, source=rec.source | {"infineon": kept | changes}).save(place, format="infineon")
        np.testing.assert_array_equal(Recording.load(place).raw, some_codes())
        assert [file.name for file in place.parent.iterdir()] == ["again"]
        shutil.rmtree(place)
    replace(rec, source=rec.source | {"infineon": []}).save(tmp_path / "x", "infineon")


# Writing what comes from elsewhere.


def full_scale(num_frames: int = 3, radar: Radar | None = None, **source: Any) -> Recording:
    radar = power_up(num_samples=16, num_chirps=4) if radar is None else radar
    wf = radar.waveform
    shape = (num_frames, radar.num_channels, wf.num_chirps, wf.num_samples)
    cube = np.random.default_rng(1).uniform(-1.0, 1.0, shape).astype(np.float32)
    return Recording(cube, wf.frame_interval * np.arange(num_frames), radar, None, FULL_SCALE | source)


def test_samples_in_full_scale_become_a_recording_of_the_vendor(tmp_path: Path) -> None:
    rec = full_scale(infineon={"if_gain_dB": 50, "firmware_version": "2.5.0", "hostname": "lab"})
    rec.save(tmp_path / "deep" / "rec", format="infineon")
    files = contents(tmp_path / "deep" / "rec")
    assert sorted(files) == sorted(
        ["meta.json", *(f"{FOLDER}/{name}" for name in ("config.json", "format.version", "meta.json", "radar.npy"))]
    )
    expected = config(if_gain_dB=50, chirp_repetition_time_s=591.125e-6, frame_repetition_time_s=77.26885e-3)
    assert files[f"{FOLDER}/config.json"] == expected
    assert files[f"{FOLDER}/format.version"] == b"1.0.0\n"
    assert files[f"{FOLDER}/radar.npy"] == array(to_codes(rec.cube))
    sensor = json.loads(files[f"{FOLDER}/meta.json"])
    assert sensor["adc_resolution"] == 12
    assert sensor["firmware_version"] == "2.5.0"
    place = json.loads(files["meta.json"])
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+-]\d{4}", place["date_captured"])
    assert place["hostname"] == "lab"
    assert all(isinstance(value, str) for value in place.values())

    again = Recording.load(tmp_path / "deep" / "rec")
    assert again.radar == rec.radar
    np.testing.assert_array_equal(again.raw, rec.raw)
    np.testing.assert_allclose(again.cube, rec.cube, atol=1.0001 / 4095)  # half a code
    np.testing.assert_array_equal(again.time, rec.time)


def test_achieved_rate_and_down_chirp_come_back(tmp_path: Path) -> None:
    radar = bgt60tr13c(start_frequency=61.2e9, stop_frequency=60.5e9, sample_rate=80e6 / 133, num_samples=16)
    full_scale(1, radar).save(tmp_path / "rec", format="infineon")
    again = Recording.load(tmp_path / "rec").radar.waveform
    assert again.sample_rate == radar.waveform.sample_rate
    assert again.slope == pytest.approx(radar.waveform.slope, rel=1e-12)


def test_simulated_samples_in_watts_are_refused_with_what_is_missing(tmp_path: Path) -> None:
    rec = full_scale()
    with pytest.raises(ValueError, match=r"expected real samples in full scale.*got float32 in sqrt\(W\).*an ADC"):
        replace(rec, source={}).save(tmp_path / "rec", format="infineon")
    with pytest.raises(ValueError, match="got complex64 in full scale"):
        replace(rec, cube=rec.cube.astype(np.complex64)).save(tmp_path / "rec", format="infineon")
    assert not (tmp_path / "rec").exists()


WAVEFORM = Waveform(
    start_frequency=60e9, slope=1e14, sample_rate=2e6, num_samples=16, num_chirps=4, adc_delay=3.1125e-6
)
RX = bgt60tr13c().rx


@pytest.mark.parametrize(
    ("radar", "message"),
    [
        (Radar(WAVEFORM.replace(adc_delay=0.0), rx=RX), "expected an adc_delay of 3.1125e-06 s.*got 0"),
        (Radar(WAVEFORM, tx=np.zeros((2, 3)), rx=RX), "expected one transmitter.*got 2"),
        (Radar(WAVEFORM.replace(chirp_times=[0.0, 1e-4, 3e-4, 4e-4]), rx=RX), "chirps at equal intervals"),
        (Radar(WAVEFORM.replace(chirp_times=[1e-4, 2e-4, 3e-4, 4e-4]), rx=RX), "from the start of the frame"),
        (Radar(WAVEFORM, rx=[[0.0, 0.01, 0.0]]), r"expected receivers of a BGT60TR13C.*got \[\[0.0, 0.01, 0.0\]\]"),
        (Radar(WAVEFORM, rx=RX[::-1]), "expected receivers of a BGT60TR13C in their order"),
        (Radar(WAVEFORM, rx=RX[[0, 0]]), "expected receivers of a BGT60TR13C in their order"),
    ],
)
def test_radar_that_the_layout_cannot_describe_is_refused(tmp_path: Path, radar: Radar, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        full_scale(1, radar).save(tmp_path / "rec", format="infineon")
    assert not (tmp_path / "rec").exists()


@pytest.mark.parametrize(
    ("value", "message"), [(1.5, "samples from -1 to 1, got 1.5 from frame 64 on"), (np.nan, "NaN")]
)
def test_samples_that_have_no_code_are_refused_and_leave_nothing(tmp_path: Path, value: float, message: str) -> None:
    rec = full_scale(70)
    rec.cube[69, 0, 0, 0] = value
    with pytest.raises(ValueError, match=message):
        rec.save(tmp_path / "rec", format="infineon")
    assert not (tmp_path / "rec").exists()


def test_what_the_layout_has_no_place_for_is_warned_of(tmp_path: Path) -> None:
    rec = full_scale()
    truth = Truth(("arm",), *np.zeros((4, 3, 1)))
    lossy = replace(rec, time=np.array([5.0, 5.1, 9.0]), truth=truth, lost=np.array([0, 0, 40]))
    with pytest.warns(UserWarning, match="has no truth, no lost frames, no times of frames") as caught:
        lossy.save(tmp_path / "rec", format="infineon")
    assert caught[0].filename == __file__
    replace(rec, time=rec.time + 1.7e9, lost=np.array([0, 0, 0])).save(tmp_path / "later", format="infineon")


@pytest.mark.parametrize(
    ("prepare", "message"),
    [
        (lambda path: full_scale().save(path), "not empty and no recording of RadarIfxAvian_00"),
        (lambda path: (path / "RadarIfxAvian_01").mkdir(parents=True), "no recording of RadarIfxAvian_00"),
    ],
)
def test_what_is_no_such_recording_is_never_overwritten(tmp_path: Path, prepare: Any, message: str) -> None:
    prepare(tmp_path / "rec")
    before = contents(tmp_path)
    with pytest.raises(FileExistsError, match=message):
        full_scale().save(tmp_path / "rec", format="infineon", overwrite=True)
    assert contents(tmp_path) == before


def test_recording_is_replaced_only_when_asked_and_other_files_stay(tmp_path: Path) -> None:
    path = folder(tmp_path / "rec")
    (path / "notes.txt").write_text("precious")
    before = contents(path)
    other = Recording.load(folder(tmp_path / "other", config_json=config(if_gain_dB=60)))
    with pytest.raises(FileExistsError, match=r"overwrite=True replaces it.*rec"):
        other.save(path, format="infineon")
    assert contents(path) == before
    other.save(path, format="infineon", overwrite=True)
    assert contents(path) == contents(tmp_path / "other") | {"notes.txt": b"precious"}
    # The other format does not write over it either.
    with pytest.raises(FileExistsError, match="not empty and no recording"):
        full_scale().save(path, overwrite=True)


@pytest.mark.parametrize("is_there", [True, False])
def test_full_disk_leaves_what_was_there(tmp_path: Path, is_there: bool) -> None:
    rec, place = Recording.load(folder(tmp_path / "rec")), tmp_path / "place"
    place.mkdir()
    if is_there:
        folder(place / "again", config_json=config(if_gain_dB=60))
    before = contents(place)
    # Room for texts and the header.
    with pytest.raises(OSError, match=rf"Errno 27.*{FOLDER}/radar\.npy'"), largest_file(1500):
        rec.save(place / "again", format="infineon", overwrite=True)
    assert contents(place) == before
    assert (place / "again").exists() == is_there


# A real one, where there is one.


@pytest.fixture(scope="module")
def real() -> Path:
    return real_recording()


def test_real_recording_is_written_to_the_last_byte(real: Path, tmp_path: Path) -> None:
    Recording.load(real).save(tmp_path / "again", format="infineon")
    assert contents(tmp_path / "again") == contents(real)


def test_real_recording_has_its_settings_and_shows_what_moves(real: Path) -> None:
    """Mean codes of the receivers, and the range bins of the person, are as published."""
    rec = Recording.load(real)
    assert rec.cube.shape == (256, 3, 8, 64)
    assert rec.raw is not None
    np.testing.assert_allclose(rec.raw.mean(axis=(0, 2, 3)), [1581.0, 1967.0, 2064.0], atol=1.0)
    expected = power_up(num_chirps=8, chirp_interval=0.0005911249900236726, frame_interval=0.07726884633302689)
    assert rec.radar.waveform == expected.waveform
    profiles = range_profile(rec.cube.mean(axis=2), rec.radar.waveform, num_bins=256)  # (frame, channel, range)
    moving = (np.abs(profiles - profiles.mean(axis=0)) ** 2).sum(axis=(0, 1))
    assert 40 <= np.argmax(moving) <= 60
