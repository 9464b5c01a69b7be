"""The fast sums at any time, and identities that every sum of paths has."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from fast_sums import METHODS, check, moving, steady
from path_scenes import EPS, C, Paths, allowance, random_phases, relative_error, scene_paths, sweep_waveform
from radarcore import _core

# --- time ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_frames_after_hours_are_those_of_the_beginning(method: str) -> None:
    # Motion that comes back every second.
    def swing(time: float) -> rc.Pose:
        turn = 2.0 * np.pi * (time % 1.0)
        return rc.Pose.from_rpy([1.5 + 0.1 * np.sin(turn), 0.1 * np.cos(turn), 0.0], [0.0, 0.0, 0.3 * np.sin(turn)])

    body = rc.Body(rc.shapes.box((0.3, 0.4, 0.3)), material=rc.Material(-0.5, 0.5), motion=swing)
    wall = rc.Body(rc.shapes.plate(2.0, 2.0), material=rc.Material(-0.5, 0.5), motion=rc.Pose([2.5, 0.0, 0.0]))
    simulator = rc.Simulator(
        rc.Scene([wall, body]), rc.Radar(sweep_waveform(32, 32)), resolution=40, method=method, tolerance=1e-4
    )
    norm = np.linalg.norm(simulator.paths(0.0).amplitude, axis=1)
    now = simulator.frame(0.0).cube.astype(complex)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        late = simulator.frame(10_000.0).cube
    error = np.sqrt((abs(late - now) ** 2).mean(axis=(1, 2))) / norm
    assert (error <= 2.5e-4).all() or any("large absolute times" in str(w.message) for w in caught), error
    assert np.isfinite(late).all()
    assert not any("series" in str(w.message) for w in caught)


@cache
def chirps_at(times: str, slope_sign: int) -> tuple[rc.Waveform, Paths, NDArray[np.complex128]]:
    """Chirps at times of a kind, paths, and their exact sum."""
    starts = {
        "staggered": np.cumsum(np.random.default_rng(0).uniform(60e-6, 900e-6, 45)),
        "interleaved": 90e-6 + 400e-6 * np.arange(45),  # the second transmitter of four
        "pairs": np.sort(np.concatenate([3e-3 * np.arange(20), 3e-3 * np.arange(20) + 70e-6])),
        "late": 2.0 + 300e-6 * np.arange(33),
    }[times]
    wf = sweep_waveform(len(starts), 40, slope_sign, chirp_interval=None, chirp_times=starts)
    paths = moving(500, speed=4.0)
    if times == "late":  # accelerated since the start of the frame, far away by then
        paths = Paths(paths.delay, paths.amplitude, paths.rate)
    return wf, paths, paths.exact(wf)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-7])
@pytest.mark.parametrize("slope_sign", [1, -1])
@pytest.mark.parametrize("times", ["staggered", "interleaved", "pairs", "late"])
def test_chirps_may_start_at_any_time(times: str, slope_sign: int, tolerance: float, method: str) -> None:
    wf, paths, exact = chirps_at(times, slope_sign)
    check(paths, wf, tolerance, exact=exact, method=method)


@pytest.mark.parametrize("method", METHODS)
def test_transmitters_that_take_turns_are_frames_of_their_own(method: str) -> None:
    # What two interleaved trains see is what one train of twice the rate sees.
    paths = moving(500)
    both = sweep_waveform(32, 24, chirp_interval=150e-6)
    whole = paths.samples(both, method=method).astype(complex)
    for start in (0, 1):
        wf = sweep_waveform(16, 24, chirp_interval=None, chirp_times=both.chirp_times[start::2])
        got = paths.samples(wf, method=method)
        assert relative_error(got, whole[:, start::2], paths) <= 2.5e-4  # twice the tolerance, on half of the samples


@pytest.mark.parametrize("method", METHODS)
def test_up_and_down_chirps_of_equal_middle_mirror_range(method: str) -> None:
    # Slow targets: up and down differ in the sign of the beat frequency only, but for the residual video phase.
    rng = np.random.default_rng(3)
    paths = Paths(2.0 / C * rng.uniform(0.5, 3.0, 400), random_phases(rng, 400), np.zeros(400) + 1e-12)
    up = sweep_waveform(2, 33, adc_delay=0.0)
    t = up.sample_times[-1]
    down = sweep_waveform(2, 33, -1, adc_delay=0.0, start_frequency=up.start_frequency + up.slope * t)
    tolerance = 1e-5
    rising, falling = (paths.samples(wf, method=method, tolerance=tolerance).astype(complex) for wf in (up, down))
    # Same frequency at mirrored times; -S tau^2 / 2 changes its sign: 2 pi S tau^2 = 0.16 rad at 3 m.
    video = np.exp(2j * np.pi * up.slope * paths.delay**2)
    turned = Paths(paths.delay, np.conj(video) * paths.amplitude, paths.rate)
    expected = turned.samples(up, method=method, tolerance=tolerance)[:, :, ::-1].astype(complex)
    assert relative_error(falling, expected, paths) <= 3.0 * tolerance
    assert relative_error(falling, rising[:, :, ::-1], paths) > 1e-2


# --- identities ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-8])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(2))
def test_paths_superpose(seed: int, method: str, tolerance: float) -> None:
    paths, wf = moving(900, seed), sweep_waveform(20, 40)
    options = {"method": method, "tolerance": tolerance}
    parts = [paths.pick(slice(0, 300)), paths.pick(slice(300, None))]
    whole = paths.samples(wf, **options)
    halves = sum(part.samples(wf, **options).astype(complex) for part in parts)
    # Both errors are within the tolerance of their own amplitudes: of the whole, sqrt(1 + 1).
    bound = (1.0 + np.sqrt(2.0)) * (tolerance + allowance(whole, paths, wf, tolerance))
    assert relative_error(whole, halves, paths) <= bound, f"seed {seed}"


@pytest.mark.parametrize("method", METHODS)
def test_factor_of_amplitudes_comes_out_conjugated(method: str) -> None:
    paths, wf = moving(500), sweep_waveform(20, 40)
    factor = 3.0 - 2.0j
    got, expected = (p.samples(wf, method=method).astype(complex) for p in (paths.scaled(factor), paths))
    assert relative_error(got / np.conj(factor), expected, paths) <= 2e-4 + 2e-7
    # A quarter turn is exact.
    quarter, whole = (p.samples(wf, method=method, tolerance=1e-8) for p in (paths.scaled(1j), paths))
    assert relative_error(quarter * 1j, whole, paths) <= 1e-14


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_paths_mirrored_in_time_and_frequency_are_conjugated(method: str, tolerance: float) -> None:
    # f0 -> -f0 is not a waveform; tau -> -tau with S tau^2 / 2 taken into the amplitude is the same.
    rng = np.random.default_rng(4)
    delay = 2.0 / C * rng.uniform(0.5, 3.0, 300)
    amplitude = random_phases(rng, 300)
    wf = sweep_waveform(6, 40)
    video = np.exp(-2j * np.pi * wf.slope * delay**2)
    paths = Paths(delay, amplitude)
    forward, mirrored = (
        p.samples(wf, method=method, tolerance=tolerance) for p in (paths, Paths(-delay, np.conj(amplitude) * video))
    )
    bound = 2.0 * (tolerance + allowance(forward, paths, wf, tolerance))
    assert relative_error(np.conj(mirrored), forward.astype(complex), paths) <= bound


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("num_paths", [100, 5000])
def test_order_of_paths_changes_nothing(num_paths: int, method: str) -> None:
    wf = sweep_waveform(20, 40)
    paths = scene_paths("image", wf, num_paths, np.random.default_rng(0))
    order = np.random.default_rng(1).permutation(num_paths)
    got, expected = (p.samples(wf, method=method).astype(complex) for p in (paths.pick(order), paths))
    assert relative_error(got, expected, paths) <= 2.0 * (1e-4 + allowance(expected, paths, wf, 1e-4))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_channels_do_not_know_of_each_other(tolerance: float, method: str) -> None:
    # One engine sums both, so bits may differ; the answer may not.
    wf, paths = sweep_waveform(20, 40), moving(600, channels=2)
    loud = paths.amplitude * np.array([[1.0], [1e-6]])
    both = replace(paths, amplitude=loud)
    got = both.samples(wf, method=method, tolerance=tolerance)
    assert paths.rate is not None
    assert paths.acceleration is not None
    for channel in range(2):
        alone = Paths(paths.delay[channel], loud[channel], paths.rate[channel], paths.acceleration[channel])
        exact = alone.exact(wf)
        error = relative_error(got[channel : channel + 1], exact, alone)
        assert error <= tolerance + allowance(exact, alone, wf, tolerance), f"channel {channel}"
        check(alone, wf, tolerance, exact=exact, method=method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_quiet_channel_keeps_its_digits_in_phase(tolerance: float, method: str) -> None:
    # Echoes of the first channel add up. In the second they cancel, are weak, and some are static.
    wf = sweep_waveform(20, 40)
    first = scene_paths("together", wf, 600, np.random.default_rng(0))
    second = scene_paths("tilted", wf, 600, np.random.default_rng(1))
    nodes = max(len(first.delay), len(second.delay))
    assert len(first.delay) == len(second.delay) == nodes
    delay = np.concatenate([first.delay, second.delay], axis=1)
    delay[1:, 1, :300] = delay[:1, 1, :300]
    paths = Paths(np.ascontiguousarray(delay), np.concatenate([first.amplitude, 1e-3 * second.amplitude], axis=0))
    check(paths, wf, tolerance, method=method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-8])
@pytest.mark.parametrize("is_bending", [False, True])
@pytest.mark.parametrize(("num_paths", "num_chirps"), [(1000, 64), (200_000, 16)])
def test_number_of_threads_does_not_change_a_bit(
    num_paths: int, num_chirps: int, is_bending: bool, tolerance: float, method: str
) -> None:
    wf, paths = sweep_waveform(num_chirps, 48), moving(num_paths)
    assert paths.rate is not None
    paths.rate[:, ::3] = 0.0
    acceleration = np.where(paths.rate == 0.0, 0.0, paths.acceleration)
    some_static = replace(paths, acceleration=acceleration if is_bending else None)
    first, *others = (some_static.samples(wf, method=method, tolerance=tolerance, threads=n) for n in (1, 2, 7))
    for other in others:
        np.testing.assert_array_equal(other, first)


@pytest.mark.parametrize("level", _core.levels())
@pytest.mark.parametrize("paths", [moving(700), steady(3000)], ids=["bending", "steady"])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
def test_instruction_sets_agree_to_rounding(tolerance: float, paths: Paths, level: str) -> None:
    wf = sweep_waveform(20, 40)
    got, best = (paths.samples(wf, method="grid", tolerance=tolerance, level=chosen) for chosen in (level, None))
    # Equal errors: results differ by rounding, of phases of 1200 turns, or in single precision.
    single = 3e-7 if tolerance > 1e-6 else 1e-12
    assert relative_error(got, best.astype(complex), paths) <= 4.0 * allowance(best, paths, wf, 1e-8) + single


def test_exact_sum_is_that_of_the_geometry() -> None:
    # What all others are compared with, against numpy: 3 m/s past the radar at 0.3 m.
    wf = sweep_waveform(8, 16)
    time = wf.chirp_times[:, None] + wf.sample_times
    side = np.random.default_rng(0).uniform(-0.1, 0.1, (30, 1, 1))

    def ranges(t: Any) -> Any:
        return np.hypot(0.3, side + 3.0 * t)

    tau = 2.0 / C * ranges(time)
    turns = wf.start_frequency * tau + wf.slope * tau * (wf.sample_times - 0.5 * tau)
    expected = np.exp(2j * np.pi * turns).sum(axis=0)
    for tolerance in (1e-2, 1e-4, 1e-7, 1e-10):
        nodes = 2.0 / C * ranges(wf.delay_times(12))[:, 0]
        paths = Paths(np.ascontiguousarray(nodes.T[:, None]), np.ones((1, 30), complex))
        for method in ("direct", *METHODS):
            check(paths, wf, tolerance, exact=expected[None], method=method)


def test_rounding_of_delays_is_what_the_allowance_says() -> None:
    # The allowance of these tests is of the size of what it stands for, not a hundred times that.
    wf, paths = sweep_waveform(), moving(2000)
    nudged = replace(paths, delay=paths.delay * (1.0 + EPS))
    error = relative_error(nudged.exact(wf), exact := paths.exact(wf), paths)
    assert error < allowance(exact, paths, wf, 1e-9) < 20.0 * error


@pytest.mark.parametrize("num_nodes", [5, 6, 8, 16])
@pytest.mark.parametrize("num_chirps", [1, 4])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-9])
def test_what_vibrates_within_slow_sweeps_is_within_the_tolerance(
    num_nodes: int, num_chirps: int, tolerance: float
) -> None:
    # 1 mm at 100 Hz, in chirps of 10 ms: phases of which no few Taylor terms are enough.
    wf = rc.Waveform(start_frequency=77e9, slope=5e10, sample_rate=100e3, num_samples=1024, num_chirps=num_chirps)
    rng = np.random.default_rng(num_nodes)
    times = wf.delay_times(num_nodes)[:, None, None]
    away = 5.0 + rng.random(40)
    delay = 2.0 / C * (away + 1e-3 * np.sin(2.0 * np.pi * 100.0 * times + 6.0 * rng.random(40)))
    amplitude = rng.standard_normal((1, 40)) + 1j * rng.standard_normal((1, 40))
    exact = rc.beat_signal(delay, amplitude, wf, method="direct", tolerance=1e-12)
    for method in METHODS:
        got = rc.beat_signal(delay, amplitude, wf, method=method, tolerance=tolerance)
        assert np.sqrt(np.mean(abs(got - exact) ** 2)) <= tolerance * np.linalg.norm(amplitude)


@pytest.mark.parametrize("num_samples", [1, 2, 4, 64, 128])
@pytest.mark.parametrize("num_nodes", [4, 12, 20, 64])
def test_many_nodes_in_a_frame_of_few_samples_are_within_the_tolerance(num_nodes: int, num_samples: int) -> None:
    # Blocks end a sample behind the frame, where series of so many terms are large, and their rounding is.
    wf = rc.Waveform(
        start_frequency=60e9, slope=1e12, sample_rate=1e6, num_samples=num_samples, num_chirps=1, adc_delay=1e-6
    )
    rng = np.random.default_rng(0)
    phase = 3.0 * wf.delay_times(num_nodes)[:, None, None] / wf.duration + 6.0 * rng.random(200)
    delay = 2.0 / C * (5.0 + rng.random(200) + 1e-3 * np.sin(phase))
    amplitude = rng.standard_normal((1, 200)) + 1j * rng.standard_normal((1, 200))
    exact = rc.beat_signal(delay, amplitude, wf, method="direct", tolerance=1e-12)
    for method in METHODS:
        got = rc.beat_signal(delay, amplitude, wf, method=method, tolerance=1e-7)
        assert np.sqrt(np.mean(abs(got - exact) ** 2)) <= 1e-7 * np.linalg.norm(amplitude)
