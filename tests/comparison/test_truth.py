"""Truth of motions and of recordings, at any time."""

from __future__ import annotations

import numpy as np
import pytest

import radarcore as rc
from radarcore.comparison.truth import MovingTargets, RecordedTruth, nearest_points
from radarcore.motion.group import Inverse

TIMES = np.array([0.0, 0.1, 0.35])
NAN = np.nan


def test_truth_of_a_motion_is_that_of_its_origin_less_the_radius() -> None:
    ball = rc.Linear(rc.Pose([3.0, 4.0, 0.0]), velocity=[1.0, 0.0, 0.0], angular_velocity=[0.0, 0.0, 5.0])
    truth = MovingTargets({"ball": ball}, radii={"ball": 0.2}).at(TIMES)
    x = 3.0 + TIMES
    np.testing.assert_allclose(truth.range[:, 0], np.hypot(x, 4.0) - 0.2)
    np.testing.assert_allclose(truth.velocity[:, 0], x / np.hypot(x, 4.0))
    np.testing.assert_allclose(truth.azimuth[:, 0], np.arctan2(4.0, x))
    np.testing.assert_allclose(truth.elevation[:, 0], 0.0)


def test_radar_may_move_and_turn() -> None:
    radar = rc.Linear(rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2]), velocity=[0.0, 0.5, 0.0])
    truth = MovingTargets({"post": rc.PointTarget([1.0, 2.0, 0.0])}, radar).at(TIMES)
    np.testing.assert_allclose(truth.range[:, 0], 2.0 - 0.5 * TIMES)
    np.testing.assert_allclose(truth.velocity[:, 0], -0.5)
    np.testing.assert_allclose(truth.azimuth[:, 0], 0.0, atol=1e-12)


def test_truth_of_a_body_is_its_nearest_point_as_the_simulator_has_it() -> None:
    motion = rc.Linear(rc.Pose([2.0, 0.3, 0.1]), velocity=[-1.0, 0.5, 0.0], angular_velocity=[0.0, 0.0, 1.0])
    body = rc.Body(rc.shapes.box([0.3, 0.2, 0.4]), motion=motion, name="box")
    radar = rc.bgt60tr13c(num_chirps=16)
    frame = rc.Simulator(rc.Scene([body]), radar).frame(0.2)
    assert frame.truth is not None
    truth = MovingTargets({"box": body}).at([0.2 + 0.5 * radar.waveform.duration])
    # The rays hit it in points close to each other.
    assert truth.range[0, 0] == pytest.approx(frame.truth.range[0], abs=1e-3)
    assert truth.velocity[0, 0] == pytest.approx(frame.truth.velocity[0], abs=3e-3)
    assert truth.azimuth[0, 0] == pytest.approx(frame.truth.azimuth[0], abs=1e-3)


def test_nearest_points_of_a_box_are_on_faces_edges_and_corners() -> None:
    mesh = rc.shapes.box(2.0)
    places = np.array([[3.0, 0.2, -0.4], [4.0, 5.0, 0.5], [-2.0, 3.0, 7.0], [0.0, 0.0, 1.5]])
    expected = np.clip(places, -1.0, 1.0)
    np.testing.assert_allclose(nearest_points(places, mesh.vertices[mesh.triangles]), expected, atol=1e-12)


def test_gaps_of_motions_and_what_is_behind_the_radar_have_no_truth() -> None:
    poses = [rc.Pose([x, 0.0, 0.0]) for x in (2.0, 2.1, 2.2, 3.0, 3.1)]
    caught = rc.Trajectory([0.0, 0.1, 0.2, 1.0, 1.1], poses, max_gap=0.2)
    behind = rc.Pose([-2.0, 0.0, 0.0])
    truth = MovingTargets({"caught": caught, "behind": behind}).at([-0.1, 0.15, 0.5, 1.05, 1.2])
    assert np.isfinite(truth.range[:, 0]).tolist() == [False, True, False, True, False]
    assert np.isnan(truth.range[:, 1]).all()
    attached = rc.Attached(caught, rc.Pose([0.0, 0.0, 0.1]))
    assert np.isnan(MovingTargets({"on top": attached}).at([0.5]).range).all()
    # A frame of TF in another one that moves: the way back to the common root has gaps too.
    back = rc.Attached(Inverse(caught), rc.Pose([9.0, 0.0, 0.0]))
    seen = MovingTargets({"back": back})
    assert np.isfinite(seen.at([0.15, 0.5, 1.05]).range[:, 0]).tolist() == [True, False, True]
    assert seen.span == (0.0, 1.1)
    assert MovingTargets({"caught": caught, "still": rc.Pose([1.0, 0.0, 0.0])}).span == (0.0, 1.1)
    assert MovingTargets({"still": rc.Pose([1.0, 0.0, 0.0])}).span is None


def recorded(times: list[float]) -> RecordedTruth:
    """A target that accelerates at 2 m/s^2, lost in the fifth frame."""
    t = np.array(times)
    columns = np.stack([1.0 + 0.5 * t + t**2, 0.5 + 2.0 * t, 0.1 * t, 0.0 * t])[:, :, None]
    columns[:, 4] = NAN
    return RecordedTruth(t, rc.Truth(("ball",), *columns))


def test_recorded_truth_is_continued_between_frames_but_not_across_gaps() -> None:
    truth = recorded([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 1.5])
    t = np.array([0.0, 0.025, 0.15, 0.2, 0.55])
    found = truth.at(t)
    np.testing.assert_allclose(found.range[:, 0], 1.0 + 0.5 * t + t**2)  # a cubic is exact for a parabola
    np.testing.assert_allclose(found.velocity[:, 0], 0.5 + 2.0 * t)
    unknown = truth.at([-0.01, 0.35, 0.4, 0.45, 1.0, 1.6])
    assert np.isnan(unknown.range).all()
    assert truth.at([1.5]).range[0, 0] == pytest.approx(1.0 + 0.75 + 2.25)


def test_targets_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="radii: expected names of the truth, got 'bal'; did you mean 'ball'"):
        MovingTargets({"ball": rc.Pose()}, radii={"bal": 0.1})
    with pytest.raises(TypeError, match=r"truth\['ball'\]: expected Pose, Linear, "):
        MovingTargets({"ball": 3.0})


def test_recorded_truth_is_as_exact_by_clocks_that_count_since_1970() -> None:
    """Float64 seconds since 1970 are known to 0.2 us; truth must not belong to a neighbouring frame."""
    times, ranges = np.array([0.0, 0.05, 0.1]), np.array([2.0, 2.05, 2.1])
    rows = (ranges[:, None], np.ones((3, 1)), np.zeros((3, 1)), np.zeros((3, 1)))
    epoch = 1_700_000_000.0
    truth = RecordedTruth(epoch + times, rc.Truth(("cart",), *rows)).at(epoch + np.array([-0.01, 0.05, 0.08, 0.1, 0.2]))
    np.testing.assert_allclose(truth.range[:, 0], [NAN, 2.05, 2.08, 2.1, NAN], atol=1e-6)
