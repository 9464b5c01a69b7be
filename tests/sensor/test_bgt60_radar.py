"""Radars as settings of the BGT60TR13C, and its settings as radars."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import radarcore as rc
from chip_settings import CLOCK, V1, image, legal_settings, power_up
from radarcore.sensor.bgt60.settings import Settings, achieved, registers_of


def test_radar_at_power_up_has_the_default_settings() -> None:
    default = Settings.from_radar(power_up())
    assert registers_of(default, 6144) == image(V1)
    assert default.start_frequency == pytest.approx(58e9, abs=1.0)
    assert default.end_frequency == pytest.approx(63.5e9, abs=1.0)


def test_options_of_the_chip_are_passed_on() -> None:
    options = {"tx_power_level": 7, "if_gain_db": 40, "highpass_cutoff": 45e3}
    passed = Settings.from_radar(power_up(), **options)
    assert {name: getattr(passed, name) for name in options} == options


def test_settings_become_the_radar_at_power_up() -> None:
    radar = achieved(Settings()).to_radar()
    preset = power_up()
    assert (radar.tx.tolist(), radar.rx.tolist()) == (preset.tx.tolist(), preset.rx.tolist())
    assert (radar.pattern, radar.receiver, radar.tx_power_dbm) == (preset.pattern, preset.receiver, 4.0)
    waveform = radar.waveform
    assert waveform.start_frequency == 58e9
    assert waveform.slope == pytest.approx(3208 * 640e6 / 2**20 * CLOCK, rel=1e-12)  # 156.64 MHz/us
    assert (waveform.sample_rate, waveform.num_samples, waveform.num_chirps) == (2e6, 64, 64)
    assert (waveform.chirp_interval, waveform.frame_interval) == (591.125e-6, 77.2434e-3)
    assert waveform.adc_delay == 3.1125e-6
    # The first sample is taken at 58.487544 GHz.
    assert waveform.start_frequency + waveform.slope * waveform.adc_delay == pytest.approx(58.487544e9, abs=500.0)
    # Effective bandwidth: B Ts / (Ts + 3.1125 us).
    width = achieved(Settings()).end_frequency - 58e9
    assert waveform.bandwidth == pytest.approx(width * 32.0 / 35.1125, rel=1e-12)


@pytest.mark.parametrize("rate", [2e6, 2.33e6, 601504.0])
@pytest.mark.parametrize("adc_delay", [0.0, 3.1125e-6, 9e-6])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_sampled_band_is_that_of_the_waveform(rate: float, adc_delay: float, sign: float) -> None:
    wanted = rc.Waveform(
        start_frequency=60.5e9,
        slope=sign * 30e12 * rate / 2e6,
        sample_rate=rate,
        num_samples=100,
        num_chirps=4,
        chirp_interval=1e-3,
        frame_interval=0.1,
        adc_delay=adc_delay,
    )
    radar = achieved(Settings.from_radar(rc.Radar(wanted))).to_radar()
    found = radar.waveform

    def band(waveform: rc.Waveform) -> tuple[float, float]:
        first = waveform.start_frequency + waveform.slope * waveform.adc_delay
        return first, first + waveform.slope * waveform.num_samples / waveform.sample_rate

    # kHz of the start, and half a step of the slope over the sweep of 253 to 13549 cycles.
    half_step = 0.5 * 640e6 / 2**20 * (249 + 100 * CLOCK / rate)
    assert band(found) == pytest.approx(band(wanted), abs=1620.0 + half_step * 1.05)
    assert np.sign(found.slope) == sign
    assert radar.rx.tolist() == [[0.0, 0.0, 0.0]]  # at the place of RX3


def radars() -> st.SearchStrategy[rc.Radar]:
    return legal_settings().filter(lambda s: abs(s.end_frequency - s.start_frequency) > 100e6).map(Settings.to_radar)


@settings(deadline=None)
@given(radar=radars())
def test_radar_of_a_radar_is_a_fixed_point(radar: rc.Radar) -> None:
    once = achieved(Settings.from_radar(radar)).to_radar()
    twice = achieved(Settings.from_radar(once)).to_radar()
    for name in ("start_frequency", "slope", "sample_rate", "num_samples", "num_chirps", "adc_delay"):
        assert getattr(once.waveform, name) == getattr(twice.waveform, name)
    for name in ("chirp_interval", "frame_interval"):
        assert getattr(twice.waveform, name) == pytest.approx(getattr(once.waveform, name), rel=2.0**-23)
    assert (once.rx == twice.rx).all()
    # The chip's steps: rounding to kHz and PLL steps at both ends of the sweep, and half a step of the slope; timers.
    wanted, found = radar.waveform, once.waveform
    sweep = wanted.adc_delay + wanted.num_samples / wanted.sample_rate
    assert abs(found.slope - wanted.slope) <= 1620.0 / sweep + 0.5001 * CLOCK * 640e6 / 2**20
    assert found.sample_rate == pytest.approx(wanted.sample_rate, rel=1e-12)
    assert found.frame_interval == pytest.approx(wanted.frame_interval, rel=0.004, abs=7 / CLOCK)
    assert np.array_equal(once.rx, radar.rx)


@pytest.mark.parametrize("mask", range(1, 8))
def test_receivers_are_known_by_their_places(mask: int) -> None:
    preset = power_up()
    rows = preset.rx[[i for i in range(3) if mask >> i & 1]]
    radar = rc.Radar(preset.waveform, rx=rows + 0.9e-4)
    found = Settings.from_radar(radar)
    assert found.rx_mask == mask
    assert found.to_radar().rx.tolist() == rows.tolist()
    assert found.frame_size == len(rows) * 64 * 64


def test_three_receivers_anywhere_are_all_of_them() -> None:
    waveform = power_up().waveform
    assert Settings.from_radar(rc.Radar(waveform, rx=[[0, 0, 0], [0, 0.2, 0], [0, 0.4, 0]])).rx_mask == 7


@pytest.mark.parametrize(
    ("rx", "count"),
    [
        ([[0.0, 0.0, 0.1]], 1),
        ([[0.0, 0.0, 1.2e-4]], 1),
        ([[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]], 2),  # RX3 and RX1 in the wrong order
        ([[0.0, 0.0, 0.0]] * 4, 4),
    ],
)
def test_other_receivers_are_refused(rx: list[list[float]], count: int) -> None:
    with pytest.raises(ValueError, match=r"^rx: expected three antennas, or some of"):
        Settings.from_radar(rc.Radar(power_up().waveform, rx=rx))


@pytest.mark.parametrize(
    ("radar", "message"),
    [
        (
            rc.Radar(power_up().waveform, tx=[[0, 0, 0], [0, 0.1, 0]]),
            "tx: expected one antenna, got 2",
        ),
        (
            power_up(num_chirps=3, chirp_times=[0.0, 1e-3, 3e-3]),
            "chirp_times: expected evenly spaced chirps from 0 s on, got 0 s",
        ),
        (
            power_up(num_chirps=2, chirp_times=[1e-3, 2e-3]),
            "chirp_times: expected evenly spaced chirps from 0 s on, got 0.001 s",
        ),
        (
            power_up(chirp_interval=36e-6),
            "chirp_interval: expected at least 39.7125 us for 64 samples at 2 MHz, got 36 us; the nearest is "
            "39.7125 us",
        ),
        (
            power_up(frame_interval=30e-3),
            "frame_interval: expected at least 37.2805875 ms for 64 chirps every 591.125 us, got 30 ms",
        ),
        (power_up(sample_rate=5e6), "sample_rate: expected 78.201 kHz to 4 MHz, got 5 MHz"),
        (power_up(num_samples=1100), "num_samples: "),
        (
            power_up(start_frequency=57e9),
            "start_frequency (3.1125 us before the first sample): expected 58 GHz to 63.5 GHz, got 57 GHz; the "
            "nearest is 58 GHz",
        ),
        (
            power_up(stop_frequency=64e9),
            "slope (the ramp's end, one sample after the last): expected 58 GHz to 63.5 GHz, got 64 GHz",
        ),
    ],
)
def test_radar_that_the_chip_cannot_be_is_refused_in_its_own_words(radar: rc.Radar, message: str) -> None:
    if message == "num_samples: ":
        waveform = radar.waveform.replace(
            sample_rate=500e3, slope=radar.waveform.slope / 4.0, chirp_interval=5e-3, frame_interval=1.0
        )
        radar = rc.Radar(waveform, rx=radar.rx)
        message = "num_samples: expected 1 to 816 at 500 kHz (ramps of at most 1.6383 ms), got 1100"
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # compared below
        Settings.from_radar(radar)
    assert str(caught.value).startswith(message)


def test_radar_of_impossible_settings_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^rx_mask: expected 1 to 7, got 0"):
        Settings(rx_mask=0).to_radar()
    with pytest.raises(ValueError, match=r"^sample_rate: expected 78.201 kHz to 4 MHz"):
        Settings(sample_rate=1.0).to_radar()
    with pytest.raises(TypeError, match=r"^radar: expected Radar, got Settings"):
        Settings.from_radar(Settings())  # type: ignore[arg-type]


@st.composite
def wishes(draw: st.DrawFn) -> dict[str, float]:
    """Some wishes, from 0.3 m to 300 m, 0.1 m/s to 50 m/s and 1 Hz to 1 kHz."""
    ranges = {
        "max_range": (-0.5, 2.5),
        "range_resolution": (-1.5, 0.5),
        "max_velocity": (-1.0, 1.7),
        "velocity_resolution": (-2.0, 0.5),
        "rate": (0.0, 3.0),
    }
    names = draw(st.sets(st.sampled_from(sorted(ranges)), min_size=1))
    return {name: 10.0 ** draw(st.floats(*ranges[name])) for name in sorted(names)}


@settings(deadline=None)
@given(wishes=wishes())
def test_wishes_become_settings_that_the_chip_has_and_that_meet_them(wishes: dict[str, float]) -> None:
    try:
        radar = rc.bgt60tr13c(**wishes)
    except ValueError:
        assume(False)
    found = achieved(Settings.from_radar(radar)).to_radar().waveform
    wanted = radar.waveform
    assert (found.sample_rate, found.num_samples, found.num_chirps) == (
        wanted.sample_rate,
        wanted.num_samples,
        wanted.num_chirps,
    )
    # The start in whole kHz, 610 Hz of the PLL; slopes are whole steps already.
    assert found.slope == pytest.approx(wanted.slope, rel=1e-12)
    assert found.start_frequency == pytest.approx(wanted.start_frequency, abs=1620.0)
    rounding = 1e-6
    assert found.max_range >= wishes.get("max_range", 0.0) * (1.0 - rounding)
    assert found.range_resolution <= wishes.get("range_resolution", np.inf) * (1.0 + rounding)
    assert found.velocity_resolution <= wishes.get("velocity_resolution", np.inf) * (1.0 + rounding)
    # At the shortest time from chirp to chirp the timer still takes up to 8 of at least 624 cycles.
    assert found.max_velocity >= wishes.get("max_velocity", 0.0) * (1.0 - 8 / 624)
    if "rate" in wishes:
        assert 1.0 / found.frame_interval == pytest.approx(wishes["rate"], rel=0.004, abs=0.0)


def test_default_radar_is_one_that_the_chip_has() -> None:
    wanted = rc.bgt60tr13c().waveform
    found = achieved(Settings.from_radar(rc.bgt60tr13c())).to_radar().waveform
    assert found.slope == pytest.approx(wanted.slope, rel=1e-3)
    assert found.chirp_interval == pytest.approx(wanted.chirp_interval, rel=4e-3)
    assert found.frame_interval == pytest.approx(wanted.frame_interval, rel=4e-3)


def test_schedules_and_sub_sequences_are_refused() -> None:
    preset = rc.bgt60tr13c()
    with pytest.raises(ValueError, match=r"^schedule: expected none with one antenna, got 'tdm'"):
        Settings.from_radar(replace(preset, schedule=rc.Schedule.tdm()))
    with pytest.raises(ValueError, match=r"^waveform: expected one, got 2 sub-sequences"):
        Settings.from_radar(replace(preset, waveform=preset.waveform.alternating()))
