"""The fast sums at the ends of what can be asked for, and identities that every sum of paths has."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from path_scenes import EPS, C, Paths, allowance, random_phases, relative_error, scene_paths, sweep_waveform
from radarcore import _core

METHODS = ("auto", "grid", "recurrence", "lanes")
FAST = ("grid", "recurrence", "lanes")


def finest(method: str, tolerance: float) -> float:
    """The tolerance, or what sums in lanes reach: they follow the phase within a chirp to second order."""
    return max(tolerance, 1e-4) if method == "lanes" else tolerance


def moving(num_paths: int, seed: int = 0, speed: float = 2.0, channels: int = 1) -> Paths:
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


# --- paths unlike all others ---------------------------------------------------------------------------------------


@cache
def constant_velocities() -> tuple[rc.Waveform, Paths, NDArray[np.complex128]]:
    """Many paths at constant velocities, and the exact sum of all but three."""
    paths, wf = moving(30_000), sweep_waveform(48, 16)
    assert paths.acceleration is not None
    paths.acceleration[:] = 0.0
    return wf, paths, paths.pick(np.delete(np.arange(30_000), [7001, 7003, 22_222])).exact(wf)


@pytest.mark.parametrize("acceleration", [20.0, 300.0])
def test_few_paths_unlike_all_others_are_within_the_tolerance(acceleration: float) -> None:
    # The search for modes sees one path in a hundred: those at constant velocity.
    wf, paths, others = constant_velocities()
    unlike = [7001, 7003, 22_222]
    paths = Paths(paths.delay, paths.amplitude.copy(), paths.rate, np.zeros_like(paths.delay))
    paths.acceleration[:, unlike] = 2.0 / C * acceleration  # type: ignore[index]  # given above
    paths.amplitude[:, unlike] *= 20.0
    exact = others + paths.pick(unlike).exact(wf)
    for tolerance in (1e-2, 1e-4, 1e-7):
        check(paths, wf, tolerance, exact=exact, method="grid")


@pytest.mark.parametrize("seed", [*range(12), 41, 161, 270, 402, 430, 455, 591, 741, 938, 1140, 1421, 2016, 2497, 2515])
def test_strays_of_any_kind_are_within_the_tolerance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    num_paths, num_chirps, num_samples = (
        int(rng.choice(c)) for c in ([1500, 3000, 7000], [8, 24, 60, 128], [1, 8, 16])
    )
    paths, wf = moving(num_paths, seed), sweep_waveform(num_chirps, num_samples)
    assert paths.acceleration is not None
    if rng.random() < 0.5:
        paths.acceleration[:] = 0.0
    stray = rng.integers(0, num_paths, int(rng.integers(1, 6)))
    paths.acceleration[:, stray] = 2.0 / C * rng.uniform(-1.0, 1.0, len(stray)) * 10.0 ** rng.uniform(0.0, 2.7)
    paths.amplitude[:] *= 10.0 ** rng.uniform(-4.0, 0.0)
    paths.amplitude[:, stray] /= np.abs(paths.amplitude[:, stray])
    tolerance = 10.0 ** rng.uniform(-8.0, -1.5)
    exact = paths.nearly_exact(wf) if tolerance >= 1e-7 else None
    check(paths, wf, tolerance, exact=exact, method="grid")


def test_few_paths_among_silent_ones_are_within_the_tolerance() -> None:
    paths, wf = moving(30_000), sweep_waveform(48, 16)
    silent = np.ones(30_000, dtype=bool)
    silent[[7001, 7003, 22_222]] = False
    exact = paths.pick(~silent).exact(wf)
    paths.amplitude[:, silent] = 0.0
    for tolerance in (1e-3, 1e-6):
        check(paths, wf, tolerance, exact=exact, method="grid")


def test_amplitudes_of_a_few_that_change_are_within_the_tolerance() -> None:
    paths, wf = moving(20_000), sweep_waveform(32, 16)
    assert paths.rate is not None
    nodes = wf.delay_times(5)[:, None, None]
    amplitude = np.repeat(paths.amplitude[None], 5, axis=0)
    amplitude[:, :, [4321, 15_000]] *= 30.0 * np.cos(2.5 * nodes / nodes.max())
    changing = Paths(paths.delay + paths.rate * nodes, amplitude)
    exact = changing.exact(wf)
    for tolerance in (1e-3, 1e-6):
        check(changing, wf, tolerance, exact=exact, method="grid")


# --- amplitudes and delays at the ends -----------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("exponent", [-100, -33, 17, 100])
def test_scaled_amplitudes_give_scaled_samples(exponent: int, method: str, tolerance: float) -> None:
    # Powers of two, to 1e-30 and 1e30: not a digit changes.
    paths, wf, tolerance = moving(600), sweep_waveform(17, 40), finest(method, tolerance)
    scale = 2.0**exponent
    unscaled, scaled = (p.samples(wf, tolerance=tolerance, method=method) for p in (paths, paths.scaled(scale)))
    np.testing.assert_allclose(scaled.astype(complex) / scale, unscaled.astype(complex), rtol=0, atol=1e-15)


@pytest.mark.parametrize("method", ["auto", "grid", "recurrence"])
@pytest.mark.parametrize("scale", [1e-150, 1e-60, 1e60, 1e150])
def test_amplitudes_beyond_single_precision_are_summed_in_double(scale: float, method: str) -> None:
    # Down to where their squares, by which errors are measured, are no numbers any more.
    paths, wf, tolerance = moving(600), sweep_waveform(17, 40), 1e-9
    got = paths.scaled(scale).samples(wf, tolerance=tolerance, method=method)
    expected = paths.exact(wf)
    assert relative_error(got / scale, expected, paths) <= tolerance + allowance(expected, paths, wf, tolerance)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scale", [5e-324, 1e-310, 1e-200, 1e-60, 1e39, 1e100, 1e200])
def test_amplitudes_that_no_sample_can_hold_are_no_endless_work_nor_nan(scale: float, method: str) -> None:
    paths, wf = moving(600), sweep_waveform(17, 40)
    try:
        got = paths.scaled(scale).samples(wf, tolerance=1e-4, method=method)
    except ValueError as refusal:
        if scale < 1e38 or not str(refusal).startswith("amplitude: expected"):
            raise
        return
    assert not np.isnan(got).any()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("first", [0.0, 1e-60, 1e-310])
def test_amplitudes_that_begin_with_nothing_are_followed(first: float, method: str) -> None:
    # What comes into the beam during the frame.
    wf, paths = sweep_waveform(40, 32), moving(400)
    assert paths.rate is not None
    nodes = wf.delay_times(4)[:, None, None]
    growth = np.array([first, 0.1, 0.5, 1.0])[:, None, None]
    nodal = Paths(paths.delay + paths.rate * nodes, paths.amplitude * growth)
    # Sums in lanes take the amplitude in the middle of a chirp.
    check(nodal, wf, 1e-2 if method == "lanes" else 1e-3, method=method)


@pytest.mark.parametrize("method", [*METHODS, "direct"])
@pytest.mark.parametrize(("num_delays", "num_amplitudes"), [(6, 3), (3, 7), (5, 1), (1, 4)])
def test_amplitudes_may_have_nodes_of_their_own(num_delays: int, num_amplitudes: int, method: str) -> None:
    wf, paths = sweep_waveform(24, 32), moving(400)

    def at_nodes(num_delays: int, num_amplitudes: int, *, is_constant: bool, is_still: bool) -> Paths:
        of_delays, of_amplitudes = (wf.delay_times(n)[:, None, None] for n in (num_delays, num_amplitudes))
        x = 0.0 * of_amplitudes if is_constant else of_amplitudes / wf.duration
        rate = 0.0 if is_still else paths.rate
        return Paths(paths.delay + rate * of_delays, paths.amplitude * (0.2 + x + 2.0 * x**2))

    kind = {"is_constant": num_amplitudes == 1, "is_still": num_delays == 1}
    exact = at_nodes(7, 7, **kind).exact(wf)
    apart = at_nodes(num_delays, num_amplitudes, **kind)
    # Sums in lanes take the amplitude in the middle of a chirp.
    tolerance = 1e-2 if method == "lanes" else 1e-3
    got = apart.samples(wf, tolerance=tolerance, method=method)
    assert relative_error(got, exact, apart).max() <= tolerance


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("distance", [10e3, 100e3])
def test_distant_paths_keep_their_digits(distance: float, method: str, tolerance: float) -> None:
    paths, wf = moving(500), sweep_waveform(33, 40)
    check(replace(paths, delay=paths.delay + 2.0 / C * distance), wf, tolerance, method=method)


@pytest.mark.parametrize("slope_sign", [1, -1])
@pytest.mark.parametrize("method", METHODS)
def test_delay_that_takes_the_ramp_to_frequency_zero_is_summed(method: str, slope_sign: int) -> None:
    # S tau = f0 or so: the received frequency less the beat frequency vanishes.
    paths, wf = moving(300), sweep_waveform(9, 40, slope_sign)
    delay = (wf.start_frequency + wf.slope * wf.sample_times[20]) / wf.slope
    for offset in (0.0, 1e-9, 1e-6):
        here = replace(paths, delay=paths.delay - paths.delay.mean() + delay + offset)
        try:
            got, _ = here.signal(wf, tolerance=1e-2, method=method)
        except ValueError as refusal:
            if method == "auto" or "tolerance" not in str(refusal):
                raise
            continue
        exact = here.exact(wf)
        assert relative_error(got, exact, here) <= 1e-2 + allowance(exact, here, wf, 1e-2)


@pytest.mark.parametrize("near_and_far", [1.0, 1e3, 10e3])
def test_near_and_far_paths_fit_into_one_frame(near_and_far: float) -> None:
    paths, wf = moving(2000), sweep_waveform(33, 40)
    delay = paths.delay.copy()
    delay[:, ::3] += 2.0 / C * near_and_far
    for method in METHODS:
        # Sums in lanes follow one received frequency: 10 km apart it differs by 6 %.
        check(replace(paths, delay=delay), wf, 1e-2 if method == "lanes" else 1e-4, method=method)


@pytest.mark.parametrize("method", ["auto", "direct", "grid", "recurrence", "lanes"])
@pytest.mark.parametrize("argument", ["delay", "rate", "acceleration"])
def test_phases_without_digits_are_refused(argument: str, method: str) -> None:
    # 1e12 turns at 58 GHz take 17 s.
    paths, wf = moving(50), sweep_waveform()
    far = replace(paths, **{argument: np.full_like(paths.delay, 1e9)})
    with pytest.raises(ValueError, match=r"delay: expected phases of at most 1e12 turns, got \S+"):
        far.samples(wf, method=method)


@pytest.mark.parametrize("num_nodes", [3, 70])
@pytest.mark.parametrize("method", ["auto", "direct", "grid"])
def test_nodal_phases_without_digits_are_refused(num_nodes: int, method: str) -> None:
    paths = Paths(np.full((num_nodes, 1, 4), 1e6), np.ones((1, 4), complex))
    with pytest.raises(ValueError, match=r"delay: expected phases of at most 1e12 turns"):
        paths.samples(sweep_waveform(), method=method)


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("method", ["auto", "direct", *FAST])
@pytest.mark.parametrize("bad", [NAN, INF, -INF])
@pytest.mark.parametrize(
    ("field", "name"),
    [("delay", "delay"), ("amplitude", "amplitude"), ("rate", "delay_rate"), ("acceleration", "delay_acceleration")],
)
def test_numbers_that_are_not_finite_are_refused_with_their_name(
    field: str, name: str, bad: float, method: str
) -> None:
    paths = moving(400)
    values = getattr(paths, field).copy()
    values[0, 300] = bad
    with pytest.raises(ValueError, match=f"{name}: expected finite numbers, got .* at flat index 300"):
        replace(paths, **{field: values}).samples(sweep_waveform(), method=method)
    nodal = Paths(np.tile(paths.delay, (3, 1, 1)), np.tile(paths.amplitude, (3, 1, 1)))
    if field in ("delay", "amplitude"):
        getattr(nodal, field)[1, 0, 5] = bad
        with pytest.raises(ValueError, match=f"{name}: expected finite numbers, got .* at flat index 405"):
            nodal.samples(sweep_waveform(), method=method)


@pytest.mark.parametrize("method", ["auto", "direct", *FAST])
@pytest.mark.parametrize(("num_chirps", "num_samples"), [(1, 1), (1, 16), (3, 1), (40, 24)])
def test_no_path_one_path_and_no_amplitude(num_chirps: int, num_samples: int, method: str) -> None:
    wf = sweep_waveform(num_chirps, num_samples)
    assert not moving(0).samples(wf, method=method).any()
    one = moving(1)
    check(one, wf, 1e-5, method=method)
    assert not one.scaled(0.0).samples(wf, method=method).any()
    many = moving(500).scaled(0.0)
    assert not many.samples(wf, method=method).any()
    # Silent paths, however fast and far, do not disturb the others.
    mixed = moving(500)
    amplitude, delay = mixed.amplitude.copy(), mixed.delay.copy()
    amplitude[:, 1:] = 0.0
    delay[:, 1:] *= 50.0
    # Lanes count them in the bound of their error.
    tolerance = 1e-3 if method == "lanes" else 1e-5
    check(replace(mixed, amplitude=amplitude, delay=delay), wf, tolerance, method=method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_all_velocities_may_be_the_same(speed: float, method: str) -> None:
    paths, wf = moving(700), sweep_waveform()
    same = Paths(paths.delay, paths.amplitude, np.full_like(paths.delay, 2.0 / C * speed))
    check(same, wf, 1e-5, method=method, split_still=False)


@cache
def in_phase(scene: str) -> tuple[rc.Waveform, Paths, NDArray[np.complex128]]:
    wf = sweep_waveform(17, 24)
    paths = scene_paths(scene, wf, 20_000, np.random.default_rng(1))
    return wf, paths, paths.exact(wf)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("scene", ["together", "facing"])
@pytest.mark.parametrize("method", METHODS)
def test_many_paths_in_phase_lose_no_more_digits_than_the_tolerance(method: str, scene: str, tolerance: float) -> None:
    # 20 000 equal numbers added in single precision.
    wf, paths, exact = in_phase(scene)
    check_or_refused(paths, wf, tolerance, may_refuse=method != "auto", exact=exact, method=method)


def equal_steps(number: int, order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places in [-1, 1] and weights at which a sum over `number` equal steps has the terms of polynomials.

    Gauss's quadrature for the sum instead of the integral, from the recurrence of the discrete Chebyshev polynomials:
    exact up to the degree 2 `order` - 1.
    """
    k = np.arange(1.0, order)
    beside = k / number * np.sqrt((number**2 - k**2) / (4.0 * k**2 - 1.0))
    places, vectors = np.linalg.eigh(np.diag(beside, 1) + np.diag(beside, -1))
    return places, number * vectors[0] ** 2


def plate_that_faces(wf: rc.Waveform, frames: float, num_paths: int) -> tuple[Paths, NDArray[np.complex128]]:
    """A plate of 0.4 m at 2 m that turns at 3 rad/s and faces the radar some frames after the middle of this one.

    Returns its paths and their exact sum.
    """
    angle = 3.0 * (wf.delay_times(6)[:, None] - (0.5 + frames) * wf.duration)

    def at(y: NDArray[np.float64], weight: NDArray[np.float64]) -> Paths:
        return Paths(2.0 / C * (2.0 + 0.2 * y * np.sin(angle))[:, None], weight[None].astype(complex))

    steps = (2.0 * np.arange(num_paths) + 1.0) / num_paths - 1.0
    # Phases are linear in y, and at most 80 rad from those of the middle: half of these terms would do.
    return at(steps, np.ones(num_paths)), at(*equal_steps(num_paths, 200)).exact(wf)


@pytest.mark.parametrize("frames", [0.0, 2.2])
def test_sum_over_equal_steps_is_that_of_fewer_terms(frames: float) -> None:
    # What plates are compared with below, against every sample of every path.
    wf = sweep_waveform(24, 24)
    paths, exact = plate_that_faces(wf, frames, 20_000)
    assert relative_error(paths.exact(wf), exact, paths) < 1e-9


@cache
def plate_of_another_frame(frames: float, num_paths: int) -> tuple[rc.Waveform, Paths, NDArray[np.complex128]]:
    wf = sweep_waveform(24, 24)
    return wf, *plate_that_faces(wf, frames, num_paths)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 3e-5, 1e-6])
@pytest.mark.parametrize("num_paths", [700, 20_000])
@pytest.mark.parametrize("frames", [-2.0, -1.5, -1.0, 0.0, 1.0, 1.5, 1.73, 2.0])
@pytest.mark.parametrize("method", METHODS)
def test_plate_that_faces_the_radar_in_another_frame_is_no_ghost(
    method: str, frames: float, num_paths: int, tolerance: float
) -> None:
    # Its echoes add up at a time that is the frame's own to the grid but for the kernel: one and a half frames away
    # that is an end of the frame, where the kernel is worst.
    wf, paths, exact = plate_of_another_frame(frames, num_paths)
    may_refuse = method in ("recurrence", "lanes")
    check_or_refused(paths, wf, tolerance, may_refuse=may_refuse, exact=exact, method=method)


@pytest.mark.parametrize("num_paths", [20_000, 65_536])
@pytest.mark.parametrize("seed", range(4))
def test_plates_of_other_frames_are_no_ghosts_of_frames_as_long_as_usual(seed: int, num_paths: int) -> None:
    frames = np.random.default_rng(seed).uniform(-2.2, 2.2)
    wf = sweep_waveform(64, 64)
    paths, exact = plate_that_faces(wf, frames, num_paths)
    for tolerance in (1e-4, 3e-5):
        check(paths, wf, tolerance, exact=exact, method="auto")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("sweeps", [-1.5, 0.0, 1.5])
def test_paths_that_add_up_at_a_frequency_beyond_the_sweep_are_no_ghosts(
    sweeps: float, tolerance: float, method: str
) -> None:
    # Echoes of a grating: in phase at one frequency, a sweep and a half from the middle of the sweep.
    wf = sweep_waveform(20, 40)
    delay = moving(8000).delay
    frequency = wf.center_frequency + sweeps * wf.bandwidth
    paths = Paths(delay, np.exp(2j * np.pi * frequency * delay))
    check_or_refused(paths, wf, tolerance, may_refuse=method == "lanes", method=method)


# --- time ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["auto", "grid"])
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
    tolerance = 2e-5 if method == "lanes" else 1e-5
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
    tolerance = finest(method, tolerance)
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
    tolerance = finest(method, 1e-8)
    quarter, whole = (p.samples(wf, method=method, tolerance=tolerance) for p in (paths.scaled(1j), paths))
    assert relative_error(quarter * 1j, whole, paths) <= (1e-6 if method == "lanes" else 1e-14)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_paths_mirrored_in_time_and_frequency_are_conjugated(method: str, tolerance: float) -> None:
    tolerance = finest(method, tolerance)
    # f0 -> -f0 is not a waveform; tau -> -tau with S tau^2 / 2 taken into the amplitude is the same.
    rng = np.random.default_rng(4)
    delay = 2.0 / C * rng.uniform(0.5, 3.0, 300)
    amplitude = random_phases(rng, 300)
    wf = sweep_waveform(6, 40)
    video = np.exp(-2j * np.pi * wf.slope * delay**2)
    forward = Paths(delay, amplitude).samples(wf, method=method, tolerance=tolerance, split_still=False)
    mirrored = Paths(-delay, np.conj(amplitude) * video).samples(
        wf, method=method, tolerance=tolerance, split_still=False
    )
    paths = Paths(delay, amplitude)
    bound = 2.0 * (tolerance + allowance(forward, paths, wf, tolerance))
    assert relative_error(np.conj(mirrored), forward.astype(complex), paths) <= bound


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("num_paths", [100, 5000])
def test_order_of_paths_changes_nothing(num_paths: int, method: str) -> None:
    wf = sweep_waveform(20, 40)
    paths = scene_paths("image", wf, num_paths, np.random.default_rng(0))
    order = np.random.default_rng(1).permutation(num_paths)
    tolerance = 1e-3 if method == "lanes" else 1e-4
    options = {"method": method, "tolerance": tolerance}
    got, expected = (p.samples(wf, **options).astype(complex) for p in (paths.pick(order), paths))
    assert relative_error(got, expected, paths) <= 2.0 * (tolerance + allowance(expected, paths, wf, tolerance))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_channels_do_not_know_of_each_other(tolerance: float, method: str) -> None:
    tolerance = finest(method, tolerance)
    # The plan is one for both, so bits may differ; the answer may not.
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
        single = alone.samples(wf, method=method, tolerance=tolerance)
        assert relative_error(single, exact, alone) <= tolerance + allowance(exact, alone, wf, tolerance)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_quiet_channel_keeps_its_digits_in_phase(tolerance: float, method: str) -> None:
    tolerance = max(tolerance, 1e-3) if method == "lanes" else tolerance
    # The first channel's echoes add up, those of the second cancel, are weak, and have still ones among them.
    wf = sweep_waveform(20, 40)
    first = scene_paths("together", wf, 600, np.random.default_rng(0))
    second = scene_paths("tilted", wf, 600, np.random.default_rng(1))
    nodes = max(len(first.delay), len(second.delay))
    assert len(first.delay) == len(second.delay) == nodes
    delay = np.concatenate([first.delay, second.delay], axis=1)
    delay[1:, 1, :300] = delay[:1, 1, :300]
    paths = Paths(np.ascontiguousarray(delay), np.concatenate([first.amplitude, 1e-3 * second.amplitude], axis=0))
    check(paths, wf, tolerance, method=method, split_still=method != "lanes")


@pytest.mark.parametrize("method", ["auto", *FAST])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-8])
@pytest.mark.parametrize(("num_paths", "num_chirps"), [(1000, 64), (200_000, 16)])
def test_number_of_threads_does_not_change_a_bit(
    num_paths: int, num_chirps: int, tolerance: float, method: str
) -> None:
    tolerance = max(tolerance, 1e-3) if method == "lanes" else tolerance
    if num_paths == 200_000 and method == "recurrence":
        num_paths = 40_000
    wf, paths = sweep_waveform(num_chirps, 48), moving(num_paths)
    assert paths.rate is not None
    paths.rate[:, ::3] = 0.0
    still = replace(paths, acceleration=np.where(paths.rate == 0.0, 0.0, paths.acceleration))
    first, *others = (
        still.samples(wf, method=method, tolerance=tolerance, threads=n, split_still=method != "lanes")
        for n in (1, 2, 7)
    )
    for other in others:
        np.testing.assert_array_equal(other, first)


@pytest.mark.parametrize("level", _core.levels())
@pytest.mark.parametrize("method", FAST)
def test_instruction_sets_agree_to_rounding(method: str, level: str) -> None:
    wf, paths = sweep_waveform(20, 40), moving(700)
    tolerance = 0.999 * finest(method, 1e-8)
    got, best = (paths.samples(wf, method=method, tolerance=tolerance, level=chosen) for chosen in (level, None))
    # The same plan, the same errors: what differs is rounding, of phases of 1200 turns, or in single precision.
    single = 3e-7 if method == "lanes" else 1e-12
    assert relative_error(got, best, paths) <= 4.0 * allowance(best, paths, wf, 1e-8) + single


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
            try:
                got = paths.samples(wf, tolerance=tolerance, method=method)
            except ValueError:
                # Sums in lanes take series of up to eight times.
                assert tolerance < 1e-6 or method == "lanes"
                continue
            bound = tolerance + allowance(expected[None], paths, wf, tolerance)
            assert relative_error(got, expected[None], paths) <= bound, f"{method} {tolerance}"


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
    got = rc.beat_signal(delay, amplitude, wf, tolerance=tolerance)
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
    got = rc.beat_signal(delay, amplitude, wf, tolerance=1e-7)
    assert np.sqrt(np.mean(abs(got - exact) ** 2)) <= 1e-7 * np.linalg.norm(amplitude)
    try:
        got = rc.beat_signal(delay, amplitude, wf, method="grid", tolerance=1e-7)
    except ValueError:
        assert num_nodes > 4
    assert np.sqrt(np.mean(abs(got - exact) ** 2)) <= 1e-7 * np.linalg.norm(amplitude)
