"""Gain, I/Q imbalance, offsets and ADC: volts to codes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.receive.chain import receive
from radarcore.recording.frame import to_codes, to_samples

NUM_CHIRPS, NUM_SAMPLES = 50, 200
WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=NUM_SAMPLES, num_chirps=NUM_CHIRPS
)
RX = [[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]]
LSB = 2.0 / 4095.0


def received(receiver: rc.Receiver, ideal: NDArray[Any] | None = None, *, seed: int = 0) -> NDArray[Any]:
    cube = np.zeros((2, NUM_CHIRPS, NUM_SAMPLES), np.complex64)
    if ideal is not None:
        cube += ideal
    return receive(cube, rc.Radar(WAVEFORM, rx=RX, receiver=receiver), 0.0, seed=seed)


def adc(**settings: Any) -> rc.Receiver:
    return rc.Receiver(**({"output": "real", "full_scale": 1.21, "adc_bits": 12} | settings))


def ramp() -> NDArray[np.complex64]:
    """Samples [sqrt(W)] from well below full scale to well above it, evenly spaced."""
    return np.linspace(-0.2, 0.2, 2 * NUM_CHIRPS * NUM_SAMPLES, dtype=np.complex64).reshape(2, NUM_CHIRPS, NUM_SAMPLES)


def test_tone_of_known_power_has_its_voltage_at_50_ohm() -> None:
    """1 mW makes 0.224 V rms, 0.316 V peak, at 50 ohm; 6 dB double that within 0.5 %."""
    tone = np.sqrt(1e-3) * np.exp(2j * np.pi * 0.1 * np.arange(NUM_SAMPLES))
    samples = received(rc.Receiver(output="real", gain_db=6.0, full_scale=1.21), tone)
    volt = 1.21 * samples[0, 0]
    assert volt.max() == pytest.approx(np.sqrt(2.0 * 50.0 * 1e-3) * 10.0**0.3, rel=1e-5)
    assert np.sqrt(np.mean(volt**2)) == pytest.approx(0.2236 * 1.9953, rel=1e-4)


@pytest.mark.parametrize("bits", [1, 8, 12, 16])
def test_samples_are_codes_and_clip_at_full_scale(bits: int) -> None:
    samples = received(adc(adc_bits=bits), ramp())
    codes = (samples.astype(np.float64) + 1.0) * 0.5 * (2**bits - 1)
    np.testing.assert_allclose(codes, np.rint(codes), rtol=0.0, atol=2.0**bits * 1e-7)
    assert (samples.min(), samples.max()) == (-1.0, 1.0)
    # sqrt(W) beyond 0.121 are more than 1.21 V.
    beyond = abs(ramp().real) > 0.1211
    assert (abs(samples[beyond]) == 1.0).all()


def test_error_of_an_ideal_adc_is_uniform_over_a_step() -> None:
    x = ramp().real[:, :, :] * 0.5 * (10.0 / 1.21)
    error = (received(adc(), ramp() * 0.5) - x) / LSB
    inside = abs(x) < 1.0
    assert abs(error[inside]).max() < 0.501
    assert np.var(error[inside]) == pytest.approx(1.0 / 12.0, rel=0.02)  # 20 000 nearly independent places


def test_codes_of_12_bits_are_those_of_recordings() -> None:
    samples = received(adc(noise_figure_db=10.0), ramp())
    codes = to_codes(samples)
    np.testing.assert_array_equal(to_samples(codes), samples)
    assert len(np.unique(codes)) > 4000


def test_odd_codes_have_their_width_in_the_upper_three_quarters_and_even_ones_below() -> None:
    codes = to_codes(received(adc(adc_errors=rc.AdcErrors(odd_width=0.26)), ramp() * 0.999))
    upper, lower = (codes >= 1026) & (codes < 4095), (codes <= 1022) & (codes > 0)
    # Steps of the ramp are 0.7 of a code: shares of thousands of codes within 1 %.
    assert np.mean(codes[upper] & 1) == pytest.approx(0.13, abs=0.01)
    assert np.mean(codes[lower] & 1) == pytest.approx(0.87, abs=0.01)
    # Equal widths are an ideal ADC, except for samples within rounding of the border.
    differ = received(adc(adc_errors=rc.AdcErrors(odd_width=1.0)), ramp()) != received(adc(), ramp())
    assert differ.mean() < 1e-3
    assert (np.diff(codes.ravel().astype(int)) >= 0).all()


@pytest.mark.parametrize("output", ["real", "iq"])
def test_noise_of_the_adc_does_not_follow_the_gain(output: str) -> None:
    for gain_db in (0.0, 40.0):
        samples = received(adc(output=output, adc_errors=rc.AdcErrors(noise_lsb=5.0), gain_db=gain_db))
        numbers = samples.view(np.float32)
        # Rounding adds 1/12; 4 sqrt(1 / 2 / 20 000) = 2 % of a deviation.
        assert numbers.std() / LSB == pytest.approx(np.sqrt(25.0 + 1.0 / 12.0), rel=0.02)


@pytest.mark.parametrize("output", ["real", "iq"])
def test_offsets_hold_for_receivers_and_for_chirps(output: str) -> None:
    samples = received(rc.Receiver(output=output, full_scale=1.0, dc_offset=(0.1, -0.2)))
    np.testing.assert_allclose(samples.view(np.float32)[:, :, 3], np.repeat([[0.1], [-0.2]], NUM_CHIRPS, axis=1))
    chirps = received(adc(output=output, adc_bits=24, adc_errors=rc.AdcErrors(chirp_offset_lsb=(1000.0, 0.0))))
    assert (chirps == chirps[:, :, :1]).all()
    of_first = chirps.view(np.float32)[0, :, 0]
    assert of_first.std() / (2.0 / (2**24 - 1)) == pytest.approx(1000.0, rel=4.0 / np.sqrt(2 * NUM_CHIRPS))
    np.testing.assert_allclose(chirps[1], 0.0, atol=2e-7)  # half a step of the ADC, twice with I and Q


def test_offsets_of_segments_hold_for_a_sixteenth_of_the_codes() -> None:
    chirp = np.linspace(-0.1209, 0.1209, NUM_SAMPLES, dtype=np.complex64)
    quiet, moved = (
        received(adc(**more), chirp) for more in ({}, {"adc_errors": rc.AdcErrors(segment_offset_lsb=30.0)})
    )
    offset = (moved - quiet) / LSB
    segment = np.minimum(to_codes(quiet)[0, 0] // 256, 15)
    for number in range(1, 15):
        inside = offset[:, :, segment == number]
        inside = inside[:, :, 1:-1]  # rounding may cross the border
        assert np.ptp(inside, axis=2).max() <= 1.01  # rounding before and after
    means = offset[:, :, [100, 120]].ravel()
    assert means.std() == pytest.approx(30.0, rel=4.0 / np.sqrt(2 * len(means)))


@pytest.mark.parametrize(("gain_db", "phase_deg"), [(1.0, 0.0), (0.0, 5.0), (-0.5, -3.0), (None, 2.0), (0.3, None)])
def test_imbalance_makes_an_image_of_the_level_of_the_formula(gain_db: float | None, phase_deg: float | None) -> None:
    tone = np.exp(2j * np.pi * np.arange(NUM_SAMPLES) * 20 / NUM_SAMPLES)
    samples = received(rc.Receiver(iq_gain_db=gain_db, iq_phase_deg=phase_deg), tone)
    spectrum = np.fft.fft(samples[0, 0])
    g, phi = 10.0 ** ((gain_db or 0.0) / 20.0), np.deg2rad(phase_deg or 0.0)
    expected = (1.0 + g**2 - 2.0 * g * np.cos(phi)) / (1.0 + g**2 + 2.0 * g * np.cos(phi))
    assert abs(spectrum[-20] / spectrum[20]) ** 2 == pytest.approx(expected, rel=1e-4)
