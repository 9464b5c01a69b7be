"""Plans of the fast sums as plain values, and what they leave out."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from path_scenes import C, Paths, allowance, random_phases, relative_error, scene_paths, sweep_waveform


def moving(num_paths: int, seed: int = 0, speed: float = 2.0) -> Paths:
    """Paths at constant velocities."""
    rng = np.random.default_rng(seed)
    return Paths(
        2.0 / C * rng.uniform(0.5, 3.0, num_paths),
        random_phases(rng, num_paths),
        2.0 / C * rng.uniform(-speed, speed, num_paths),
    )


def still_and_moving(num_still: int, num_moving: int, seed: int = 0) -> Paths:
    paths = moving(num_still + num_moving, seed)
    assert paths.rate is not None
    paths.rate[np.random.default_rng(seed).permutation(num_still + num_moving)[:num_still]] = 0.0
    return paths


# --- what is chosen ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-1, 1e-4, 1e-8, 1e-12])
def test_few_paths_are_summed_directly(tolerance: float) -> None:
    (part,) = moving(3).plan(sweep_waveform(), tolerance=tolerance).parts
    assert part.method in ("direct", "recurrence")
    assert (part.num_paths, part.width, part.rows, part.terms) == (3, 0, (), ())


def test_many_paths_go_on_the_grid() -> None:
    (part,) = moving(20_000).plan(sweep_waveform()).parts
    assert (part.paths, part.num_paths, part.method, part.precision) == ("moving", 20_000, "grid", "single")


def test_many_still_paths_have_one_row_and_one_term() -> None:
    (part,) = still_and_moving(20_000, 0).plan(sweep_waveform(256)).parts
    assert (part.paths, part.num_paths, part.method) == ("still", 20_000, "grid")
    assert (part.rows, part.terms) == ((1,), (1,))


def test_still_and_moving_paths_are_parts_of_their_own() -> None:
    plan = still_and_moving(9000, 4000).plan(sweep_waveform(), tolerance=1e-4)
    assert {part.paths: part.num_paths for part in plan.parts} == {"still": 9000, "moving": 4000}
    # Independent parts of the whole error.
    assert plan.error == pytest.approx(np.sqrt(sum(part.error**2 for part in plan.parts)), rel=1e-12)
    assert plan.error <= 1e-4


def test_nodes_that_repeat_a_delay_are_still() -> None:
    wf = sweep_waveform()
    delay = np.tile(2.0 / C * np.random.default_rng(1).uniform(0.5, 3.0, 5000), (5, 1, 1))
    delay[:, :, :2000] += 1e-12 * wf.delay_times(5)[:, None, None]
    plan = Paths(delay, np.ones((1, 5000), complex)).plan(wf)
    assert {part.paths: part.num_paths for part in plan.parts} == {"still": 3000, "moving": 2000}


@pytest.mark.parametrize("num_paths", [3000, 100_000])
@pytest.mark.parametrize("scene", ["random", "image", "still", "lateral"])
def test_larger_tolerance_needs_no_wider_kernel_nor_more_digits(scene: str, num_paths: int) -> None:
    wf = sweep_waveform()
    paths = scene_paths(scene, wf, num_paths, np.random.default_rng(2))
    last = (0, 0)
    for digits in range(1, 10):
        plan = paths.plan(wf, tolerance=10.0**-digits, method="grid")
        finest = max((int(part.precision == "double"), part.width) for part in plan.parts)
        assert finest >= last, f"{scene}: tolerance 1e-{digits}: {plan}"
        last = finest
        assert plan.error <= 10.0**-digits


@pytest.mark.parametrize("method", ["auto", "grid"])
def test_single_precision_ends_at_about_a_millionth(method: str) -> None:
    paths, wf = moving(30_000), sweep_waveform()
    precision = [
        {part.precision for part in paths.plan(wf, tolerance=tolerance, method=method).parts}
        for tolerance in (1e-1, 1e-3, 1e-5, 2e-7, 1e-9)
    ]
    # Adding in single precision loses 3e-7.
    assert precision == [{"single"}] * 3 + [{"double"}] * 2


def test_fan_is_followed_whatever_the_plan() -> None:
    wf = sweep_waveform(64, 128)
    paths = scene_paths("fan", wf, 3000, np.random.default_rng(3))
    for tolerance in (1e-2, 1e-4):
        got, report = paths.signal(wf, tolerance=tolerance)
        error = relative_error(got, exact := paths.exact(wf), paths)
        assert error <= tolerance + allowance(exact, paths, wf, tolerance), str(report)


# --- what a plan says ----------------------------------------------------------------------------------------------


def test_memory_of_a_plan_does_not_grow_with_the_paths() -> None:
    wf = sweep_waveform()
    few, many = (moving(n).plan(wf, method="grid", tolerance=1e-3) for n in (50_000, 800_000))
    assert [part.terms for part in few.parts] == [part.terms for part in many.parts]
    assert 0 < many.memory <= 1.3 * few.memory  # but for some more rows
    # Less than the paths themselves: 32 bytes each.
    assert many.memory < 0.1 * 32 * 800_000
    assert many.memory == max(part.memory for part in many.parts)


PEAK_OF_A_SUM = """
import ctypes

# Whole huge pages of 2 MB count as used from the first byte: no such pages (PR_SET_THP_DISABLE).
assert ctypes.CDLL(None).prctl(41, 1, 0, 0, 0) == 0

import numpy as np
import radarcore as rc

def kilobytes(key):
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith(key))

n = {num_paths}
wf = rc.Waveform(start_frequency=58e9, slope=3e13, sample_rate=2e6, num_samples=64, num_chirps=64, chirp_interval=3e-4)
few = np.linspace(1e-8, 4e-8, 1000)
rc.beat_signal(few, np.ones(1000, complex), wf, delay_rate=few, method="grid", threads={threads})
delay, rate, amplitude = np.empty(n), np.empty(n), np.empty(n, complex)
for i in range(0, n, 1000):
    delay[i:i + 1000], rate[i:i + 1000], amplitude[i:i + 1000] = few, few[::-1], 1.0
plan = rc.plan_beat_signal(delay, amplitude, wf, delay_rate=rate, method="grid")
open("/proc/self/clear_refs", "w").write("5")
before = kilobytes("VmRSS")
rc.beat_signal(delay, amplitude, wf, delay_rate=rate, method="grid", threads={threads})
print(plan.memory, 1024 * (kilobytes("VmHWM") - before))
"""


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="peak memory is read from Linux's /proc")
@pytest.mark.parametrize("threads", [1, 2])
def test_a_sum_takes_no_more_memory_than_its_plan_says(threads: int) -> None:
    code = PEAK_OF_A_SUM.format(num_paths=4_000_000, threads=threads)
    for _ in range(
        3
    ):  # the kernel counts pages of a busy machine late: the peak is too high now and then, never too low
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        planned, taken = map(int, run.stdout.split())
        if taken <= planned + 1e6:
            break
    # Beside 128 MB of paths: grids, samples, tables and a bit per path.
    assert taken <= planned + 1e6, f"{taken / 1e6:.1f} MB, planned {planned / 1e6:.1f} MB"
    assert planned < 20e6


@pytest.mark.parametrize("method", ["auto", "direct", "grid"])
def test_plan_prints_its_parts(method: str) -> None:
    plan = still_and_moving(3000, 2000).plan(sweep_waveform(), method=method)
    lines = str(plan).splitlines()
    assert len(lines) == len(plan.parts) >= 1
    for line, part in zip(lines, plan.parts, strict=True):
        assert line.startswith(f"{part.num_paths} ")
        assert part.method.split()[0] in line
        assert part.precision in line
    assert "0 " not in str(rc.plan_beat_signal([], [], sweep_waveform()))
    assert str(rc.plan_beat_signal([], [], sweep_waveform())) == "no paths"


def test_plan_is_what_is_done() -> None:
    wf = sweep_waveform()
    paths = still_and_moving(3000, 2000)
    _, report = paths.signal(wf)
    assert report.runs == 1
    plan = paths.plan(wf, tolerance=1e-4)
    assert str(report) == str(plan)
    assert [part[:5] for part in report.parts()] == [
        (p.paths, p.num_paths, p.method, p.precision, p.width) for p in plan.parts
    ]


def test_paths_in_phase_take_a_finer_plan() -> None:
    wf = sweep_waveform()
    paths = scene_paths("together", wf, 5000, np.random.default_rng(5))
    got, report = paths.signal(wf, tolerance=1e-3)
    # All of one point: every sample is the sum of the amplitudes, sqrt(n) times their l2 norm.
    assert report.gain == pytest.approx(np.sqrt(5000), rel=1e-2)
    assert report.error <= 1e-3
    assert relative_error(got, paths.exact(wf), paths) <= 1e-3 + allowance(paths.exact(wf), paths, wf, 1e-3)
    apart = still_and_moving(2500, 2500).plan(wf, tolerance=1e-3)
    assert max(part[4] for part in report.parts()) > max(part.width for part in apart.parts)


@pytest.mark.parametrize("seed", range(3))
def test_plan_is_the_same_for_paths_in_another_order(seed: int) -> None:
    wf, paths = sweep_waveform(), still_and_moving(2000, 3000, seed)
    order = np.random.default_rng(seed).permutation(5000)
    mine, other = (some.plan(wf) for some in (paths, paths.pick(order)))
    choice = [
        [(p.paths, p.num_paths, p.method, p.precision, p.width, p.rows, p.terms) for p in plan.parts]
        for plan in (mine, other)
    ]
    assert choice[0] == choice[1], f"seed {seed}"
    # Predicted errors are those of samples.
    assert mine.error == pytest.approx(other.error, rel=0.1), f"seed {seed}"


# --- what is left out ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("options", [{"split_still": False}, {"skip_rows": False}])
def test_what_is_skipped_does_not_change_the_answer(options: dict[str, bool], tolerance: float) -> None:
    wf, paths = sweep_waveform(32, 48), still_and_moving(3000, 1500)
    (quick, report), (slow, slow_report) = (
        paths.signal(wf, tolerance=tolerance, method="grid", **chosen) for chosen in ({}, options)
    )
    bound = 2.0 * (tolerance + allowance(quick, paths, wf, tolerance))
    assert relative_error(quick, slow.astype(complex), paths) <= bound
    kinds = [[part[0] for part in r.parts()] for r in (report, slow_report)]
    assert kinds[0] == ["still", "moving"]
    assert kinds[1] == (["moving"] if "split_still" in options else ["still", "moving"])
    if "skip_rows" in options:
        assert slow_report.rows_skipped == 0
        assert slow_report.rows == report.rows + report.rows_skipped


def test_velocity_rows_between_slow_and_fast_paths_are_skipped() -> None:
    # 4 m/s and -40 m/s, nothing between.
    wf = sweep_waveform()
    paths = moving(2000, speed=0.5)
    assert paths.rate is not None
    paths.rate[::2] -= 2.0 / C * 40.0
    got, report = paths.signal(wf, method="grid")
    everything, full = paths.signal(wf, method="grid", skip_rows=False)
    assert report.rows_skipped > 0.8 * full.rows
    assert full.rows_skipped == 0
    bound = 2e-4 + allowance(got, paths, wf, 1e-4)
    assert 0.0 <= relative_error(got, everything.astype(complex), paths) <= bound


def test_rows_are_counted_for_every_channel_and_part() -> None:
    wf = sweep_waveform()
    one = still_and_moving(2000, 2000)
    three = Paths(*(np.tile(x, (3, 1)) for x in (one.delay, one.amplitude, one.rate)))  # type: ignore[arg-type]
    (_, single), (_, triple) = one.signal(wf, method="grid"), three.signal(wf, method="grid")
    assert (triple.rows, triple.rows_skipped) == (3 * single.rows, 3 * single.rows_skipped)
    assert single.rows >= 2


# --- the simulator -------------------------------------------------------------------------------------------------


def room() -> rc.Scene:
    """A wall and a point that stand still, a ball and a point that do not."""
    return rc.Scene(
        [
            rc.Body(rc.shapes.plate(2.0, 2.0), material=rc.Material(-0.5, 0.5), motion=rc.Pose([2.5, 0.0, 0.0])),
            rc.PointTarget([1.2, -0.2, 0.1], rcs=1e-3),
            rc.Body(
                rc.shapes.sphere(0.2),
                material=rc.Material(-0.5, 0.5),
                motion=rc.Linear(rc.Pose([1.5, 0.2, 0.1]), velocity=[-1.0, 0.5, 0.0], angular_velocity=[0, 0, 2.0]),
            ),
            rc.PointTarget([0.9, 0.2, 0.0], rcs=1e-3, velocity=[1.0, 2.0, 0.0]),
        ]
    )


def frame(method: str, tolerance: float = 1e-4, scene: rc.Scene | None = None, **options: Any) -> rc.Frame:
    radar = rc.Radar(sweep_waveform(32, 48), rx=[[0.0, 0.0, 0.0], [0.0, 0.003, 0.0]], **options)
    return rc.Simulator(
        scene or room(),
        radar,
        sampling="footprint",
        resolution=48,
        field_of_view_deg=(50.0, 50.0),
        tolerance=tolerance,
        method=method,
    ).frame(0.1)


@cache
def exact_frame(output: str) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Samples, (channel, chirp, sample), and the l2 norm of the amplitudes, (channel,)."""
    exact = frame("direct", 1e-12, receiver=rc.Receiver(output=output)).cube.astype(complex)
    radar = rc.Radar(sweep_waveform(32, 48), rx=[[0.0, 0.0, 0.0], [0.0, 0.003, 0.0]])
    simulator = rc.Simulator(room(), radar, sampling="footprint", resolution=48, field_of_view_deg=(50.0, 50.0))
    return exact, np.linalg.norm(simulator.paths(0.1).amplitude, axis=1)


@pytest.mark.parametrize("output", ["iq", "real"])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6, 1e-8])
def test_methods_of_the_simulator_agree(tolerance: float, output: str) -> None:
    receiver = rc.Receiver(output=output)
    exact, norm = exact_frame(output)
    for method in ("direct", "auto", "grid"):
        got = frame(method, tolerance, receiver=receiver).cube
        assert np.iscomplexobj(got) == (output == "iq")
        error = np.sqrt((abs(got - exact) ** 2).mean(axis=(1, 2))) / norm
        rounding = 6e-8 * np.sqrt((abs(exact) ** 2).mean(axis=(1, 2))) / norm
        # Delays at more or fewer nodes, a tenth of the tolerance; their rounding is 1e-10.
        bound = 1.1 * tolerance + (rounding if tolerance >= 1e-6 else 0.0) + 1e-10
        assert (error <= bound).all(), f"{method}: {error} beyond {bound}"


@pytest.mark.parametrize("method", ["auto", "grid"])
def test_stats_hold_the_plan_and_what_was_skipped(method: str) -> None:
    stats = frame(method).stats
    assert stats["still_paths"] > 500
    assert stats["paths"] > stats["still_paths"]
    for key in ("velocity_rows", "velocity_rows_skipped"):
        assert isinstance(stats[key], int)
    # Sums in lanes have no rows.
    assert (stats["velocity_rows"] > 0) == (method == "grid")
    assert f"still paths: {'lanes' if method == 'auto' else 'grid'}" in stats["plan"]
    assert "moving paths" in stats["plan"]


def test_stats_of_direct_sum_and_of_nothing() -> None:
    stats = frame("direct").stats
    assert "direct sum" in stats["plan"]
    assert (stats["velocity_rows"], stats["velocity_rows_skipped"]) == (0, 0)
    nothing = frame("auto", scene=rc.Scene([])).stats
    assert nothing["plan"] == "no paths"
    assert (nothing["still_paths"], nothing["velocity_rows"]) == (0, 0)
