"""Tracks against the truth: which bodies they follow, and the errors."""

from __future__ import annotations

import numpy as np
import pytest

import radarcore as rc
from radarcore.comparison.targets import Estimates, compare, estimates, table

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


def test_targets_are_followed_by_tracks_and_errors_are_those_of_detections(recording: rc.Recording) -> None:
    found = estimates(recording, ["near", "far/left"], progress=False)
    for body, one in found.items():
        c = compare(recording, body, body, one)
        assert (c.num_frames, c.num_tracked, c.num_range_within) == (20, 20, 20)
        assert c.max_range_error < 0.2  # at 20 dB and more: 0.05 bins of noise at most
    assert found["near"].num_tracks == 1
    # Tracks of both parts count for the thing: of the two the part that is asked for is the nearer.
    assert found["far/left"].num_tracks == 2
    assert "near" in table([compare(recording, "near", "near", found["near"])])[-1]


def test_errors_are_of_the_frames_in_which_a_body_is_seen_and_tracked(recording: rc.Recording) -> None:
    assert recording.truth is not None
    truth = recording.truth.select(["near"])
    step = RADAR.waveform.range_resolution
    distance = truth.range[:, 0] + step * np.where(np.arange(20) < 10, 0.1, 0.7)
    distance[:5] = np.nan
    time = recording.time + 0.5 * RADAR.waveform.duration
    c = compare(recording, "a name", "near", Estimates(time, distance, truth.velocity[:, 0], 3))
    assert (c.name, c.num_frames, c.num_tracked, c.num_tracks) == ("a name", 20, 15, 3)
    assert (c.num_range_within, c.num_velocity_within) == (5, 15)
    assert c.median_range_error == pytest.approx(0.7)
    assert c.max_velocity_error == 0.0


def test_target_without_a_track_has_no_errors(recording: rc.Recording) -> None:
    nothing = np.full(20, np.nan)
    c = compare(recording, "near", "near", Estimates(recording.time, nothing, nothing, 0))
    assert (c.num_frames, c.num_tracked, c.num_range_within) == (20, 0, 0)
    assert np.isnan(c.median_range_error)
