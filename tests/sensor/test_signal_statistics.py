"""Noise, leakage and pace of measured frames, and registers read back, by numbers known on paper."""

from __future__ import annotations

import numpy as np
import pytest

from radarcore.sensor.bgt60.registers import (
    ADC0,
    CHIP_ID,
    COMPARED,
    FSTAT,
    MAIN,
    PLL1_0,
    RESET_VALUES,
    RFT1,
    SFCTL,
    stuck_bits,
    unusual_resets,
)
from radarcore.sensor.bgt60.settings import Settings, registers_of
from radarcore.sensor.checks import chirp_noise, clipped, leakage
from radarcore.sensor.selftest import pace_of


@pytest.mark.parametrize("shape", [(5, 3, 32, 64), (40, 3, 2, 64), (64, 3, 1, 16)])
def test_noise_is_its_deviation_whatever_stands_still(shape):
    rng = np.random.default_rng(3)
    noise = np.array([1.0, 5.0, 0.0])[:, None, None]
    still = rng.uniform(0.0, 2000.0, shape[-1])
    codes = still + noise * rng.normal(size=shape)
    # 1,000 steps or more, which are correlated by pairs.
    assert chirp_noise(codes) == pytest.approx([1.0, 5.0, 0.0], rel=0.1)


def test_first_chirps_and_samples_are_no_noise():
    codes = np.random.default_rng(4).normal(0.0, 2.0, (5, 1, 32, 64))
    codes[:, :, :8] += 50.0
    codes[:, :, ::2, :16] += 50.0
    assert chirp_noise(codes) == pytest.approx([2.0], rel=0.05)


def test_leakage_is_the_change_of_the_mean_chirp():
    off = np.full((2, 2, 4, 8), 2000) + np.arange(8) % 2  # what is there without the transmitter too
    on = off + np.array([10, 300])[:, None, None] * (np.arange(8) == 0)
    assert leakage(on, off).tolist() == [10.0, 300.0]
    assert leakage(off, off).tolist() == [0.0, 0.0]


def test_clipped_samples_are_those_at_both_ends():
    assert clipped([0, 1, 4094, 4095]) == 0.5


def test_pace_is_that_of_most_frames():
    numbers = [0, 1, 2, 5, 6, 7, 8, 9]
    times = [0.02 * number for number in numbers]
    assert pace_of(numbers, times) == pytest.approx((0.02, 0.0), abs=1e-12)
    times[2] += 0.5  # one that was late
    assert pace_of(numbers, times)[0] == pytest.approx(0.02, abs=1e-12)
    assert pace_of([3, 5], [1.0, 1.5]) == (0.25, 0.0)


def test_jitter_is_what_one_frame_of_twenty_is_late():
    late = np.where(np.arange(200) % 10 == 0, 4e-3, 0.0)  # one of ten
    assert pace_of(range(200), 0.01 * np.arange(200) + late) == pytest.approx((0.01, 4e-3), rel=1e-9)
    late = np.where(np.arange(200) % 40 == 0, 4e-3, 0.0)  # one of forty
    assert pace_of(range(200), 0.01 * np.arange(200) + late) == pytest.approx((0.01, 0.0), abs=1e-6)


def test_registers_are_compared_but_for_bits_without_a_public_meaning():
    image = registers_of(Settings(), 6144)
    assert stuck_bits(image, image) == {}
    assert stuck_bits(image, image | {PLL1_0: image[PLL1_0] ^ 0x800001}) == {PLL1_0: 0x800001}
    for address, bits in ((ADC0, 1 << 13), (ADC0, 1 << 12), (MAIN, 0xF), (RFT1, 0xFFFFFF), (SFCTL, 1 << 15)):
        assert stuck_bits(image, image | {address: image[address] ^ bits}) == {}
    assert stuck_bits(image, {}) == {}
    # All that is set is compared, but for two test registers; nothing is set that is not compared.
    assert set(image) - set(COMPARED) == {RFT1, 0x5B}
    assert all(value & ~COMPARED[address] == 0 for address, value in image.items() if address in COMPARED)


def test_resets_are_compared_with_published_values_but_for_states():
    assert unusual_resets(RESET_VALUES) == {}
    changes = {ADC0: 0x0A0240, FSTAT: 0, CHIP_ID: 1, SFCTL: 0x100000, 0x30: 5}
    assert unusual_resets(RESET_VALUES | changes) == {0x30: 5}
