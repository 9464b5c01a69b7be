"""Two hundred random sums over paths are within their tolerance, against the sum of every sample of every path."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from fast_sums import METHODS
from path_scenes import C, Paths, allowance, random_phases, relative_error, sweep_waveform

ARRANGEMENTS = {"independent": 80, "together": 20, "plate": 40, "aligned": 40, "strong": 20}
"""Number of sums by the way in which paths add up."""
PER_TEST = 20
BLOCKS = [(kind, first) for kind, number in ARRANGEMENTS.items() for first in range(0, number, PER_TEST)]
MOST_WORK, MOST_STRONG_WORK = 300_000, 1_000_000
"""Paths x samples of a sum, so that all take some seconds."""

Real = NDArray[np.float64]


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def log_integer(rng: np.random.Generator, low: int, high: int) -> int:
    return min(high, int(log_uniform(rng, low, high + 1)))


def random_sum(kind: str, seed: int) -> tuple[rc.Waveform, Paths, float]:
    """Waveform, paths and tolerance."""
    rng = np.random.default_rng([list(ARRANGEMENTS).index(kind), seed])
    is_strong = kind == "strong"
    num_chirps, num_samples = (
        log_integer(rng, 1, most) if rng.random() < 0.5 else int(rng.integers(1, most + 1)) for most in (64, 128)
    )
    num_channels = int(rng.choice([1, 1, 1, 2, 3]))
    work = (MOST_STRONG_WORK if is_strong else MOST_WORK) // (num_channels * num_chirps * num_samples)
    num_paths = min(int(rng.uniform(1000, 3000)) if is_strong else log_integer(rng, 1, 2000), max(2, work))
    wf = random_waveform(rng, num_chirps, num_samples)
    polynomial, amplitude = ARRANGE[kind](rng, wf, num_paths)
    # Channels differ by the place of their antenna.
    offset = np.zeros((num_channels, 1)) + rng.uniform(-0.01, 0.01, (num_channels, 1)) * (num_channels > 1) / C
    tolerance = log_uniform(rng, *[(1e-10, 1e-2), (1e-5, 1e-2)][rng.integers(2)])
    return wf, random_terms(rng, wf, polynomial, amplitude, offset), tolerance


def random_waveform(rng: np.random.Generator, num_chirps: int, num_samples: int) -> rc.Waveform:
    base = sweep_waveform(num_chirps, num_samples, int(rng.choice([-1, 1])))
    return sweep_waveform(
        num_chirps,
        num_samples,
        slope=base.slope * rng.uniform(1.0, 5.0),
        start_frequency=rng.choice([24e9, 58e9, 58e9, 77e9]),
        chirp_interval=log_uniform(rng, 1e-4, 5e-4),
    )


# --- arrangements: delays as a polynomial of the time over the frame's duration, (degree + 1, path), and amplitudes --


def independent(rng: np.random.Generator, wf: rc.Waveform, n: int) -> tuple[Real, NDArray[np.complex128]]:
    """Ranges, velocities and accelerations without any order, of strengths over some decades."""
    speed, acceleration = log_uniform(rng, 0.1, 20.0), log_uniform(rng, 0.1, 300.0)
    polynomial = delays(
        wf, rng.uniform(0.3, 8.0, n), rng.uniform(-speed, speed, n), rng.uniform(-acceleration, acceleration, n)
    )
    return polynomial, random_phases(rng, n) * 10.0 ** rng.uniform(-rng.choice([0.0, 2.0, 4.0]), 0.0, n)


def together(rng: np.random.Generator, wf: rc.Waveform, n: int) -> tuple[Real, NDArray[np.complex128]]:
    """All paths of one point."""
    ones = np.ones(n)
    place = rng.uniform(0.3, 8.0), rng.uniform(-5.0, 5.0), rng.uniform(-20.0, 20.0)
    return delays(wf, *(each * ones for each in place)), np.full(n, 0.8 + 0.3j)


def plate(rng: np.random.Generator, wf: rc.Waveform, n: int) -> tuple[Real, NDArray[np.complex128]]:
    """Equal steps of range and velocity: paths that add up at a time within or beside the frame."""
    steps = np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1)
    velocity = log_uniform(rng, 0.01, 3.0) * steps
    facing = (0.5 + rng.uniform(-2.5, 2.5)) * wf.duration
    motion = rng.uniform(-2.0, 2.0) + velocity
    acceleration = rng.choice([0.0, 5.0]) * rng.uniform(-1.0, 1.0) + 0.0 * steps
    return delays(wf, rng.uniform(1.0, 6.0) - velocity * facing, motion, acceleration), np.full(n, 0.8 + 0.3j)


def aligned(rng: np.random.Generator, wf: rc.Waveform, n: int) -> tuple[Real, NDArray[np.complex128]]:
    """Paths anywhere whose phases all agree at one time and frequency, within or beside the frame and the sweep."""
    polynomial, amplitude = independent(rng, wf, n)
    time, fast = (rng.uniform(-1.5, 2.5) * end for end in (wf.duration, wf.num_samples / wf.sample_rate))
    tau = np.polynomial.polynomial.polyval(time / wf.duration, polynomial)
    turns = tau * (wf.start_frequency + wf.slope * (fast - 0.5 * tau))
    return polynomial, abs(amplitude) * np.exp(2j * np.pi * (turns - np.rint(turns)))


def strong(rng: np.random.Generator, wf: rc.Waveform, n: int) -> tuple[Real, NDArray[np.complex128]]:
    """One strong, accelerating path among weak ones at velocities in equal steps."""
    velocity = log_uniform(rng, 0.2, 5.0) * ((np.arange(n) + 0.5) / n - 0.5)
    acceleration, amplitude = np.zeros(n), np.ones(n, complex)
    one = int(rng.integers(n))
    velocity[one], acceleration[one] = rng.uniform(-30.0, 30.0), log_uniform(rng, 0.5, 20.0)
    amplitude[one] = log_uniform(rng, 30.0, 1e4)
    return delays(wf, np.full(n, 5.0), velocity, acceleration), amplitude


ARRANGE = {make.__name__: make for make in (independent, together, plate, aligned, strong)}


def delays(wf: rc.Waveform, distance: Real, velocity: Real, acceleration: Real) -> Real:
    motion = np.stack([distance, velocity * wf.duration, 0.5 * acceleration * wf.duration**2])
    return np.asarray(2.0 / C * motion)


# --- delays and amplitudes as they are given -------------------------------------------------------------------------


def random_terms(
    rng: np.random.Generator, wf: rc.Waveform, polynomial: Real, amplitude: NDArray[np.complex128], offset: Real
) -> Paths:
    """The paths by constant terms, or by values at nodes; some of them static, in one sum of three."""
    polynomial = polynomial.copy()
    if rng.random() < 1.0 / 3.0:
        polynomial[1:, rng.random(polynomial.shape[1]) < rng.uniform(0.1, 1.0)] = 0.0
    shape = len(offset), polynomial.shape[1]
    amplitudes = np.tile(amplitude, (len(offset), 1))
    degree = int(rng.choice([0, 1, 1, 2, 2, 2, 3, 3, 3]))
    if degree < 3:
        derivatives = [
            np.ascontiguousarray(np.broadcast_to(math.factorial(k) * polynomial[k] / wf.duration**k, shape))
            for k in range(1, degree + 1)
        ]
        return Paths(polynomial[0] + offset, amplitudes, *derivatives)
    return nodal(rng, wf, polynomial, amplitudes, offset)


def nodal(
    rng: np.random.Generator, wf: rc.Waveform, polynomial: Real, amplitudes: NDArray[np.complex128], offset: Real
) -> Paths:
    """Delays at 2 to 16 nodes, some with a vibration that these follow; amplitudes at nodes too, or constant."""
    num_nodes = int(rng.integers(2, 17))
    x = wf.delay_times(num_nodes)[:, None, None] / wf.duration
    delay = np.polynomial.polynomial.polyval(x, polynomial, tensor=False) + offset
    if num_nodes > 4 and rng.random() < 0.4:
        moves = polynomial[1:].any(axis=0)
        cycles = rng.uniform(0.2, num_nodes / 5.0)
        delay += 2.0 / C * log_uniform(rng, 1e-4, 1e-2) * np.sin(2.0 * np.pi * cycles * x) * moves
    if rng.random() < 0.5:
        return Paths(np.ascontiguousarray(delay), amplitudes)
    x = wf.delay_times(int(rng.integers(2, 9)))[:, None, None] / wf.duration
    growth = rng.choice([0.0, 1.0]) + rng.uniform(-0.8, 0.8, amplitudes.shape[1]) * x + rng.uniform(0.0, 2.0) * x**2
    return Paths(np.ascontiguousarray(delay), amplitudes * growth)


# --- the promise -----------------------------------------------------------------------------------------------------


def excess(wf: rc.Waveform, paths: Paths, tolerance: float, method: str, exact: NDArray[np.complex128]) -> float:
    """Error over its bound, at most 1."""
    got, _ = paths.signal(wf, tolerance=tolerance, method=method)
    error = relative_error(got, exact, paths)
    return float(np.nan_to_num(error / (tolerance + allowance(exact, paths, wf, tolerance)), nan=np.inf).max())


@pytest.mark.parametrize(("kind", "first"), BLOCKS)
def test_random_sums_are_within_the_tolerance(kind: str, first: int) -> None:
    failed: list[str] = []
    for seed in range(first, first + PER_TEST):
        wf, paths, tolerance = random_sum(kind, seed)
        exact = paths.exact(wf)
        for method in METHODS:
            if (ratio := excess(wf, paths, tolerance, method, exact)) > 1.0:
                shape = (*paths.delay.shape, wf.num_chirps, wf.num_samples)
                failed.append(f"seed {seed}, {method}: {ratio:.2f} times the bound at {tolerance:.1e}, {shape}")
    assert not failed, "\n".join(failed)
