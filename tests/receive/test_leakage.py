"""Leakage: a slow tone behind the high-pass and the step of turning on, the same in every chirp."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc

WAVEFORM = rc.Waveform(
    start_frequency=58e9,
    slope=150e12,
    sample_rate=2e6,
    num_samples=64,
    num_chirps=3,
    chirp_interval=500e-6,
    adc_delay=3e-6,
)


def cube(receiver: rc.Receiver, **antennas: Any) -> NDArray[Any]:
    radar = rc.Radar(WAVEFORM, tx_power_dbm=10.0, receiver=receiver, **antennas)
    return rc.Simulator(rc.Scene(), radar, resolution=8).frame().cube


@pytest.mark.parametrize("high_pass", [None, 80e3])
def test_tone_has_the_level_frequency_and_phase_of_an_echo_of_its_delay(high_pass: float | None) -> None:
    delay = 0.4e-9  # 60 kHz
    leakage = rc.Leakage(level_db=-30.0, delay=delay, phase_deg=20.0)
    found = cube(rc.Receiver(leakage=leakage, high_pass=high_pass))
    beat = WAVEFORM.slope * delay
    # 10 mW, 30 dB less; behind a first-order high-pass f / (f - j fc).
    amplitude = 10.0**-2.5 * (1.0 if high_pass is None else beat / (beat - 1j * high_pass))
    turns = WAVEFORM.start_frequency * delay + beat * WAVEFORM.sample_times - 0.5 * beat * delay
    expected = amplitude * np.exp(2j * np.pi * (turns + 20.0 / 360.0))
    assert found.dtype == np.complex64
    np.testing.assert_allclose(found[0, 0], expected, rtol=1e-5)
    np.testing.assert_array_equal(found[0, 1:], found[0, :1].repeat(2, axis=0))


def test_second_tone_has_a_level_delay_and_phase_of_its_own() -> None:
    rx = [[0.0, 0.0, 0.0], [0.0, 0.0025, 0.0]]
    both = rc.Leakage(level_db=-30.0, delay=0.1e-9, echo_db=-45.0, echo_delay=0.5e-9, echo_phase_deg=(40.0, -50.0))
    first = rc.Leakage(level_db=-30.0, delay=0.1e-9)
    second = rc.Leakage(level_db=-45.0, delay=0.5e-9, phase_deg=(40.0, -50.0))
    found, *parts = (cube(rc.Receiver(leakage=leakage, high_pass=80e3), rx=rx) for leakage in (both, first, second))
    np.testing.assert_allclose(found, parts[0] + parts[1], rtol=1e-5)
    receiver = rc.Receiver(leakage=rc.Leakage(echo_db=(-30.0, -40.0), echo_phase_deg=(1.0, 2.0)))
    assert rc.Receiver.from_dict(receiver.to_dict()) == receiver
    assert receiver.of_receivers([1]).leakage == rc.Leakage(echo_db=(-40.0,), echo_phase_deg=(2.0,))


def test_step_decays_from_the_first_sample_and_phase_180_starts_below() -> None:
    leakage = rc.Leakage(step_db=-40.0, step_phase_deg=180.0, step_time=2e-6)
    found = cube(rc.Receiver(output="real", leakage=leakage, high_pass=80e3))
    assert found.dtype == np.float32
    # Behind the high-pass already: 10 mW, 40 dB less, over four samples.
    np.testing.assert_allclose(found[0, 2], -1e-3 * np.exp(-np.arange(64) / 4.0), rtol=1e-5)


def test_levels_and_phases_may_differ_from_receiver_to_receiver_of_every_transmitter() -> None:
    leakage = rc.Leakage(level_db=(-30.0, -50.0), phase_deg=[0.0, 90.0], step_db=None)
    rx = [[0.0, 0.0, 0.0], [0.0, 0.0025, 0.0]]
    found = cube(rc.Receiver(leakage=leakage), rx=rx, tx=[[0.0, 0.0, 0.01], [0.0, 0.0, 0.02]])
    np.testing.assert_allclose(found[:, 0, 0], np.tile([10.0**-2.5, 1j * 10.0**-3.5], 2), rtol=1e-5, atol=1e-9)


def test_leakage_adds_to_echoes() -> None:
    scene = rc.Scene([rc.PointTarget([0.3, 0.0, 0.0], rcs=0.01)])
    leakage = rc.Leakage(level_db=-60.0, delay=0.1e-9)

    def of(scene: rc.Scene, receiver: rc.Receiver) -> NDArray[Any]:
        return rc.Simulator(scene, rc.Radar(WAVEFORM, receiver=receiver), resolution=8).frame().cube

    both = of(scene, rc.Receiver(leakage=leakage))
    np.testing.assert_allclose(both, of(scene, rc.Receiver()) + of(rc.Scene(), rc.Receiver(leakage=leakage)), rtol=1e-5)
