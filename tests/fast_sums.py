"""Sums of the fast methods against the exact one, within what is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from path_scenes import C, Paths, allowance, random_phases, relative_error

METHODS = ("auto", "grid", "recurrence", "lanes")
FAST = ("grid", "recurrence", "lanes")


def finest(method: str, tolerance: float) -> float:
    """The tolerance, or what sums in lanes reach: they follow the phase within a chirp to second order."""
    return max(tolerance, 1e-4) if method == "lanes" else tolerance


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


def check(
    paths: Paths, wf: rc.Waveform, tolerance: float, *, exact: NDArray[np.complex128] | None = None, **options: Any
) -> None:
    """Compare a sum with the exact one, which is found here if it is not given."""
    tolerance = finest(options.get("method", "auto"), tolerance)
    got, report = paths.signal(wf, tolerance=tolerance, **options)
    assert np.isfinite(got).all(), f"{options}: {report}"
    exact = paths.exact(wf) if exact is None else exact
    error, bound = relative_error(got, exact, paths).max(), tolerance + allowance(exact, paths, wf, tolerance)
    assert error <= bound, f"{options}: error {error:.2e} beyond {bound:.2e}, {report}"


def check_or_refused(paths: Paths, wf: rc.Waveform, tolerance: float, *, may_refuse: bool, **options: Any) -> None:
    """Check a sum; methods that may refuse a tolerance name the one that they reach."""
    try:
        check(paths, wf, tolerance, **options)
    except ValueError as refusal:
        if not (may_refuse and "tolerance: expected" in str(refusal)):
            raise
