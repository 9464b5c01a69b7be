"""Clocks: offsets by detections and truth, and frames that are missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import radarcore as rc
from radarcore.comparison.alignment import estimated_offset
from radarcore.comparison.targets import dropped_frames
from radarcore.comparison.truth import MovingTargets

INTERVAL, BINS = 0.025, (0.1, 0.1)


def swing(time: float) -> rc.Pose:
    return rc.Pose([2.0 + 0.4 * np.sin(4.0 * time), 0.0, 0.0])


def walk(time: float) -> rc.Pose:
    return rc.Pose([4.0 - 0.8 * time - 0.05 * np.cos(11.0 * time), 0.0, 0.0])


def detections(motions: list[Callable[[float], rc.Pose]], clock: float, seed: int) -> list[rc.Detections]:
    """Noisy detections of the targets, 6 cm before their origins, at times of a clock that is behind; and clutter."""
    rng = np.random.default_rng(seed)
    truth = MovingTargets({str(k): motion for k, motion in enumerate(motions)})
    found = []
    for time in 1.0 + INTERVAL * np.arange(80):
        known = truth.at([time])
        range_, velocity = known.range[0] - 0.06, known.velocity[0]
        seen = rng.random(len(motions)) < 0.9
        range_ = np.append(range_[seen] + 0.01 * rng.standard_normal(seen.sum()), [4.5, 3.0])
        velocity = np.append(velocity[seen] + 0.01 * rng.standard_normal(seen.sum()), [0.0, rng.uniform(-2.0, 2.0)])
        nothing = np.full(len(range_), np.nan)
        found.append(rc.Detections(range_, velocity, nothing, nothing, nothing, time=time - clock))
    return found


@pytest.mark.parametrize(("clock", "seed"), [(0.4371, 2), (1.6e9 - 0.8137, 4)])
def test_offset_of_a_clock_is_found_within_a_millisecond(clock: float, seed: int) -> None:
    truth = MovingTargets({"swing": swing, "walk": walk})
    found = estimated_offset(
        detections([swing, walk], clock, seed), truth, bins=BINS, interval=INTERVAL, span=(0.5, 3.5)
    )
    assert found.is_estimated
    # Accelerations of 4 m/s^2 rms, noise of 10 mm/s, 150 detections: 0.2 ms.
    assert found.deviation < 0.4e-3
    assert found.seconds == pytest.approx(clock, abs=1e-3)


def test_offset_is_not_guessed_where_nothing_tells_it() -> None:
    still, uniform = rc.Pose([2.0, 0.0, 0.0]), rc.Linear(rc.Pose([3.0, 0.0, 0.0]), velocity=[-0.5, 0.0, 0.0])
    found = detections([still.at, uniform.at], 0.1, 5)
    for truth in ({"still": still}, {"uniform": uniform}):
        with pytest.raises(ValueError, match="offset: expected a detected target with changing velocity"):
            estimated_offset(found, MovingTargets(truth), bins=BINS, interval=INTERVAL)
    with pytest.raises(ValueError, match="offset: expected detections near the truth at some offset, got none"):
        estimated_offset(found, MovingTargets({"far": rc.Pose([50.0, 0.0, 0.0])}), bins=BINS, interval=INTERVAL)
    with pytest.raises(ValueError, match="offset: expected detections to align the clock by, got none"):
        estimated_offset([one[:0] for one in found], MovingTargets(truth), bins=BINS, interval=INTERVAL)
    with pytest.raises(ValueError, match="max_offset: expected a value at which recording and truth overlap"):
        estimated_offset(found, MovingTargets(truth), bins=BINS, interval=INTERVAL, longest=1.0, span=(1e3, 1e3 + 2.0))


def test_motions_that_come_again_do_not_tell_the_offset() -> None:
    found, truth = detections([swing], 0.3, 6), MovingTargets({"swing": swing})
    period = 2.0 * np.pi / 4.0
    with pytest.raises(ValueError, match="offset: expected motions that fit at one offset only, got two"):
        estimated_offset(found, truth, bins=BINS, interval=INTERVAL, longest=0.3 + period)
    told = estimated_offset(found, truth, bins=BINS, interval=INTERVAL, longest=0.5 * period)
    assert told.seconds == pytest.approx(0.3, abs=1e-3)


def recording(times: list[float], lost: list[int] | None = None) -> rc.Recording:
    radar = rc.bgt60tr13c(num_samples=16, num_chirps=4)
    return rc.Recording(np.zeros((len(times), 3, 4, 16), np.float32), times, radar, lost=lost)


def test_missing_frames_are_listed_as_counted_and_by_gaps() -> None:
    times = [0.0, 0.025, 0.0502, 0.125, 0.15, 0.175, 0.2, 0.225]
    (gap,) = dropped_frames(recording(times), 10.0)
    assert (gap.frame, gap.count, gap.is_counted) == (3, 2, False)
    assert gap.time == pytest.approx(10.125)
    # The recording counts them itself; its times reveal uncounted ones.
    first, second = dropped_frames(recording(times, [0, 0, 0, 1, 0, 0, 3, 0]))
    assert (first.frame, first.count, first.is_counted) == (3, 2, False)
    assert (second.frame, second.count, second.is_counted) == (6, 3, True)
    assert dropped_frames(recording(times[4:])) == ()
    assert dropped_frames(replace(recording(times[:1]))) == ()
