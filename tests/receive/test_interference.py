"""Chirps of other radars behind mixer and anti-alias filter: tones, bursts and ghosts known on paper, and sums."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, freqs, sosfilt

import radarcore as rc
from radarcore.receive.filters import LowPass, low_pass_of
from radarcore.receive.interference import Arrivals, Chirps, beat_of_chirps

RATE = 1e6
F0 = 77e9

Array = NDArray[Any]


def waveform(slope: float = 1e11, **options: Any) -> rc.Waveform:
    return rc.Waveform(
        **{"start_frequency": F0, "slope": slope, "sample_rate": RATE, "num_samples": 64, "num_chirps": 2, **options}
    )


def gain(low_pass: LowPass, frequency: Any) -> Array:
    """Transfer function of a filter at frequencies [Hz], by its partial fractions."""
    rate = 2j * np.pi * np.asarray(frequency)[..., None]
    return np.asarray((low_pass.residues / (rate - low_pass.poles)).sum(axis=-1))


def one_chirp(start: float, frequency: float, slope: float, duration: float, phase: float = 0.0) -> Chirps:
    return Chirps(np.array([start]), np.array([phase]), frequency, slope, duration)


def one_path(num_chirps: int, delay: float = 0.0, rate: float = 0.0, amplitude: complex = 1.0) -> Arrivals:
    shape = (1, 1, num_chirps)
    return Arrivals(np.full(shape, delay), np.full(shape, rate), np.full(shape, amplitude + 0j), np.zeros(1))


def beat(
    chirps: Chirps,
    wf: rc.Waveform,
    arrivals: Arrivals | None = None,
    low_pass: LowPass | None = None,
    strongest: float | None = None,
) -> Array:
    """Samples (chirp, sample) of one receiver."""
    paths = one_path(wf.num_chirps) if arrivals is None else arrivals
    return beat_of_chirps(chirps, paths, wf, wf.chirp_times, low_pass or LowPass(0.5 * RATE), strongest)[0][0]


# --- The filter


@pytest.mark.parametrize("order", [1, 2, 3, 4, 8, 16])
def test_filter_is_that_of_butterworth(order: int) -> None:
    low_pass, frequency = LowPass(2e5, order), np.linspace(-2e6, 2e6, 101)
    numerator, denominator = butter(order, 2.0 * np.pi * low_pass.cutoff, analog=True)
    expected = freqs(numerator, denominator, 2.0 * np.pi * frequency)[1]
    # Partial fractions of order 16 are as large as 1e3: their sum has that many rounding errors.
    np.testing.assert_allclose(gain(low_pass, frequency), expected, rtol=0.0, atol=1e-11)
    assert abs(gain(low_pass, 2e5)) ** 2 == pytest.approx(0.5, rel=1e-9)
    band = low_pass.band(np.array([1.0, 1e-2, 1e-4, 1e-6]))
    np.testing.assert_allclose(np.abs(gain(low_pass, band[:2])), [1e-4, 1e-2], rtol=1e-9)
    assert band[2:].tolist() == [0.0, 0.0]


def test_filter_of_a_receiver_without_one_is_at_half_the_sample_rate() -> None:
    for receiver in (None, rc.Receiver(), rc.Receiver(output="real")):
        assert low_pass_of(rc.Radar(waveform(), receiver=receiver)) == LowPass(0.5 * RATE, 4)


@pytest.mark.parametrize("slope", [1e9, -1e10, 3e11, -1e13])
def test_response_to_a_chirp_solves_the_equation_of_the_filter(slope: float) -> None:
    # y' = p y + exp j psi, by differences of fourth order; steps of a twentieth of the fastest turn.
    low_pass = LowPass(5e5, 4)
    step = 0.05 / max(2e6, 8.0 * np.sqrt(abs(slope)))
    times = np.arange(-100.0, 101.0) * step
    u = times[:, None] + np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) * step

    def modes(at: Array) -> Array:
        phasor = np.exp(1j * np.pi * slope * at**2)
        return (low_pass.modes(slope * at, np.full_like(at, slope)).T * phasor).T

    values = np.stack([modes(u[:, k]) for k in range(5)])
    change = (values[0] - 8.0 * values[1] + 8.0 * values[3] - values[4]) / (12.0 * step)
    driven = low_pass.poles * values[2] + low_pass.residues * np.exp(1j * np.pi * slope * times**2)[:, None]
    # (2 pi / 20)^4 / 30 of the rate; the series is off by 1e-7, and by the free decay below 1e-4.
    assert np.abs(change - driven).max() <= 1e-3 * np.abs(low_pass.residues).max()


# --- Tones and ghosts


@pytest.mark.parametrize("offset", [-3e5, 2e4, 1.3e6])
def test_equal_slopes_give_a_tone_with_the_gain_of_the_filter_there(offset: float) -> None:
    wf, amplitude, phase = waveform(), 2.0 * np.exp(0.3j), 0.2
    chirps = one_chirp(-1e-3, F0 + offset - 1e11 * 1e-3, 1e11, 3e-3, phase)
    samples = beat(chirps, wf, one_path(2, amplitude=amplitude))
    # The other ramp is at F0 + offset when our first one starts, and a chirp interval further at the second.
    for chirp, start in enumerate(wf.chirp_times):
        t = wf.sample_times
        other = phase + (F0 + offset - 1e8) * (t + start + 1e-3) + 0.5e11 * (t + start + 1e-3) ** 2
        own = F0 * t + 0.5e11 * t**2
        level = gain(LowPass(0.5 * RATE), -offset - 1e11 * start)
        expected = np.conj(amplitude) * level * np.exp(2j * np.pi * ((own - other) % 1.0))
        # Phases of 1e8 turns are rounded to 1e-8 turns, on both sides. Less than -80 dB is left out.
        error = 1e-6 if abs(level) > 1e-4 else 1e-4
        np.testing.assert_allclose(samples[chirp], expected, rtol=0.0, atol=error * abs(amplitude))


# --- Bursts


def test_no_crossing_is_no_interference() -> None:
    wf = waveform(num_chirps=3, chirp_interval=100e-6)
    for chirps in (
        one_chirp(0.0, F0 + 1e9, 1e11, 1e-3),  # parallel, far off
        one_chirp(0.0, F0 + 1e9, 0.0, 1e-3),  # a tone beyond the sweep
        one_chirp(-1e-3, F0, 1e11, 0.9e-3),  # over before
        one_chirp(66e-6, F0, 1e11, 15e-6),  # between two chirps, and over when the filter begins to settle
    ):
        samples, is_hit = beat_of_chirps(chirps, one_path(3), wf, wf.chirp_times, LowPass(0.5 * RATE))
        assert not samples.any()
        assert not is_hit.any()


def test_only_chirps_that_are_hit_count() -> None:
    wf = waveform(num_chirps=4, chirp_interval=100e-6)
    samples, is_hit = beat_of_chirps(
        one_chirp(210e-6, F0 + 1e6, 1e11, 20e-6), one_path(4), wf, wf.chirp_times, LowPass(0.5 * RATE)
    )
    assert is_hit.tolist() == [False, False, True, False]
    assert (np.abs(samples[0]).max(axis=1) > 0.0).tolist() == is_hit.tolist()


# --- Against a sum of small steps


def stepped(chirps: Chirps, arrivals: Arrivals, wf: rc.Waveform, low_pass: LowPass, over: int) -> Array:
    """The slow truth of one receiver: steps `over` times as fine as the samples, through a digital filter."""
    rate = wf.sample_rate * over
    before = (int(low_pass.settling_time * wf.sample_rate) + 1) * over
    u = wf.adc_delay + np.arange(-before, (wf.num_samples - 1) * over + 1) / rate
    sections = butter(low_pass.order, low_pass.cutoff, fs=rate, output="sos")
    result = []
    for m, start in enumerate(wf.chirp_times):
        total = np.zeros(len(u), dtype=complex)
        for p in range(arrivals.delay.shape[1]):
            received = u + start - arrivals.delay[0, p, m] - arrivals.delay_rate[0, p, m] * u - arrivals.sent_after[p]
            for begin, phase in zip(chirps.starts, chirps.phases, strict=True):
                t = received - begin
                other = phase + chirps.start_frequency * t + 0.5 * chirps.slope * t**2
                own = wf.start_frequency * u + 0.5 * wf.slope * u**2
                is_on = (t >= 0.0) & (t < chirps.duration)
                total += is_on * np.conj(arrivals.amplitude[0, p, m]) * np.exp(2j * np.pi * ((own - other) % 1.0))
        result.append(sosfilt(sections, total)[before::over])
    return np.array(result)


@pytest.mark.parametrize("seed", range(12))
def test_samples_are_those_of_a_sum_of_small_steps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ours = rng.uniform(-4e10, 4e10)
    slope = [ours, -ours, 1.001 * ours, 0.0, ours + 5e9, 3.0 * ours][seed % 6]
    wf = waveform(ours, num_chirps=3, chirp_interval=90e-6, adc_delay=rng.uniform(0.0, 5e-6))
    duration = rng.uniform(20e-6, 80e-6)
    starts = np.arange(-2, 8) * rng.uniform(80e-6, 100e-6) + rng.uniform(-10e-6, 10e-6)
    shift = rng.uniform(-3e5, 3e5)
    chirps = Chirps(starts, rng.uniform(size=10), F0 + shift, slope, duration)
    shape = (1, 2, 3)
    arrivals = Arrivals(
        rng.uniform(1e-8, 1e-6, shape),
        np.full(shape, rng.uniform(-1e-6, 1e-6)),
        rng.normal(size=shape) + 1j * rng.normal(size=shape),
        np.array([0.0, rng.uniform(0.0, 5e-6)]),
    )
    low_pass = LowPass(rng.uniform(2e5, 5e5), int(rng.integers(1, 4)))
    got = beat(chirps, wf, arrivals, low_pass)
    expected = stepped(chirps, arrivals, wf, low_pass, 64)
    # Edges fall between steps: up to a step of a chirp is missing, 1/64 of a sample beside bursts of many. Edges
    # beyond the filter's band, more than 21 cut-offs away, make clicks of up to 1/21 for a sample in the sum alone.
    allowed = 0.02 * max(np.linalg.norm(expected), 2.0)
    assert np.linalg.norm(got - expected) <= allowed, f"seed {seed}"


def test_receivers_near_each_other_have_the_samples_that_each_would_have_alone() -> None:
    wf = waveform(num_chirps=3, chirp_interval=90e-6)
    chirps = Chirps(np.array([-20e-6, 70e-6, 160e-6]), np.array([0.1, 0.2, 0.7]), F0 + 2e5, 0.7e11, 80e-6)
    rng = np.random.default_rng(0)
    shape = (4, 2, 3)
    spread = rng.uniform(0.0, 1e-9, shape)  # 0.3 m: 100 Hz of 500 kHz
    arrivals = Arrivals(
        1e-7 + spread, 1e-7 + rng.uniform(0.0, 1e-9, shape), rng.normal(size=shape) + 0j, np.array([0.0, 3e-6])
    )
    together = beat_of_chirps(chirps, arrivals, wf, wf.chirp_times, LowPass(5e5), 1.0)[0]
    for k in range(4):
        one = Arrivals(
            *(getattr(arrivals, name)[k : k + 1] for name in ("delay", "delay_rate", "amplitude")), arrivals.sent_after
        )
        alone = beat_of_chirps(chirps, one, wf, wf.chirp_times, LowPass(5e5), 1.0)[0][0]
        # 2 pi times 180 Hz over 500 kHz, in a response with slopes of about one over the cut-off.
        assert np.linalg.norm(together[k] - alone) <= 2e-3 * np.linalg.norm(alone)
