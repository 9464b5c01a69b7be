"""Tracks that follow what is known to be there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import radarcore as rc
from radarcore.comparison.targets import Found, estimates, found_in, measured, target_errors, truth_of

RADAR = rc.bgt60tr13c()
POINTS = {"near": (1.5, 0.5), "far/left": (3.5, -1.0), "far/right": (4.5, -1.0)}


@pytest.fixture(scope="module")
def recording() -> rc.Recording:
    """A point that recedes, and two that come nearer together, parts of one thing."""
    points = [
        rc.PointTarget([x, 0.2, 0.0], rcs=1.0, velocity=[rate, 0.0, 0.0], name=name)
        for name, (x, rate) in POINTS.items()
    ]
    return rc.Simulator(rc.Scene(points), RADAR).record(0.0, 0.5, 40.0, progress=False)


def test_targets_are_followed_by_tracks_and_estimates_are_detections(recording: rc.Recording) -> None:
    assert recording.truth is not None
    found = found_in(recording, progress=False)
    near = estimates(found, recording.truth, ["near"])["near"]
    errors = rc.compare(recording, targets=["near"], progress=False)["near"].errors[0]
    assert (errors.num_frames, errors.num_tracked, errors.num_predicted, errors.range.num_within) == (20, 20, 0, 20)
    assert errors.range.largest_bins < 0.2  # at 20 dB and more: 0.05 bins of noise at most
    assert set(near.range) <= {value for frame in found.detections for value in frame.range}
    assert near.num_tracks == 1


NUM, BLIND, HAND = 60, slice(30, 34), 0.3
"""Frames of a walker, those without an echo, and how far the hand is in front of the trunk [m]."""


def walker() -> tuple[Found, rc.Truth]:
    """A trunk that recedes at 1 m/s from 2 m on with a hand in front of it, and for 20 frames somebody nearer."""
    time = np.arange(NUM) / 40.0
    parts = np.stack([2.0 + time, 2.0 + time - HAND], axis=1)
    radar = rc.bgt60tr13c(num_chirps=2, num_samples=64)

    def detections(frame: rc.Frame) -> rc.Detections:
        k = round(40.0 * frame.time)
        ranges = [] if k in range(NUM)[BLIND] else [*parts[k]]
        if k < 20:
            ranges.append(parts[k, 1] - 1.2)
        number = len(ranges)
        middle = frame.time + radar.middle
        return rc.Detections(
            ranges, np.ones(number), np.zeros(number), np.zeros(number), np.full(number, 20.0), None, middle
        )

    recording = rc.Recording(np.zeros((NUM, 3, 2, 64), np.float32), time, radar)
    velocity = np.stack([np.ones(NUM), np.full(NUM, 1.5)], axis=1)
    truth = rc.Truth(("person/trunk", "person/hand"), parts, velocity, 0.0 * parts, 0.0 * parts)
    return found_in(recording, detector=detections, progress=False), truth


def test_person_has_one_track_and_the_nearest_point_of_all_parts() -> None:
    found, truth = walker()
    (person,) = estimates(found, truth, ["person/trunk"]).values()
    distance, velocity = truth_of(truth, "person/trunk")
    assert distance.tolist() == truth.range[:, 1].tolist()
    assert velocity.tolist() == [1.0] * NUM
    assert (len(found.people), person.num_tracks) == (2, 1)
    is_blind = np.isin(np.arange(NUM), np.arange(NUM)[BLIND])
    assert person.is_detected.tolist() == (~is_blind).tolist()
    assert person.range[~is_blind] == pytest.approx(distance[~is_blind], abs=1e-9)
    assert person.velocity[20:] == pytest.approx(velocity[20:], abs=0.05)  # settled
    errors = target_errors("person", person, (distance, velocity), (0.1, 0.1))
    assert (errors.num_frames, errors.num_tracked, errors.num_predicted) == (NUM, NUM, 4)


def test_track_of_a_person_is_chosen_by_its_length_and_not_by_the_truth() -> None:
    """Wherever the truth is, even at the shorter track, the longer one counts."""
    found, truth = walker()
    elsewhere = replace(truth, range=truth.range - 1.2)
    (person,), (other,) = (estimates(found, one, ["person/trunk"]).values() for one in (truth, elsewhere))
    assert np.array_equal(person.range, other.range)


def test_track_without_a_detection_is_what_it_expects(recording: rc.Recording) -> None:
    def half_blind(frame: rc.Frame) -> rc.Detections:
        found = rc.detect(frame)
        return found[found.range > 3.0] if frame.time > 0.24 else found

    found = found_in(recording, detector=half_blind, progress=False)
    far = next(one for one in found.tracks if one.range[0] < 3.6 and len(one) == 20)
    points = measured(far, found.detections, RADAR.waveform)
    assert points[:, 0] == pytest.approx(far.range, abs=0.03)
    assert recording.truth is not None
    near = estimates(found, recording.truth, ["near"])["near"]
    assert (near.range == near.range).sum() == 10  # up to its last detection


def test_target_without_a_track_has_no_estimates(recording: rc.Recording) -> None:
    assert recording.truth is not None
    found = found_in(recording, detector=lambda frame: rc.detect(frame, min_range=3.0), progress=False)
    near = estimates(found, recording.truth, ["near"])["near"]
    assert near.num_tracks == 0
    assert not (near.range == near.range).any()
