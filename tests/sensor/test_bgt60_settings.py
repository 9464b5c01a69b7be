"""Settings of the BGT60TR13C: values in steps, limits that name the nearest possible one, and radars as settings."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import radarcore as rc
from chip_settings import CLOCK, V1, image, legal_settings, power_up
from radarcore.sensor.bgt60.settings import IF_GAINS_DB, Settings, achieved, registers_of


def test_gain_goes_to_the_nearest_step() -> None:
    for gain in range(18, 61):
        result = min(IF_GAINS_DB, key=lambda step: (abs(step - gain), -step))  # used at once
        assert achieved(Settings(if_gain_db=gain)).if_gain_db == result
        # The first amplifier has 18 dB for these.
        first = registers_of(Settings(if_gain_db=gain), 2)[0x12] >> 20
        assert first == (7 if result in (18, 23, 28, 33, 38, 43, 48) else 0)


@pytest.mark.parametrize(
    ("rate", "divider", "back"),
    [
        (2e6, 40, 2e6),
        (600e3, 133, 601504.0),
        (2.33e6, 34, 2352941.0),
        (4e6, 20, 4e6),
        (2909090.0, 28, 2857143.0),
        (2909091.0, 27, 2962963.0),
    ],
)
def test_sample_rate_is_the_clock_divided(rate: float, divider: int, back: float) -> None:
    wanted = Settings(sample_rate=rate, num_samples=16)
    adc = registers_of(wanted, 2)[0x01]
    assert adc >> 14 == divider
    assert adc & 0x3FFF == (0x210 if divider >= 28 else 0x010)  # with tracking, or too fast for it
    assert achieved(wanted).sample_rate == back
    # The exact rate, as a radar has it, is the same one.
    assert achieved(dataclasses.replace(wanted, sample_rate=CLOCK / divider)).sample_rate == back


def test_every_divider_is_found_again_from_its_rate() -> None:
    for divider in range(20, 1024):
        for rate in (float((160_000_000 // divider + 1) // 2), CLOCK / divider):
            if rate >= 78201.0:
                wanted = Settings(sample_rate=rate, num_samples=8, end_frequency=59e9)
                assert registers_of(wanted, 2)[0x01] >> 14 == divider


@pytest.mark.parametrize(
    ("cutoffs", "result"),
    [((0.0, 20e3, 32499.0), 20e3), ((32500.0, 57499.0), 45e3), ((57500.0, 74999.0), 70e3), ((75000.0, 1e9), 80e3)],
)
def test_highpass_goes_to_the_nearest_cutoff(cutoffs: tuple[float, ...], result: float) -> None:
    for cutoff in cutoffs:
        assert achieved(Settings(highpass_cutoff=cutoff)).highpass_cutoff == result


def test_sensor_adc_averages_as_long_as_the_chirp_allows() -> None:
    cycles = {0xE00: (5760,), 0x600: (5720, 3760), 0xC00: (3680, 720), 0x400: (680, 480), 0xA00: (440, 360)}
    for field, samplings in (cycles | {0x200: (320, 240), 0x800: (200,), 0x000: (160,)}).items():
        for sampling in samplings:
            narrow = Settings(num_samples=sampling // 40, end_frequency=59e9)
            assert registers_of(narrow, 2)[0x07] == 0x010100 | field


def test_transmitter_off_has_no_power() -> None:
    off = registers_of(Settings(is_transmitting=False, rx_mask=4), 2)
    # Not TX1_EN, and not LO_DIST1, which RX2 and TX share.
    assert (off[0x10], off[0x11]) == (0x130450, 0x4FF400)
    assert achieved(Settings(is_transmitting=False)).tx_power_level == 0


def test_falling_ramp_starts_at_the_top() -> None:
    falling = Settings(start_frequency=63.5e9, end_frequency=58e9)
    registers = registers_of(falling, 2)
    # The step of the rising ramp, downwards, and 150 cycles before the start.
    assert registers[0x31] == 0x1000000 - 3208
    assert registers[0x30] == 3375104 + 150 * 3208
    back = achieved(falling)
    assert back.start_frequency == 63.5e9
    assert back.end_frequency == 640e6 * (96 + (3375104 - 3208 * 2809) / 2**20)


def test_wide_slow_ramp_may_end_beyond_the_band_by_the_rounding_of_its_step() -> None:
    slow = Settings(sample_rate=500e3, num_samples=800, chirp_time=2e-3, frame_time=0.2)
    # 9011200 steps in 128249 cycles are 70.26 per cycle, rounded to 70: 20 MHz short. 71 would be too far.
    back = achieved(slow)
    assert back.end_frequency == pytest.approx(63.5e9 - 20.6e6, abs=0.1e6)
    wider = dataclasses.replace(slow, start_frequency=58.02e9)  # 70.0 per cycle
    assert registers_of(achieved(wider), 2)[0x31] == 70
    beyond = dataclasses.replace(slow, start_frequency=58.03e9)  # 69.88, rounded up
    assert achieved(beyond).end_frequency > 63.505e9
    assert registers_of(achieved(beyond), 2) == registers_of(beyond, 2)
    with pytest.raises(ValueError, match=r"end_frequency: expected 58 GHz to 63.5 GHz, got 63.56 GHz"):
        registers_of(dataclasses.replace(beyond, end_frequency=63.56e9), 2)


# Limits.


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sample_rate": 5e6}, "sample_rate: expected 78.201 kHz to 4 MHz, got 5 MHz; the nearest is 4 MHz"),
        ({"num_samples": 4096}, "num_samples: expected 1 to 4095, got 4096; the nearest is 4095"),
        (
            {"num_samples": 4000},
            "num_samples: expected 1 to 3266 at 2 MHz (ramps of at most 1.6383 ms), got 4000; the nearest is 3266, or "
            "a sample_rate of at least 2.5 MHz",
        ),
        ({"highpass_cutoff": -1.0}, "highpass_cutoff: expected 0 Hz or more, got -1 Hz; the nearest is 20 kHz"),
        (
            {"start_frequency": 57.999e9},
            "start_frequency: expected 58 GHz to 63.5 GHz, got 57.999 GHz; the nearest is 58 GHz",
        ),
        (
            {"chirp_time": 30e-6},
            "chirp_time: expected at least 39.7125 us for 64 samples at 2 MHz, got 30 us; the nearest is 39.7125 us",
        ),
        ({"chirp_time": 1e300}, "chirp_time: expected at most 27380.4176027 s (the longest timer), got 1e+300 s"),
        (
            {"frame_time": 30e-3},
            "frame_time: expected at least 37.2805875 ms for 64 chirps every 591.125 us, got 30 ms; the nearest is "
            "37.2805875 ms",
        ),
        (
            {"frame_time": 30e-6, "num_chirps": 1},
            "frame_time: expected at least 39.7125 us for a chirp of 64 samples at 2 MHz, got 30 us",
        ),
    ],
)
def test_chip_refuses_and_names_the_nearest(changes: dict[str, Any], message: str) -> None:
    wanted = Settings(**changes)  # finite numbers are taken
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # compared below
        registers_of(wanted, 2)
    assert str(caught.value).startswith(message)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"sample_rate": 78201.0, "chirp_time": 1e-3, "frame_time": 0.1},
        {"num_samples": 1, "end_frequency": 58.1e9},
        {"num_samples": 4095, "sample_rate": 4e6, "chirp_time": 2e-3, "frame_time": 1.0},
        {"num_chirps": 4096, "frame_time": 3.0},
        {"start_frequency": 58e9 - 499.0},  # rounded to kHz
        {"end_frequency": 63.5e9 + 499.0},
        {"chirp_time": 39.7125e-6},
        {"frame_time": 37.2805875e-3},
        {"chirp_time": 27380.0, "frame_time": 27380.0, "num_chirps": 1},
    ],
)
def test_chip_can_do_its_limits(changes: dict[str, Any]) -> None:
    wanted = Settings(**changes)
    back = achieved(wanted)
    for name in changes.keys() - {"start_frequency", "end_frequency", "chirp_time"}:
        assert getattr(back, name) == pytest.approx(changes[name], rel=0.004)


@pytest.mark.parametrize("ends", [(58e9, 63.5e9), (58.2e9, 63e9), (63.5e9, 58e9)])
def test_ramp_must_not_begin_beyond_the_pll(ends: tuple[float, float]) -> None:
    steep = Settings(start_frequency=ends[0], end_frequency=ends[1], num_samples=1, sample_rate=4e6)
    with pytest.raises(
        ValueError, match=r"end_frequency: expected at (most|least) [\d.]+ GHz after 3.3625 us"
    ) as caught:
        registers_of(steep, 2)
    # The nearest value that it names is within a step of the slope, 269 cycles of 610 Hz, of a possible one.
    nearest = float(str(caught.value).split("the nearest is ")[1].split()[0]) * 1e9
    registers_of(dataclasses.replace(steep, end_frequency=nearest), 2)
    further = nearest + np.sign(ends[1] - ends[0]) * 170e3
    with pytest.raises(ValueError, match="end_frequency"):
        registers_of(dataclasses.replace(steep, end_frequency=further), 2)


def test_settings_become_plain_numbers() -> None:
    numbers = {"start_frequency": np.float64(58e9), "chirp_time": np.float32(1e-3), "num_samples": np.int64(8)}
    plain = Settings(**numbers, is_transmitting=np.bool_(True))
    assert [*map(type, dataclasses.astuple(plain))] == [*map(type, dataclasses.astuple(Settings()))]
    assert hash(plain) != hash(Settings())


@settings(deadline=None)
@given(wanted=legal_settings())
def test_achieved_settings_are_within_the_chips_steps(wanted: Settings) -> None:
    back = achieved(wanted)
    for name in ("num_samples", "num_chirps", "rx_mask", "is_transmitting", "num_frames", "has_test_pattern"):
        assert getattr(back, name) == getattr(wanted, name)
    assert back.tx_power_level == (wanted.tx_power_level if wanted.is_transmitting else 0)
    # Half a step of the divider, and 1 Hz of rounding to whole ones.
    assert abs(CLOCK / back.sample_rate - CLOCK / wanted.sample_rate) <= 0.5 + 1.1 * CLOCK / wanted.sample_rate**2
    # 500 Hz of rounding to kHz and 305 Hz to the PLL's step; the slope's half step over the whole sweep.
    length = round(CLOCK / back.sample_rate) * back.num_samples + 249
    step = 640e6 / 2**20
    assert abs(back.start_frequency - wanted.start_frequency) <= 810.0
    assert abs(back.end_frequency - wanted.end_frequency) <= 1620.0 + (0.5 * length + 1) * step
    # Timers of 8 bits: 6 cycles, or half a part in 127 of the delay; times come in float32.
    chirp = (8 * -(-(length + 150) // 8) + 217) / CLOCK
    if wanted.num_chirps > 1:
        delay = wanted.chirp_time - chirp
        bound = 7 / CLOCK + 0.004 * delay + 2.0**-23 * wanted.chirp_time
        assert abs(back.chirp_time - wanted.chirp_time) <= bound
    delay = wanted.frame_time - (wanted.num_chirps - 1) * back.chirp_time - chirp
    assert abs(back.frame_time - wanted.frame_time) <= 7 / CLOCK + 0.004 * delay + 2.0**-23 * wanted.frame_time


# Radars as settings, and settings as radars


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
@pytest.mark.parametrize("adc_delay", [0.0, 9e-6])
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


@settings(deadline=None, max_examples=50)
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
    if mask == 7:  # three are all of them wherever they are
        assert Settings.from_radar(rc.Radar(preset.waveform, rx=50.0 * rows)).rx_mask == 7


@st.composite
def requirements(draw: st.DrawFn) -> dict[str, float]:
    """Some requirements, from 0.3 m to 300 m, 0.1 m/s to 50 m/s and 1 Hz to 1 kHz."""
    ranges = {
        "max_range": (-0.5, 2.5),
        "range_resolution": (-1.5, 0.5),
        "max_velocity": (-1.0, 1.7),
        "velocity_resolution": (-2.0, 0.5),
        "rate": (0.0, 3.0),
    }
    names = draw(st.sets(st.sampled_from(sorted(ranges)), min_size=1))
    return {name: 10.0 ** draw(st.floats(*ranges[name])) for name in sorted(names)}


@settings(deadline=None, max_examples=50)
@given(requirements=requirements())
def test_requirements_become_settings_of_the_chip_that_meet_them(requirements: dict[str, float]) -> None:
    try:
        radar = rc.bgt60tr13c(**requirements)
    except ValueError:
        assume(False)
    found = achieved(Settings.from_radar(radar)).to_radar().waveform
    wanted = radar.waveform
    for name in ("sample_rate", "num_samples", "num_chirps"):
        assert getattr(found, name) == getattr(wanted, name)
    # The start in whole kHz, 610 Hz of the PLL; slopes are whole steps already.
    assert found.slope == pytest.approx(wanted.slope, rel=1e-12)
    assert found.start_frequency == pytest.approx(wanted.start_frequency, abs=1620.0)
    rounding = 1e-6
    assert found.max_range >= requirements.get("max_range", 0.0) * (1.0 - rounding)
    assert found.range_resolution <= requirements.get("range_resolution", np.inf) * (1.0 + rounding)
    assert found.velocity_resolution <= requirements.get("velocity_resolution", np.inf) * (1.0 + rounding)
    # At the shortest time from chirp to chirp the timer still takes up to 8 of at least 624 cycles.
    assert found.max_velocity >= requirements.get("max_velocity", 0.0) * (1.0 - 8 / 624)
    if "rate" in requirements:
        assert 1.0 / found.frame_interval == pytest.approx(requirements["rate"], rel=0.004, abs=0.0)
