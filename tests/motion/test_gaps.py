"""Trajectories with gaps: pieces of their own, times that are known, refusal or interpolation within gaps."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import radarcore as rc

# Two pieces, 0 to 0.4 s and 1 to 1.3 s, and a pose alone in between, at 0.7 s.
TIMES = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.7, 1.0, 1.1, 1.2, 1.3])


def pose_at(t: float) -> rc.Pose:
    return rc.Pose.from_rpy([np.sin(2.0 * t), t**2, 0.1], [0.3 * t, 0.0, np.cos(t)])


POSES = [pose_at(t) for t in TIMES]
GAPPED = rc.Trajectory(TIMES, POSES, max_gap=0.15, extrapolate="continue")
WHOLE = rc.Trajectory(TIMES, POSES, extrapolate="continue")


def test_gaps_are_bounded_by_the_poses_around_them() -> None:
    np.testing.assert_array_equal(GAPPED.gaps, [[0.4, 1.0]])
    np.testing.assert_array_equal(GAPPED.times, TIMES[TIMES != 0.7])
    assert len(GAPPED.poses) == 9
    assert rc.Trajectory(TIMES, POSES, max_gap=0.31).gaps.shape == WHOLE.gaps.shape == (0, 2)


def test_times_are_known_within_pieces_alone() -> None:
    asked = [-0.01, 0.0, 0.25, 0.4, 0.41, 0.7, 0.99, 1.0, 1.3, 1.31]
    np.testing.assert_array_equal(
        GAPPED.known(asked), [False, True, True, True, False, False, False, True, True, False]
    )
    np.testing.assert_array_equal(WHOLE.known(asked), [False, *[True] * 8, False])
    assert GAPPED.known(0.4 + 1e-10)  # rounding of a time that was computed in another way
    assert not GAPPED.known(0.4 + 1e-8)


def test_each_piece_is_the_trajectory_of_its_own_poses() -> None:
    for part in (slice(0, 5), slice(6, 10)):
        alone = rc.Trajectory(TIMES[part], POSES[part])
        asked = np.linspace(TIMES[part][0], TIMES[part][-1], 31)
        np.testing.assert_array_equal(GAPPED.poses_at(asked), alone.poses_at(asked))
        np.testing.assert_array_equal(GAPPED.rate_at(asked[7]), alone.rate_at(asked[7]))
    mixed = GAPPED.poses_at([1.15, 0.05, 1.25, -0.2, 1.5])
    np.testing.assert_array_equal(mixed, np.concatenate([GAPPED.poses_at([t]) for t in (1.15, 0.05, 1.25, -0.2, 1.5)]))


@pytest.mark.parametrize("ask", ["at", "rate_at", "poses_at"])
def test_time_within_a_gap_is_an_error_that_names_it(ask: str) -> None:
    message = (
        r"time: 0\.7 s is within a gap of this Trajectory, from 0\.4 to 1 s; ask known\(times\) before, "
        r"or bridge gaps by a larger max_gap or within_gaps='interpolate'"
    )
    with pytest.raises(ValueError, match=message):
        getattr(GAPPED, ask)([0.1, 0.7] if ask == "poses_at" else 0.7)


def test_gaps_are_interpolated_where_that_is_chosen_and_still_told() -> None:
    # The pose alone is left out there, too.
    kept = TIMES != 0.7
    expected = rc.Trajectory(TIMES[kept], [pose_at(t) for t in TIMES[kept]])
    bridged = rc.Trajectory(TIMES, POSES, max_gap=0.15, within_gaps="interpolate")
    asked = np.linspace(0.0, 1.3, 40)
    np.testing.assert_array_equal(bridged.poses_at(asked), expected.poses_at(asked))
    np.testing.assert_array_equal(bridged.rate_at(0.7), expected.rate_at(0.7))
    np.testing.assert_array_equal(bridged.gaps, [[0.4, 1.0]])
    assert not bridged.known(0.7)


def test_poses_alone_at_the_ends_are_left_out() -> None:
    motion = rc.Trajectory([0.0, 1.0, 1.1, 2.0], [pose_at(t) for t in (0.0, 1.0, 1.1, 2.0)], max_gap=0.2)
    np.testing.assert_array_equal(motion.times, [1.0, 1.1])
    assert motion.gaps.shape == (0, 2)


def test_gaps_are_read_only_and_survive_pickling() -> None:
    with pytest.raises(ValueError, match="read-only"):
        GAPPED.gaps[...] = 0.0
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(GAPPED)).gaps, GAPPED.gaps)


def test_steps_of_just_the_largest_gap_are_none() -> None:
    times = np.arange(50) * 0.1  # steps differ from 0.1 by rounding
    assert rc.Trajectory(times, [pose_at(t) for t in times], max_gap=0.1).gaps.shape == (0, 2)
