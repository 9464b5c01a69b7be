"""Packing of the ADC's codes, their scale, and the chip's test pattern."""

from __future__ import annotations

import numpy as np

from radarcore.recording.frame import NUM_CODES, to_codes, to_samples
from radarcore.sensor.bgt60.registers import test_pattern
from radarcore.sensor.strata.slices import pack_msb, unpack_msb

CODES = np.arange(NUM_CODES, dtype=np.uint16)


def test_chip_packs_two_samples_in_three_bytes_most_significant_bit_first() -> None:
    assert unpack_msb(bytes.fromhex("123456")).tolist() == [0x123, 0x456]
    assert pack_msb([0x123, 0x456]) == bytes.fromhex("123456")
    values = np.random.default_rng(0).integers(0, 4096, 1000)
    data = bytes.fromhex("".join(f"{value:03x}" for value in values))
    assert pack_msb(values) == data
    assert unpack_msb(data).tolist() == values.tolist()
    # Every bit of every byte has its own place.
    assert unpack_msb(bytes.fromhex("800000 010000 008000 001000 000800 000100 000080 000001")).tolist() == [
        *(0x800, 0, 0x010, 0, 0x008, 0, 0x001, 0),
        *(0, 0x800, 0, 0x100, 0, 0x080, 0, 0x001),
    ]


def test_unpacked_codes_are_writable_uint16_from_any_bytes() -> None:
    for kind in (bytes, bytearray, memoryview):
        unpacked = unpack_msb(kind(b"\x12\x34\x56"))
        assert (unpacked.dtype, unpacked.flags.writeable) == (np.uint16, True)


def test_samples_go_from_minus_one_to_one_in_float32() -> None:
    samples = to_samples(CODES)
    assert samples.dtype == np.float32
    assert (samples[0], samples[-1]) == (-1.0, 1.0)
    # 2 code / 4095 is rounded to float32 below 2, with half a unit of 2**-24; the rest is exact or smaller.
    exact = 2.0 * CODES.astype(np.float64) / 4095.0 - 1.0
    assert np.abs(samples - exact).max() <= 1.01 * 2.0**-24
    # float32 by hand: 4096 / 4095 is nearest to 1 + 2049 * 2**-23; 3162 / 4095 to 12954715 * 2**-24.
    assert samples[2048] == 2049 * 2.0**-23
    assert samples[1581] == 12954715 * 2.0**-24 - 1.0


def test_codes_come_back_from_their_samples() -> None:
    back = to_codes(to_samples(CODES))
    assert back.dtype == np.uint16
    assert np.array_equal(back, CODES)
    assert np.array_equal(to_codes(2.0 * CODES / 4095.0 - 1.0), CODES)
    assert to_samples(CODES.reshape(2, -1, 4)).shape == to_codes(np.zeros((2, 512, 4))).shape


def test_samples_are_rounded_to_the_nearest_code() -> None:
    step = 2.0 / 4095.0
    assert to_codes([-1.0 + 0.49 * step, -1.0 + 0.51 * step, 1.0 - 0.51 * step]).tolist() == [0, 1, 4094]


def test_adc_clips_beyond_full_scale() -> None:
    assert to_codes([-1.0001, -np.inf, 1.0001, np.inf, 1e300]).tolist() == [0, 0, 4095, 4095, 4095]


def test_given_samples_are_not_changed() -> None:
    samples = np.array([0.25, -3.0])
    to_codes(samples)
    assert samples.tolist() == [0.25, -3.0]


def test_pattern_is_that_of_the_chip() -> None:
    pattern = test_pattern(5000)
    first = "001 800 400 200 100 880 440 220 110 888 444 A22"
    assert " ".join(f"{code:03X}" for code in pattern[:12]) == first
    assert pattern.dtype == np.uint16
    assert len(set(pattern[:4095].tolist())) == 4095  # all but 0: the longest period
    assert np.array_equal(pattern[4095:], pattern[:905])
    assert np.array_equal(test_pattern(5, 4093), pattern[4093:4098])
    assert np.array_equal(test_pattern(3, 10 * 4095 + 1), pattern[1:4])
