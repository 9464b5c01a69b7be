"""Removal of static echoes, and levels of noise: gains on paper."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore import processing
from radarcore.processing.spectra.noise import known_noise

RNG = np.random.default_rng(1)
CUBE = RNG.standard_normal((2, 3, 8, 5)).astype(np.float32)


def test_mean_is_removed_along_the_axis_named() -> None:
    for axis in (-1, -2, -4, 0):
        moving = rc.remove_mean(CUBE + 7.0, axis=axis)
        assert moving.dtype == np.float32
        np.testing.assert_allclose(moving.mean(axis=axis), 0.0, atol=1e-6)  # float32 rounding of 7
    np.testing.assert_allclose(rc.remove_mean(CUBE + 5.0), rc.remove_mean(CUBE), atol=1e-6)


@pytest.mark.parametrize("num_pulses", [2, 3])
def test_canceller_has_the_gain_of_its_pulses(num_pulses: int) -> None:
    for turns in (0.0, 0.1, 0.5, 1.0):
        tone = np.exp(2j * np.pi * turns * np.arange(8))[:, None] * np.ones((2, 1, 5))
        moving = rc.cancel_pulses(tone, num_pulses=num_pulses)
        assert moving.shape == (2, 8 - num_pulses + 1, 5)
        expected = abs(2.0 * np.sin(np.pi * turns)) ** (num_pulses - 1)
        np.testing.assert_allclose(np.abs(moving), expected, atol=1e-12)


def test_running_mean_is_that_of_all_frames_at_first_and_forgets_later() -> None:
    cube = RNG.standard_normal((300, 1, 4, 3))
    moving = rc.remove_running_mean(cube, 0.1 * np.arange(300), time_constant=2.0)
    np.testing.assert_allclose(moving[0], cube[0] - cube[0].mean(axis=-2, keepdims=True), atol=1e-12)
    np.testing.assert_allclose(moving[9], cube[9] - cube[:10].mean(axis=(0, -2)), atol=1e-12)
    # An offset that comes up has gone down to exp(-t / time constant) after t.
    step = np.where(np.arange(400)[:, None, None, None] >= 300, 1.0, np.zeros((1, 1, 4, 3)))
    moving = rc.remove_running_mean(step, 0.1 * np.arange(400), time_constant=2.0)
    assert moving[300 + 19, 0, 0, 0] == pytest.approx(np.exp(-1.0), rel=1e-12)


@pytest.mark.parametrize("num_looks", [1, 2, 5])
def test_noise_level_is_the_mean_in_spite_of_echoes(num_looks: int) -> None:
    power = 3.0 * np.random.default_rng(2).gamma(num_looks, size=(100, 400))
    echoes = power.copy()
    echoes[3:6] = 1e9  # 3 of 100 cells: the median is where 51.5 of 100 are below, up by 2.2 to 4.4 %
    # The median of n exponential powers scatters by 1 / (ln 2 sqrt(n)): 0.7 %.
    assert processing.noise_level(power, num_looks=num_looks) == pytest.approx(3.0 * num_looks, rel=4.0 * 0.0072)
    assert processing.noise_level(echoes, num_looks=num_looks) == pytest.approx(
        3.0 * num_looks * 1.025, rel=4.0 * 0.0072
    )
    assert processing.noise_level(np.empty((0, 3))) == 0.0


@pytest.mark.parametrize("output", ["iq", "real"])
def test_noise_of_the_receiver_is_that_of_the_map(output: str) -> None:
    wf = rc.Waveform(
        start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=64, num_chirps=32, chirp_interval=1e-4
    )
    of = rc.Radar(wf, receiver=rc.Receiver(output=output, noise_figure_db=12.0))
    frame = rc.Simulator(rc.Scene(), of).frame()
    level = processing.noise_level(np.abs(rc.range_doppler(frame)) ** 2)
    # The median of 1000 or 2000 cells, about a quarter of them independent: 1 / (ln 2 sqrt(270)) is 9 %.
    windows = [0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n) for n in (64, 32)]
    assert known_noise(frame, *windows) == pytest.approx(level, rel=0.36)
    for radar in (rc.Radar(wf), rc.Radar(wf, receiver=rc.Receiver())):
        assert known_noise(rc.Frame(frame.cube, 0.0, radar), *windows) is None


def test_noise_is_not_known_in_other_units_and_beyond_thermal_noise(tmp_path: Path) -> None:
    wf = rc.Waveform(start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=16, num_chirps=4)
    plain, one = rc.Receiver(output="real", noise_figure_db=12.0), np.ones(1)
    frame = rc.Frame(np.zeros((1, 4, 16), np.float32), 0.0, rc.Radar(wf, receiver=plain))
    assert known_noise(frame, one) is not None
    for changes in ({"gain_db": 20.0}, {"low_pass": 5e5}, {"phase_noise": ((1e5, -80.0),)}):
        other = replace(frame, radar=rc.Radar(wf, receiver=replace(plain, **changes)))
        assert known_noise(other, one) is None
    # Codes of an ADC, also after a filter took them; counts, and numbers of bare files without a unit.
    codes = replace(frame, raw=np.full((1, 4, 16), 2048, np.uint16))
    rested = rc.remove_static(codes, [0.0, 0.0, 0.0])
    recordings = [rc.Recording.from_frames([one_of]) for one_of in (codes, rested)]
    for dtype in (np.int16, np.float32):
        np.save(tmp_path / "cube.npy", np.zeros((2, 1, 4, 16), dtype))
        recordings.append(rc.Recording.load(tmp_path / "cube.npy", radar=frame.radar))
    recordings.append(rc.remove_mean(recordings[0]))
    for unknown in (codes, rested, *recordings, *(recording[0] for recording in recordings)):
        assert known_noise(unknown, one) is None
    assert (rested.raw, recordings[-1].raw) == (None, None)


@pytest.mark.parametrize(
    "clean",
    [
        *(lambda frame: rc.remove_static(frame, [0.0, 2.0, 0.0]), rc.remove_mean),
        *(rc.cancel_pulses, lambda frame: rc.cancel_pulses(frame, num_pulses=3)),
    ],
    ids=["band", "mean", "two", "three"],
)
def test_noise_that_filters_left_has_no_strongest_peak(clean: Any) -> None:
    of = rc.bgt60tr13c(num_samples=32, num_chirps=64)
    rng = np.random.default_rng(9)
    # One frame in a million has one; of three pulses more, as the noise that is left differs by 6 dB from row to row.
    frames = [rc.Frame(rng.standard_normal((3, 64, 32)), 0.0, of) for _ in range(10)]
    assert [rc.strongest_peak(clean(frame)) for frame in frames] == [None] * 10
    strong = np.cos(np.pi * (0.5 * np.arange(32) + 0.7 * np.arange(64)[:, None]))
    assert all(rc.strongest_peak(clean(rc.Frame(frame.cube + strong, 0.0, of))) is not None for frame in frames)


def test_frames_and_recordings_stay_what_they_are() -> None:
    wf = rc.Waveform(
        start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=64, num_chirps=32, chirp_interval=1e-4
    )
    scene = rc.Scene([rc.PointTarget([3.0, 0.0, 0.0]), rc.PointTarget([2.0, 0.0, 0.0], rcs=0.1, velocity=[2, 0, 0])])
    recording = rc.Simulator(scene, rc.Radar(wf)).record(0.0, 0.05, progress=False)
    np.testing.assert_array_equal(rc.remove_mean(recording).cube, rc.remove_mean(recording.cube))
    np.testing.assert_array_equal(rc.remove_mean(recording[1]).cube, rc.remove_mean(recording.cube[1]))
    running = rc.remove_running_mean(recording, time_constant=1.0)
    expected = rc.remove_running_mean(recording.cube, recording.time, time_constant=1.0)
    np.testing.assert_array_equal(running.cube, expected)
    for num_pulses in (2, 3):
        moving = rc.cancel_pulses(recording, num_pulses=num_pulses)
        np.testing.assert_array_equal(moving.cube, rc.cancel_pulses(recording.cube, num_pulses=num_pulses))
        assert moving.radar.waveform.num_chirps == 33 - num_pulses
        # The walker remains, within 0.002 bins of its place in the middle of the frame.
        peak, truth = rc.strongest_peak(moving[1]), recording[1].truth
        assert peak is not None
        assert truth is not None
        assert abs(peak.range - truth.range[1]) <= 0.002 * wf.range_resolution
        assert abs(peak.velocity - truth.velocity[1]) <= 0.002 * wf.velocity_resolution * 32 / 30
    assert len(rc.remove_mean(recording[:0])) == 0
