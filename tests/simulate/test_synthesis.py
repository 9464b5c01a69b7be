"""The fast sums of scenes that are hard on them, at any time, against every sample of every path."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from fast_sums import METHODS, check, moving
from path_scenes import SCENES, C, Paths, relative_error, scene_paths, sweep_waveform


@pytest.mark.parametrize("nodal", [False, True])
@pytest.mark.parametrize("scene", SCENES)
def test_sums_of_scenes_are_within_the_tolerance(scene: str, nodal: bool) -> None:
    for num_chirps, num_samples, slope_sign in ((1, 16, 1), (2, 1, -1), (32, 16, -1), (12, 32, 1)):
        wf = sweep_waveform(num_chirps, num_samples, slope_sign)
        paths = scene_paths(scene, wf, 300, np.random.default_rng(num_chirps), nodal=nodal)
        exact = paths.exact(wf)
        for tolerance in (1e-2, 1e-5, 1e-9):
            for method in METHODS:
                check(paths, wf, tolerance, exact=exact, method=method)


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
    late = simulator.frame(10_000.0).cube
    error = np.sqrt((abs(late - now) ** 2).mean(axis=(1, 2))) / norm
    assert (error <= 2.5e-4).all()


CHIRP_TIMES = {
    "staggered": np.cumsum(np.random.default_rng(0).uniform(60e-6, 900e-6, 45)),
    "interleaved": 90e-6 + 400e-6 * np.arange(45),  # the second transmitter of four
    "pairs": np.add.outer(3e-3 * np.arange(20), [0.0, 70e-6]).ravel(),
    "late": 2.0 + 300e-6 * np.arange(33),
}


@pytest.mark.parametrize("slope_sign", [1, -1])
@pytest.mark.parametrize("times", CHIRP_TIMES.values(), ids=CHIRP_TIMES)
def test_chirps_may_start_at_any_time(times: NDArray[np.float64], slope_sign: int) -> None:
    wf = sweep_waveform(len(times), 40, slope_sign, chirp_interval=None, chirp_times=times)
    paths = moving(500, speed=4.0)
    if times[0] > 1.0:  # accelerated since the start of the frame, far away by then
        paths = Paths(paths.delay, paths.amplitude, paths.rate)
    exact = paths.exact(wf)
    for tolerance in (1e-2, 1e-7):
        for method in METHODS:
            check(paths, wf, tolerance, exact=exact, method=method)


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


def test_exact_sum_is_that_of_the_geometry() -> None:
    # The reference of all others, against numpy: 3 m/s past the radar at 0.3 m.
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


SLOW = rc.Waveform(start_frequency=77e9, slope=5e10, sample_rate=100e3, num_samples=1024, num_chirps=4)
SHORT = rc.Waveform(start_frequency=60e9, slope=1e12, sample_rate=1e6, num_samples=64, adc_delay=1e-6)


@pytest.mark.parametrize(
    ("wf", "turns", "nodes", "tolerances"),
    [
        # Phases for which no few Taylor terms are enough: 100 Hz in chirps of 10 ms.
        *((SLOW.replace(num_chirps=number), 100.0, (5, 6, 8, 16), (1e-3, 1e-5, 1e-9)) for number in (1, 4)),
        # Blocks end a sample behind the frame, where series of so many terms are large, and their rounding is.
        *((SHORT.replace(num_samples=number), None, (4, 12, 20, 64), (1e-7,)) for number in (1, 2, 4, 64, 128)),
    ],
)
def test_points_that_vibrate_by_a_millimetre_are_within_the_tolerance(
    wf: rc.Waveform, turns: float | None, nodes: tuple[int, ...], tolerances: tuple[float, ...]
) -> None:
    rng = np.random.default_rng(0)
    start, away = 6.0 * rng.random(100), 5.0 + rng.random(100)
    amplitude = rng.standard_normal((1, 100)) + 1j * rng.standard_normal((1, 100))
    rate = 3.0 / wf.duration if turns is None else 2.0 * np.pi * turns
    for num_nodes in nodes:
        delay = 2.0 / C * (away + 1e-3 * np.sin(rate * wf.delay_times(num_nodes)[:, None, None] + start))
        paths = Paths(delay, amplitude)
        exact = paths.exact(wf)
        for tolerance in tolerances:
            for method in METHODS:
                got = paths.samples(wf, method=method, tolerance=tolerance)
                assert relative_error(got, exact, paths) <= tolerance
