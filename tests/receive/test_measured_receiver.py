"""Presets: the chip's steps of gain and filters, and the levels of the measured chain against its recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from chip_settings import power_up
from radarcore.radar.bgt60_receiver import gain_stages, highpass_index

STEPS_DB = (18, 23, 28, 30, 33, 35, 38, 40, 43, 45, 48, 50, 55, 60)
LOWEST_OF_STEPS = (18, 21, 26, 29, 32, 34, 37, 39, 42, 44, 47, 49, 53, 58)
"""Smallest wanted gain of every step (SDK 3.6.4)."""


def measured(if_gain_db: int = 23, **settings: Any) -> rc.Radar:
    return power_up(receiver="measured", if_gain_db=if_gain_db, **settings)


def codes(radar: rc.Radar, num_frames: int, **changes: Any) -> NDArray[np.float64]:
    """Codes (frame, rx, chirp, sample) of an empty scene, with changes of the receiver."""
    assert radar.receiver is not None
    receiver = replace(radar.receiver, **changes)
    radar = rc.Radar(radar.waveform, tx=radar.tx, rx=radar.rx, tx_power_dbm=radar.tx_power_dbm, receiver=receiver)
    simulator = rc.Simulator(rc.Scene(), radar, resolution=8)
    frames = [simulator.frame(k * radar.waveform.frame_interval).raw for k in range(num_frames)]
    return np.array(frames, np.float64)


def test_gains_are_rounded_as_the_chip_rounds_them() -> None:
    for wanted in range(18, 61):
        expected = max(step for step, least in zip(STEPS_DB, LOWEST_OF_STEPS, strict=True) if least <= wanted)
        first, steps = gain_stages(wanted)
        assert first + 5 * steps == expected, wanted
        receiver = measured(wanted).receiver
        assert receiver is not None
        assert receiver.gain_db == 14.0 + expected
    for bad in (17, 61):
        with pytest.raises(ValueError, match="if_gain_db: expected at"):
            measured(bad)


def test_high_pass_is_the_nearest_of_four() -> None:
    for wanted, expected in ((0.0, 20e3), (32e3, 20e3), (33e3, 45e3), (60e3, 70e3), (76e3, 80e3), (1e6, 80e3)):
        receiver = measured(high_pass=wanted).receiver
        assert receiver is not None
        assert receiver.high_pass == expected
        assert (20e3, 45e3, 70e3, 80e3)[highpass_index(wanted)] == expected


def test_default_receiver_has_thermal_noise_alone_and_others_can_be_given() -> None:
    assert rc.bgt60tr13c().receiver == rc.Receiver(output="real", noise_figure_db=12.0)
    assert rc.bgt60tr13c(receiver="thermal") == rc.bgt60tr13c()
    assert rc.bgt60tr13c(receiver=rc.Receiver()).receiver == rc.Receiver()
    for settings in ({"receiver": "real"}, {"receiver": None}, {"if_gain_db": 30}, {"high_pass": 80e3}):
        name = next(iter(settings))
        with pytest.raises(ValueError, match=f"{name}: expected"):
            rc.bgt60tr13c(**settings)


@pytest.mark.parametrize(("gain_db", "before"), [(23, 0.56), (50, 7.3), (55, 12.98)])
def test_noise_before_the_low_pass_is_that_of_the_recordings(gain_db: int, before: float) -> None:
    quiet = {"leakage": None, "adc_errors": rc.AdcErrors(noise_lsb=0.9), "dc_offset": None}
    raw = codes(measured(gain_db), 4, low_pass=None, **quiet)
    # Noise, the ADC's floor of 0.9, and rounding; 5e4 samples: 4 / sqrt(1e5) = 1.3 %.
    assert raw.std() == pytest.approx(np.sqrt(before**2 + 0.81 + 1.0 / 12.0), rel=0.014)


def test_start_of_chirps_is_kicked_as_in_the_recordings() -> None:
    radar = measured(50)
    assert radar.receiver is not None
    errors = replace(radar.receiver.adc_errors, segment_offset_lsb=None, chirp_offset_lsb=None)
    raw = codes(radar, 8, low_pass=None, leakage=None, adc_errors=errors)
    raw -= raw.mean(axis=(0, 2, 3), keepdims=True)
    found = raw.std(axis=(0, 1, 2))[:8]
    # 18 at the first sample, gone after 4, beside noise of 7.3: 1536 draws, 4 / sqrt(3072) = 7 %.
    expected = np.sqrt(7.3**2 + 0.81 + (18.0 * np.exp(-np.arange(8) / 1.5)) ** 2)
    np.testing.assert_allclose(found, expected, rtol=0.075)


def test_leakage_has_the_range_profile_of_a_recording() -> None:
    """Within 2 dB in every one of the first ten bins where leakage is what was recorded.

    The figures come from the mean chirp of a public recording (58 to 63.5 GHz, 64 samples, 23 dB), less its mean,
    in dB over 1 LSB, no window. RX1 and RX2 are leakage in all ten. The ramp of RX3 ends where it begins: from bin 3
    on there is less of it than of the room, whose first echoes stand in bins 10 to 13 with 51 dB.
    """
    recorded = {
        0: [83.8, 72.7, 70.2, 65.6, 63.1, 61.0, 59.2, 57.7, 56.5],
        1: [76.0, 68.1, 67.7, 62.0, 60.1, 57.5, 55.8, 54.4, 52.9],
        2: [69.6, 54.1],
    }
    sweep = {"slope": 156.64e12, "stop_frequency": None}
    mean = codes(measured(num_chirps=8, **sweep), 20).mean(axis=(0, 2))
    # Bin 0 without a window is the operating point.
    np.testing.assert_allclose(mean.mean(axis=1), [1581.0, 1967.0, 2064.0], atol=5.0)
    spectrum = 20.0 * np.log10(abs(np.fft.rfft(mean - mean.mean(axis=1, keepdims=True)))[:, 1:10])
    for rx, levels in recorded.items():
        np.testing.assert_allclose(spectrum[rx, : len(levels)], levels, atol=2.0, err_msg=f"RX{rx + 1}")
    # With a Hann window, bins 0 to 4: the residual ends of the ramp no longer cover the tones.
    hann = np.fft.rfft((mean - mean.mean(axis=1, keepdims=True)) * np.hanning(65)[:-1])
    expected = [[73.7, 76.5, 68.0, 51.8, 46.6], [67.0, 68.3, 57.8, 54.3, 47.3], [56.7, 63.9, 59.1, 46.6, 38.1]]
    np.testing.assert_allclose(20.0 * np.log10(abs(hann[:, :5])), expected, atol=2.0)


@pytest.mark.parametrize(("gain_db", "recorded"), [(23, 1.1), (50, 5.5), (55, 9.8)])
def test_noise_from_chirp_to_chirp_follows_the_gain_as_in_the_recordings(gain_db: int, recorded: float) -> None:
    """1.1, 5.5 and 9.8 codes: 7.3 at 50 dB, reduced to 0.73 by the low-pass, beside the ADC's own 0.9.

    With the offset of each chirp taken out, which 23 dB hardly exceeds; the kick at the start of chirps is part of it.
    """
    narrow = {"start_frequency": 60e9, "stop_frequency": 61e9, "num_samples": 128}
    raw = codes(measured(gain_db, num_chirps=32, **narrow), 4)
    change = np.diff(raw, axis=2) / np.sqrt(2.0)
    offset = change[..., 8:].mean(axis=-1, keepdims=True) if gain_db == 23 else 0.0
    np.testing.assert_allclose((change - offset).std(axis=(0, 2, 3)), recorded, rtol=0.1)


def test_phase_noise_is_far_below_a_tenth_of_a_degree_at_short_range() -> None:
    receiver = measured().receiver
    assert receiver is not None
    scene = rc.Scene([rc.PointTarget([0.3, 0.0, 0.0])])
    quiet = rc.Simulator(scene, power_up(receiver=rc.Receiver()), resolution=8).frame().cube
    noisy = power_up(receiver=rc.Receiver(phase_noise=receiver.phase_noise))
    turn = np.angle(rc.Simulator(scene, noisy, resolution=8).frame().cube / quiet)
    assert 0.0 < np.rad2deg(turn.std()) < 0.1


def test_bgt60tr24_has_two_transmitters_and_a_square_of_receivers() -> None:
    radar = rc.bgt60tr24(num_chirps=32)
    assert (len(radar.tx), len(radar.rx), radar.num_channels) == (2, 4, 8)
    assert radar.waveform.num_chirps == 32
    assert radar.is_real
    np.testing.assert_allclose(np.ptp(radar.rx, axis=0), [0.0, 3.5e-3, 3.5e-3])
    # The channels fill a grid of four by two with a spacing of 3.5 mm.
    places = {tuple(row) for row in np.round(radar.virtual_array[:, 1:] / 3.5e-3, 6).tolist()}
    assert places == {(y, z) for y in (-1.5, -0.5, 0.5, 1.5) for z in (-0.5, 0.5)}
    assert rc.bgt60tr24(receiver=rc.Receiver()).receiver == rc.Receiver()
    with pytest.raises(TypeError, match=r"bgt60tr24: unknown keyword 'num_chirp'; did you mean 'num_chirps'"):
        rc.bgt60tr24(num_chirp=3)


@pytest.mark.filterwarnings("ignore:receiver.full_scale")  # it clips, as the chip does
@pytest.mark.parametrize(
    ("schedule", "num_channels"),
    [(None, 8), (rc.Schedule.tdm(), 8), (rc.Schedule.ddm(), 4), (rc.Schedule.steered(azimuth=0.2), 4)],
)
def test_bgt60tr24_has_the_measured_chain_with_any_schedule(schedule: rc.Schedule | None, num_channels: int) -> None:
    radar = rc.bgt60tr24(receiver="measured", if_gain_db=33, schedule=schedule)
    receiver, chain = radar.receiver, rc.bgt60tr13c(receiver="measured", if_gain_db=33).receiver
    assert receiver is not None
    assert chain is not None
    assert (receiver.gain_db, receiver.noise_figure_db) == (chain.gain_db, chain.noise_figure_db)
    assert not radar.channel_phases.any()
    scene = rc.Scene([rc.PointTarget([0.5, 0.1, 0.0], rcs=0.05, velocity=[0.5, 0.0, 0.0])])
    recording = rc.Simulator(scene, radar, resolution=8).record(0.0, 0.05, progress=False)
    assert recording.raw is not None
    assert recording.raw.shape == (2, num_channels, 16, 64)
    np.testing.assert_array_equal(recording.cube[1], rc.Simulator(scene, radar, resolution=8).frame(0.025).cube)
    with pytest.raises(ValueError, match="if_gain_db: expected None unless receiver is 'measured', got 33"):
        rc.bgt60tr24(if_gain_db=33)


SCENE_FILE = """\
[radar]
preset = "bgt60tr13c"
measured_receiver = true
if_gain_db = 33

[[point]]
position = [1.0, 0.0, 0.0]

[run]
stop = 0.1
"""


def test_scene_files_have_the_receiver(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE_FILE)
    assert rc.load_scene(path).radar == rc.bgt60tr13c(receiver="measured", if_gain_db=33)
    own = "receiver = { phase_noise = [[1e5, -80.0]], leakage = { level_db = [-3, -4, -5] } }\n"
    path.write_text(SCENE_FILE.replace("measured_receiver = true\nif_gain_db = 33\n", own))
    expected = rc.Receiver(phase_noise=((1e5, -80.0),), leakage=rc.Leakage(level_db=(-3.0, -4.0, -5.0)))
    assert rc.load_scene(path).radar.receiver == expected
    path.write_text(SCENE_FILE.replace("bgt60tr13c", "bgt60tr24").replace("= 33", '= 33\nschedule = { kind = "tdm" }'))
    expected = rc.bgt60tr24(receiver="measured", if_gain_db=33, schedule=rc.Schedule.tdm())
    assert rc.load_scene(path).radar == expected


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("measured_receiver = true\n", "", "if_gain_db: expected none unless measured_receiver is true, got 33"),
        (
            'preset = "bgt60tr13c"',
            "start_frequency = 60e9\nstop_frequency = 61e9\nsample_rate = 2e6\nnum_samples = 64",
            "measured_receiver: expected false without a preset",
        ),
        (
            "if_gain_db = 33",
            "receiver = { low_pass = 5e5 }",
            "measured_receiver: expected false where there is a table",
        ),
        ("if_gain_db = 33", "if_gain_db = 70", "if_gain_db: expected at most 60, got 70"),
    ],
)
def test_scene_files_that_contradict_themselves_are_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE_FILE.replace(old, new))
    with pytest.raises(ValueError, match=f"radar: {message}"):
        rc.load_scene(path)
