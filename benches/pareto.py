"""Error of the beat signal against run time: the NUFFTs, direct sums, and a public library of nonuniform FFTs.

    python benches/pareto.py            print the tables
    python benches/pareto.py --write    also write its section of the results and the picture
    python benches/pareto.py --picture  draw the picture of the results again
    python benches/pareto.py --tiny     run everything once on few paths

The library, finufft, is optional: `pip install finufft==2.5.1`.
"""

from __future__ import annotations

import argparse
import ctypes
import io
import math
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

import radarcore as rc
from page import DOCS, PERFORMANCE, machine, milliseconds, section_of, table, tables_of, write_section
from radarcore import _core
from radarcore.simulate.beat import core_rows
from scenes import Case, Job, arm_case, fan_case, image_order, random_order, room_case, walker_case, waveform

try:
    import finufft
except ImportError:
    finufft = None

PICTURE = DOCS / "performance.png"
INSTALL_HINT = "finufft is not installed, its rows are left out: pip install finufft==2.5.1"

PAGE_TEXT = """\
Error of the beat signal against run time, written by `python benches/pareto.py --write`.

{num_paths} paths, one channel, {machine}; one thread unless stated otherwise. Times are medians over {repeats} rounds
in which the methods take turns, and include the call from Python with delays and amplitudes in memory. "auto" and
"direct" are methods of `beat_signal`, see [synthesis](../../docs/synthesis.md). "C f64" is an independent baseline for
linear delays: a direct sum by phasor recurrences in forty lines of C (`benches/direct_sum.c`, `cc -O3 -march=native
-ffast-math`). "× C" and "× direct" are speedups over these two: medians of the ratios of the rounds, not ratios of the
medians beside them. On other machines times change more than ratios.

Errors are rms over samples relative to the l2 norm of the amplitudes, estimated at {num_samples} random samples of the
frame against eq. (1) with the exact delays of all paths.

![Error against run time](../../docs/{picture})

## Linear delays

58 GHz, 64 chirps every 400 μs; ranges to 8 m, velocities to 3 m/s. Paths are in random order, or in the order of the
pixels of a depth image, where adjacent paths have similar ranges and velocities.

{linear}

"finufft 2-D" is one transform over range and velocity per term of a low-rank expansion of the residual phase: range
migration and Doppler within a chirp. "finufft 1-D" is one transform per chirp. The terms come from a singular value
decomposition cut at the tolerance, and run as many-vector transforms of a reused plan, with the faster of two
oversampling factors and of sorted or unsorted points. Times and ratios count the library alone (`setpts` and
`execute`). "with numpy" adds coordinates, strengths and the sum of the terms in numpy, which C would do faster.

## Real motion

Delays and amplitudes (1/R²) follow the geometry. They are given at the Chebyshev nodes of the frame, and errors include
the interpolation between nodes. Limbs of the walker reach 5 m/s, joints of the arm turn at 2 rad/s, fan blades of 0.15
m at 20 turns per second.

{moving}

## Fewer paths

The same scenes in milliseconds by tolerance, and the largest error relative to the tolerance.

{fewer}

## Growth

Milliseconds at a tolerance of {growth_tolerance:g}, 1 GHz, 128 samples per chirp.

{growth}

## A call from Python

{overhead}
"""

MOVING_TOLERANCES = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6]
GROWTH_TOLERANCE = 1e-4

Phasors = NDArray[np.complex128]


@dataclass(frozen=True)
class Run:
    """Sizes of a measurement."""

    bands: list[tuple[float, int]]  # bandwidth [Hz] and samples per chirp, of linear delays
    paths: int
    fewer_paths: list[int]
    samples: int
    tolerances: list[float]  # of linear delays
    repeats: int
    round: float  # seconds that a method's turn lasts, if one call is shorter
    growth: list[int]
    calls: int


FULL = Run(
    bands=[(1e9, 128), (5e9, 256)],
    paths=65_536,
    fewer_paths=[100, 1000, 8192],
    samples=200,
    tolerances=[10.0**-k for k in range(2, 13)],
    repeats=5,
    round=5e-3,
    growth=[16, 32, 64, 128, 256, 512, 1024],
    calls=5000,
)
TINY = Run(
    bands=[(1e9, 16)],
    paths=64,
    fewer_paths=[16],
    samples=10,
    tolerances=[1e-3, 1e-10],
    repeats=1,
    round=0.0,
    growth=[16, 32],
    calls=10,
)


@dataclass
class Method:
    """A way to form the sum of a case, and what it took."""

    name: str
    tolerance: float | None
    call: Callable[[], Phasors]
    nodes: int | None = None
    error: float = math.nan
    times: list[float] = field(default_factory=list)
    """Of the sum itself, round by round [s]."""
    totals: list[float] = field(default_factory=list)
    """Of the call from Python, round by round [s]."""

    @property
    def seconds(self) -> float:
        """Median time of the sum itself."""
        return float(np.median(self.times))

    @property
    def total_seconds(self) -> float:
        """Median time of the call from Python."""
        return float(np.median(self.totals))

    def speedup(self, base: Method) -> float:
        """Median over the rounds of the ratio of the times of another method and of this one."""
        return float(np.median(np.divide(base.times, self.times)))

    def take_turn(self, shortest: float) -> None:
        """Add the median times of calls for at least `shortest` [s]: the first finds other data in the caches."""
        is_library = isinstance(self.call, LibrarySum)
        totals: list[float] = []
        if is_library:
            self.call.times.clear()
        while not totals or sum(totals) < shortest:
            start = time.perf_counter()
            self.call()
            totals.append(time.perf_counter() - start)
        self.totals.append(float(np.median(totals)))
        self.times.append(self.call.library_seconds if is_library else self.totals[-1])


def radarcore_sum(job: Job, method: str, tolerance: float, threads: int) -> Phasors:
    """The samples of a job by a method of `beat_signal`."""
    samples, *_ = _core.beat_signal(
        **core_rows(job.delay, job.amplitude, job.delay_rate),
        waveform=job.waveform._core,
        tolerance=tolerance,
        method=method,
        threads=threads,
    )
    return samples


# The direct sum in C.


@cache
def c_library() -> ctypes.CDLL | None:
    """direct_sum.c, by the compiler of the machine; None where there is none."""
    source = Path(__file__).with_name("direct_sum.c")
    with tempfile.TemporaryDirectory() as directory:
        target = Path(directory) / "direct_sum.so"
        options = ["-O3", "-march=native", "-ffast-math", "-shared", "-fPIC"]
        try:
            done = subprocess.run(["cc", *options, "-o", target, source, "-lm"], capture_output=True, check=False)
        except OSError:
            return None
        if done.returncode != 0:
            return None
        library = ctypes.CDLL(str(target))
    reals, phasors = (np.ctypeslib.ndpointer(dtype, flags="C_CONTIGUOUS") for dtype in (np.float64, np.complex128))
    number, count = ctypes.c_double, ctypes.c_long
    library.direct_sum.argtypes = [
        *(reals, reals, phasors, count),
        *(number, number, number, number, reals, count, count),
        phasors,
    ]
    library.direct_sum.restype = None
    return library


def c_sum(library: ctypes.CDLL, job: Job) -> Phasors:
    """The samples of a job with linear delays."""
    wf = job.waveform
    samples = np.empty((1, wf.num_chirps, wf.num_samples), complex)
    paths = job.delay, job.delay_rate, job.amplitude, len(job.delay)
    times = wf.sample_times[0], 1.0 / wf.sample_rate, wf.chirp_times, wf.num_chirps, wf.num_samples
    library.direct_sum(*paths, wf.start_frequency, wf.slope, *times, samples)
    return samples


# The library: a good user's sum for linear delays.


class LibrarySum:
    """Type 1 transforms of finufft for linear delays, with everything that can be kept between frames kept.

    About the centre of a block of chirps and of the sweep, where t = t0 + t', T = T0 + T'_c + t' and the delay is
    tau + r (T'_c + t'), the phase of eq. (1) in cycles with f = f0 + S t0 is

        f tau - S tau² / 2                                                         a strength,
        + t' (S tau + r f - r S tau) + T'_c r (f - S tau)                          two coordinates
        + S r (1 - r) t' T'_c + S r (1 - r / 2) t'² - S r² T'_c² / 2               and the rest.

    The rest depends on the rate of a path only. Its exponential is a sum of terms (function of the rate) x (function
    of the sample), from a singular value decomposition, each term one transform.

    Parameters
    ----------
    dims : 1 or 2
        Transforms over fast time, a block being a chirp, or over slow and fast time, with one block.
    """

    DEGREE = 48
    """Of the polynomials in the rate that hold the functions: exact to rounding up to 10 radians."""

    def __init__(self, job: Job, tolerance: float, dtype: type, dims: int) -> None:
        wf = job.waveform
        self.job, self.dtype, self.dims = job, dtype, dims
        self.fast = (np.arange(wf.num_samples) - wf.num_samples // 2) / wf.sample_rate
        self.center = wf.sample_times[wf.num_samples // 2]
        in_block = np.arange(wf.num_chirps) - wf.num_chirps // 2 if dims == 2 else np.zeros(1)
        self.slow = in_block * wf.chirp_interval
        self.block_times = (wf.chirp_times[[wf.num_chirps // 2]] if dims == 2 else wf.chirp_times) + self.center

        self.max_rate = np.abs(job.delay_rate).max()
        self.of_rate, self.of_sample = self._terms(0.3 * tolerance)
        self.times: list[float] = []
        self.plan = self._fastest_plan(0.3 * tolerance)
        self.times.clear()

    def _terms(self, bound: float) -> tuple[Phasors, Phasors]:
        """Chebyshev coefficients of the functions of the rate, (degree, term), and of sample, (term, slow, fast)."""
        nodes = np.cos(np.pi * (np.arange(self.DEGREE) + 0.5) / self.DEGREE)
        slope, rate = self.job.waveform.slope, self.max_rate * nodes[:, None, None]
        slow, fast = self.slow[:, None], self.fast
        turns = slope * rate * ((1.0 - rate) * fast * slow + (1.0 - 0.5 * rate) * fast**2 - 0.5 * rate * slow**2)
        matrix = np.exp(2j * np.pi * turns).reshape(self.DEGREE, -1)

        # Nodes weigh as if rates were spread evenly.
        weights = np.sqrt(np.sqrt(1.0 - nodes**2) * np.pi / 2.0 / self.DEGREE)[:, None]
        left, values, right = np.linalg.svd(weights * matrix, full_matrices=False)
        rms = np.sqrt(np.cumsum(values[::-1] ** 2)[::-1] / matrix.shape[1])
        num_terms = max(1, int(np.argmax(rms < bound))) if rms[-1] < bound else self.DEGREE
        of_rate = chebyshev.chebvander(nodes, self.DEGREE - 1).T @ (left / weights)[:, :num_terms] * 2.0 / self.DEGREE
        of_rate[0] *= 0.5
        of_sample = (values[:num_terms, None] * right[:num_terms]).reshape(num_terms, *turns.shape[1:])
        size = np.abs(of_rate) @ values[:num_terms] / np.sqrt(matrix.shape[1])
        used = 1 + np.flatnonzero(size > 0.1 * bound).max()
        return of_rate[:used], of_sample

    def _fastest_plan(self, bound: float) -> finufft.Plan:
        modes = (len(self.slow), len(self.fast))[2 - self.dims :]
        # The coarser grid does not reach every digit.
        coarse_is_enough = bound > (1e-4 if self.dtype is np.complex64 else 1e-8)
        plans, functions = {}, self._functions()
        for upsampling, sort in product((2.0, 1.25) if coarse_is_enough else (2.0,), (0, 1)):
            plan = finufft.Plan(
                1,
                modes,
                len(self.of_sample),
                max(bound, 1e-6 if self.dtype is np.complex64 else 1e-14),
                isign=1,
                dtype=np.dtype(self.dtype).name,
                nthreads=1,
                upsampfac=upsampling,
                spread_sort=sort,
            )
            self.times.clear()
            for _ in range(3):
                self._block(plan, functions, self.block_times[0])
            plans[min(self.times)] = plan
        return plans[min(plans)]

    @property
    def library_seconds(self) -> float:
        """Median time of a frame inside the library, since `times` was cleared."""
        per_frame = np.reshape(self.times, (-1, len(self.block_times))).sum(axis=1)
        return float(np.median(per_frame))

    def __call__(self) -> Phasors:
        """The samples, (channel, chirp, sample)."""
        functions = self._functions()
        blocks = [self._block(self.plan, functions, block_time) for block_time in self.block_times]
        return np.concatenate(blocks)[None]

    def _functions(self) -> Phasors:
        """The functions of the rate at the paths, (path, term)."""
        return chebyshev.chebvander(self.job.delay_rate / self.max_rate, len(self.of_rate) - 1) @ self.of_rate

    def _block(self, plan: finufft.Plan, functions: Phasors, block_time: float) -> Phasors:
        """Samples of the chirps of a block, (chirp, sample)."""
        wf, rate = self.job.waveform, self.job.delay_rate
        tau = self.job.delay + rate * block_time
        frequency = wf.start_frequency + wf.slope * self.center

        # Coordinates [rad] and strengths, in f64 until their phases are reduced.
        along_fast = reduced(wf.slope * tau + rate * (frequency - wf.slope * tau), 1.0 / wf.sample_rate)
        along_slow = reduced(rate * (frequency - wf.slope * tau), wf.chirp_interval)
        points = [along_slow, along_fast][2 - self.dims :]
        strengths = np.conj(self.job.amplitude) * np.exp(1j * reduced(tau, frequency - 0.5 * wf.slope * tau))
        vectors = np.ascontiguousarray((functions * strengths[:, None]).T, dtype=self.dtype)
        points = [p.astype(vectors.real.dtype) for p in points]

        start = time.perf_counter()
        plan.setpts(*points)
        transforms = plan.execute(vectors)
        self.times.append(time.perf_counter() - start)

        return (self.of_sample * transforms.reshape(self.of_sample.shape)).sum(axis=0)


def reduced(cycles: NDArray[np.float64], factor: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """The angle [rad] of a product in cycles, within half a turn of zero."""
    product = cycles * factor
    return 2.0 * np.pi * (product - np.rint(product))


# Truth.


class Truth:
    """Eq. (1) with exact delays at random samples of a frame."""

    def __init__(self, case: Case, num_samples: int) -> None:
        wf = case.waveform
        chosen = np.random.default_rng(0).choice(wf.num_chirps * wf.num_samples, num_samples, replace=False)
        self.chirp, self.sample = np.divmod(chosen, wf.num_samples)
        self.norm = np.linalg.norm(case.amplitude)
        parts = zip(*(np.array_split(index, len(chosen) // 8 + 1) for index in (self.chirp, self.sample)), strict=True)
        self.values = np.concatenate([samples_of(case, *part) for part in parts])

    def error(self, cube: Phasors) -> float:
        """Rms error of a cube of one channel relative to the l2 norm of the amplitudes."""
        difference = cube[0, self.chirp, self.sample] - self.values
        return float(np.sqrt(np.mean(np.abs(difference) ** 2)) / self.norm)


def samples_of(case: Case, chirp: NDArray[np.intp], sample: NDArray[np.intp]) -> Phasors:
    """Samples by eq. (1), (index,). In extended precision where the delays are and the machine has it."""
    wf = case.waveform
    fast = wf.sample_times[sample]
    tau = case.delay_at(wf.chirp_times[chirp] + fast)  # (index, path)
    turns = tau * (wf.start_frequency + wf.slope * fast[:, None] - 0.5 * wf.slope * tau)
    phase = 2.0 * np.pi * (turns - np.rint(turns)).astype(np.float64)
    return np.sum(np.conj(case.amplitude_at(tau)) * np.exp(1j * phase), axis=1)


# Measurement.


def measure(case: Case, methods: list[Method], run: Run) -> None:
    """Errors and times of all methods, which take turns."""
    truth = Truth(case, run.samples)
    for method in methods:  # also warms up
        method.error = truth.error(method.call())
    for _ in range(run.repeats):
        for method in methods:
            method.take_turn(run.round)


def ours(case: Case, tolerances: Iterable[float]) -> Iterator[Method]:
    """The fastest sum at every tolerance, and the direct sum with the delays of the finest."""
    jobs = {tolerance: case.job(tolerance) for tolerance in tolerances}

    def method(name: str, tolerance: float | None) -> Method:
        job = jobs[min(jobs) if tolerance is None else tolerance]
        nodes = None if case.is_linear else len(job.delay)
        return Method(name, tolerance, lambda: radarcore_sum(job, name, tolerance or 1e-9, 1), nodes)

    for tolerance in jobs:
        yield method("auto", tolerance)
    yield method("direct", None)


def in_c(job: Job) -> Iterator[Method]:
    """The direct sum in C, if there is a compiler and the chirps make whole groups."""
    if job.waveform.num_chirps % 16 == 0 and (built := c_library()) is not None:
        yield Method("C f64", None, lambda: c_sum(built, job))


def library(job: Job, tolerances: Iterable[float]) -> Iterator[Method]:
    """The library at the tolerances that its precisions reach; fewer of the slow transforms per chirp."""
    if finufft is None:
        return
    for name, dims, dtype, reached in (
        ("finufft 2-D f32", 2, np.complex64, [1e-2, 1e-3, 1e-4, 1e-5]),
        ("finufft 2-D f64", 2, np.complex128, [1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12]),
        ("finufft 1-D f32", 1, np.complex64, [1e-3, 1e-5]),
        ("finufft 1-D f64", 1, np.complex128, [1e-6, 1e-10]),
    ):
        for tolerance in tolerances:
            if any(math.isclose(tolerance, t) for t in reached):
                yield Method(name, tolerance, LibrarySum(job, tolerance, dtype, dims))


def linear_results(run: Run) -> Iterator[tuple[str, list[Method]]]:
    for bandwidth, num_samples in run.bands:
        wf = waveform(bandwidth=bandwidth, num_samples=num_samples)
        for case in (random_order(wf, run.paths), image_order(wf, run.paths)):
            job = case.job(run.tolerances[0])
            methods = [*ours(case, run.tolerances), *in_c(job), *library(job, run.tolerances)]
            measure(case, methods, run)
            yield f"{case.name}, {bandwidth / 1e9:g} GHz", methods


def moving_results(run: Run) -> Iterator[tuple[str, list[Method]]]:
    for case in moving_cases(run.paths):
        methods = list(ours(case, MOVING_TOLERANCES))
        measure(case, methods, run)
        yield title(case), methods


def moving_cases(num_paths: int) -> Iterator[Case]:
    wf, wide = waveform(), waveform(bandwidth=5e9, num_samples=256)
    yield walker_case(wf, num_paths)
    yield arm_case(wf, num_paths)
    yield room_case(wf, num_paths)
    yield walker_case(wide, num_paths)
    yield fan_case(wf, num_paths)


def title(case: Case) -> str:
    """The case, and its bandwidth if it is not the usual one."""
    bandwidth = f"{case.waveform.bandwidth / 1e9:.0f}"
    return case.name if bandwidth == "1" else f"{case.name}, {bandwidth} GHz"


def fewer_rows(run: Run) -> Iterator[list[str]]:
    """Times by tolerance for fewer paths, linear and moving."""
    for num_paths in run.fewer_paths:
        wf = waveform()
        for case in (random_order(wf, num_paths), image_order(wf, num_paths), *moving_cases(num_paths)):
            methods = list(ours(case, MOVING_TOLERANCES))
            measure(case, methods, run)
            excess = max(method.error / method.tolerance for method in methods if method.tolerance is not None)
            yield [
                title(case),
                str(num_paths),
                *(milliseconds(method.seconds) for method in methods),
                f"{excess:.2g}",
            ]


def growth_rows(run: Run) -> Iterator[list[str]]:
    """Times for ever more chirps, by linear delays and by a walker, whose nodes follow the length of the frame."""
    for num_chirps in run.growth:
        wf = waveform(num_chirps=num_chirps)
        num_nodes = round(6.0 * math.sqrt(max(1.0, num_chirps / 64)))
        for case in (random_order(wf, run.paths), walker_case(wf, run.paths, {GROWTH_TOLERANCE: num_nodes})):
            job = case.job(GROWTH_TOLERANCE)
            methods = [
                Method("auto", GROWTH_TOLERANCE, lambda j=job, t=threads: radarcore_sum(j, "auto", GROWTH_TOLERANCE, t))
                for threads in (1, 2)
            ]
            baseline = list(in_c(job)) if case.is_linear else []
            measure(case, methods + baseline, run)
            yield [
                case.name,
                str(num_chirps),
                "-" if case.is_linear else str(num_nodes),
                f"{methods[0].error:.1e}",
                *(milliseconds(method.seconds) for method in methods),
                milliseconds(baseline[0].seconds) if baseline else "-",
            ]


def overhead(run: Run) -> str:
    """Run time of a call without work."""
    wf = waveform(num_chirps=1, num_samples=16)
    delay, amplitude = np.array([20e-9]), np.array([1.0 + 0.0j])
    times = []
    for _ in range(run.calls):
        start = time.perf_counter()
        rc.beat_signal(delay, amplitude, wf, threads=1)
        times.append(time.perf_counter() - start)
    return f"One path, one chirp, 16 samples: {1e6 * np.median(times):.0f} μs, the median of {run.calls} calls."


# Tables and picture.


def result_rows(results: Iterable[tuple[str, list[Method]]]) -> Iterator[list[str]]:
    """One row per method; missing nodes and library columns are dashes."""
    for name, methods in results:
        by_name = {method.name: method for method in methods}
        bases = [by_name.get(name) for name in ("C f64", "direct")]
        for method in methods:
            is_library = isinstance(method.call, LibrarySum)
            yield [
                name,
                method.name,
                "-" if method.tolerance is None else f"{method.tolerance:.0e}",
                "-" if method.nodes is None else str(method.nodes),
                str(len(method.call.of_sample)) if is_library else "-",
                f"{method.error:.1e}",
                milliseconds(method.seconds),
                milliseconds(method.total_seconds) if is_library else "-",
                *("-" if base is None else f"{method.speedup(base):.3g}" for base in bases),
            ]


def result_table(results: list[tuple[str, list[Method]]], *leave_out: str) -> str:
    header = ["case", "method", "tolerance", "nodes", "terms", "error", "ms", "with numpy", "× C", "× direct"]
    kept = [i for i, name in enumerate(header) if name not in leave_out]
    return table([header[i] for i in kept], [[row[i] for i in kept] for row in result_rows(results)])


STYLES = {
    "auto": "o-C3",
    "direct": "DC0",
    "C f64": "sC7",
    "finufft 2-D f32": "^--C1",
    "finufft 2-D f64": "v--C1",
    "finufft 1-D f32": "^:C2",
    "finufft 1-D f64": "v:C2",
}

Row = dict[str, str]


def picture(linear: list[Row], moving: list[Row]) -> Figure:
    """Error against run time by the rows of the tables: three panels of linear delays, one of real motion."""
    figure = Figure(figsize=(11.0, 9.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True, subplot_kw={"xscale": "log", "yscale": "log"}).ravel()
    cases = list(dict.fromkeys(row["case"] for row in linear))[:3]
    for ax, case in zip(axes, cases, strict=False):
        of_case = [row for row in linear if row["case"] == case]
        for name, style in STYLES.items():
            draw(ax, [row for row in of_case if row["method"] == name], style, label=name)
        for base in [float(row["ms"]) for row in of_case if row["method"] == "C f64"]:

            def ratio(ms: NDArray[np.float64], base: float = base) -> NDArray[np.float64]:
                return base / np.maximum(ms, 1e-9)  # matplotlib asks for 0, too

            faster = ax.secondary_xaxis("top", functions=(ratio, ratio))
            faster.set_xlabel("times faster than the direct sum in C")
            faster.xaxis.set_major_formatter("{x:g}")
        ax.set_title(f"Linear delays, {case}")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(STYLES))
    for color, case in enumerate(dict.fromkeys(row["case"] for row in moving)):
        of_case = [row for row in moving if row["case"] == case]
        draw(axes[3], [row for row in of_case if row["method"] == "auto"], f"o-C{color}", label=case)
        draw(axes[3], [row for row in of_case if row["method"] == "direct"], f"DC{color}")
    axes[3].set_title("Real motion: auto (lines), direct (◇)")
    axes[3].legend(fontsize=9)
    for ax in axes:
        ax.xaxis.set_major_formatter("{x:g}")
        ax.grid(which="major", alpha=0.3)
    figure.supxlabel("run time [ms]")
    figure.supylabel("rms error relative to the l2 norm of the amplitudes")
    return figure


def draw(ax: Axes, rows: list[Row], style: str, **options: str) -> None:
    """Points of a method, unless another one is faster and more exact."""
    points = sorted((float(row["ms"]), float(row["error"])) for row in rows)
    best = [(time, error) for index, (time, error) in enumerate(points) if all(error < e for _, e in points[:index])]
    ax.plot([time for time, _ in best], [error for _, error in best], style, markerfacecolor="none", **options)


def write_picture() -> None:
    """Draw the picture of the first two tables of the results."""
    picture(*tables_of(section_of(PERFORMANCE, "pareto"))[:2]).savefig(PICTURE, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description="Error of the beat signal against run time.")
    parser.add_argument("--tiny", action="store_true", help="once, on few paths")
    parser.add_argument("--write", action="store_true", help="write the section of the results and the picture")
    parser.add_argument("--picture", action="store_true", help="draw the picture of the results as they are")
    arguments = parser.parse_args()
    if arguments.picture:
        write_picture()
        return
    run = TINY if arguments.tiny else FULL

    if finufft is None:
        print(INSTALL_HINT, end="\n\n")
    linear = list(linear_results(run))
    linear_table = result_table(linear, "nodes", *(["terms", "with numpy"] if finufft is None else []))
    print(linear_table, end="\n\n")
    moving = list(moving_results(run))
    moving_table = result_table(moving, "terms", "with numpy", "× C")
    print(moving_table, end="\n\n")
    columns = ["case", "paths", *(f"{tolerance:.0e}" for tolerance in MOVING_TOLERANCES), "direct", "error"]
    fewer = table(columns, fewer_rows(run))
    print(fewer, end="\n\n")
    columns = ["case", "chirps", "nodes", "error", "auto", "2 threads", "C f64"]
    growth = table(columns, growth_rows(run))
    print(growth, end="\n\n")
    call = overhead(run)
    print(call)

    picture(*tables_of(f"{linear_table}\n\n{moving_table}")).savefig(io.BytesIO(), dpi=110)
    if arguments.write:
        text = PAGE_TEXT.format(
            num_paths=f"{run.paths:,}".replace(",", " "),
            machine=machine(),
            repeats=run.repeats,
            num_samples=run.samples,
            picture=PICTURE.name,
            linear=linear_table,
            moving=moving_table,
            fewer=fewer,
            growth_tolerance=GROWTH_TOLERANCE,
            growth=growth,
            overhead=call,
        )
        write_section(PERFORMANCE, "pareto", text)
        write_picture()


if __name__ == "__main__":
    main()
