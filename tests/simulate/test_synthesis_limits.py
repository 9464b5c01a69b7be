"""The fast sums at the ends of what can be asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import radarcore as rc
from fast_sums import METHODS, check, moving
from path_scenes import C, Paths, allowance, relative_error, sweep_waveform

# --- paths unlike all others ---------------------------------------------------------------------------------------


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
@pytest.mark.parametrize("exponent", [-100, 17, 100])
def test_scaled_amplitudes_give_scaled_samples(exponent: int, method: str, tolerance: float) -> None:
    # Powers of two, to 1e-30 and 1e30: not a digit changes.
    paths, wf, scale = moving(600), sweep_waveform(17, 40), 2.0**exponent
    unscaled, scaled = (p.samples(wf, tolerance=tolerance, method=method) for p in (paths, paths.scaled(scale)))
    np.testing.assert_allclose(scaled.astype(complex) / scale, unscaled.astype(complex), rtol=0, atol=1e-15)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scale", [1e-150, 1e60])
def test_amplitudes_beyond_single_precision_are_summed_in_double(scale: float, method: str) -> None:
    # Down to where their squares, by which errors are measured, are no numbers any more.
    paths, wf, tolerance = moving(600), sweep_waveform(17, 40), 1e-9
    got = paths.scaled(scale).samples(wf, tolerance=tolerance, method=method)
    expected = paths.exact(wf)
    assert relative_error(got / scale, expected, paths) <= tolerance + allowance(expected, paths, wf, tolerance)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scale", [5e-324, 1e-310, 1e-200, 1e39, 1e200])
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
    # A target that enters the beam during the frame.
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


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("distance", [1e3, 10e3, 100e3])
def test_distant_paths_keep_their_digits_also_beside_near_ones(distance: float, method: str) -> None:
    # At a path difference of 10 km the received frequency differs by 6 %.
    paths, wf = moving(500), sweep_waveform(33, 40)
    is_far = np.arange(500) % 3 == 0
    for far, tolerance in ((1.0, 1e-3), (1.0, 1e-6), (is_far, 1e-4)):
        check(replace(paths, delay=paths.delay + 2.0 / C * distance * far), wf, tolerance, method=method)


@pytest.mark.parametrize("slope_sign", [1, -1])
@pytest.mark.parametrize("method", METHODS)
def test_delay_that_takes_the_ramp_to_frequency_zero_is_summed(method: str, slope_sign: int) -> None:
    # S tau = f0 or so: the received frequency less the beat frequency vanishes.
    paths, wf = moving(300), sweep_waveform(9, 40, slope_sign)
    delay = (wf.start_frequency + wf.slope * wf.sample_times[20]) / wf.slope
    for offset in (0.0, 1e-9, 1e-6):
        here = replace(paths, delay=paths.delay - paths.delay.mean() + delay + offset)
        check(here, wf, 1e-2, method=method)


@pytest.mark.parametrize("method", [*METHODS, "direct"])
def test_phases_without_digits_are_refused(method: str) -> None:
    # 1e12 turns at 58 GHz take 17 s.
    paths, amplitude = moving(50), np.ones((1, 4), complex)
    taylor = [replace(paths, **{name: np.full_like(paths.delay, 1e9)}) for name in ("delay", "rate", "acceleration")]
    nodal = [Paths(np.full((num_nodes, 1, 4), 1e6), amplitude) for num_nodes in (3, 70)]
    for far in [*taylor, *nodal]:
        with pytest.raises(ValueError, match=r"delay: expected phases of at most 1e12 turns, got \S+"):
            far.samples(sweep_waveform(), method=method)


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


# --- paths that add up for a moment --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("number", "acceleration", "focus"), [(4455, 757.0, 0.5), (1287, 103.0, 1.0), (226, 435.0, 0.5)]
)
@pytest.mark.parametrize("method", ["auto", "grid"])
def test_flash_within_the_frame_is_within_the_tolerance(
    number: int, acceleration: float, focus: float, method: str
) -> None:
    """Paths of equal ranges, in phase at one time and dispersed by their accelerations before and after it."""
    rng, wf = np.random.default_rng(number), sweep_waveform(64, 64)
    time = focus * wf.duration
    velocity = rng.uniform(-1.6, 1.6, number) if number > 1000 else rng.uniform(-0.02, 0.02, number)
    acceleration_of = rng.uniform(-acceleration, acceleration, number)
    radius = 2.0 - velocity * time + 0.5 * acceleration_of * time**2
    delay, rate, bend = (2.0 / C * x for x in (radius, velocity - acceleration_of * time, acceleration_of))
    amplitude = np.ones(number)
    options = {"delay_rate": rate, "delay_acceleration": bend}
    exact = rc.beat_signal(delay, amplitude, wf, tolerance=1e-12, method="direct", **options)
    for tolerance in (3e-3, 1e-3, 1e-4):
        got = rc.beat_signal(delay, amplitude, wf, tolerance=tolerance, method=method, **options)
        assert np.sqrt(np.mean(np.abs(got - exact) ** 2)) <= tolerance * np.sqrt(number)
