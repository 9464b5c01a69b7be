"""Tracks that follow what is known to be there."""

from __future__ import annotations

import pytest

import radarcore as rc
from radarcore.comparison.targets import estimates, found_in, measured

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
    followed = estimates(found, recording.truth, ["near", "far/left"])
    compared = rc.compare(recording, targets=["near", "far/left"], progress=False)
    for body, one in followed.items():
        errors = compared[body].errors[0]
        assert (errors.num_frames, errors.num_tracked, errors.range.num_within) == (20, 20, 20)
        assert errors.range.largest_bins < 0.2  # at 20 dB and more: 0.05 bins of noise at most
        detected = {value for frame in found.detections for value in frame.range}
        assert set(one.range) <= detected
    assert followed["near"].num_tracks == 1
    # Tracks of both parts count for the thing: of the two the part that is asked for is the nearer.
    assert followed["far/left"].num_tracks == 2


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
