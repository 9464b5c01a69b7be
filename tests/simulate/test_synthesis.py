"""Fast sums keep their tolerance: against the direct sum in double precision, over all inputs that may matter."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from fast_sums import METHODS, check, steady
from path_scenes import (
    COURSES,
    IN_PHASE,
    SCENES,
    C,
    Paths,
    allowance,
    num_nodes,
    random_phases,
    relative_error,
    scene_paths,
    sweep_waveform,
)
from radarcore import _core

LEVELS = tuple(_core.levels())
AXES: dict[str, tuple[Any, ...]] = {
    "scene": SCENES,
    "tolerance": tuple(10.0**-digit for digit in range(1, 13)),
    "num_chirps": (1, 2, 64, 1000),
    "num_samples": (1, 16, 256),
    "slope_sign": (1, -1),
    "nodal": (False, True),
    "level": LEVELS,
    "method": METHODS,
    "num_paths": (7, 130, 600),
}
MAX_PATH_SAMPLES, MAX_PATH_CHIRPS = 2_500_000, 200_000
"""So that one case takes some hundredths of a second."""


def all_pairs(seed: int) -> list[dict[str, Any]]:
    """Combinations in which every pair of values of two axes occurs: the best of random ones, until none is left."""
    rng = np.random.default_rng(seed)
    names = list(AXES)
    left = {
        (a, i, b, j)
        for a, b in combinations(range(len(names)), 2)
        for i in range(len(AXES[names[a]]))
        for j in range(len(AXES[names[b]]))
    }
    sizes = [len(values) for values in AXES.values()]

    def pairs(choice: list[int]) -> set[tuple[int, int, int, int]]:
        return {(a, choice[a], b, choice[b]) for a, b in combinations(range(len(names)), 2)}

    cases = []
    while left:
        a, i, b, j = min(left)  # at least one new pair each time
        candidates = []
        for _ in range(30):
            choice = [int(rng.integers(size)) for size in sizes]
            choice[a], choice[b] = i, j
            candidates.append(choice)
        best = max(candidates, key=lambda choice: len(pairs(choice) & left))
        left -= pairs(best)
        cases.append({name: AXES[name][k] for name, k in zip(names, best, strict=True)})
    return cases


CASES = all_pairs(20)


def case_paths(case: dict[str, Any], seed: int) -> tuple[rc.Waveform, Paths]:
    wf = sweep_waveform(case["num_chirps"], case["num_samples"], case["slope_sign"])
    most = min(MAX_PATH_SAMPLES // case["num_samples"], MAX_PATH_CHIRPS) // case["num_chirps"]
    num_paths = max(5, min(case["num_paths"], most))
    return wf, scene_paths(case["scene"], wf, num_paths, np.random.default_rng(seed), nodal=case["nodal"])


def is_ordinary(case: dict[str, Any]) -> bool:
    """True for cases that a NUFFT has to sum: motion of bodies, and tolerances that double precision has room for."""
    return (
        case["tolerance"] >= 1e-9
        and case["num_chirps"] <= 64
        and case["scene"] not in ("fan", "lateral", "beyond", "together", "facing")
    )


def test_every_pair_of_values_occurs() -> None:
    for a, b in combinations(AXES, 2):
        found = {(case[a], case[b]) for case in CASES}
        assert found == {(x, y) for x in AXES[a] for y in AXES[b]}, f"{a}, {b}"


@pytest.mark.parametrize("seed", range(len(CASES)))
def test_error_is_within_the_tolerance(seed: int) -> None:
    case = CASES[seed]
    wf, paths = case_paths(case, seed)
    report = check(paths, wf, case["tolerance"], method=case["method"], level=case["level"])
    if case["method"] == "grid" and is_ordinary(case):
        assert report.engine != "direct", f"{case}: {report}"


@cache
def many_paths(speed: float) -> tuple[rc.Waveform, Paths, NDArray[np.complex128]]:
    rng, n = np.random.default_rng(7), 200_000
    wf = sweep_waveform(4, 16)
    paths = Paths(2.0 / C * rng.uniform(0.5, 2.5, n), random_phases(rng, n), 2.0 / C * rng.uniform(-speed, speed, n))
    return wf, paths, paths.exact(wf)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-3, 3e-6, 1e-6])
@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_sums_of_many_paths_in_single_precision_keep_their_digits(speed: float, tolerance: float, method: str) -> None:
    # 200 000 paths in 27 cells: the rounding of their sums grows with the root of their number.
    wf, paths, exact = many_paths(speed)
    check(paths, wf, tolerance, exact=exact, method=method, threads=None)


@pytest.mark.parametrize("num_samples", [1, 3, 16])
@pytest.mark.parametrize("num_chirps", [1, 2, 3, 8])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-7, 1e-9])
def test_kernel_holds_for_few_chirps_and_samples(tolerance: float, num_chirps: int, num_samples: int) -> None:
    # One or two chirps lie at the ends of the kernel's range, where its error is largest.
    wf = sweep_waveform(num_chirps, num_samples)
    for seed in range(4):
        check(steady(300, seed=seed, speed=3.0), wf, tolerance, method="grid")


@pytest.mark.parametrize("scene", ["lateral", "image", "tilted"])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
def test_samples_are_those_of_the_exact_geometry(scene: str, tolerance: float) -> None:
    # Interpolation included: the geometry at the time of every sample.
    wf = sweep_waveform(32, 24)
    ranges = COURSES[scene](np.random.default_rng(3), 60, wf)
    time = (wf.chirp_times[:, None] + wf.sample_times - 0.5 * wf.duration).reshape(-1, 1)
    tau = 2.0 / C * ranges(time)
    fast = np.tile(wf.sample_times, wf.num_chirps)[:, None]
    turns = wf.start_frequency * tau + wf.slope * tau * (fast - 0.5 * tau)
    amplitude = 0.8 + 0.3j if scene in IN_PHASE else random_phases(np.random.default_rng(4), 60)
    expected = (np.conj(amplitude) * np.exp(2j * np.pi * turns)).sum(axis=1).reshape(1, wf.num_chirps, wf.num_samples)
    nodes = wf.delay_times(num_nodes(scene, wf))[:, None] - 0.5 * wf.duration
    paths = Paths(2.0 / C * ranges(nodes)[:, None], np.broadcast_to(amplitude, (1, 60)).astype(complex))
    for method in (*METHODS, "direct"):
        got, report = paths.signal(wf, tolerance=tolerance, method=method)
        bound = tolerance + 1e-7 + allowance(expected, paths, wf, tolerance)
        assert relative_error(got, expected, paths) <= bound, str(report)
