"""The receiver: thermal noise of the right power, real or I/Q, the same for the same seed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.receive.chain import receive

THERMAL = 1.380649e-23 * 290.0  # k T [W/Hz]
NUM = 200_000
"""Samples of a statistical test; four sigma of an estimated variance are then 0.9 % (I/Q) and 1.3 % (real)."""


def received(receiver: rc.Receiver, signal: NDArray[Any], seed: int) -> NDArray[Any]:
    return receive(signal.copy(), rc.Radar(WAVEFORM, receiver=receiver), 0.0, seed=seed)


def noise(receiver: rc.Receiver, seed: int) -> NDArray[Any]:
    return received(receiver, np.zeros((4, 50, NUM // 200), dtype=np.complex128), seed)


@pytest.mark.parametrize("figure_db", [0.0, 3.0103, 12.0])
@pytest.mark.parametrize("sample_rate", [1e6, 2.5e6])
def test_noise_variance_is_k_t_f_fs_and_half_of_it_for_a_real_receiver(figure_db: float, sample_rate: float) -> None:
    power = THERMAL * 10.0 ** (figure_db / 10.0) * sample_rate
    iq, real = (rc.Receiver(output=output, noise_figure_db=figure_db) for output in ("iq", "real"))
    assert iq.noise_variance(sample_rate) == pytest.approx(power, rel=1e-14)
    assert real.noise_variance(sample_rate) == pytest.approx(0.5 * power, rel=1e-14)
    assert rc.Receiver().noise_variance(sample_rate) == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_iq_noise_is_circular_with_the_stated_power(seed: int) -> None:
    receiver = rc.Receiver(noise_figure_db=12.0)
    n = noise(receiver, seed) / np.sqrt(receiver.noise_variance(2e6))
    four_sigma = 4.0 / np.sqrt(NUM)  # of a mean of NUM numbers of unit variance
    assert abs(np.mean(abs(n) ** 2) - 1.0) <= four_sigma, f"seed {seed}"  # |n|^2: exponential, variance 1
    assert abs(np.mean(n)) <= four_sigma, f"seed {seed}"
    assert abs(np.mean(n**2)) <= np.sqrt(2.0) * four_sigma, f"seed {seed}"  # |n^2|^2 has mean 2
    assert abs(np.mean(n.real**2) - 0.5) <= np.sqrt(0.5) * four_sigma, f"seed {seed}"  # half in either part


def test_noise_adds_to_the_signal_and_equal_seeds_give_equal_bits() -> None:
    receiver = rc.Receiver(noise_figure_db=12.0)
    signal = 1e-6 * np.exp(1j * np.arange(24.0)).reshape(1, 2, 12)
    first, again, other = (received(receiver, signal, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()
    alone = received(receiver, np.zeros_like(signal), 1)
    np.testing.assert_array_equal(first, signal + alone)
    # More noise is the same noise, louder: F from 12 to 32 dB is 10 in amplitude.
    louder = received(rc.Receiver(noise_figure_db=32.0), np.zeros_like(signal), 1)
    np.testing.assert_allclose(louder, 10.0 * alone, rtol=1e-6)


def test_without_noise_iq_is_the_signal_and_real_its_real_part() -> None:
    signal = np.exp(1j * np.arange(24.0)).reshape(1, 2, 12)
    np.testing.assert_array_equal(received(rc.Receiver(), signal, 0), signal)
    real = received(rc.Receiver(output="real"), signal, 0)
    np.testing.assert_array_equal(real, signal.real)
    assert real.flags.c_contiguous


WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=100, num_chirps=50, chirp_interval=100e-6
)
