"""Errors over the frames in which a target is visible and tracked."""

from __future__ import annotations

import numpy as np
import pytest

from radarcore.comparison.targets import Estimates, target_errors
from radarcore.processing.tracking.kalman import Array

NAN = np.nan


def estimates(found: Array, velocity: Array, num_tracks: int = 1, predicted: tuple[int, ...] = ()) -> Estimates:
    is_detected = ~np.isin(np.arange(len(found)), predicted)
    return Estimates(np.arange(len(found)) / 40.0, found, velocity, is_detected, num_tracks)


def test_errors_are_of_the_frames_in_which_a_target_is_visible_and_tracked() -> None:
    true = np.array([2.0, 2.0, 2.0, 2.0, NAN, 2.0])
    found = np.array([2.1, 1.9, 2.5, NAN, 2.0, 1.7])
    errors = target_errors("ball", estimates(found, 0.5 * found, 3), (true, 0.5 * true), (0.4, 0.1))
    assert (errors.name, errors.num_frames, errors.num_tracked, errors.num_tracks) == ("ball", 5, 4, 3)
    # 0.1, -0.1, 0.5, -0.3 m
    assert errors.range.bias == pytest.approx(0.0)
    assert errors.range.median == pytest.approx(0.2)
    assert errors.range.rms == pytest.approx(0.3)  # sqrt((0.01 + 0.01 + 0.25 + 0.09) / 4)
    assert errors.range.largest == pytest.approx(0.5)
    assert errors.range.percentile_95 == pytest.approx(0.3 + 0.85 * 0.2)  # of four: at 0.95 * 3 = 2.85 from the least
    assert errors.range.median_bins == pytest.approx(0.5)
    assert (errors.range.num_within, errors.range_share) == (2, 0.4)  # below 0.2 m, of 5
    # 0.05, -0.05, 0.25, -0.15 m/s, below 0.1 m/s
    assert (errors.velocity.num_within, errors.velocity_share) == (2, 0.4)


def test_predicted_frames_are_counted_by_themselves_and_have_no_errors() -> None:
    true, found = np.full(5, 2.0), np.array([2.1, 2.1, 5.0, 2.1, NAN])
    errors = target_errors("ball", estimates(found, found, predicted=(2, 3, 4)), (true, true), (0.4, 0.1))
    assert (errors.num_frames, errors.num_tracked, errors.num_predicted) == (5, 4, 2)
    assert errors.range.largest == errors.velocity.largest == pytest.approx(0.1)
    assert errors.range.num_within == 3  # a prediction counts where it is right


def test_target_that_was_never_seen_has_no_errors() -> None:
    nothing = np.full(3, NAN)
    errors = target_errors("ball", estimates(nothing, nothing, 0), (nothing, nothing), (0.1, 0.1))
    assert (errors.num_frames, errors.num_tracked, errors.range.num_within) == (0, 0, 0)
    assert np.isnan([errors.range.median, errors.velocity.largest, errors.range_share]).all()


def test_velocities_that_a_radar_does_not_tell_are_no_errors() -> None:
    errors = target_errors("ball", estimates(np.ones(3), np.full(3, NAN)), (np.ones(3), np.ones(3)), (0.1, 0.1))
    assert errors.range.largest == 0.0
    assert errors.velocity.num_within == 0
    assert np.isnan(errors.velocity.median)
