"""The beat signal against the direct sum, tones on paper and exact geometry."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from reference import beat_signal_reference

C = 299_792_458.0  # [m/s]
EPS = np.finfo(float).eps
STRICT: dict[str, Any] = {"tolerance": 1e-9, "method": "direct"}
"""Every sample of every path in double precision."""


def waveform(**changes: Any) -> rc.Waveform:
    settings: dict[str, Any] = {
        "start_frequency": 60e9,
        "slope": 50e12,
        "sample_rate": 2e6,
        "num_samples": 40,
        "num_chirps": 16,
        "chirp_interval": 400e-6,
        "adc_delay": 3e-6,
    }
    return rc.Waveform(**(settings | changes))


def rounding(wf: rc.Waveform, delay: NDArray[np.float64], amplitude: NDArray[np.complex128]) -> float:
    """Largest rounding error of a sum over paths in double precision.

    The phase of a path is f0 tau turns, with a relative rounding error of eps/2 in each of eight steps (three terms of
    tau, its times f0, tau and t, the three terms of the phase): 4 eps f0 tau turns. Adding n paths loses n eps of their
    amplitudes.
    """
    turns = max(wf.start_frequency, wf.center_frequency + wf.bandwidth) * float(np.abs(delay).max())
    return (2.0 * np.pi * turns * 4.0 + delay.shape[-1]) * EPS * float(np.abs(amplitude).sum(axis=-1).max())


def exact_signal(delay: NDArray[np.float64], amplitude: Any, wf: rc.Waveform) -> NDArray[np.complex128]:
    """Eq. (1) with any delays, given at every sample of every path: (path, chirp, sample) to (chirp, sample)."""
    turns = wf.start_frequency * delay + wf.slope * delay * (wf.sample_times - 0.5 * delay)
    result: NDArray[np.complex128] = (np.conj(amplitude) * np.exp(2j * np.pi * turns)).sum(axis=0)
    return result


def all_times(wf: rc.Waveform) -> NDArray[np.float64]:
    """Time of every sample since the start of the frame, (chirp, sample)."""
    return wf.chirp_times[:, None] + wf.sample_times


def random_paths(rng: np.random.Generator, shape: tuple[int, ...]) -> tuple[NDArray[Any], ...]:
    """Delays of 0.2 to 3 m, rates of up to 5 m/s, accelerations of up to 50 m/s^2, and complex amplitudes."""
    two_way = 2.0 / C
    return (
        two_way * rng.uniform(0.2, 3.0, shape),
        two_way * rng.uniform(-5.0, 5.0, shape),
        two_way * rng.uniform(-50.0, 50.0, shape),
        rng.standard_normal(shape) + 1j * rng.standard_normal(shape),
    )


@pytest.mark.parametrize("seed", range(8))
def test_beat_signal_agrees_with_the_direct_sum_on_random_paths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    num_chirps = int(rng.integers(1, 9))
    wf = waveform(
        slope=rng.choice([-1.0, 1.0]) * rng.uniform(1e12, 200e12),
        num_samples=int(rng.integers(1, 150)),  # below, at and above a block of 64
        num_chirps=num_chirps,
        chirp_times=rng.choice([0.0, 1e-4]) + np.cumsum(rng.uniform(0.2e-3, 2e-3, num_chirps)),  # staggered
        adc_delay=rng.choice([0.0, 7.3e-6]),
    )
    shape = (int(rng.integers(1, 4)), int(rng.integers(1, 30)))
    delay, rate, acceleration, amplitude = random_paths(rng, shape)
    for options, terms in [
        ({}, (0.0, 0.0)),
        ({"delay_rate": rate}, (rate, 0.0)),
        ({"delay_acceleration": acceleration}, (0.0, acceleration)),
        ({"delay_rate": rate, "delay_acceleration": acceleration}, (rate, acceleration)),
    ]:
        got = rc.beat_signal(delay, amplitude, wf, **options, **STRICT)
        expected = beat_signal_reference(delay, amplitude, wf, *terms)
        assert got.shape == expected.shape == (shape[0], num_chirps, wf.num_samples)
        # About 1e-12 of the sum of amplitudes at 1 m; a wrong residual video phase alone would be 1e-2.
        assert abs(got - expected).max() <= rounding(wf, delay, amplitude), f"seed {seed}, {list(options)}"


@pytest.mark.parametrize(
    ("distance", "frequency", "phase"),
    [(0.5, 333_564.095, 0.866456), (2.0, 1_334_256.381, 3.423879), (10.0, 6_671_281.904, 3.434467)],
)
def test_beat_frequency_and_phase_have_the_values_of_the_closed_form(
    distance: float, frequency: float, phase: float
) -> None:
    wf = rc.Waveform(start_frequency=60e9, slope=1e14, sample_rate=20e6, num_samples=64)
    (samples,) = rc.beat_signal([2.0 * distance / C], [1.0], wf, **STRICT)[0]
    # Half a unit of the last digit of the values; rounding is 1e-11 rad and 1e-4 Hz.
    assert abs(np.angle(samples[0]) % (2.0 * np.pi) - phase) <= 0.51e-6
    assert abs(np.angle(samples[1] / samples[0]) * 20e6 / (2.0 * np.pi) - frequency) <= 0.51e-3
    np.testing.assert_allclose(abs(samples), 1.0, rtol=0, atol=4 * EPS)


@pytest.mark.parametrize("slope", [50e12, -50e12])
@pytest.mark.parametrize("num_nodes", [3, 4, 7])
def test_delays_at_nodes_reproduce_polynomial_motion(num_nodes: int, slope: float) -> None:
    rng = np.random.default_rng(num_nodes)
    wf = waveform(slope=slope, chirp_times=np.cumsum(rng.uniform(0.1e-3, 1e-3, 16)))
    delay, rate, acceleration, amplitude = random_paths(rng, (2, 5))
    nodes = wf.delay_times(num_nodes)[:, None, None]
    nodal = rc.beat_signal(delay + rate * nodes + 0.5 * acceleration * nodes**2, amplitude, wf, **STRICT)
    taylor = rc.beat_signal(delay, amplitude, wf, delay_rate=rate, delay_acceleration=acceleration, **STRICT)
    # Delays at nodes are rounded before they are interpolated: by less than n times (Lebesgue's constant is below 3).
    assert abs(nodal - taylor).max() <= 3.0 * rounding(wf, delay, amplitude)


@pytest.mark.parametrize("num_nodes", [4, 8, 12])
@pytest.mark.parametrize("slope", [50e12, -50e12])
def test_pass_by_at_nodes_agrees_with_exact_geometry_at_every_sample(num_nodes: int, slope: float) -> None:
    # 3 m/s past the radar at 0.3 m, nearest in the middle of a frame of 26 ms.
    wf = waveform(slope=slope, num_chirps=64)
    middle = 0.5 * wf.duration

    def distance(times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.hypot(0.3, 3.0 * (times - middle))

    nodes = wf.delay_times(num_nodes)[:, None, None]
    got = rc.beat_signal(2.0 * distance(nodes) / C, 0.09 / distance(nodes) ** 2 + 0j, wf, **STRICT)[0]
    there = distance(all_times(wf))[None]
    expected = exact_signal(2.0 * there / C, 0.09 / there**2, wf)

    # Interpolation of a function analytic in the Bernstein ellipse of parameter rho and below M there errs by
    # 4 M rho^(1-n) / (rho - 1) (Trefethen, Approximation Theory and Approximation Practice, theorem 8.2). R has its
    # branch points at +-0.1 s, rho = 15.5 of half the frame; within 12, |t| < 78 ms, so R < 0.38 m, 0.09 / R^2 < 2.6.
    decay = 4.0 * 12.0 ** (1 - num_nodes) / 11.0
    radians = 4.0 * np.pi * (max(60e9, 60e9 + slope * 23e-6)) / C
    bound = (radians * 0.38 + 2.6) * decay + 3.0 * rounding(wf, 2.0 * there[:, 0] / C, np.ones(1))
    error = abs(got - expected).max()
    assert error <= bound
    if num_nodes == 12:
        assert error <= 1e-9


@pytest.mark.parametrize(
    ("tolerance", "dtype"),
    [(1e-1, "complex64"), (1e-4, "complex64"), (1e-6, "complex64"), (9.9e-7, "complex128"), (1e-12, "complex128")],
)
def test_samples_are_single_unless_the_tolerance_is_below_a_millionth(tolerance: float, dtype: str) -> None:
    delay, rate, _, amplitude = random_paths(np.random.default_rng(4), (2, 50))
    got = rc.beat_signal(delay, amplitude, waveform(), delay_rate=rate, tolerance=tolerance)
    assert got.dtype == dtype
    assert got.flags.c_contiguous
    assert rc.beat_signal([1e-9], [1.0], waveform()).dtype == "complex64"
    # The contract: rms of the error over the samples of a channel against the l2 norm of its amplitudes; rounding to
    # single precision, 6e-8 of each sample, comes on top.
    expected = beat_signal_reference(delay, amplitude, waveform(), rate)
    error = np.sqrt((abs(got - expected) ** 2).mean(axis=(1, 2))) / np.linalg.norm(amplitude, axis=1)
    single = np.finfo(np.float32).eps / 2 if dtype == "complex64" else 0.0
    size = np.sqrt((abs(expected) ** 2).mean(axis=(1, 2))) / np.linalg.norm(amplitude, axis=1)
    own = rounding(waveform(), delay, amplitude) / np.linalg.norm(amplitude, axis=1)
    assert (error <= tolerance + single * size + own).all()


def test_path_without_amplitude_is_silent_and_without_delay_is_constant() -> None:
    assert not rc.beat_signal([1e-9, 2e-9], [0.0, 0.0], waveform()).any()
    np.testing.assert_array_equal(rc.beat_signal([0.0], [2.0 - 1.0j], waveform()), np.full((1, 16, 40), 2.0 + 1.0j))


def test_what_numpy_takes_for_numbers_is_accepted() -> None:
    wf = waveform()
    delay, rate, _, amplitude = random_paths(np.random.default_rng(2), (2, 6))
    expected = rc.beat_signal(delay, amplitude, wf, delay_rate=rate)
    for got in (
        rc.beat_signal(delay.tolist(), amplitude.tolist(), wf, delay_rate=rate.tolist()),
        rc.beat_signal(np.asfortranarray(delay), np.asfortranarray(amplitude), wf, delay_rate=np.asfortranarray(rate)),
        rc.beat_signal(np.repeat(delay, 2, axis=1)[:, ::2], amplitude, wf, delay_rate=rate),
        rc.beat_signal(delay.astype(">f8"), amplitude.astype(">c16"), wf, delay_rate=rate),
    ):
        np.testing.assert_array_equal(got, expected)
    one = rc.beat_signal([1e-9], [1.0], wf)
    for delay_like, amplitude_like in [(1e-9, 1), ((1e-9,), (1.0,)), ([1e-9], np.ones(1, np.float32)), ([1e-9], [1])]:
        np.testing.assert_array_equal(rc.beat_signal(delay_like, amplitude_like, wf), one)
    # One value for all paths, one row for all channels.
    same = rc.beat_signal(delay, np.ones((2, 6)), wf, delay_rate=np.full((2, 6), 1e-9))
    np.testing.assert_array_equal(rc.beat_signal(delay, 1.0, wf, delay_rate=1e-9), same)
    np.testing.assert_array_equal(rc.beat_signal(delay, np.ones(6), wf, delay_rate=[1e-9]), same)
