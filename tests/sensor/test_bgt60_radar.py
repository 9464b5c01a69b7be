"""Radars as settings of the BGT60TR13C, and its settings as radars."""

from __future__ import annotations

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
