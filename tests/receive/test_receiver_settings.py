"""Settings of receivers: errors, files, and defaults; any frame can be made again alone."""

from __future__ import annotations

import json
import pickle
import re
import warnings
from dataclasses import fields, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.receive.chain import receive
from radarcore.receive.noise import _EFFECTS, RandomStreams

ALL: dict[str, Any] = {
    "output": "iq",
    "noise_figure_db": 12.0,
    "phase_noise": ((100e3, -80.0), (1e6, -105.0)),
    "leakage": rc.Leakage(level_db=(-70.0, -80.0), delay=1e-10, step_db=-90.0),
    "rx_phase_deg": (0.0, -75.0),
    "high_pass": 80e3,
    "high_pass_order": 2,
    "low_pass": 500e3,
    "low_pass_order": 5,
    "iq_gain_db": 0.2,
    "iq_phase_deg": 1.0,
    "gain_db": 40.0,
    "full_scale": 1.0,
    "dc_offset": (0.01, -0.02),
    "adc_bits": 14,
    "adc_errors": rc.AdcErrors(
        noise_lsb=0.7, chirp_offset_lsb=0.5, segment_offset_lsb=0.5, odd_width=0.9, turn_on_db=10.0, turn_on_time=1e-6
    ),
}
RX = [[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]]
WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=32, num_chirps=4, chirp_interval=100e-6
)
SCENE = rc.Scene([rc.PointTarget([1.0, 0.2, 0.1], rcs=0.1, velocity=[0.5, 0.0, 0.0])])


def simulator(receiver: rc.Receiver | None, seed: int = 0) -> rc.Simulator:
    return rc.Simulator(SCENE, rc.Radar(WAVEFORM, rx=RX, receiver=receiver), resolution=8, seed=seed)


def test_all_settings_are_in_this_test() -> None:
    assert set(ALL) == {field.name for field in fields(rc.Receiver)}
    for name, value in ALL.items():
        if name != "output":
            assert getattr(rc.Receiver(), name) != value, name


@pytest.mark.parametrize("output", ["iq", "real"])
def test_any_frame_alone_is_that_of_a_recording_to_the_last_bit(output: str) -> None:
    own = {"iq_gain_db": None, "iq_phase_deg": None, "adc_bits": 12} if output == "real" else {}
    sim = simulator(rc.Receiver(**(ALL | {"output": output} | own)), seed=7)
    recording = sim.record(0.0, 0.1, rate=50.0, progress=False)
    again = pickle.loads(pickle.dumps(sim))
    for k in (4, 1, 3):
        np.testing.assert_array_equal(again.frame(float(recording.time[k])).cube, recording.cube[k])
    assert (recording.raw is not None) == (output == "real")
    assert recording.source.get("cube_unit") == ("full scale" if output == "real" else "parts of full scale")
    for other in (recording.cube[1], replace(sim, seed=8).frame(0.0).cube):
        assert (other != recording.cube[0]).mean() > 0.3  # some samples have the same code by chance


def test_effects_have_streams_of_their_own() -> None:
    number = 50_000
    numbers = [
        RandomStreams(seed, start).normal(effect, (number,))
        for effect, seed, start in product(_EFFECTS, (0, 1), (0.0, 0.1))
    ]
    correlation = np.corrcoef(numbers) - np.eye(len(numbers))
    assert abs(correlation).max() < 5.0 / np.sqrt(number)  # 378 pairs: 5 sigma


def test_noise_stays_the_same_as_other_effects_are_switched_on() -> None:
    noisy = rc.Receiver(noise_figure_db=12.0)
    zeros = np.zeros((2, 4, 32), np.complex64)

    def of(receiver: rc.Receiver) -> Any:
        return receive(zeros.copy(), rc.Radar(WAVEFORM, rx=RX, receiver=receiver), 0.5, seed=3)

    with_leakage, noise = of(replace(noisy, leakage=rc.Leakage(level_db=-160.0))), of(noisy)
    # Single precision rounds the sum by a unit in its last place.
    np.testing.assert_allclose(with_leakage - noise, 1e-8, rtol=0.0, atol=np.spacing(abs(noise).max()))


@pytest.mark.parametrize("output", ["iq", "real"])
def test_settings_that_do_nothing_change_no_bit(output: str) -> None:
    plain = rc.Receiver(output=output, noise_figure_db=12.0)
    expected = simulator(plain).frame().cube
    nothing = {"adc_errors": rc.AdcErrors(turn_on_time=1.0), "low_pass_order": 2, "high_pass_order": 3}
    for more in (nothing, {"gain_db": 0.0}, {"dc_offset": 0.0}):
        np.testing.assert_array_equal(simulator(replace(plain, **more)).frame().cube, expected)


def test_phases_of_receivers_turn_echoes_and_processing_can_know_them() -> None:
    turned = simulator(rc.Receiver(rx_phase_deg=[10.0, -75.0])).frame()
    straight = simulator(None).frame()
    phases = turned.radar.channel_phases
    np.testing.assert_allclose(phases, np.deg2rad([10.0, -75.0]))
    np.testing.assert_array_equal(straight.radar.channel_phases, [0.0, 0.0])
    back = turned.cube * np.exp(-1j * phases)[:, None, None]
    np.testing.assert_allclose(back, straight.cube, rtol=1e-5)


def test_receivers_survive_files_pickle_and_comparison(tmp_path: Path) -> None:
    radar = rc.Radar(WAVEFORM, rx=RX, receiver=rc.Receiver(**ALL))
    text = json.dumps(radar.to_dict())
    again = rc.Radar.from_dict(json.loads(text))
    assert again == radar
    assert hash(again.receiver) == hash(radar.receiver)
    assert pickle.loads(pickle.dumps(radar)) == radar
    for name, value in ALL.items():
        assert getattr(again.receiver, name) == value, name
        if name not in ("output", "noise_figure_db", "full_scale", "adc_bits"):
            default = next(field.default for field in fields(rc.Receiver) if field.name == name)
            assert replace(again.receiver, **{name: default}) != again.receiver
    recording = rc.Simulator(SCENE, radar, resolution=8).record(0.0, 0.02, progress=False, path=tmp_path / "r")
    assert rc.Recording.load(tmp_path / "r").radar == recording.radar == radar


@pytest.mark.parametrize(
    ("filters", "warning"),
    [
        ({"low_pass": 1e6}, None),
        (
            {"low_pass": 1.2e6},
            r"receiver\.low_pass: expected at most half the sample rate, 1e\+06 Hz, got 1\.2e\+06 Hz",
        ),
        ({"high_pass": 1.2e6}, r"receiver\.high_pass: expected at most half the sample rate"),
    ],
)
def test_filters_beyond_half_the_sample_rate_raise_a_warning(filters: dict[str, float], warning: str | None) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        rc.Simulator(SCENE, rc.Radar(WAVEFORM, rx=RX, receiver=rc.Receiver(**filters)), resolution=8).frame()
    assert len(caught) == (warning is not None)
    assert warning is None or re.search(warning, str(caught[0].message))


@pytest.mark.parametrize(
    ("settings", "warning"),
    [
        ({"gain_db": 35.0}, None),
        ({"gain_db": 70.0}, r"receiver\.full_scale: [\d.]+ % of the samples are beyond it and clip"),
        ({"gain_db": 120.0}, r"receiver\.full_scale: 100 % of the samples are beyond it and clip"),
        ({"gain_db": -5.0}, r"receiver\.adc_bits: the signal uses 2 of 256 codes"),
        ({"gain_db": -60.0}, r"receiver\.adc_bits: the signal uses 2 of 256 codes"),
        ({"gain_db": -60.0, "dc_offset": 0.1}, r"receiver\.adc_bits: the signal uses 1 of 256 codes"),
        ({"gain_db": 0.0, "adc_bits": 1}, None),
        ({"gain_db": 0.0, "adc_bits": None}, None),
    ],
)
def test_adc_that_clips_or_uses_two_codes_raises_one_warning(settings: dict[str, Any], warning: str | None) -> None:
    """An echo of 1 m^2 at 1 m: a tone of its amplitude has the same shares."""
    receiver = rc.Receiver(**({"output": "real", "full_scale": 0.1, "adc_bits": 8} | settings))
    scene = rc.Scene([rc.PointTarget([1.0, 0.0, 0.0])])
    ideal = rc.Simulator(scene, rc.Radar(WAVEFORM, receiver=rc.Receiver(output="real")), resolution=8).frame().cube
    sim = rc.Simulator(scene, rc.Radar(WAVEFORM, receiver=receiver), resolution=8)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        stats = sim.frame().stats
        sim.frame(0.1)
    tone = ideal * np.sqrt(100.0) * 10.0 ** (settings["gain_db"] / 20.0) / 0.1 + settings.get("dc_offset", 0.0)
    assert stats["clipped_share"] == np.mean(abs(tone) > 1.0)
    if receiver.adc_bits is not None:
        codes = np.rint(0.5 * (np.clip(tone, -1.0, 1.0) + 1.0) * (2**receiver.adc_bits - 1))
        assert stats["used_codes_share"] == (np.ptp(codes) + 1) / 2**receiver.adc_bits
    assert [re.search(str(warning), str(each.message)) is not None for each in caught] == [True] * (warning is not None)


@pytest.mark.parametrize(("output", "tolerance"), [("iq", 1e-3), ("real", 1e-8)])
@pytest.mark.parametrize(
    "changes",
    [
        {"num_samples": 1},
        {"num_chirps": 1},
        {"num_samples": 1, "num_chirps": 1},
        {"slope": -50e12},
        {"slope": 0.0, "sample_rate": 1e4},
        {"slope": 5e10},
        {"adc_delay": 5e-6},
        {"chirp_times": [0.0, 60e-6, 200e-6, 300e-6]},
    ],
    ids=str,
)
def test_all_effects_work_with_any_waveform_and_precision(
    output: str, tolerance: float, changes: dict[str, Any]
) -> None:
    basic = {"start_frequency": 60e9, "slope": 50e12, "sample_rate": 2e6, "num_samples": 32, "num_chirps": 4}
    waveform = rc.Waveform(**(basic | changes))
    settings = ALL | {"output": output}
    if output == "real":
        settings |= {"iq_gain_db": None, "iq_phase_deg": None}
    if waveform.slope == 0.0:
        settings |= {"high_pass": None, "low_pass": 4e3}
    radar = rc.Radar(waveform, rx=RX, receiver=rc.Receiver(**settings))
    scene = rc.Scene([rc.PointTarget([0.5, 0.0, 0.0])])
    cube = rc.Simulator(scene, radar, resolution=8, tolerance=tolerance).frame().cube
    assert cube.shape == (2, waveform.num_chirps, waveform.num_samples)
    assert cube.dtype.kind == {"iq": "c", "real": "f"}[output]
    assert cube.real.dtype == (np.float32 if tolerance == 1e-3 else np.float64)
    assert np.isfinite(cube).all()
    assert cube.base is None or cube.base.size <= 2 * cube.size
    assert abs(cube.real).max() <= 1.0


@pytest.mark.filterwarnings("ignore:receiver.full_scale")  # it clips, as the chip does
def test_depth_images_are_received_too() -> None:
    distance = np.full((16, 16), 0.5)
    radar = rc.bgt60tr13c(receiver="measured", num_chirps=4)
    frame, again = (rc.frame_from_depth(distance, 1.0, radar, camera=(40.0, 40.0)) for _ in range(2))
    assert frame.raw is not None
    assert frame.cube.shape == frame.raw.shape == (3, 4, 128)
    np.testing.assert_array_equal(again.raw, frame.raw)
