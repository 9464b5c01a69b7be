"""The fast sums at the ends of what can be asked for."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from fast_sums import METHODS, check, moving, steady
from path_scenes import C, Paths, allowance, relative_error, scene_paths, sweep_waveform

# --- paths unlike all others ---------------------------------------------------------------------------------------


@cache
def constant_velocities() -> tuple[rc.Waveform, Paths, NDArray[np.complex128]]:
    """Many paths at constant velocities, and the exact sum of all but three."""
    paths, wf = steady(30_000), sweep_waveform(48, 16)
    return wf, paths, paths.pick(np.delete(np.arange(30_000), [7001, 7003, 22_222])).exact(wf)


@pytest.mark.parametrize("acceleration", [20.0, 300.0])
def test_few_paths_unlike_all_others_are_within_the_tolerance(acceleration: float) -> None:
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
    check(paths, wf, tolerance, method="grid")


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
    paths, wf, scale = moving(600), sweep_waveform(17, 40), 2.0**exponent
    unscaled, scaled = (p.samples(wf, tolerance=tolerance, method=method) for p in (paths, paths.scaled(scale)))
    np.testing.assert_allclose(scaled.astype(complex) / scale, unscaled.astype(complex), rtol=0, atol=1e-15)


@pytest.mark.parametrize("method", METHODS)
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
    check(nodal, wf, 1e-3, method=method)


@pytest.mark.parametrize("method", [*METHODS, "direct"])
@pytest.mark.parametrize(("num_delays", "num_amplitudes"), [(6, 3), (3, 7), (5, 1), (1, 4), (4, 70), (70, 4)])
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
    got = apart.samples(wf, tolerance=1e-3, method=method)
    assert relative_error(got, exact, apart).max() <= 1e-3


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
        check(here, wf, 1e-2, method=method)


@pytest.mark.parametrize("near_and_far", [1.0, 1e3, 10e3])
def test_near_and_far_paths_fit_into_one_frame(near_and_far: float) -> None:
    paths, wf = moving(2000), sweep_waveform(33, 40)
    delay = paths.delay.copy()
    delay[:, ::3] += 2.0 / C * near_and_far
    for method in METHODS:
        # 10 km apart the received frequency differs by 6 %.
        check(replace(paths, delay=delay), wf, 1e-4, method=method)


@pytest.mark.parametrize("method", [*METHODS, "direct"])
@pytest.mark.parametrize("argument", ["delay", "rate", "acceleration"])
def test_phases_without_digits_are_refused(argument: str, method: str) -> None:
    # 1e12 turns at 58 GHz take 17 s.
    paths, wf = moving(50), sweep_waveform()
    far = replace(paths, **{argument: np.full_like(paths.delay, 1e9)})
    with pytest.raises(ValueError, match=r"delay: expected phases of at most 1e12 turns, got \S+"):
        far.samples(wf, method=method)


@pytest.mark.parametrize("num_nodes", [3, 70])
@pytest.mark.parametrize("method", [*METHODS, "direct"])
def test_nodal_phases_without_digits_are_refused(num_nodes: int, method: str) -> None:
    paths = Paths(np.full((num_nodes, 1, 4), 1e6), np.ones((1, 4), complex))
    with pytest.raises(ValueError, match=r"delay: expected phases of at most 1e12 turns"):
        paths.samples(sweep_waveform(), method=method)


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("method", [*METHODS, "direct"])
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


@pytest.mark.parametrize("method", [*METHODS, "direct"])
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
    check(replace(mixed, amplitude=amplitude, delay=delay), wf, 1e-5, method=method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_all_velocities_may_be_the_same(speed: float, method: str) -> None:
    paths, wf = moving(700), sweep_waveform()
    same = Paths(paths.delay, paths.amplitude, np.full_like(paths.delay, 2.0 / C * speed))
    check(same, wf, 1e-5, method=method)


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
    check(paths, wf, tolerance, exact=exact, method=method)


@pytest.mark.parametrize("method", [*METHODS, "direct"])
@pytest.mark.parametrize("num_paths", [100, 100_000])
def test_rounding_of_single_precision_is_as_the_docstring_says(num_paths: int, method: str) -> None:
    """At most 2^-24 of every sample, the sum of all amplitudes, on top of the tolerance; a quarter is reached."""
    wf = sweep_waveform(4, 64)
    delay, amplitude = np.full(num_paths, 1e-8), np.ones(num_paths, complex)
    exact = rc.beat_signal(delay[:1], num_paths * amplitude[:1], wf, tolerance=1e-12)
    got = rc.beat_signal(delay, amplitude, wf, tolerance=1e-6, method=method)
    assert got.dtype == np.complex64
    error = np.sqrt(np.mean(np.abs(got - exact) ** 2) / num_paths)
    rounding = 6e-8 * np.sqrt(num_paths)
    assert 0.25 * rounding < error < 1e-6 + rounding
    assert num_paths < 100_000 or rounding == pytest.approx(1.9e-5, rel=0.01)


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
    check(paths, wf, tolerance, exact=exact, method=method)


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
    check(paths, wf, tolerance, method=method)
