"""Cramér-Rao bounds against closed forms, and against the Fisher information of eq. (1) by finite differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from chip_settings import power_up
from radarcore import processing
from radarcore.units import SPEED_OF_LIGHT

Array = NDArray[np.float64]

# Long, wide chirps, so that all three things that tell of velocity count.
LONG = rc.Waveform(
    start_frequency=58e9,
    slope=4e12,
    sample_rate=64e3,
    num_samples=64,
    num_chirps=8,
    chirp_interval=1.3e-3,
    adc_delay=2e-5,
)
SHORT = power_up(num_chirps=16).waveform
FALLING = rc.bgt60tr13c(num_chirps=4, start_frequency=63e9, stop_frequency=59e9).waveform
ONE = LONG.replace(num_chirps=1)
DOWN = rc.Waveform(start_frequency=62.5e9, slope=-3.5e12, sample_rate=64e3, num_samples=80)
RANGE, VELOCITY, SNR_DB = 3.1, 0.7, 12.0

EXACT = 1e-4
"""The part neglected by the closed forms, the delay within slope * delay**2 / 2, counts less than this."""


def echo(waveform: rc.Waveform, distance: float, velocity: float, since: float) -> NDArray[np.complex128]:
    """Eq. (1), (chirp, sample), of a range that holds `since` after the start of the frame."""
    ramp = waveform.sample_times
    time = waveform.chirp_times[:, None] + ramp
    delay = 2.0 / SPEED_OF_LIGHT * (distance + velocity * (time - since))
    turns = delay * (waveform.start_frequency + waveform.slope * ramp - 0.5 * waveform.slope * delay)
    return np.exp(2j * np.pi * turns)


def least_deviations(signal: Callable[[Array], NDArray[Any]], start: Array, steps: Array) -> Array:
    """Of the first two parameters of a signal of unit amplitude in white noise, from its derivatives."""
    columns = [
        (signal(start + step * unit) - signal(start - step * unit)).ravel() / (2.0 * step)
        for step, unit in zip(steps, np.eye(len(start)), strict=True)
    ]
    jacobian = np.stack(columns, axis=1)
    # Fisher information: 2 / s^2 Re(J^H J) of I/Q samples of power 1, and 1 / s^2 J^T J of real ones of power 1/2.
    fisher = 2.0 * 10.0 ** (0.1 * SNR_DB) * (jacobian.conj().T @ jacobian).real
    size = np.sqrt(np.diag(fisher))
    variances: Array = np.diag(np.linalg.inv(fisher / np.outer(size, size))) / size**2
    return np.sqrt(variances[:2])


def of_one_frame(waveform: rc.Waveform, *, per_chirp: bool, is_real: bool = False) -> Array:
    """Deviations of range and velocity, with an unknown amplitude and an unknown phase, or one per chirp."""
    num_phases = waveform.num_chirps if per_chirp else 1

    def signal(parameters: Array) -> NDArray[Any]:
        distance, velocity, amplitude, *phases = parameters
        turned = echo(waveform, distance, velocity, 0.5 * waveform.duration) * np.exp(1j * np.array(phases))[:, None]
        samples: NDArray[Any] = amplitude * turned
        return samples.real if is_real else samples

    start = np.array([RANGE, VELOCITY, 1.0, *np.linspace(0.3, 2.0, num_phases)])
    return least_deviations(signal, start, np.array([1e-7, 1e-5, 1e-4, *[1e-4] * num_phases]))


def both(bound: processing.CramerRaoBound) -> list[float]:
    return [float(bound.range), float(bound.velocity)]


# The Fisher information of the exact signal


@pytest.mark.parametrize("waveform", [LONG, SHORT, FALLING])
def test_doppler_bound_is_that_of_the_exact_signal(waveform: rc.Waveform) -> None:
    exact = of_one_frame(waveform, per_chirp=False)
    np.testing.assert_allclose(both(processing.doppler_bound(waveform, SNR_DB)), exact, rtol=EXACT)


def test_real_samples_have_the_bound_of_the_exact_signal_but_for_the_mirror_image() -> None:
    exact = of_one_frame(LONG, per_chirp=False, is_real=True)
    # The beat frequency is 83 bins away from its mirror image, whose interference falls as one over that.
    np.testing.assert_allclose(both(processing.doppler_bound(LONG, SNR_DB, is_real=True)), exact, rtol=2e-2)


@pytest.mark.parametrize("waveform", [ONE, DOWN])
def test_chirp_rate_bound_is_that_of_one_exact_chirp(waveform: rc.Waveform) -> None:
    exact = of_one_frame(waveform, per_chirp=False)
    np.testing.assert_allclose(both(processing.chirp_rate_bound(waveform, SNR_DB)), exact, rtol=EXACT)


@pytest.mark.parametrize("delay", [0.0, 1.4e-3])
def test_up_down_bound_is_that_of_two_exact_chirps_of_one_target(delay: float) -> None:
    middle = 0.25 * (ONE.duration + DOWN.duration) + 0.5 * delay  # between the middles, after the start of `up`

    def beats(parameters: Array) -> NDArray[Any]:
        """Information of two chirps without their curvature: each its frequency in the middle."""
        distance, velocity, *phases = parameters
        parts = []
        for wf, since, turn in ((ONE, middle, phases[0]), (DOWN, middle - delay, phases[1])):
            samples = echo(wf, distance, velocity, since)[0]
            parts.append(samples * np.exp(1j * turn))
        return np.concatenate(parts)

    exact = least_deviations(beats, np.array([RANGE, VELOCITY, 0.4, 1.1]), np.array([1e-7, 1e-5, 1e-4, 1e-4]))
    bound = both(processing.up_down_bound(ONE, DOWN, SNR_DB, down_delay=delay))
    # The curvature tells a little of velocity too: information adds.
    curvature = [float(processing.chirp_rate_bound(wf, SNR_DB).velocity) for wf in (ONE, DOWN)]
    together = (bound[1] ** -2 + sum(part**-2 for part in curvature)) ** -0.5
    assert exact[1] == pytest.approx(together, rel=1e-6)  # but for what range and velocity share
    assert together <= bound[1] <= 1.01 * together
    assert exact[0] == pytest.approx(bound[0], rel=1e-2)


# Closed forms


def test_a_hann_window_costs_a_factor_of_1_53() -> None:
    # By integrals over the window: sqrt(int w^2 t^2 * int t^2) / int w t^2, with w = (1 + cos t) / 2.
    pi = np.pi
    loss = np.sqrt((pi**3 / 4.0 - 2.0 * pi + pi / 8.0) * (2.0 * pi**3 / 3.0)) / (pi**3 / 3.0 - 2.0 * pi)
    assert loss == pytest.approx(1.5306, abs=1e-4)
    up = LONG.replace(slope=4e11, num_samples=512, num_chirps=1)
    down = up.replace(start_frequency=62e9, slope=-up.slope)
    plain, windowed = (processing.up_down_bound(up, down, 0.0, window=window).range for window in (None, "hann"))
    assert windowed / plain == pytest.approx(loss, rel=1e-4)  # a periodic window is half a sample late


def test_chirp_rate_bound_is_that_of_djuric_and_kay() -> None:
    """Parameter Estimation of Chirp Signals, IEEE Trans. ASSP 1990."""
    snr, n = 10.0 ** (0.1 * SNR_DB), ONE.num_samples
    rate = np.sqrt(90.0 / (np.pi**2 * snr * n * (n**2 - 1) * (n**2 - 4))) * ONE.sample_rate**2  # [Hz/s]
    expected = SPEED_OF_LIGHT / (4.0 * ONE.slope) * rate
    assert float(processing.chirp_rate_bound(ONE, SNR_DB).velocity) == pytest.approx(expected, rel=1e-12)
    many = ONE.replace(num_chirps=9)
    assert float(processing.chirp_rate_bound(many, SNR_DB).velocity) == pytest.approx(expected / 3.0, rel=1e-9)


def test_up_and_down_at_once_have_closed_forms() -> None:
    down = ONE.replace(start_frequency=ONE.start_frequency + ONE.slope * 1.04e-3, slope=-ONE.slope)
    carrier = ONE.start_frequency + ONE.slope * (ONE.adc_delay + 31.5 / ONE.sample_rate)
    # Rife and Boorstyn, Single-Tone Parameter Estimation from Discrete-Time Observations, IEEE Trans. IT 1974.
    snr, number = 10.0 ** (0.1 * SNR_DB), ONE.num_samples
    frequency = np.sqrt(6.0 / (snr * number * (number**2 - 1))) * ONE.sample_rate / (2.0 * np.pi)
    bound = processing.up_down_bound(ONE, down, SNR_DB, down_delay=0.0)
    # The carriers of both are equal to 1e-3.
    assert float(bound.velocity) == pytest.approx(2**0.5 * SPEED_OF_LIGHT / (4.0 * carrier) * frequency, rel=1e-3)
    assert float(bound.range) == pytest.approx(2**0.5 * SPEED_OF_LIGHT / (4.0 * ONE.slope) * frequency, rel=1e-3)


def test_channels_add_information_and_an_echo_without_power_has_none() -> None:
    one, four = (processing.doppler_bound(SHORT, [0.0, -np.inf], num_channels=number) for number in (1, 4))
    np.testing.assert_allclose(four.velocity[0], 0.5 * one.velocity[0])
    assert one.velocity[1] == one.range[1] == np.inf
