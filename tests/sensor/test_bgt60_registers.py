"""Registers of the BGT60TR13C: published lists, the words that start it, and images of anyone."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chip_settings import (
    CLOCK,
    V1,
    V1_SETTINGS,
    V2_CHANGES,
    V2_SETTINGS,
    V3_CHANGES,
    V3_SETTINGS,
    image,
    legal_settings,
)
from radarcore.sensor.bgt60.registers import RESET_VALUES, chip_name, temperature_code, temperature_of
from radarcore.sensor.bgt60.settings import (
    Settings,
    achieved,
    choose_slice_size,
    registers_of,
    slice_size_of,
)
from radarcore.sensor.bgt60.timing import scaled_timer, timer_cycles


@pytest.mark.parametrize(
    ("given_settings", "slice_size", "changes"),
    [(V1_SETTINGS, 6144, ""), (V2_SETTINGS, 1024, V2_CHANGES), (V3_SETTINGS, 4096, V3_CHANGES)],
    ids=["V1", "V2", "V3"],
)
def test_registers_are_those_of_published_lists(given_settings: Settings, slice_size: int, changes: str) -> None:
    found = registers_of(given_settings, slice_size)
    expected = image(V1) | image(changes)
    assert {f"{a:02X}={v:06X}" for a, v in found.items()} == {f"{a:02X}={v:06X}" for a, v in expected.items()}
    assert list(found) == sorted(found)
    assert slice_size_of(found) == slice_size


def test_settings_of_published_lists_are_achieved_in_whole_cycles_and_steps() -> None:
    found = achieved(V1_SETTINGS)
    # The end is where 3208 steps per cycle lead in 2809 cycles: 63.500044 GHz.
    assert found == Settings(
        end_frequency=640e6 * (96 + (-5636096 + 3208 * 2809) / 2**20), chirp_time=591.125e-6, frame_time=6179472 / CLOCK
    )
    assert round(found.end_frequency / 1e3) == 63_500_044
    found = achieved(V2_SETTINGS)
    assert (found.rx_mask, found.num_samples, found.num_chirps) == (1, 8, 32)
    assert (found.chirp_time, found.frame_time) == (15.9625e-6, pytest.approx(10.0053e-3, abs=50e-9))
    found = achieved(V3_SETTINGS)
    assert (found.rx_mask, found.sample_rate, found.if_gain_db) == (4, 2352941.0, 60)
    assert found.start_frequency == pytest.approx(61.020099e9, abs=500.0)
    assert (found.chirp_time, found.frame_time) == (69.9625e-6, pytest.approx(5.0039e-3, abs=50e-9))


def test_registers_after_a_reset() -> None:
    values = RESET_VALUES
    assert list(values) == list(range(0x60))
    expected = image("00=1E0000 01=0A2240 02=000303 04=196524 05=040014 06=710000 55=001F40 56=060000 57=000200")
    expected |= image("0B=000B60 0F=000B60 16=000B60 1D=000B60 24=000B60 2B=000B60 5D=0000A8 5F=100000")
    assert {address: value for address, value in values.items() if value} == expected


def test_chips_are_named_by_their_id() -> None:
    assert chip_name(0x000303) == "BGT60TR13C"
    assert chip_name(0x000504) == "BGT60ATR24C"
    assert chip_name(0x060B) == "BGT60UTR13DAIP"
    # Later chips have step and technology above the digital id.
    assert chip_name(0x05080A) == "BGT120UTR13E"
    assert chip_name(0) == "unknown chip 0x000000"


@settings(deadline=None, max_examples=50)
@given(wanted=legal_settings(), slice_size=st.integers(1, 8192).map(lambda n: 2 * n))
def test_achieved_settings_are_achieved_again(wanted: Settings, slice_size: int) -> None:
    registers = registers_of(wanted, slice_size)
    back = achieved(wanted)
    again = registers_of(back, slice_size)
    timers = {address: registers[address] for address in (0x2D, 0x37)}
    assert again | timers == registers
    # Times move by what float32 makes of them, 2**-24, and one cycle.
    twice = achieved(back)
    times = {"chirp_time": twice.chirp_time, "frame_time": twice.frame_time}
    assert dataclasses.replace(back, **times) == twice
    assert list(times.values()) == pytest.approx([back.chirp_time, back.frame_time], rel=2.0**-23)


# Temperature.


def test_temperature_of_a_code() -> None:
    assert temperature_of(700) == pytest.approx(13.327, abs=1e-3)
    assert temperature_of(0) == pytest.approx(-276.1678, abs=1e-3)
    for code in range(1024):
        assert temperature_code(temperature_of(code)) == code
    assert (temperature_code(-400.0), temperature_code(1e300)) == (0, 1023)
    # A step of the code is 0.414 degrees.
    assert abs(temperature_of(temperature_code(36.6)) - 36.6) <= 0.207


# Times


@pytest.mark.parametrize(
    ("cycles", "timer", "result"),
    [
        (0, (0, 0), 1),
        (6, (0, 0), 1),
        (7, (1, 0), 11),
        (100, (6, 1), 100),
        (10000, (39, 5), 9992),
        (560, (70, 0), 563),
        ((255 << 33) + 33, (255, 30), (255 << 33) + 33),
    ],
)
def test_scaled_timer_comes_nearest(cycles: int, timer: tuple[int, int], result: int) -> None:
    assert scaled_timer(cycles) == timer
    assert timer_cycles(*timer) == result


# N, fs, n, chirp time, frame time; timer after chirps and read-back time, timer after frames, cycles, read-back time.
IDLE, DEEP = 1, 2
TIMES = [
    (64, 2e6, 64, 0.000591125, 0.0772688463, (39, 7), 0.0005911249900236726, (95, 12), 6179472, 0.07724340260028839),
    (128, 1e6, 64, 0.00053861, 1 / 15, (219, 4), 0.0005382875096984208, (77, 12), 5331027, 0.06663783639669418),
    (64, 1e6, 32, 0.000411238, 0.2, (180, 4), 0.00041188750765286386, (227, 13), 15987956, 0.1998494565486908),
    (32, 1e6, 16, 0.0005, 0.1, (255, 4), 0.0004998875083401799, (223, 12), 7994371, 0.09992963820695877),
]


@pytest.mark.parametrize("row", TIMES, ids=lambda row: f"{row[0]}x{row[2]}")
def test_times_are_rounded_as_in_the_worked_examples(row: tuple[Any, ...]) -> None:
    samples, rate, chirps, chirp, frame, chirp_timer, chirp_back, frame_timer, cycles, frame_back = row
    wanted = Settings(num_samples=samples, sample_rate=rate, num_chirps=chirps, chirp_time=chirp, frame_time=frame)
    registers = registers_of(wanted, 2)
    for value, mode, timer in ((registers[0x37], IDLE, chirp_timer), (registers[0x2D], DEEP, frame_timer)):
        assert (value >> 9 & 3, value >> 11 & 255, value >> 19) == (mode, *timer)
    back = achieved(wanted)
    assert back.frame_time == cycles / CLOCK
    assert float(np.float32(back.chirp_time)) == chirp_back
    assert float(np.float32(back.frame_time)) == frame_back


@pytest.mark.parametrize(
    ("samples", "rate", "least"),
    [
        (64, 2e6, 39.7125e-6),
        (64, 1e6, 71.7125e-6),
        (512, 2e6, 263.7125e-6),
    ],
)
def test_chirps_follow_no_faster_than_they_last(samples: int, rate: float, least: float) -> None:
    fast = Settings(num_samples=samples, sample_rate=rate, num_chirps=2, chirp_time=least)
    # The shortest delay is one cycle.
    assert achieved(fast).chirp_time == pytest.approx(least + 1 / CLOCK, abs=1e-12)
    # A single chirp takes its own time; that time can be set again, and so can its float32.
    alone = achieved(dataclasses.replace(fast, num_chirps=1))
    assert alone.chirp_time == pytest.approx(least, abs=1e-15)
    for again in (alone.chirp_time, float(np.float32(alone.chirp_time))):
        assert achieved(dataclasses.replace(alone, chirp_time=again)) == alone
    text = f"chirp_time: expected at least {least * 1e6:.4f} us for {samples} samples at {rate / 1e6:g} MHz, got "
    with pytest.raises(ValueError, match=text):
        registers_of(dataclasses.replace(fast, chirp_time=least - 1 / CLOCK), 2)


def test_least_time_may_be_given_in_float32() -> None:
    # Half of these are rounded down, below the chirp's own length.
    for samples in range(64, 128):
        cycles = 8 * -(-(samples * 40 + 399) // 8) + 217
        least = float(np.float32(cycles / CLOCK))
        alone = Settings(num_samples=samples, num_chirps=1, chirp_time=least, frame_time=least)
        assert achieved(alone).frame_time == (cycles + 1) / CLOCK


def frame_timer(wanted: Settings) -> tuple[int, int]:
    value = registers_of(wanted, 2)[0x2D]
    return value >> 11 & 255, value >> 19


def test_times_count_in_float32() -> None:
    # float32 near 3 s has steps of 19 cycles, so that a delay of 200 cycles comes out otherwise.
    chirps = 4096 * 47290 - 44113
    differing = 0
    for delay in range(200, 240, 4):
        wanted = Settings(num_chirps=4096, chirp_time=591.125e-6, frame_time=(chirps + delay) / CLOCK)
        counted = round(float(np.float32(wanted.frame_time)) * CLOCK) - chirps
        assert frame_timer(wanted) == scaled_timer(counted)
        differing += scaled_timer(counted) != scaled_timer(delay)
    assert differing >= 3


def test_parts_of_100_ps_are_dropped_before_cycles_are_rounded() -> None:
    # Half a cycle is 62.5 steps of 100 ps; 62.7 are 62, less than half, and 63.3 are 63, more.
    cycles = next(x for x in range(100, 200) if scaled_timer(x) != scaled_timer(x + 1))
    for steps, counted in ((62.7, cycles), (63.3, cycles + 1)):
        frame = (3177 + cycles) / CLOCK + steps * 1e-10
        assert frame_timer(Settings(num_chirps=1, frame_time=frame)) == scaled_timer(counted)


def test_chip_sleeps_as_deep_as_there_is_time_for() -> None:
    # 3177 cycles of chirp; waking takes 4167 cycles from idle and 84050 from deep sleep.
    for delay, mode in ((4166, 0), (4168, IDLE), (84049, IDLE), (84052, DEEP)):
        timing = Settings(num_chirps=2, chirp_time=(3177 + delay) / CLOCK, frame_time=1.0)
        assert registers_of(timing, 2)[0x37] >> 9 & 3 == mode
        assert abs(achieved(timing).chirp_time * CLOCK - 3177 - delay) <= 0.004 * delay + 6


def test_single_chirp_has_no_delay_of_its_own() -> None:
    # The frame ends 3177 cycles after its start and then waits.
    frame = achieved(Settings(num_chirps=1, chirp_time=5e-3, frame_time=3178 / CLOCK))
    assert frame.frame_time == 3178 / CLOCK


# Slices.


@pytest.mark.parametrize(
    ("changes", "size"),
    [
        ({"num_chirps": 8}, 1536),  # one frame
        ({"num_samples": 1, "num_chirps": 2, "rx_mask": 1, "end_frequency": 58.1e9}, 2),
        ({}, 6144),  # half a frame of 12288
        ({"num_chirps": 86}, 5504),  # 16512 = 2 x 8256: three of 5504
        ({"num_samples": 67, "num_chirps": 126, "rx_mask": 1}, 4221 * 2 // 3),  # 8442 = 2 x 4221: odd; 3 x 2814
        ({"num_samples": 8, "num_chirps": 4, "chirp_time": 20e-6, "frame_time": 1e-3}, 480),  # 1000: five at once
        ({"num_samples": 8, "num_chirps": 32, "chirp_time": 16e-6, "frame_time": 0.6e-3}, 6912),  # 1667: nine
        ({"num_samples": 63, "num_chirps": 7}, 2 * 1323),  # odd: two frames
        ({"num_samples": 4095, "num_chirps": 1, "rx_mask": 1, "sample_rate": 4e6}, 8190),
        ({"num_samples": 9, "num_chirps": 3, "chirp_time": 20e-6, "frame_time": 1e-3}, 6 * 81),  # odd: six at once
    ],
)
def test_slices_stay_in_step_with_frames(changes: dict[str, Any], size: int) -> None:
    wanted = Settings(**{"chirp_time": 2e-3, "frame_time": 1.0} | changes)
    assert choose_slice_size(wanted) == size
    assert size % wanted.frame_size == 0 or wanted.frame_size % size == 0
    assert slice_size_of(registers_of(wanted, size)) == size


def test_odd_frame_that_is_too_long_is_refused() -> None:
    long = {"chirp_time": 2e-3, "frame_time": 1.0, "rx_mask": 1}
    message = (
        "num_samples: expected an even number of samples in a frame of more than 4096, got 1 receivers x 65 chirps x "
        "65 samples; take an even number of samples or chirps"
    )
    with pytest.raises(ValueError, match=message):
        choose_slice_size(Settings(num_samples=65, num_chirps=65, **long))
    for samples, chirps in ((64, 65), (65, 66)):
        assert choose_slice_size(Settings(num_samples=samples, num_chirps=chirps, **long)) % 2 == 0
