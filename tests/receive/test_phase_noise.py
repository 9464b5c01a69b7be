"""Phase noise: its spectrum with range correlation, and what it does to echoes near and far and to leakage."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.receive.filters import phase_noise_delays, phase_noise_shares
from radarcore.receive.noise import RandomStreams
from radarcore.receive.phase_noise import phase_density, phase_differences

C = 299_792_458.0
RATE = 2e6
FLAT = ((1e3, -90.0), (1e6, -90.0))
FALLING = ((100e3, -80.0),)
RISING = ((1e3, -120.0), (1e6, -90.0))


def differences(
    pairs: tuple[tuple[float, float], ...], *delays: float, num_chirps: int, num_samples: int, interval: float = 1e-3
) -> NDArray[np.float64]:
    starts, times = interval * np.arange(num_chirps), np.arange(num_samples) / RATE
    return phase_differences(pairs, delays, starts, times, RandomStreams(5, 0.25)).astype(np.float64)


def variance(pairs: tuple[tuple[float, float], ...], delay: float, lowest: float = 10.0) -> float:
    """Integral of ``S_phi 4 sin^2(pi f tau)`` up to half the sample rate."""
    edges = np.geomspace(lowest, 0.5 * RATE, 200_001)
    offset = 0.5 * (edges[1:] + edges[:-1])
    power = phase_density(pairs, offset) * 4.0 * np.sin(np.pi * offset * delay) ** 2
    return float((power * np.diff(edges)).sum())


def test_density_is_twice_the_level_and_straight_between_pairs_and_beyond() -> None:
    pairs = ((1e4, -70.0), (1e5, -80.0), (1e6, -110.0))
    decibels = 10.0 * np.log10(phase_density(pairs, [1e3, 1e4, 10**4.5, 1e5, 10**5.5, 1e6, 1e7]) / 2.0)
    np.testing.assert_allclose(decibels, [-60.0, -70.0, -75.0, -80.0, -95.0, -110.0, -140.0], atol=1e-9)
    np.testing.assert_allclose(phase_density(FALLING, [1e4, 1e6]), [2e-6, 2e-10], rtol=1e-9)


def test_spectrum_is_that_of_the_phase_times_four_sine_squared() -> None:
    """A delay of three samples: nulls at a third and two thirds of the sample rate, within the band at 333 kHz."""
    delay, num_samples, num_chirps = 3.0 / RATE, 128, 3000
    (found,) = differences(FLAT, delay, num_chirps=num_chirps, num_samples=num_samples)
    window = np.hanning(num_samples)
    spectra = abs(np.fft.rfft(found * window)) ** 2
    density = 2.0 * spectra.mean(axis=0) / (RATE * (window**2).sum())
    frequency = np.fft.rfftfreq(num_samples, 1.0 / RATE)
    expected = phase_density(FLAT, 1e3)[()] * 4.0 * np.sin(np.pi * frequency * delay) ** 2
    # Exponential powers of 3000 chirps: 4 / sqrt(3000) = 7 %. The window widens the nulls by two bins, in which the
    # sine's square rises to 4 (pi delay 2 bins)^2 = 0.09.
    peak = expected.max()
    np.testing.assert_allclose(density[3:-3], expected[3:-3], rtol=0.08, atol=0.025 * peak)
    null = round(RATE / 3.0 / (frequency[1]))
    assert density[null] < 0.01 * peak


@pytest.mark.parametrize("pairs", [FLAT, FALLING, ((1e3, -50.0), (1e6, -140.0))], ids=["flat", "-20 dB", "-30 dB"])
@pytest.mark.parametrize("delay", [1e-10, 2e-9, 67e-9, 1.3e-6])
def test_variance_is_the_integral_of_the_formula(pairs: tuple[tuple[float, float], ...], delay: float) -> None:
    starts, times = np.array([0.0, 1e-3]), np.arange(64) / RATE
    frames = [phase_differences(pairs, (delay,), starts, times, RandomStreams(k, 0.5)) for k in range(1500)]
    lowest = 1.0 / (8.0 * (1e-3 + 64 / RATE))  # slower offsets are left out
    # Slow tones have one draw per frame: at most 4 sqrt(2 / 1500) = 15 % where they have all of the power.
    assert np.mean(np.square(frames, dtype=np.float64)) == pytest.approx(variance(pairs, delay, lowest), rel=0.15)


def test_all_delays_have_the_phase_of_one_oscillator() -> None:
    near, far, twice = differences(FALLING, 1e-9, 10e-9, 20e-9, num_chirps=50, num_samples=64)
    # phi(t) - phi(t - tau) is tau times the slope of phi while pi f tau is small: here at most 0.06 of a turn.
    np.testing.assert_allclose(far, 10.0 * near, rtol=0.0, atol=0.06 * far.std())
    np.testing.assert_allclose(twice, 2.0 * far, rtol=0.0, atol=0.2 * far.std())


def test_slow_phase_noise_runs_on_from_chirp_to_chirp() -> None:
    """Of a spectrum that falls by 40 dB per decade the difference has a 1/f^2 spectrum: means of chirps are alike."""
    pairs, delay, interval = ((1e3, -50.0), (1e6, -170.0)), 10e-9, 50e-6
    num_frames, num_samples = 600, 64
    starts, times = interval * np.arange(8), np.arange(num_samples) / RATE
    means = np.array(
        [
            phase_differences(pairs, (delay,), starts, times, RandomStreams(k, 0.0))[0].mean(axis=1, dtype=np.float64)
            for k in range(num_frames)
        ]
    )
    found = (means[:, 1:] * means[:, :-1]).mean() / (means**2).mean()
    edges = np.geomspace(1.0 / (8.0 * (7.0 * interval + num_samples / RATE)), 0.5 * RATE, 100_001)
    offset = np.sqrt(edges[1:] * edges[:-1])
    mean = np.sinc(offset * num_samples / RATE) / np.sinc(offset / RATE)
    power = phase_density(pairs, offset) * np.sin(np.pi * offset * delay) ** 2 * mean**2 * np.diff(edges)
    expected = (power * np.cos(2.0 * np.pi * offset * interval)).sum() / power.sum()
    assert expected > 0.5
    # 4 (1 - expected^2) / sqrt(600) of the draws, and a coefficient of correlation that tones share out anew.
    assert found == pytest.approx(expected, abs=0.12)


def radar(receiver: rc.Receiver, *, num_chirps: int = 64, slope: float = 20e12) -> rc.Radar:
    waveform = rc.Waveform(
        start_frequency=60e9,
        slope=slope,
        sample_rate=RATE,
        num_samples=128,
        num_chirps=num_chirps,
        chirp_interval=100e-6,
    )
    return rc.Radar(waveform, receiver=receiver)


def turns(distance: float, receiver: rc.Receiver, **waveform: float) -> NDArray[np.complex128]:
    """Samples of an echo over those without phase noise."""
    scene = rc.Scene([rc.PointTarget([distance, 0.0, 0.0])])
    quiet = rc.Simulator(scene, radar(rc.Receiver(), **waveform), resolution=8).frame().cube
    noisy = rc.Simulator(scene, radar(receiver, **waveform), resolution=8).frame().cube
    return np.asarray(noisy / quiet, np.complex128)


@pytest.mark.parametrize("distance", [0.03, 3.0, 9.0])
def test_echoes_have_the_phase_noise_of_their_delay_short_range_less_than_long(distance: float) -> None:
    turn = turns(distance, rc.Receiver(phase_noise=FALLING))
    expected = variance(FALLING, 2.0 * distance / C)
    # 64 chirps of 128 nearly independent samples: 4 sqrt(2 / 8192) = 6 %.
    assert np.mean(np.angle(turn) ** 2) == pytest.approx(expected, rel=0.08)
    # Phase alone, to second order in the phase of the longest delay, 15 m: at most an eighth of its square, at 5 sigma.
    np.testing.assert_allclose(abs(turn), 1.0, rtol=0.0, atol=3.2 * variance(FALLING, 1e-7) + 1e-6)


SLOPES = [200e12, 20e12, -14e12, 10e12, 5e12, 2e12, 1e12, 0.3e12, 0.1e12, 0.0]


@pytest.mark.parametrize("pairs", [FLAT, FALLING, RISING], ids=["flat", "falling", "rising"])
@pytest.mark.parametrize("output", ["iq", "real"])
def test_every_delay_has_the_integral_of_the_formula_at_every_slope(
    output: str, pairs: tuple[tuple[float, float], ...]
) -> None:
    """Power of the sum of the drawn delays, by their shares, over the formula: no draws, so no error of them."""
    offset = np.linspace(50.0, 0.5 * RATE, 8000)
    density = phase_density(pairs, offset)
    for slope in SLOPES:
        receiver = rc.Receiver(output=output, phase_noise=pairs)
        waveform = radar(receiver, slope=slope).waveform
        largest = waveform.max_range * (1 if output == "real" else 2)
        # An echo of the whole ramp, 64 us or 9.6 km, has no sample left; a CW radar has no largest range.
        longest = min(2.0 * largest / C, 64e-6) if slope else 1e-6
        delay = longest * np.concatenate([np.geomspace(1e-4, 1.0, 30), np.linspace(0.01, 1.0, 100)])
        drawn = phase_noise_delays(receiver, waveform)
        shares = phase_noise_shares(receiver, waveform, delay)
        assert len(drawn) <= max(8, 1.2 * np.pi * 0.5 * RATE * longest + 8), slope
        of_drawn = 1.0 - np.exp(-2j * np.pi * np.outer(drawn, offset))
        found = (np.abs(shares.T @ of_drawn) ** 2 * density).sum(axis=1)
        expected = (4.0 * np.sin(np.pi * np.outer(delay, offset)) ** 2 * density).sum(axis=1)
        np.testing.assert_allclose(found, expected, rtol=0.02, err_msg=f"{slope:g}")


def test_near_and_far_echo_of_a_frame_have_their_own_phase_noise() -> None:
    """The noise of a strong near echo over all ranges follows its short delay."""
    near, far = rc.PointTarget([0.15, 0.0, 0.0], rcs=1e-6), rc.PointTarget([6.0, 0.0, 0.0], rcs=2.56)
    noisy = radar(rc.Receiver(phase_noise=FALLING))
    both = rc.Simulator(rc.Scene([near, far]), noisy, resolution=8).frame().cube
    parts = sum(rc.Simulator(rc.Scene([one]), noisy, resolution=8).frame().cube for one in (near, far))
    np.testing.assert_allclose(both, parts, rtol=0.0, atol=2e-3 * abs(both).max())  # twice the bound of the sum


def test_leakage_stays_coherent() -> None:
    leakage = rc.Leakage(level_db=-20.0, delay=0.1e-9)
    zeros = rc.Scene()
    quiet = rc.Simulator(zeros, radar(rc.Receiver(leakage=leakage)), resolution=8).frame().cube
    noisy = rc.Simulator(zeros, radar(rc.Receiver(leakage=leakage, phase_noise=FALLING)), resolution=8).frame().cube
    angle = np.angle(noisy / quiet)
    assert np.mean(angle**2) == pytest.approx(variance(FALLING, 0.1e-9), rel=0.08)
    # The oscillator itself, as two of them would show it, has 10^5 times the power above 1 kHz.
    own = sum(phase_density(FALLING, f) * 1e3 for f in np.arange(1e3, 1e6, 1e3))
    assert np.mean(angle**2) < 1e-5 * own


def test_transmitters_share_the_phase_noise_of_their_time() -> None:
    receiver = rc.Receiver(phase_noise=FALLING)
    waveform = radar(receiver, num_chirps=4).waveform
    tx, rx = [[0.0, 0.0, 0.0], [0.0, 0.01, 0.0]], [[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]]
    scene = rc.Scene([rc.PointTarget([3.0, 0.0, 0.0])])
    quiet = rc.Simulator(scene, rc.Radar(waveform, tx=tx, rx=rx), resolution=8).frame().cube
    frame = rc.Simulator(scene, rc.Radar(waveform, tx=tx, rx=rx, receiver=receiver), resolution=8).frame()
    assert frame.cube.shape == (4, 4, 128)
    angle = np.angle(frame.cube / quiet)
    # All channels look at the same point within 1e-5 of its delay.
    np.testing.assert_allclose(angle[1:], angle[:1].repeat(3, axis=0), rtol=0.0, atol=1e-3 * angle.std() + 1e-6)
    paths = rc.Simulator(scene, frame.radar, resolution=8).paths()
    assert paths.delay.shape == (4, 1)
