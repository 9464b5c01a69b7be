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

C = 299_792_458.0
RATE = 1e6
F0 = 77e9

Array = NDArray[Any]


def waveform(slope: float = 1e11, **options: Any) -> rc.Waveform:
    return rc.Waveform(
        **{"start_frequency": F0, "slope": slope, "sample_rate": RATE, "num_samples": 64, "num_chirps": 2, **options}
    )


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


@pytest.mark.parametrize("order", range(1, 17))
def test_filter_is_that_of_butterworth(order: int) -> None:
    low_pass, frequency = LowPass(2e5, order), np.linspace(-2e6, 2e6, 101)
    numerator, denominator = butter(order, 2.0 * np.pi * low_pass.cutoff, analog=True)
    expected = freqs(numerator, denominator, 2.0 * np.pi * frequency)[1]
    # Partial fractions of order 16 are as large as 1e3: their sum is off by as many roundings.
    np.testing.assert_allclose(low_pass.gain(frequency), expected, rtol=0.0, atol=1e-11)
    assert abs(low_pass.gain(np.array(2e5))) ** 2 == pytest.approx(0.5, rel=1e-9)
    band = low_pass.band(np.array([1.0, 1e-2, 1e-4, 1e-6]))
    np.testing.assert_allclose(np.abs(low_pass.gain(band[:2])), [1e-4, 1e-2], rtol=1e-9)
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
        gain = LowPass(0.5 * RATE).gain(np.array(-offset - 1e11 * start))
        expected = np.conj(amplitude) * gain * np.exp(2j * np.pi * ((own - other) % 1.0))
        # Phases of 1e8 turns are rounded to 1e-8 turns, on both sides. Less than -80 dB is left out.
        error = 1e-6 if abs(gain) > 1e-4 else 1e-4
        np.testing.assert_allclose(samples[chirp], expected, rtol=0.0, atol=error * abs(amplitude))


@pytest.mark.parametrize(("shift", "lag"), [(0.0, 1.5e-6), (1e5, 0.0), (-5e4, 2e-6)])
def test_equal_slope_and_late_start_are_a_ghost_at_the_predicted_range(shift: float, lag: float) -> None:
    slope = 1e11
    wf = waveform(slope, num_samples=256, num_chirps=1)
    delay = 10.0 / C
    chirps = one_chirp(lag, F0 - shift, slope, wf.num_samples / RATE)
    spectrum = np.abs(np.fft.fft(beat(chirps, wf, one_path(1, delay))[0, 8:] * np.hanning(248), 16384))
    ghost = 0.5 * C * (shift / slope + lag + delay)
    axis = wf.range_axis(16384)
    assert axis[spectrum.argmax()] == pytest.approx(ghost, abs=0.05 * wf.range_resolution)


def test_range_rate_of_the_path_shifts_the_tone_to_higher_beat_frequencies() -> None:
    # A receding transmitter is received at a lower frequency; the beat is ours minus that.
    wf, velocity = waveform(0.0, num_chirps=1, num_samples=512), 100.0
    samples = beat(one_chirp(-1e-3, F0, 0.0, 3e-3), wf, one_path(1, 1e-8, velocity / C))[0]
    turns = np.unwrap(np.angle(samples)) / (2.0 * np.pi)
    assert (turns[-1] - turns[0]) * RATE / 511 == pytest.approx(F0 * velocity / C, rel=1e-6)


def test_cw_radars_give_one_tone_through_all_chirps() -> None:
    wf = waveform(0.0, num_chirps=8, chirp_interval=100e-6)
    samples = beat(one_chirp(-1e-3, F0 + 1.234e5, 0.0, 5e-3), wf)
    times = wf.chirp_times[:, None] + wf.sample_times
    expected = np.exp(-2j * np.pi * 1.234e5 * times)
    # One phase for all.
    assert np.abs(np.vdot(expected, samples)) == pytest.approx(
        samples.size * abs(LowPass(5e5).gain(np.array(1.234e5))), rel=1e-6
    )


# --- Bursts


@pytest.mark.parametrize("slope", [-1e11, 0.0, 0.98e11, 1.5e11])
@pytest.mark.parametrize("order", [2, 4, 8])
def test_crossing_is_a_burst_of_twice_the_cutoff_over_the_difference_of_slopes(slope: float, order: int) -> None:
    # A fine grid of samples behind a filter that is fast beside the sweep: the gain is that at the frequency.
    ours, num = 1e11, 2000
    difference = ours - slope
    cutoff = 3.0 * np.sqrt(abs(difference))
    duration = 2.0 * cutoff / abs(difference)
    rate = 400.0 / duration
    wf = waveform(ours, sample_rate=rate, num_samples=num, num_chirps=1)
    middle = 0.5 * num / rate
    chirps = one_chirp(-1.0, F0 + (ours - slope) * middle - slope, slope, 2.0)
    samples = np.abs(beat(chirps, wf, low_pass=LowPass(cutoff, order))[0])
    burst = np.count_nonzero(samples > np.sqrt(0.5)) / rate
    # Group delays shift it; what the next term of the series changes is below slope over cutoff squared, a ninth, of
    # half the duration.
    assert burst == pytest.approx(duration, rel=0.06)


def test_fast_crossing_leaves_the_energy_of_the_filter() -> None:
    # Behind a short crossing the filter has its impulse response over sqrt(difference): energy int |H|^2 df / S.
    ours, slope, order = 5e11, -5e11, 4
    low_pass = LowPass(5e4, order)
    wf = waveform(ours, sample_rate=2e6, num_samples=200, num_chirps=1)
    chirps = one_chirp(-1e-3, F0 + 1e12 * 30e-6 + 5e11 * 1e-3, slope, 3e-3)
    energy = (np.abs(beat(chirps, wf, low_pass=low_pass)) ** 2).sum() / wf.sample_rate
    bandwidth = np.pi / (order * np.sin(np.pi / (2 * order))) * low_pass.cutoff
    assert energy == pytest.approx(bandwidth / 1e12, rel=1e-3)  # Parseval, exact for an endless chirp


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


@pytest.mark.parametrize("seed", range(24))
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
        # 2 pi times 180 Hz over 500 kHz, in a response of which the slopes are about one over the cut-off.
        assert np.linalg.norm(together[k] - alone) <= 2e-3 * np.linalg.norm(alone)


def test_paths_add_up() -> None:
    wf = waveform(num_chirps=2)
    chirps = one_chirp(10e-6, F0 + 1e5, 0.9e11, 60e-6)
    paths = [one_path(2, delay, 0.0, amplitude) for delay, amplitude in ((1e-8, 1.0), (5e-7, 0.3j))]
    both = Arrivals(
        *(np.concatenate([getattr(path, name) for path in paths], axis=1) for name in ("delay", "delay_rate")),
        np.concatenate([path.amplitude for path in paths], axis=1),
        np.zeros(2),
    )
    apart = sum(beat(chirps, wf, path, strongest=1.0) for path in paths)
    np.testing.assert_allclose(beat(chirps, wf, both), apart, rtol=0.0, atol=1e-12)


def test_chirps_before_a_frame_by_any_number_of_frames_shift_nothing() -> None:
    wf = waveform(num_chirps=2)
    near = Chirps(np.array([0.0, 1e-4]), np.array([0.1, 0.7]), F0, 0.9e11, 60e-6)
    more = Chirps(
        np.concatenate([np.arange(-50, 0) * 1e-3, near.starts]),
        np.concatenate([np.zeros(50), near.phases]),
        F0,
        0.9e11,
        60e-6,
    )
    assert np.array_equal(beat(near, wf), beat(more, wf))
