"""Registers of the BGT60TR13C: published lists, the words that start it, and images of anyone."""

from __future__ import annotations

import dataclasses

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
from radarcore.sensor.bgt60.registers import (
    RESET_VALUES,
    chip_name,
    start_words,
    temperature_code,
    temperature_of,
)
from radarcore.sensor.bgt60.settings import Settings, registers_of, settings_of, slice_size_of
from radarcore.sensor.strata.packets import encode_commands

# The words that start settings V1 with a gain of 33 dB.
WORDS = """
030A0210 09E967FD 0B0805B4 0D102BFF 0F010D00 11000000 13000000 15000000 17000BE0 19000000 1B000000 1D000000 1F000B60
2113FC51 237FF41F 25703DEF 2D000490 3B000480 49000480 57000480 5911BE0E 5B62FC0A 5D03F000 5F787E1E 61A2A850 63000C88
65000172 67000040 69000000 6B000000 6D000000 6F393B10 7F000100 8F000100 9F000100 AD000000 B7000000 011E8271
"""


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
    times = {"chirp_time": default.chirp_time, "frame_time": default.frame_time}
    assert [decoded.chirp_time, decoded.frame_time] == pytest.approx(list(times.values()), rel=1e-7)
    assert dataclasses.replace(decoded, end_frequency=63.5e9, **times) == default


def test_start_sends_main_last_with_the_trigger() -> None:
    registers = registers_of(dataclasses.replace(V1_SETTINGS, if_gain_db=33), 6144)
    words = start_words(registers)
    assert [f"{word:08X}" for word in words] == WORDS.split()
    assert encode_commands(words) == bytes.fromhex("".join(WORDS.split()))
    # The order of the mapping does not matter.
    assert start_words(dict(reversed(registers.items()))) == words


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


@settings(deadline=None, max_examples=50)
@given(wanted=legal_settings(), slice_size=st.integers(1, 8192).map(lambda n: 2 * n))
def test_registers_of_decoded_registers_are_the_same(wanted: Settings, slice_size: int) -> None:
    registers = registers_of(wanted, slice_size)
    back = settings_of(registers)
    again = registers_of(back, slice_size)
    timers = {address: registers[address] for address in (0x2D, 0x37)}
    assert again | timers == registers
    # Times move by what float32 makes of them, 2**-24, and one cycle.
    twice = settings_of(again)
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
