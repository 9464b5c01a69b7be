"""Noise of the receiver: its power, its spectrum behind the low-pass, and the kick at the start of chirps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.receive.chain import receive
from radarcore.receive.filters import low_pass_gain

THERMAL = 1.380649e-23 * 290.0  # k T [W/Hz]
RATE = 2e6


def radar(receiver: rc.Receiver, num_chirps: int = 1000, num_samples: int = 1000) -> rc.Radar:
    return rc.Radar(
        rc.Waveform(
            start_frequency=60e9, slope=10e12, sample_rate=RATE, num_samples=num_samples, num_chirps=num_chirps
        ),
        receiver=receiver,
    )


def noise(receiver: rc.Receiver, num_chirps: int = 1000, num_samples: int = 1000, seed: int = 1) -> NDArray[Any]:
    zeros = np.zeros((1, num_chirps, num_samples), np.complex64)
    return receive(zeros, radar(receiver, num_chirps, num_samples), 0.0, seed=seed)


@pytest.mark.parametrize("output", ["real", "iq"])
@pytest.mark.parametrize("gain_db", [None, 30.0])
def test_deviation_of_a_million_samples_is_that_of_k_t_f_fs(output: str, gain_db: float | None) -> None:
    n = noise(rc.Receiver(output=output, noise_figure_db=12.0, gain_db=gain_db))
    expected = THERMAL * 10.0**1.2 * RATE * (0.5 if output == "real" else 1.0) * 10.0 ** ((gain_db or 0.0) / 10.0)
    # A deviation of 1e6 normal numbers is within 4 / sqrt(2e6) = 0.28 %; the issue asks for 2 %.
    assert np.sqrt(np.mean(np.abs(n) ** 2) / expected) == pytest.approx(1.0, abs=3e-3)


@pytest.mark.filterwarnings("ignore:receiver.low_pass. expected at most half the sample rate")  # aliases are wanted
@pytest.mark.parametrize("output", ["real", "iq"])
@pytest.mark.parametrize(("order", "low_pass"), [(1, 300e3), (4, 515e3), (7, 1.6e6)])
def test_power_behind_the_low_pass_is_that_of_its_noise_bandwidth(output: str, order: int, low_pass: float) -> None:
    """Integral of a Butterworth filter's ``|H|^2``: (pi / 2 n) / sin(pi / 2 n) times its corner; aliases included."""
    n = noise(rc.Receiver(output=output, noise_figure_db=12.0, low_pass=low_pass, low_pass_order=order), 4000, 100)
    angle = 0.5 * np.pi / order
    # One-sided density k T F of real samples, as white noise up to half the rate has it; I/Q has both sides.
    density = THERMAL * 10.0**1.2 * (1.0 if output == "real" else 2.0)
    expected = density * low_pass * angle / np.sin(angle)
    # 4e5 samples, correlated over a few: 4 sqrt(2 * 4 / 4e5) = 1.8 %; aliases beyond 64 rates: 0.2 % at first order.
    assert np.mean(np.abs(n) ** 2) / expected == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("output", ["real", "iq"])
def test_noise_has_the_same_covariance_at_all_places_of_a_chirp(output: str) -> None:
    receiver = rc.Receiver(output=output, noise_figure_db=12.0, low_pass=300e3)
    num_chirps, num_samples = 40_000, 8
    n = noise(receiver, num_chirps, num_samples)[0] / np.sqrt(receiver.noise_variance(RATE))
    covariance = (n.conj().T @ n).real / num_chirps
    # Wiener and Khinchin: the transform of |H|^2 with its aliases, by the midpoint rule.
    frequency = RATE * (np.arange(20_000) + 0.5) / 20_000
    power = sum(abs(low_pass_gain(receiver, frequency + RATE * k)) ** 2 for k in range(-4, 4))
    lags = np.arange(num_samples)
    expected = (power * np.cos(2.0 * np.pi * np.outer(lags, frequency) / RATE)).mean(axis=1)
    assert abs(expected[1]) > 0.2  # it is coloured
    toeplitz = expected[abs(np.subtract.outer(lags, lags))]
    # Products of unit numbers have a variance of at most 2 expected[0]^2: 4 sigma of their mean.
    np.testing.assert_allclose(covariance, toeplitz, rtol=0.0, atol=4.0 * np.sqrt(2.0 / num_chirps) * expected[0])


def test_high_pass_leaves_noise_alone_and_gain_makes_it_louder() -> None:
    receiver = rc.Receiver(output="real", noise_figure_db=12.0)
    first = noise(receiver, 4, 50)
    np.testing.assert_array_equal(noise(replace(receiver, high_pass=80e3), 4, 50), first)
    louder = noise(replace(receiver, gain_db=20.0), 4, 50)
    np.testing.assert_allclose(louder, 10.0 * first, rtol=1e-6)


@pytest.mark.parametrize("output", ["real", "iq"])
def test_kick_decays_from_its_level_and_is_one_draw_per_chirp(output: str) -> None:
    receiver = rc.Receiver(output=output, noise_figure_db=0.0)
    kicked = replace(receiver, adc_errors=rc.AdcErrors(turn_on_db=20.0, turn_on_time=4.0 / RATE))
    num_chirps = 20_000
    kick = (noise(kicked, num_chirps, 16) - noise(receiver, num_chirps, 16))[0].astype(complex)
    kick /= np.sqrt(receiver.noise_variance(RATE))
    level = np.sqrt(np.mean(np.abs(kick) ** 2, axis=0))
    # 20 dB over the noise, falling to 1/e in four samples; a deviation of 20 000 draws within 4 / sqrt(4e4) = 2 %.
    np.testing.assert_allclose(level, 10.0 * np.exp(-np.arange(16) / 4.0), rtol=0.02)
    # The difference of float32 numbers of about 10 leaves 1e-6 of them.
    np.testing.assert_allclose(kick[:, 5], kick[:, 0] * np.exp(-1.25), rtol=0.0, atol=1e-4)
    assert abs(np.mean(kick[1:, 0] * kick[:-1, 0].conj())) < 4.0 * 100.0 / np.sqrt(num_chirps)
