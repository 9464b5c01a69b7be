"""Sums by the fast engines against the exact one, within the tolerance."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from path_scenes import C, Paths, Report, allowance, random_phases, relative_error

METHODS = ("auto", "grid")
CHIRP, DOPPLER = "chirp-wise NUFFT", "range-Doppler NUFFT"


def moving(num_paths: int, seed: int = 0, speed: float = 2.0, channels: int = 1) -> Paths:
    """Paths at 0.5 to 3 m that move, and accelerate a little."""
    rng = np.random.default_rng(seed)
    shape = (channels, num_paths)
    return Paths(
        2.0 / C * rng.uniform(0.5, 3.0, shape),
        random_phases(rng, shape),
        2.0 / C * rng.uniform(-speed, speed, shape),
        2.0 / C * rng.uniform(-9.0, 9.0, shape),
    )


def steady(num_moving: int, num_static: int = 0, seed: int = 0, speed: float = 2.0) -> Paths:
    """Paths at constant velocities, some of them static."""
    paths = moving(num_moving + num_static, seed, speed)
    assert paths.rate is not None
    paths.rate[:, np.random.default_rng(seed).permutation(num_moving + num_static)[:num_static]] = 0.0
    return Paths(paths.delay, paths.amplitude, paths.rate)


def check(
    paths: Paths, wf: rc.Waveform, tolerance: float, *, exact: NDArray[np.complex128] | None = None, **options: Any
) -> Report:
    """Compare a sum with the exact one, which is computed here if it is not given; returns the report of the sum."""
    got, report = paths.signal(wf, tolerance=tolerance, **options)
    assert np.isfinite(got).all(), f"{options}: {report}"
    exact = paths.exact(wf) if exact is None else exact
    error, bound = relative_error(got, exact, paths).max(), tolerance + allowance(exact, paths, wf, tolerance)
    assert error <= bound, f"{options}: error {error:.2e} exceeds {bound:.2e}, {report}"
    return report
