"""Velocity by Doppler, pairs of chirps and changes of the beat frequency: exact without noise, at the bound with it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore import processing
from radarcore.units import SPEED_OF_LIGHT
from reference import beat_signal_reference

UP = rc.Waveform(
    start_frequency=58e9,
    slope=4e12,
    sample_rate=64e3,
    num_samples=64,
    num_chirps=16,
    chirp_interval=1.1e-3,
    adc_delay=2e-5,
)
DOWN = rc.Waveform(
    start_frequency=62.2e9, slope=-4e12, sample_rate=64e3, num_samples=64, num_chirps=16, chirp_interval=1.2e-3
)
RANGE, VELOCITY = 0.7, 0.43  # the beat frequency is 19 bins above 0

Estimator = Callable[..., processing.VelocityEstimate]


def echo(waveform: rc.Waveform, distance: float, velocity: float, amplitude: Any = 1.0) -> NDArray[np.complex128]:
    """Eq. (1) of a target with its range at the middle of the frame; (1, chirp, sample)."""
    rate = 2.0 * velocity / SPEED_OF_LIGHT
    delay = 2.0 * distance / SPEED_OF_LIGHT - 0.5 * rate * waveform.duration
    return beat_signal_reference([delay], [amplitude], waveform, [rate])


def noisy(samples: NDArray[Any], snr_db: float, number: int, seed: int) -> NDArray[Any]:
    """Trials (trial, channel, chirp, sample); the ratio is of powers per sample, of real samples too."""
    rng = np.random.default_rng(seed)
    shape = (number, *samples.shape)
    deviation = np.sqrt(0.5 * 10.0 ** (-0.1 * snr_db))
    noise = rng.normal(size=(2, *shape))
    return samples + deviation * (noise[0] + 1j * noise[1] if np.iscomplexobj(samples) else noise[0])


def pair(up: rc.Waveform, down: rc.Waveform) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Echoes of one target with its range and velocity between the middles of two frames that follow each other."""
    half = 0.5 * (up.frame_interval + 0.5 * down.duration - 0.5 * up.duration)
    return echo(up, RANGE - VELOCITY * half, VELOCITY), echo(down, RANGE + VELOCITY * half, VELOCITY)


SINGLE: list[tuple[Estimator, Callable[..., processing.CramerRaoBound]]] = [
    (rc.doppler_velocity, processing.doppler_bound),
    (processing.chirp_rate_velocity, processing.chirp_rate_bound),
]


# Without noise


@pytest.mark.parametrize("waveform", [UP, DOWN])
@pytest.mark.parametrize("is_real", [False, True])
@pytest.mark.parametrize("window", [None, "hann"])
def test_estimates_of_one_echo_without_noise_are_exact(
    waveform: rc.Waveform, is_real: bool, window: str | None
) -> None:
    samples = echo(waveform, RANGE, VELOCITY)
    for estimator, bound in SINGLE:
        found = estimator(samples.real if is_real else samples, waveform, window=window, max_velocity=1.2)
        deviation = bound(waveform, 110.0)
        # Far below the noise of any receiver: real samples take their mirror image off step by step.
        assert abs(found.velocity - VELOCITY) <= deviation.velocity
        assert abs(found.range - RANGE) <= deviation.range


@pytest.mark.parametrize("num_chirps", [1, 16])
@pytest.mark.parametrize("is_real", [False, True])
def test_a_pair_of_chirps_tells_range_and_velocity(num_chirps: int, is_real: bool) -> None:
    waveforms = UP.replace(num_chirps=num_chirps), DOWN.replace(num_chirps=num_chirps)
    samples = [one.real if is_real else one for one in pair(*waveforms)]
    found = processing.up_down_velocity(*samples, *waveforms)
    bound = processing.up_down_bound(*waveforms, 110.0)
    assert abs(found.velocity - VELOCITY) <= bound.velocity
    assert abs(found.range - RANGE) <= bound.range
    swapped = processing.up_down_velocity(*samples[::-1], *waveforms[::-1], down_delay=-waveforms[0].frame_interval)
    assert swapped.velocity == pytest.approx(found.velocity, abs=float(bound.velocity))
    assert swapped.range == pytest.approx(found.range, abs=float(bound.range))


def test_frames_of_a_pair_bring_their_times() -> None:
    up, down = UP.replace(num_chirps=1), DOWN.replace(num_chirps=1)
    gap = 7e-3
    half = 0.5 * (gap + 0.5 * down.duration - 0.5 * up.duration)
    frames = [
        rc.Frame(echo(wf, RANGE + VELOCITY * since, VELOCITY), time, rc.Radar(wf))
        for wf, since, time in ((up, -half, 2.0), (down, half, 2.0 + gap))
    ]
    found = processing.up_down_velocity(*frames)
    assert abs(found.velocity - VELOCITY) <= 1e-7  # 2 mm of migration would count 0.2 m/s
    assert abs(found.range - RANGE) <= 1e-9


@pytest.mark.filterwarnings("ignore:'point 0' has a radial speed")  # beyond what Doppler could tell
@pytest.mark.parametrize(
    ("num_chirps", "schedule", "apart"),
    [(2, None, False), (16, rc.Schedule.tdm(), False), (2, rc.Schedule.tdm(), True)],
)
def test_sub_sequences_of_a_frame_are_pairs_with_the_times_of_their_chirps(
    num_chirps: int, schedule: rc.Schedule | None, apart: bool
) -> None:
    wf = UP.replace(num_chirps=num_chirps, chirp_interval=2.4e-3)
    up, down = wf.alternating()
    if apart:
        down = down.replace(chirp_times=up.chirp_times + up.chirp_times[-1] + 7e-3)
    radar = rc.Radar([up, down], tx=[[0.0, 0.0, 0.0]] * 2, schedule=schedule)
    target = rc.PointTarget([RANGE, 0.0, 0.0], velocity=[VELOCITY, 0.0, 0.0])
    frame = rc.Simulator(rc.Scene([target]), radar, tolerance=1e-9).frame()
    found = processing.up_down_velocity(*frame.sequences())
    # Up to 17 mm from one to the other: at times that are not theirs the velocity would be off by 0.1 m/s and more.
    middle = 0.5 * sum(part.radar.middle for part in frame.sequences())
    assert abs(found.velocity - VELOCITY) <= 5e-6
    assert abs(found.range - (RANGE + VELOCITY * middle)) <= 1e-5
    other = processing.up_down_velocity(*frame.sequences()[::-1])
    assert other.velocity == pytest.approx(found.velocity, abs=1e-12)
    cubes = processing.up_down_velocity(*(part.cube for part in frame.sequences()), *radar.sequences())
    assert (cubes.range, cubes.velocity) == (found.range, found.velocity)
    bound = processing.up_down_bound(up, down, found.snr_db, num_channels=radar.num_channels)  # type: ignore[arg-type]
    assert found.velocity_std == pytest.approx(float(bound.velocity))
    recording = rc.Recording.from_frames([frame, rc.Frame(frame.cube, 1.0, radar, frame.truth)])
    both = processing.up_down_velocity(*recording.sequences())
    np.testing.assert_allclose(both.velocity, found.velocity, rtol=1e-12)


def test_changes_of_the_frequency_tell_velocities_beyond_those_of_doppler() -> None:
    fast = 2.0 * UP.max_velocity + 0.3
    samples = echo(UP, RANGE, fast)
    assert processing.chirp_rate_velocity(samples, UP).velocity == pytest.approx(fast, abs=1e-6)
    # Doppler's is another one, a whole number of intervals away but for the carrier's own error.
    alias = rc.doppler_velocity(samples, UP).velocity
    assert abs(alias - 0.3) <= 1e-3  # 2.27 m/s of an interval times 1e-4 of the carrier


def test_an_echo_smeared_within_the_chirp_is_found_by_dechirping() -> None:
    """At 60 m/s the frequency moves by three bins within a chirp."""
    one = UP.replace(num_chirps=1)
    samples = noisy(echo(one, RANGE, 60.0), 20.0, 1, seed=3)[0]
    found = processing.chirp_rate_velocity(samples, one, max_velocity=100.0)
    assert abs(found.velocity - 60.0) <= 4.0 * processing.chirp_rate_bound(one, 20.0).velocity


def test_chirps_may_come_at_any_times_for_the_chirp_rate() -> None:
    times = UP.chirp_times + np.random.default_rng(1).uniform(0.0, 5e-3, 16).cumsum()
    staggered = UP.replace(chirp_times=times)
    found = processing.chirp_rate_velocity(echo(staggered, RANGE, VELOCITY), staggered)
    assert abs(found.velocity - VELOCITY) <= 1e-6


# With noise

TRIALS = 100
ACCURACY = 4.0 / np.sqrt(2.0 * TRIALS)
"""Four standard deviations of a standard deviation that is measured over the trials."""


@pytest.mark.parametrize("is_real", [False, True])
@pytest.mark.parametrize(("estimator", "bound"), SINGLE)
def test_deviations_from_15_db_up_are_those_of_the_bound_and_as_predicted(
    estimator: Estimator, bound: Callable[..., processing.CramerRaoBound], is_real: bool
) -> None:
    wf = UP.replace(num_chirps=4)
    samples = echo(wf, RANGE, VELOCITY)
    trials = noisy(samples.real if is_real else samples, 15.0, TRIALS, seed=15)
    found = estimator(trials, wf, max_velocity=1.2)
    least = bound(wf, 15.0, is_real=is_real)
    for estimate, truth, deviation, predicted in (
        (found.range, RANGE, least.range, found.range_std),
        (found.velocity, VELOCITY, least.velocity, found.velocity_std),
    ):
        assert abs(np.mean(estimate) - truth) <= 4.0 * deviation / np.sqrt(TRIALS)
        # Within 1.5 of the bound is what is promised; least squares are at the bound.
        assert np.std(estimate) == pytest.approx(float(deviation), rel=ACCURACY)
        # The noise of one frame is known from 66 cells or more, its deviation to 9 % then.
        assert np.mean(predicted) == pytest.approx(float(deviation), rel=0.03)


@pytest.mark.parametrize("is_real", [False, True])
def test_deviations_of_one_pair_from_15_db_up_are_those_of_the_bound(is_real: bool) -> None:
    up, down = UP.replace(num_chirps=1), DOWN.replace(num_chirps=1)
    samples = pair(up, down)
    trials = [noisy(one.real if is_real else one, 15.0, TRIALS, seed) for seed, one in enumerate(samples)]
    found = processing.up_down_velocity(*trials, up, down)
    bound = processing.up_down_bound(up, down, 15.0, is_real=is_real)
    assert np.std(found.velocity) == pytest.approx(float(bound.velocity), rel=ACCURACY)
    assert np.std(found.range) == pytest.approx(float(bound.range), rel=ACCURACY)
    # Noise from 31 cells or more of each chirp.
    assert np.mean(found.velocity_std) == pytest.approx(float(bound.velocity), rel=0.1)


def test_a_hann_window_is_less_accurate_as_predicted() -> None:
    trials = noisy(echo(UP, RANGE, VELOCITY), 20.0, TRIALS, seed=5)
    windows = {"window": "hann", "doppler_window": "hann"}
    found = rc.doppler_velocity(trials, UP, **windows)  # type: ignore[arg-type]
    windowed = processing.doppler_bound(UP, 20.0, **windows).velocity  # type: ignore[arg-type]
    assert np.std(found.velocity) == pytest.approx(float(windowed), rel=ACCURACY)
    assert windowed > 1.5 * processing.doppler_bound(UP, 20.0).velocity


def test_channels_of_any_phases_are_used_together() -> None:
    wf = UP.replace(num_chirps=4)
    one = echo(wf, RANGE, VELOCITY)
    trials = noisy(np.concatenate([one, 1j * one, -one, one]), 15.0, TRIALS, seed=6)
    found = rc.doppler_velocity(trials, wf)
    assert np.std(found.velocity) == pytest.approx(
        float(processing.doppler_bound(wf, 15.0, num_channels=4).velocity), rel=ACCURACY
    )


@pytest.mark.parametrize("is_real", [False, True])
def test_channels_may_have_their_chirps_later(is_real: bool) -> None:
    slow = UP.replace(chirp_interval=2.2e-3)
    radar = rc.Radar(slow, tx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]], schedule=rc.Schedule.tdm(interval=1.05e-3))
    rate = 2.0 * VELOCITY / SPEED_OF_LIGHT
    delay = 2.0 * RANGE / SPEED_OF_LIGHT - rate * radar.middle
    waveforms = [slow.replace(chirp_times=slow.chirp_times + offset) for offset in radar.channel_offsets]
    cube = np.concatenate([beat_signal_reference([delay], [1.0], wf, [rate]) for wf in waveforms])
    for estimator, bound in SINGLE:
        found = estimator(cube.real if is_real else cube, radar)
        assert abs(found.velocity - VELOCITY) <= bound(slow, 110.0).velocity
        assert abs(found.range - RANGE) <= bound(slow, 110.0).range


def test_range_of_one_chirp_is_that_of_the_frame_with_transmitters_in_turn_too() -> None:
    one = UP.replace(num_chirps=1)
    radar = rc.Radar(one, tx=[[0.0, 0.0, 0.0]] * 2, schedule=rc.Schedule.tdm(interval=20e-3))
    target = rc.PointTarget([RANGE, 0.0, 0.0], velocity=[VELOCITY, 0.0, 0.0])
    frame = rc.Simulator(rc.Scene([target]), radar, tolerance=1e-9).frame()
    found = processing.chirp_rate_velocity(frame)
    assert abs(found.velocity - VELOCITY) <= 1e-3
    # The second transmitter sees the target 8.6 mm farther away, and 5 % weaker: it counts less by 0.1 mm.
    assert found.range == pytest.approx(RANGE + VELOCITY * radar.middle, abs=2e-4)


# Inputs


def test_a_recording_gives_what_its_frames_give() -> None:
    recording = rc.Simulator(
        rc.Scene([rc.PointTarget([1.5, 0.2, 0.0], velocity=[0.5, 0.0, 0.0])]),
        rc.bgt60tr13c(num_chirps=16, stop_frequency=60e9),
    ).record(0.0, 0.25, 12.0, progress=False)
    assert recording.truth is not None
    for estimator, _ in SINGLE:
        together = estimator(recording)
        assert np.shape(together.velocity) == (3,)
        alone = estimator(recording[1])
        assert isinstance(alone.velocity, float)
        assert alone.velocity == np.asarray(together.velocity)[1]
    found = rc.doppler_velocity(recording)
    middle = recording.time + 0.5 * recording.radar.waveform.duration
    truth = np.hypot(1.5 + 0.5 * middle, 0.2)
    # The channels' distances differ by up to half the spacing of the antennas; the frame bends by less.
    np.testing.assert_allclose(found.range, truth, atol=2e-3)
    np.testing.assert_allclose(found.velocity, recording.truth.velocity[:, 0], atol=2e-3)


def test_the_strongest_echo_within_the_limits_is_measured() -> None:
    samples = echo(UP, 0.35, -0.2, 3.0) + echo(UP, RANGE, VELOCITY)
    limits = {"min_range": 0.6, "max_range": 0.9, "window": "hann"}
    found = rc.doppler_velocity(samples, UP, doppler_window="hann", **limits)  # type: ignore[arg-type]
    assert abs(found.velocity - VELOCITY) <= 1e-5 * UP.velocity_resolution
    assert abs(found.range - RANGE) <= 1e-5 * UP.range_resolution
    by_velocity = rc.doppler_velocity(samples, UP, min_velocity=0.0, window="hann", doppler_window="hann")
    assert by_velocity.velocity == pytest.approx(found.velocity)


def test_known_noise_gives_the_bound_itself() -> None:
    samples = echo(UP, RANGE, VELOCITY)
    found = rc.doppler_velocity(samples, UP, noise=0.01)
    assert found.snr_db == pytest.approx(20.0, abs=1e-3)  # but for the part of the noise that is in the amplitude
    assert found.velocity_std == pytest.approx(float(processing.doppler_bound(UP, 20.0).velocity), rel=1e-3)
    real = rc.doppler_velocity(samples.real, UP, noise=0.01)
    assert real.snr_db == pytest.approx(20.0 - 10.0 * np.log10(2.0), abs=1e-2)


def test_without_an_echo_there_is_no_estimate() -> None:
    nothing = np.zeros((1, 16, 64), dtype=np.complex64)
    estimates = [estimator(nothing, UP) for estimator, _ in SINGLE]
    estimates.append(processing.up_down_velocity(nothing, nothing, UP, DOWN))
    estimates.append(rc.doppler_velocity(echo(UP, RANGE, VELOCITY), UP, min_range=0.8, max_range=0.801))
    for found in estimates:
        assert np.isnan([found.range, found.velocity, found.range_std, found.velocity_std, found.snr_db]).all()
    assert np.shape(rc.doppler_velocity(np.zeros((0, 1, 16, 64)), UP).velocity) == (0,)
