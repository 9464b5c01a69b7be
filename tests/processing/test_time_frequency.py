"""Power over a recording, against points whose velocity at every time is known on paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.processing.spectra.spectra import range_doppler, range_profile
from radarcore.processing.spectra.time_frequency import range_time, spectrogram
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.recording.recording import Recording
from radarcore.simulate.beat import beat_signal
from radarcore.units import SPEED_OF_LIGHT

UP, DOWN = 1.0, -1.0

BURST = 32 * 400e-6
"""Duration of a frame's chirps [s]; frames at 40 Hz leave as much again before the next."""

Distance = Callable[[NDArray[np.float64]], Any]


def waveform(direction: float = UP, **changes: Any) -> Waveform:
    """1 GHz at 60 GHz: 15 cm and 0.19 m/s bins, to 4.8 m (real) and 3.1 m/s."""
    settings: dict[str, Any] = {"num_samples": 64, "num_chirps": 32, "chirp_interval": 400e-6} | changes
    return Waveform.from_sweep(
        start_frequency=60e9, stop_frequency=60e9 + direction * 1e9, sample_rate=2e6, adc_delay=5e-6, **settings
    )


def record(
    *distances: Distance,
    times: Any = None,
    wf: Waveform | None = None,
    real: bool = False,
    amplitudes: tuple[float, ...] | None = None,
    num_channels: int = 1,
) -> Recording:
    """Points at given distances [m] over time [s], followed exactly; default: one second at 40 Hz from 0.5 s on."""
    wf = waveform() if wf is None else wf
    times = 0.5 + 25e-3 * np.arange(40) if times is None else times
    radar = Radar(wf, rx=np.zeros((num_channels, 3)), receiver=Receiver(output="real") if real else None)
    nodes = wf.delay_times(16)
    cube = []
    for time in times:
        delay = np.stack([2.0 / SPEED_OF_LIGHT * distance(time + nodes) for distance in distances], axis=-1)
        delay = np.broadcast_to(delay[:, None], (len(nodes), num_channels, len(distances)))
        cube.append(beat_signal(delay, amplitudes or np.ones(len(distances)), wf, tolerance=1e-9))
    samples = np.array(cube).reshape(-1, num_channels, wf.num_chirps, wf.num_samples)
    return Recording(samples.real if real else samples, times, radar)


def steady(distance: float, velocity: float, at: float = 1.0) -> Distance:
    return lambda time: distance + velocity * (time - at)


def strongest_velocity(found: Any) -> NDArray[np.float64]:
    """Velocity of the largest power of every column [m/s]."""
    return np.asarray(found.velocity[found.power.argmax(axis=1)])


@pytest.mark.parametrize("direction", [UP, DOWN])
@pytest.mark.parametrize("real", [False, True])
@pytest.mark.parametrize("velocity", [-1.7, 0.0, 0.4])
def test_steady_point_is_a_line_at_its_velocity(direction: float, real: bool, velocity: float) -> None:
    wf = waveform(direction)
    found = spectrogram(record(steady(2.4, velocity), wf=wf, real=real), num_velocity_bins=256)
    assert found.power.shape == (40, 256)
    np.testing.assert_array_equal(found.velocity, wf.velocity_axis(256))
    # Cells are 1/8 of a bin: the nearest is off by 1/16 at most.
    assert np.abs(strongest_velocity(found) - velocity).max() <= 0.07 * wf.velocity_resolution


def test_oscillating_point_has_its_velocity_in_every_column_and_its_largest_as_envelope() -> None:
    frequency, largest = 2.0, 2.0  # Hz, m/s
    amplitude = largest / (2.0 * np.pi * frequency)
    recording = record(lambda t: 2.4 + amplitude * np.sin(2.0 * np.pi * frequency * t))
    wf = recording.radar.waveform
    found = spectrogram(recording, window_length=16, num_velocity_bins=512)
    velocity = largest * np.cos(2.0 * np.pi * frequency * found.time)
    # The window is symmetric about `time`, the velocity to first order too; the residual is the third derivative,
    # and cells of 1/16 of a 32-chirp bin.
    assert np.abs(strongest_velocity(found) - velocity).max() <= 0.1 * wf.velocity_resolution
    envelope = found.velocity[(found.power > 0.5 * found.power.max()).any(axis=0)]
    for extreme, expected in ((envelope.max(), largest), (envelope.min(), -largest)):
        # One bin of 16 chirps: a Hann window is at half its power 0.72 bins off.
        assert abs(extreme - expected) <= 2.0 * wf.velocity_resolution


def test_column_of_a_whole_frame_is_the_power_of_its_range_doppler_map() -> None:
    recording = record(steady(2.4, 0.4), steady(1.2, -1.0), real=True, num_channels=2)
    wf = recording.radar.waveform
    found = spectrogram(recording, num_velocity_bins=64)
    for column, frame in zip(found.power, recording.frames(), strict=True):
        spectrum = range_doppler(frame.cube, wf, num_velocity_bins=64)
        np.testing.assert_allclose(column, (np.abs(spectrum) ** 2).sum(axis=(0, 2)), rtol=1e-9)


def test_times_are_the_middles_of_the_windows() -> None:
    recording = record(steady(2.4, 0.4), times=[3.0, 3.1])
    # A periodic window of n has its middle at n/2; fast time adds the middle of the samples.
    fast = 5e-6 + 32 / 2e6
    np.testing.assert_allclose(spectrogram(recording).time, [3.0 + 16 * 400e-6 + fast, 3.1 + 16 * 400e-6 + fast])
    starts = np.array([0, 4, 8, 12, 16, 20, 24])
    found = spectrogram(recording, window_length=8)
    expected = np.add.outer([3.0, 3.1], (starts + 4) * 400e-6 + fast).ravel()
    np.testing.assert_allclose(found.time, expected, rtol=1e-12)
    # An unweighted window of n chirps is centred on (n - 1)/2.
    bare = spectrogram(recording, window_length=8, overlap=0.0, window=None, doppler_window=None)
    expected = np.add.outer([3.0, 3.1], (np.array([0, 8, 16, 24]) + 3.5) * 400e-6 + 5e-6 + 31.5 / 2e6).ravel()
    np.testing.assert_allclose(bare.time, expected, rtol=1e-12)


def test_windows_run_across_frames_without_a_gap_as_in_one_long_frame() -> None:
    times = 0.2 + BURST * np.arange(10)
    seamless = record(steady(2.4, 0.47, at=0.25), times=times)
    long_wf = waveform(num_chirps=320)
    long = Recording(seamless.cube.reshape(1, 1, 320, 64), [0.2], Radar(long_wf))
    settings: dict[str, Any] = {"window_length": 80, "overlap": 0.7, "num_velocity_bins": 128}
    found, expected = spectrogram(seamless, **settings), spectrogram(long, **settings)
    assert len(found.time) == (320 - 80) // 24 + 1
    np.testing.assert_allclose(found.time, expected.time, rtol=1e-12)
    np.testing.assert_allclose(found.power, expected.power, rtol=1e-9)
    assert (
        np.abs(strongest_velocity(found) - 0.47).max() <= 0.5 * seamless.radar.waveform.velocity_resolution * 32 / 128
    )


def test_no_window_spans_a_gap() -> None:
    # Four frames, a pause, two frames: 128 and 64 chirps in one go.
    times = BURST * np.array([0.0, 1.0, 2.0, 3.0, 9.0, 10.0])
    recording = record(steady(2.4, 0.5, at=0.0), times=times)
    assert len(spectrogram(recording, window_length=64, overlap=0.0).time) == 2 + 1
    assert len(spectrogram(recording, window_length=96, overlap=0.0).time) == 1  # the second run is too short
    with pytest.raises(ValueError, match=r"window_length: expected at most 128, the most chirps without a gap"):
        spectrogram(recording, window_length=129)


def test_static_echo_goes_and_the_moving_one_stays() -> None:
    recording = record(steady(1.2, 0.0), steady(2.4, 1.0), amplitudes=(1.0, 0.01), real=True)
    found, kept = spectrogram(recording, subtract_mean=True), spectrogram(recording)
    at_rest, moving = (int(np.argmin(np.abs(found.velocity - v))) for v in (0.0, 1.0))
    assert (strongest_velocity(kept) == 0.0).all()
    assert np.abs(strongest_velocity(found) - 1.0).max() <= recording.radar.waveform.velocity_resolution
    # Left over is the mean of the moving echo, weaker by its 80 turns over the recording.
    assert (found.power[:, at_rest] < 1e-5 * kept.power[:, at_rest]).all()
    np.testing.assert_allclose(found.power[:, moving], kept.power[:, moving], rtol=1e-9)
    over_time = range_time(recording, subtract_mean=True)
    assert (over_time.range[over_time.power.argmax(axis=1)] > 1.9).all()
    alone = spectrogram(record(steady(1.2, 0.0)), subtract_mean=True)
    assert alone.power.max() < 1e-20 * kept.power.max()


def test_range_gate_and_channel_choose_what_is_seen() -> None:
    recording = record(steady(1.2, 1.0), steady(3.0, -1.0), num_channels=2)
    near, far = spectrogram(recording, max_range=2.1), spectrogram(recording, min_range=2.1)
    resolution = recording.radar.waveform.velocity_resolution
    assert np.abs(strongest_velocity(near) - 1.0).max() <= resolution
    assert np.abs(strongest_velocity(far) + 1.0).max() <= resolution
    np.testing.assert_allclose(near.power + far.power, spectrogram(recording).power)
    one = spectrogram(recording, channel=-1)
    np.testing.assert_allclose(2.0 * one.power, spectrogram(recording).power)


def test_single_precision_in_single_precision_throughout() -> None:
    recording = record(steady(2.4, 0.4), real=True)
    single = Recording(recording.cube.astype(np.float32), recording.time, recording.radar)
    found, expected = (spectrogram(r, subtract_mean=True).power for r in (single, recording))
    np.testing.assert_allclose(found, expected, atol=1e-6 * expected.max())


def test_range_over_time_follows_the_point() -> None:
    recording = record(steady(2.4, 1.0), real=True)
    wf = recording.radar.waveform
    found = range_time(recording, num_bins=256)
    assert found.power.shape == (40, 129)
    np.testing.assert_allclose(found.time, recording.time + 0.5 * wf.duration)
    # Moving targets lie velocity * f / slope beyond their range: see `range_doppler`.
    expected = 2.4 + 1.0 * (found.time - 1.0) + 1.0 * wf.center_frequency / wf.slope
    ranges = found.range[found.power.argmax(axis=1)]
    assert np.abs(ranges - expected).max() <= 0.25 * wf.range_resolution  # half a cell is 1/8; the mirror image
    first = np.abs(range_profile(recording.cube[0], wf, num_bins=256)) ** 2
    np.testing.assert_allclose(found.power[0], first.mean(axis=1).sum(axis=0))


def test_recording_without_frames_gives_no_columns() -> None:
    wf = waveform()
    empty = Recording(np.zeros((0, 1, 32, 64), np.complex64), [], Radar(wf))
    found = spectrogram(empty, subtract_mean=True)
    assert (found.time.shape, found.power.shape) == ((0,), (0, 32))
    assert range_time(empty).power.shape == (0, 64)


def test_range_alone_does_not_mind_unequal_intervals() -> None:
    staggered = waveform(chirp_times=400e-6 * np.arange(32) + 50e-6 * (np.arange(32) % 2))
    assert range_time(Recording(np.ones((2, 1, 32, 64)), [0.0, 0.025], Radar(staggered))).power.shape == (2, 33)


@pytest.mark.parametrize("jitter", [0.0, 0.08])
def test_frames_of_a_single_chirp_tell_velocities_over_frames(jitter: float) -> None:
    wf = rc.bgt60tr13c(num_chirps=2).waveform.replace(num_chirps=1, frame_interval=1e-3)
    point = rc.PointTarget([2.0, 0.0, 0.0], velocity=[0.4, 0.0, 0.0])
    recording = rc.Simulator(rc.Scene([point]), rc.Radar(wf), resolution=8).record(0.0, 0.3, 1000.0, progress=False)
    stamps = recording.time + 1e-3 * jitter * np.random.default_rng(1).uniform(-1.0, 1.0, 300)
    found = rc.spectrogram(replace(recording, time=stamps), num_velocity_bins=1024)
    assert len(found.time) == 8  # of 64 frames, half of them shared
    strongest = found.velocity[found.power.argmax(axis=1)]
    np.testing.assert_allclose(strongest, 0.4, atol=0.1 * wf.wavelength / (2.0 * 64e-3))
    # A lost frame ends the window; a single frame has no velocity.
    lost = rc.Recording(np.delete(recording.cube, 150, axis=0), np.delete(recording.time, 150), recording.radar)
    assert len(rc.spectrogram(lost).time) == 2 * 3
    for alone in (rc.spectrogram(recording[0]), rc.spectrogram(recording, window_length=1)):
        assert np.isnan(alone.velocity).all()
