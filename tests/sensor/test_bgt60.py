"""Settings and registers of the BGT60TR13C: published lists, worked examples, limits, and radars."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import radarcore as rc
from radarcore.sensor.bgt60.registers import (
    ADC0,
    FIFO_RESET,
    FSM_RESET,
    MAIN,
    RESET_VALUES,
    chip_name,
    start_words,
    temperature_code,
    temperature_of,
    word_bytes,
    write_word,
)
from radarcore.sensor.bgt60.settings import IF_GAINS_DB, Settings, achieved, registers_of, settings_of
from radarcore.sensor.bgt60.slices import choose_slice_size, sdk_slice_size, slice_size_of
from radarcore.sensor.bgt60.timing import scaled_timer, timer_cycles

CLOCK = 80e6  # [Hz]

# Published lists: register=value, hex.
V1 = """
00=1E8270 01=0A0210 04=E967FD 05=0805B4 06=102BFF 07=010D00 08=000000 09=000000 0A=000000 0B=000BE0 0C=000000 0D=000000
0E=000000 0F=000B60 10=13FC51 11=7FF41F 12=701CE7 16=000490 1D=000480 24=000480 2B=000480 2C=11BE0E 2D=62FC0A 2E=03F000
2F=787E1E 30=A2A850 31=000C88 32=000172 33=000040 34=000000 35=000000 36=000000 37=393B10 3F=000100 47=000100 4F=000100
56=000000 5B=000000
"""
V2_CHANGES = """
06=1021FF 07=010300 10=103C51 11=1FF41F 2D=4D2C0A 2E=01F000 30=85C082 31=003DDD 32=00005A 33=000008 37=08A910
"""
V3_CHANGES = """
01=088210 06=1027FF 07=010700 10=130C51 11=4FF41F 12=006F7B 2D=3EF40A 2E=00F000 30=F5208A 31=0000A4 32=000252 33=000080
37=093910
"""
V1_SETTINGS = Settings(chirp_time=591.1249900e-6, frame_time=77.26884633e-3)
V2_SETTINGS = Settings(num_samples=8, num_chirps=32, rx_mask=1, chirp_time=15.9625e-6, frame_time=10.0053e-3)
V3_SETTINGS = Settings(
    start_frequency=61.020099e9,
    end_frequency=61.479903e9,
    sample_rate=2.352941e6,
    num_samples=128,
    num_chirps=16,
    rx_mask=4,
    if_gain_db=60,
    chirp_time=70e-6,
    frame_time=5e-3,
)

# The words that start settings V1 with a gain of 33 dB.
WORDS = """
030A0210 09E967FD 0B0805B4 0D102BFF 0F010D00 11000000 13000000 15000000 17000BE0 19000000 1B000000 1D000000 1F000B60
2113FC51 237FF41F 25703DEF 2D000490 3B000480 49000480 57000480 5911BE0E 5B62FC0A 5D03F000 5F787E1E 61A2A850 63000C88
65000172 67000040 69000000 6B000000 6D000000 6F393B10 7F000100 8F000100 9F000100 AD000000 B7000000 011E8271
"""


def image(text: str) -> dict[int, int]:
    return {int(a, 16): int(v, 16) for a, v in (pair.split("=") for pair in text.split())}


# Registers.


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


def test_published_lists_are_decoded() -> None:
    decoded = settings_of(image(V1))
    # The end is where 3208 steps per cycle lead in 2809 cycles: 63.500044 GHz.
    assert decoded == Settings(
        end_frequency=640e6 * (96 + (-5636096 + 3208 * 2809) / 2**20), chirp_time=591.125e-6, frame_time=6179472 / CLOCK
    )
    assert round(decoded.end_frequency / 1e3) == 63_500_044
    decoded = settings_of(image(V1) | image(V2_CHANGES))
    assert (decoded.rx_mask, decoded.num_samples, decoded.num_chirps) == (1, 8, 32)
    assert (decoded.chirp_time, decoded.frame_time) == (15.9625e-6, pytest.approx(10.0053e-3, abs=50e-9))
    decoded = settings_of(image(V1) | image(V3_CHANGES))
    assert (decoded.rx_mask, decoded.sample_rate, decoded.if_gain_db) == (4, 2352941.0, 60)
    assert decoded.start_frequency == pytest.approx(61.020099e9, abs=500.0)
    assert (decoded.chirp_time, decoded.frame_time) == (69.9625e-6, pytest.approx(5.0039e-3, abs=50e-9))


def test_chip_at_power_up_has_the_default_settings() -> None:
    # The frame ends idle with the timer (195, 11), and unused shapes have a delay but are off.
    power_up = image(V1) | {0x2D: 10 | 1 << 9 | 195 << 11 | 11 << 19, 0x3F: 0x393B00, 0x47: 0x393B00, 0x4F: 0x393B00}
    decoded = settings_of(power_up)
    assert decoded.frame_time == 6181508 / CLOCK
    default = Settings()
    for name in ("chirp_time", "frame_time"):
        assert np.float32(getattr(decoded, name)) == np.float32(getattr(default, name))
    assert (
        dataclasses.replace(decoded, end_frequency=63.5e9, chirp_time=default.chirp_time, frame_time=default.frame_time)
        == default
    )


def test_start_sends_main_last_with_the_trigger() -> None:
    registers = registers_of(dataclasses.replace(V1_SETTINGS, if_gain_db=33), 6144)
    words = start_words(registers)
    assert [f"{word:08X}" for word in words] == WORDS.split()
    assert word_bytes(words) == bytes.fromhex("".join(WORDS.split()))
    # The order of the mapping does not matter.
    assert start_words(dict(reversed(registers.items()))) == words


def test_words_go_out_most_significant_byte_first() -> None:
    assert word_bytes([write_word(ADC0, 0x0A0210)]) == bytes.fromhex("030a0210")
    stop = write_word(MAIN, 0x1E8270 | FSM_RESET | FIFO_RESET)
    assert word_bytes([stop]) == bytes.fromhex("011e827c")
    with pytest.raises(ValueError, match="registers: expected MAIN"):
        start_words({1: 0x0A0210})
    for address, value in ((0x80, 0), (-1, 0), (0, 1 << 24), (0, -1)):
        with pytest.raises(ValueError, match="address, value: expected 7 and 24 bits"):
            write_word(address, value)


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


# Times.


@pytest.mark.parametrize(
    ("cycles", "timer", "result"),
    [
        (0, (0, 0), 1),
        (5, (0, 0), 1),
        (6, (0, 0), 1),
        (7, (1, 0), 11),
        (100, (6, 1), 100),
        (1000, (125, 0), 1003),
        (10000, (39, 5), 9992),
        (39946, (39, 7), 39946),
        (3115011, (95, 12), 3112975),
        # The fixed timers of the chip.
        (80000, (39, 8), 79883),
        (3600, (225, 1), 3604),
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
    (64, 2e6, 8, 0.000591125, 0.0772688463, (39, 7), 0.0005911249900236726, (176, 12), 6185440, 0.07731799781322479),
    (128, 1e6, 64, 0.00053861, 1 / 15, (219, 4), 0.0005382875096984208, (77, 12), 5331027, 0.06663783639669418),
    (64, 1e6, 32, 0.000411238, 0.2, (180, 4), 0.00041188750765286386, (227, 13), 15987956, 0.1998494565486908),
    (128, 2e6, 16, 0.0005, 0.307325, (235, 4), 0.0004998875083401799, (91, 15), 24544774, 0.306809663772583),
    (128, 2e6, 128, 0.0005, 0.1, (235, 4), 0.0004998875083401799, (173, 11), 8003090, 0.10003862529993057),
    (256, 2e6, 64, 0.0005, 0.1, (195, 4), 0.0004998875083401799, (41, 14), 7988309, 0.09985386580228806),
    (32, 1e6, 16, 0.0005, 0.1, (255, 4), 0.0004998875083401799, (223, 12), 7994371, 0.09992963820695877),
]


@pytest.mark.parametrize("row", TIMES, ids=lambda row: f"{row[0]}x{row[2]}")
def test_times_are_rounded_as_in_the_worked_examples(row: tuple[Any, ...]) -> None:
    samples, rate, chirps, chirp, frame, chirp_timer, chirp_back, frame_timer, cycles, frame_back = row
    wanted = Settings(num_samples=samples, sample_rate=rate, num_chirps=chirps, chirp_time=chirp, frame_time=frame)
    registers = registers_of(wanted, 2)
    for value, mode, timer in ((registers[0x37], IDLE, chirp_timer), (registers[0x2D], DEEP, frame_timer)):
        assert (value >> 9 & 3, value >> 11 & 255, value >> 19) == (mode, *timer)
    back = settings_of(registers)
    assert back == achieved(wanted)
    assert back.frame_time == cycles / CLOCK
    assert float(np.float32(back.chirp_time)) == chirp_back
    assert float(np.float32(back.frame_time)) == frame_back


@pytest.mark.parametrize(
    ("samples", "rate", "least"),
    [
        (64, 2e6, 39.7125e-6),
        (128, 2e6, 71.7125e-6),
        (64, 1e6, 71.7125e-6),
        (256, 1e6, 263.7125e-6),
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


# Values that the chip has in steps.


@pytest.mark.parametrize(
    ("gains", "result"),
    [
        (range(18, 21), 18),
        (range(21, 26), 23),
        (range(26, 29), 28),
        (range(29, 32), 30),
        (range(32, 34), 33),
        (range(34, 37), 35),
        (range(37, 39), 38),
        (range(39, 42), 40),
        (range(42, 44), 43),
        (range(44, 47), 45),
        (range(47, 49), 48),
        (range(49, 53), 50),
        (range(53, 58), 55),
        (range(58, 61), 60),
    ],
)
def test_gain_goes_to_the_nearest_step(gains: range, result: int) -> None:
    for gain in gains:
        assert achieved(Settings(if_gain_db=gain)).if_gain_db == result
        # The first amplifier has 18 dB for these.
        first = registers_of(Settings(if_gain_db=gain), 2)[0x12] >> 20
        assert first == (7 if result in (18, 23, 28, 33, 38, 43, 48) else 0)
    assert result in IF_GAINS_DB


@pytest.mark.parametrize(
    ("rate", "divider", "back"),
    [
        (2e6, 40, 2e6),
        (1e6, 80, 1e6),
        (500e3, 160, 500e3),
        (600e3, 133, 601504.0),
        (1.5e6, 53, 1509434.0),
        (2.33e6, 34, 2352941.0),
        (3e6, 27, 2962963.0),
        (4e6, 20, 4e6),
        (78201.0, 1023, 78201.0),
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
        read_back = float((160_000_000 // divider + 1) // 2)
        for rate in (read_back, CLOCK / divider):
            if rate >= 78201.0:
                assert (
                    registers_of(Settings(sample_rate=rate, num_samples=8, end_frequency=59e9), 2)[0x01] >> 14
                    == divider
                )


@pytest.mark.parametrize(
    ("cutoff", "result"),
    [
        (0.0, 20e3),
        (20e3, 20e3),
        (32499.0, 20e3),
        (32500.0, 45e3),
        (57499.0, 45e3),
        (57500.0, 70e3),
        (74999.0, 70e3),
        (75000.0, 80e3),
        (1e9, 80e3),
    ],
)
def test_highpass_goes_to_the_nearest_cutoff(cutoff: float, result: float) -> None:
    assert achieved(Settings(highpass_cutoff=cutoff)).highpass_cutoff == result


@pytest.mark.parametrize(
    ("sampling", "field"),
    [
        (5760, 0xE00),
        (5720, 0x600),
        (3760, 0x600),
        (3680, 0xC00),
        (720, 0xC00),
        (680, 0x400),
        (480, 0x400),
        (440, 0xA00),
        (360, 0xA00),
        (320, 0x200),
        (240, 0x200),
        (200, 0x800),
        (160, 0x000),
    ],
)
def test_sensor_adc_averages_as_long_as_the_chirp_allows(sampling: int, field: int) -> None:
    narrow = Settings(num_samples=sampling // 40, end_frequency=59e9)
    assert registers_of(narrow, 2)[0x07] == 0x010100 | field


def test_transmitter_off_has_no_power() -> None:
    off = registers_of(Settings(is_transmitting=False, rx_mask=4), 2)
    # Neither TX1_EN nor LO_DIST1, which RX2 and TX share.
    assert (off[0x10], off[0x11]) == (0x130450, 0x4FF400)
    decoded = settings_of(off)
    assert (decoded.is_transmitting, decoded.tx_power_level) == (False, 0)


def test_falling_ramp_starts_at_the_top() -> None:
    falling = Settings(start_frequency=63.5e9, end_frequency=58e9)
    registers = registers_of(falling, 2)
    # The step of the rising ramp, downwards, and 150 cycles before the start.
    assert registers[0x31] == 0x1000000 - 3208
    assert registers[0x30] == 3375104 + 150 * 3208
    back = settings_of(registers)
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
        ({"sample_rate": 50e3}, "sample_rate: expected 78.201 kHz to 4 MHz, got 50 kHz; the nearest is 78.201 kHz"),
        ({"sample_rate": 0.0}, "sample_rate: expected 78.201 kHz to 4 MHz, got 0 Hz; the nearest is 78.201 kHz"),
        ({"sample_rate": 1e300}, "sample_rate: expected 78.201 kHz to 4 MHz, got"),
        ({"num_samples": 0}, "num_samples: expected 1 to 4095, got 0; the nearest is 1"),
        ({"num_samples": 4096}, "num_samples: expected 1 to 4095, got 4096; the nearest is 4095"),
        (
            {"num_samples": 4000},
            "num_samples: expected 1 to 3266 at 2 MHz (ramps of at most 1.6383 ms), got 4000; the nearest is 3266, or "
            "a sample_rate of at least 2.5 MHz",
        ),
        ({"num_chirps": 0}, "num_chirps: expected 1 to 4096, got 0; the nearest is 1"),
        ({"num_chirps": 4097}, "num_chirps: expected 1 to 4096, got 4097; the nearest is 4096"),
        ({"rx_mask": 0}, "rx_mask: expected 1 to 7, got 0; the nearest is 1"),
        ({"rx_mask": 8}, "rx_mask: expected 1 to 7, got 8; the nearest is 7"),
        ({"tx_power_level": -1}, "tx_power_level: expected 0 to 31, got -1; the nearest is 0"),
        ({"tx_power_level": 32}, "tx_power_level: expected 0 to 31, got 32; the nearest is 31"),
        ({"if_gain_db": 17}, "if_gain_db: expected 18 dB to 60 dB, got 17 dB; the nearest is 18 dB"),
        ({"if_gain_db": 61}, "if_gain_db: expected 18 dB to 60 dB, got 61 dB; the nearest is 60 dB"),
        ({"num_frames": -1}, "num_frames: expected 0 to 4094, got -1; the nearest is 0"),
        ({"num_frames": 4095}, "num_frames: expected 0 to 4094, got 4095; the nearest is 4094"),
        ({"highpass_cutoff": -1.0}, "highpass_cutoff: expected 0 Hz or more, got -1 Hz; the nearest is 20 kHz"),
        (
            {"start_frequency": 57.999e9},
            "start_frequency: expected 58 GHz to 63.5 GHz, got 57.999 GHz; the nearest is 58 GHz",
        ),
        ({"start_frequency": 0.0}, "start_frequency: expected 58 GHz to 63.5 GHz, got 0 Hz; the nearest is 58 GHz"),
        (
            {"end_frequency": 63.6e9},
            "end_frequency: expected 58 GHz to 63.5 GHz, got 63.6 GHz; the nearest is 63.5 GHz",
        ),
        ({"end_frequency": -1e300}, "end_frequency: expected 58 GHz to 63.5 GHz, got -1e+291 GHz"),
        (
            {"chirp_time": 30e-6},
            "chirp_time: expected at least 39.7125 us for 64 samples at 2 MHz, got 30 us; the nearest is 39.7125 us",
        ),
        ({"chirp_time": -1e300}, "chirp_time: expected at least 39.7125 us"),
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
        ({"frame_time": 28e3}, "frame_time: expected at most 27380.4548436 s (the longest timer), got 28000 s"),
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
        {"sample_rate": 4e6},
        {"sample_rate": 78201.0, "chirp_time": 1e-3, "frame_time": 0.1},
        {"num_samples": 1, "end_frequency": 58.1e9},
        {"num_samples": 3266, "chirp_time": 2e-3, "frame_time": 1.0},
        {"num_samples": 4000, "sample_rate": 2.5e6, "chirp_time": 2e-3, "frame_time": 1.0},
        {"num_samples": 4095, "sample_rate": 4e6, "chirp_time": 2e-3, "frame_time": 1.0},
        {"num_chirps": 4096, "frame_time": 3.0},
        {"num_chirps": 1},
        {"tx_power_level": 0},
        {"num_frames": 4094},
        {"start_frequency": 58e9 - 499.0},  # rounded to kHz
        {"end_frequency": 63.5e9 + 499.0},
        {"chirp_time": 39.7125e-6},
        {"frame_time": 37.2805875e-3},
        {"chirp_time": 27380.0, "frame_time": 27380.0, "num_chirps": 1},
        {"frame_time": 27380.4548436},
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


@pytest.mark.parametrize(
    ("slice_size", "message"),
    [
        (0, "slice_size: expected 2 to 16384, got 0; the nearest is 2"),
        (16386, "slice_size: expected 2 to 16384, got 16386; the nearest is 16384"),
        (77, "slice_size: expected an even number, got 77; the nearest are 76, 78"),
    ],
)
def test_slices_hold_pairs_and_fit_the_memory(slice_size: int, message: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # compared below
        registers_of(Settings(), slice_size)
    assert str(caught.value) == message


NUMBERS = ("start_frequency", "end_frequency", "sample_rate", "chirp_time", "frame_time", "highpass_cutoff")
COUNTS = ("num_samples", "num_chirps", "rx_mask", "tx_power_level", "if_gain_db", "num_frames")


@pytest.mark.parametrize("name", [*NUMBERS, *COUNTS, "is_transmitting"])
def test_settings_are_finite_numbers(name: str) -> None:
    for value in (None, "2", [1], 1j) if name == "is_transmitting" else (True, None, "2", [1], 1j):
        with pytest.raises(TypeError, match=f"^{name}: expected"):
            Settings(**{name: value})
    for value in (float("nan"), float("inf"), -float("inf")):
        with pytest.raises((ValueError, TypeError), match=f"^{name}: expected"):
            Settings(**{name: value})


def test_settings_become_plain_numbers() -> None:
    plain = Settings(
        start_frequency=np.float64(58e9),
        chirp_time=np.float32(1e-3),
        num_samples=np.int64(8),
        is_transmitting=np.bool_(True),
    )
    assert [type(value) for value in dataclasses.astuple(plain)] == [
        type(value) for value in dataclasses.astuple(Settings())
    ]
    assert hash(plain) != hash(Settings())


# Slices.


@pytest.mark.parametrize(
    ("changes", "size"),
    [
        ({"num_chirps": 8}, 1536),  # one frame
        ({"num_samples": 1, "num_chirps": 2, "rx_mask": 1, "end_frequency": 58.1e9}, 2),
        ({}, 6144),  # half a frame of 12288
        ({"num_samples": 128}, 8192),  # a third of 24576
        ({"num_chirps": 86}, 5504),  # 16512 = 2 x 8256: three of 5504
        ({"num_samples": 67, "num_chirps": 122, "rx_mask": 2}, 8174),
        ({"num_samples": 67, "num_chirps": 126, "rx_mask": 1}, 4221 * 2 // 3),  # 8442 = 2 x 4221: odd; 3 x 2814
        ({"num_samples": 8, "num_chirps": 4, "chirp_time": 20e-6, "frame_time": 5e-3}, 96),  # 200 frames per second
        ({"num_samples": 8, "num_chirps": 4, "chirp_time": 20e-6, "frame_time": 1e-3}, 480),  # 1000: five at once
        ({"num_samples": 8, "num_chirps": 32, "chirp_time": 16e-6, "frame_time": 0.6e-3}, 6912),  # 1667: nine
        ({"num_samples": 16, "num_chirps": 32, "chirp_time": 20e-6, "frame_time": 0.7e-3}, 7680),  # eight do not fit
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


def test_odd_frame_that_is_too_long_is_refused_with_its_neighbours() -> None:
    long = {"chirp_time": 2e-3, "frame_time": 1.0, "rx_mask": 1}
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # compared below
        choose_slice_size(Settings(num_samples=65, num_chirps=65, **long))
    assert str(caught.value) == (
        "num_samples: expected an even number of samples in a frame of more than 4096, got 1 receivers x 65 chirps x "
        "65 samples; the nearest are 64 or 66 samples, or 64 or 66 chirps"
    )
    for samples, chirps in ((64, 65), (66, 65), (65, 64), (65, 66)):
        assert choose_slice_size(Settings(num_samples=samples, num_chirps=chirps, **long)) % 2 == 0
    with pytest.raises(ValueError, match="the nearest are 2 samples, or 4094 or 4096 chirps"):
        choose_slice_size(
            Settings(num_samples=1, num_chirps=4095, rx_mask=7, chirp_time=1e-4, frame_time=1.0, end_frequency=58.1e9)
        )


@pytest.mark.parametrize(
    ("changes", "size"),
    [
        ({"frame_time": 0.0772}, 6144),
        ({"num_samples": 64, "num_chirps": 8, "rx_mask": 1, "frame_time": 0.1}, 512),
        ({"num_samples": 128, "frame_time": 0.1}, 8192),
        ({"num_samples": 64, "num_chirps": 16, "rx_mask": 1, "chirp_time": 3e-4, "frame_time": 0.005}, 8192),
        ({"num_samples": 8, "num_chirps": 32, "rx_mask": 1, "chirp_time": 15.9625e-6, "frame_time": 10.0053e-3}, 1024),
    ],
)
def test_slice_of_the_vendors_host(changes: dict[str, Any], size: int) -> None:
    assert sdk_slice_size(Settings(**changes)) == size


def test_odd_slice_of_the_vendors_host_is_refused() -> None:
    with pytest.raises(ValueError, match="got slices of 189 samples"):
        sdk_slice_size(Settings(num_samples=63, num_chirps=1))


# Registers of anyone.


def test_image_without_a_sawtooth_is_refused() -> None:
    good = image(V1)
    settings_of(good)
    for address, value in (
        (0x37, good[0x37] & ~0x10),  # no shape
        (0x37, good[0x37] | 1),  # repeated shape
        (0x37, good[0x37] | 0x600),  # no such power mode
        (0x2D, good[0x2D] | 0x600),
        (0x3F, 0x110),  # two shapes
        (0x33, 0),  # no samples
        (0x33, 0x040040),  # samples on the way back
        (0x36, 1),  # a ramp back
        (0x16, 0x480),  # no channel set
        (0x11, good[0x11] & 0x0FFFFF),  # no receiver
        (0x11, 0x8FF41F),  # RX4
        (0x11, 0x7FF01F),  # no ADC
        (0x01, 0x000210),  # divider 0
        (0x01, 19 << 14),
        (0x05, 0x0805B5),  # another crystal
        (0x31, 0x7FFFFF),  # beyond the PLL
        (0x32, 0x000130),  # the ramp ends before the samples do
        (0x2D, good[0x2D] | 0x1FF),  # the ramp begins after the first sample
        (0x12, good[0x12] | 7 << 2),  # no such gain
        (0x12, 1 << 24),
        (0x12, -1),
        (0x60, 0),
    ):
        with pytest.raises(ValueError, match=r"^registers: expected"):
            settings_of(good | {address: value})
    with pytest.raises(ValueError, match=r"^registers: expected shape 1 to be on"):
        settings_of({})


def test_wrapped_ramp_of_the_vendors_host_is_refused() -> None:
    # 4000 samples at 2 MHz: 56 steps per cycle; 160399 cycles, 20050 times 8, of which 14 bits are kept.
    wrapped = {0x33: 4000, 0x32: 20050 & 0x3FFF, 0x31: 56, 0x30: -5636096 - 150 * 56 & 0xFFFFFF}
    with pytest.raises(ValueError, match="a ramp that lasts to the last sample"):
        settings_of(image(V1) | wrapped)


def test_other_timing_is_decoded_by_the_samples() -> None:
    # Power on 8 cycles later and the ramp 16 cycles later: the first sample sees 8 cycles less of the ramp.
    good = image(V1)
    later = settings_of(good | {0x2F: good[0x2F] + 1, 0x2D: good[0x2D] + 2})
    normal = settings_of(good)
    assert normal.start_frequency - later.start_frequency == pytest.approx(8 * 3208 * 640e6 / 2**20, abs=1e-3)
    assert round((later.chirp_time - normal.chirp_time) * CLOCK) == 16  # the ramp is the longer path
    # Delays after the rising and the falling ramp: 8 d + 5 instead of 2.
    delayed = settings_of(good | {0x32: good[0x32] | 2 << 16, 0x36: 1 << 16})
    assert round((delayed.chirp_time - normal.chirp_time) * CLOCK) == (21 - 2) + (13 - 2)
    # Fast down ramp by its mode, and none at all, instead of 6.
    for mode, cycles in enumerate((0, 40, 56, 24)):
        ramp = settings_of(good | {0x05: 0x080034 | mode << 6})
        assert round((ramp.chirp_time - normal.chirp_time) * CLOCK) == cycles - 6


bits24 = st.integers(0, 0xFFFFFF)


@given(changes=st.dictionaries(st.integers(0, 0x5F), bits24, max_size=12), complete=st.booleans())
def test_any_registers_are_decoded_or_refused(changes: dict[int, int], complete: bool) -> None:
    registers = (image(V1) if complete else {}) | changes
    try:
        decoded = settings_of(registers)
        radar = decoded.to_radar()
    except ValueError:
        return
    assert radar.waveform.num_samples == decoded.num_samples


@given(address=st.sampled_from(sorted(image(V1))), flip=st.integers(0, 23))
def test_registers_with_a_flipped_bit_are_decoded_or_refused(address: int, flip: int) -> None:
    registers = image(V1)
    registers[address] ^= 1 << flip
    try:
        decoded = settings_of(registers)
        registers_of(decoded, slice_size_of(registers))
    except ValueError:
        return
    assert 1 <= decoded.num_samples <= 4095


@st.composite
def legal_settings(draw: st.DrawFn) -> Settings:
    rate = draw(st.integers(78201, 4_000_000))
    divider = (160_000_000 // rate + 1) // 2
    samples = draw(st.integers(1, min(4095, (131064 - 399) // divider)))
    chirps = draw(st.integers(1, 4096))
    chirp = (8 * -(-(samples * divider + 399) // 8) + 217) / CLOCK
    delay = draw(st.one_of(st.just(0.0), st.floats(-8.0, 0.0).map(lambda x: 10.0**x)))
    rest = draw(st.floats(-7.0, 4.0).map(lambda x: 10.0**x))
    # The timer after a chirp may take 6 cycles or 0.4 % longer than wanted.
    frame = chirps * (chirp + delay * 1.004 + 8 / CLOCK) + rest
    frequency = st.floats(58e9, 63.5e9)
    start, end = draw(frequency), draw(frequency)
    # Ramps of fewer cycles than these begin beyond the PLL's range, 1.3 GHz from the band.
    length = samples * divider + 249
    assume(150 * abs(end - start) / length < 1.6e9)
    return Settings(
        start_frequency=start,
        end_frequency=end,
        sample_rate=rate,
        num_samples=samples,
        num_chirps=chirps,
        chirp_time=chirp + delay,
        frame_time=frame,
        rx_mask=draw(st.integers(1, 7)),
        tx_power_level=draw(st.integers(0, 31)),
        is_transmitting=draw(st.booleans()),
        if_gain_db=draw(st.integers(18, 60)),
        highpass_cutoff=draw(st.floats(0.0, 1e6)),
        num_frames=draw(st.integers(0, 4094)),
    )


TIMERS = (0x2D, 0x37)


@settings(deadline=None)
@given(wanted=legal_settings(), slice_size=st.integers(1, 8192).map(lambda n: 2 * n))
def test_registers_of_decoded_registers_are_the_same(wanted: Settings, slice_size: int) -> None:
    registers = registers_of(wanted, slice_size)
    back = settings_of(registers)
    again = registers_of(back, slice_size)
    assert {a: v for a, v in again.items() if a not in TIMERS} == {
        a: v for a, v in registers.items() if a not in TIMERS
    }
    # Times move by what float32 makes of them, 2**-24, and one cycle.
    twice = settings_of(again)
    assert dataclasses.replace(twice, chirp_time=0.0, frame_time=0.0) == dataclasses.replace(
        back, chirp_time=0.0, frame_time=0.0
    )
    for name in ("chirp_time", "frame_time"):
        assert abs(getattr(twice, name) / getattr(back, name) - 1.0) <= 2.0**-23


@settings(deadline=None)
@given(wanted=legal_settings())
def test_achieved_settings_are_within_the_chips_steps(wanted: Settings) -> None:
    back = achieved(wanted)
    for name in ("num_samples", "num_chirps", "rx_mask", "is_transmitting", "num_frames"):
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


# Radars.


def test_preset_radar_has_the_default_settings() -> None:
    default = Settings.from_radar(rc.bgt60tr13c())
    assert registers_of(default, 6144) == image(V1)
    assert default.start_frequency == pytest.approx(58e9, abs=1.0)
    assert default.end_frequency == pytest.approx(63.5e9, abs=1.0)


def test_options_of_the_chip_are_passed_on() -> None:
    options = {"tx_power_level": 7, "if_gain_db": 40, "highpass_cutoff": 45e3}
    passed = Settings.from_radar(rc.bgt60tr13c(), **options)
    assert {name: getattr(passed, name) for name in options} == options


def test_settings_become_the_preset_radar() -> None:
    radar = achieved(Settings()).to_radar()
    preset = rc.bgt60tr13c()
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
    preset = rc.bgt60tr13c()
    rows = preset.rx[[i for i in range(3) if mask >> i & 1]]
    radar = rc.Radar(preset.waveform, rx=rows + 0.9e-4)
    found = Settings.from_radar(radar)
    assert found.rx_mask == mask
    assert found.to_radar().rx.tolist() == rows.tolist()
    assert found.frame_size == len(rows) * 64 * 64


def test_three_receivers_anywhere_are_all_of_them() -> None:
    waveform = rc.bgt60tr13c().waveform
    assert Settings.from_radar(rc.Radar(waveform, rx=[[0, 0, 0], [0, 0.5, 0], [0, 1, 0]])).rx_mask == 7


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
        Settings.from_radar(rc.Radar(rc.bgt60tr13c().waveform, rx=rx))


@pytest.mark.parametrize(
    ("radar", "message"),
    [
        (
            rc.Radar(rc.bgt60tr13c().waveform, tx=[[0, 0, 0], [0, 1, 0]]),
            "tx: expected one antenna, got 2",
        ),
        (
            rc.bgt60tr13c(num_chirps=3, chirp_times=[0.0, 1e-3, 3e-3]),
            "chirp_times: expected evenly spaced chirps from 0 s on, got 0 s",
        ),
        (
            rc.bgt60tr13c(num_chirps=2, chirp_times=[1e-3, 2e-3]),
            "chirp_times: expected evenly spaced chirps from 0 s on, got 0.001 s",
        ),
        (
            rc.bgt60tr13c(chirp_interval=36e-6),
            "chirp_interval: expected at least 39.7125 us for 64 samples at 2 MHz, got 36 us; the nearest is "
            "39.7125 us",
        ),
        (
            rc.bgt60tr13c(frame_interval=30e-3),
            "frame_interval: expected at least 37.2805875 ms for 64 chirps every 591.125 us, got 30 ms",
        ),
        (rc.bgt60tr13c(sample_rate=5e6), "sample_rate: expected 78.201 kHz to 4 MHz, got 5 MHz"),
        (rc.bgt60tr13c(num_samples=1100), "num_samples: "),
        (
            rc.bgt60tr13c(start_frequency=57e9),
            "start_frequency (3.1125 us before the first sample): expected 58 GHz to 63.5 GHz, got 57 GHz; the "
            "nearest is 58 GHz",
        ),
        (
            rc.bgt60tr13c(stop_frequency=64e9),
            "slope (the ramp's end, one sample after the last): expected 58 GHz to 63.5 GHz, got 64 GHz",
        ),
    ],
)
def test_radar_that_the_chip_cannot_be_is_refused_in_its_own_words(radar: rc.Radar, message: str) -> None:
    if message == "num_samples: ":
        radar = rc.Radar(
            radar.waveform.replace(sample_rate=500e3, chirp_interval=5e-3, frame_interval=1.0), rx=radar.rx
        )
        message = "num_samples: expected 1 to 816 at 500 kHz (ramps of at most 1.6383 ms), got 1100"
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # compared below
        Settings.from_radar(radar)
    assert str(caught.value).startswith(message)


def test_radar_of_impossible_settings_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^rx_mask: expected 1 to 7, got 0"):
        Settings(rx_mask=0).to_radar()
    with pytest.raises(ValueError, match=r"^sample_rate: expected 78.201 kHz to 4 MHz"):
        Settings(sample_rate=1.0).to_radar()
    with pytest.raises(ValueError, match=r"^slope: expected"):
        Settings(end_frequency=58e9).to_radar()
    with pytest.raises(TypeError, match=r"^radar: expected Radar, got Settings"):
        Settings.from_radar(Settings())  # type: ignore[arg-type]


# Temperature.


def test_temperature_of_a_code() -> None:
    assert temperature_of(700) == pytest.approx(13.327, abs=1e-3)
    assert temperature_of(0) == pytest.approx(-276.1678, abs=1e-3)
    for code in range(1024):
        assert temperature_code(temperature_of(code)) == code
    # A step of the code is 0.414 degrees.
    assert abs(temperature_of(temperature_code(36.6)) - 36.6) <= 0.207


def test_temperatures_beyond_the_sensor_have_its_last_codes() -> None:
    assert (temperature_code(-400.0), temperature_code(1e300)) == (0, 1023)
    for code in (-1, 1024):
        with pytest.raises(ValueError, match=r"^code: expected"):
            temperature_of(code)
    with pytest.raises(ValueError, match=r"^temperature: expected a finite number"):
        temperature_code(float("nan"))
