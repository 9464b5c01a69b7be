"""Times beyond the ends of trajectories, joint angles and deformations: one rule, chosen by the user."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.models import JointTrajectory

TIMES = [1.0, 2.0, 4.0]
MESH = rc.shapes.plate(0.3, 0.3)

Series = Callable[..., Any]
Values = Callable[[Any, float], NDArray[np.float64]]


def trajectory(**options: Any) -> rc.Trajectory:
    poses = [rc.Pose.from_rpy([3.0 - 0.3 * t, 0.02 * t**2, 0.0], [0.0, 0.0, 0.1 * t]) for t in TIMES]
    return rc.Trajectory(TIMES, poses, **options)


def joints(**options: Any) -> JointTrajectory:
    return JointTrajectory(TIMES, [[0.1], [0.5], [0.2]], **options)


def deformation(**options: Any) -> rc.Deformation:
    return rc.Deformation(TIMES, [MESH.vertices + 0.01 * t for t in TIMES], **options)


def pose_of(motion: Any, time: float) -> NDArray[np.float64]:
    return np.asarray(motion.poses_at([time])[0])


KINDS: dict[str, tuple[Series, Values, Values]] = {
    "trajectory": (trajectory, pose_of, lambda motion, time: motion.rate_at(time)),
    "joints": (joints, lambda motion, time: motion.angles(time), lambda motion, time: motion.rates(time)),
    "deformation": (deformation, lambda shape, time: shape.at(time), lambda shape, time: shape.rate_at(time)),
}


@pytest.mark.parametrize(("make", "values", "rates"), KINDS.values(), ids=KINDS)
@pytest.mark.parametrize(("end", "outside"), [(1.0, 0.4), (4.0, 5.5)])
def test_series_hold_continue_or_refuse_times_beyond_their_ends(
    make: Series, values: Values, rates: Values, end: float, outside: float
) -> None:
    held, continued, strict = (make(extrapolate=mode) for mode in ("hold", "continue", "error"))
    for same in (held, copy.deepcopy(held), pickle.loads(pickle.dumps(held))):
        assert same.extrapolate == "hold"
        np.testing.assert_array_equal(values(same, outside), values(held, end))
        np.testing.assert_array_equal(rates(same, outside), 0.0)
    # The last column is a place, not turned (tests/motion/test_rates.py has the rates in full).
    moved = values(continued, end) + (outside - end) * rates(continued, end)
    np.testing.assert_allclose(values(continued, outside)[..., -1], moved[..., -1], atol=1e-12)
    name = type(strict).__name__
    for function in (values, rates):
        with pytest.raises(ValueError, match=rf"time: expected 1 to 4 s, the times of this {name}, got {outside:g} s"):
            function(strict, outside)
        function(strict, end + 1e-10 * (outside - end))  # but for rounding
    with pytest.raises(ValueError, match="extrapolate: expected one of 'hold', 'continue', 'error', got 'stop'"):
        make(extrapolate="stop")


def test_body_that_moves_where_its_poses_end_says_once_that_nobody_chose() -> None:
    motion, chosen = trajectory(), trajectory(extrapolate="continue")
    with pytest.warns(UserWarning, match=r"time: expected 1 to 4 s, .*, got 5.5 s: it keeps .* choose by") as caught:
        motion.at(5.5)
    assert [warning.filename for warning in caught] == [__file__]
    for time in (5.5, 0.0):  # said already
        np.testing.assert_array_equal(pose_of(motion, time), pose_of(chosen, time))
        np.testing.assert_array_equal(motion.rate_at(time), chosen.rate_at(time))


def test_vertices_and_what_is_at_rest_where_it_ends_rest_without_a_word() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(joints().angles(9.0), joints().angles(4.0))
        np.testing.assert_array_equal(deformation().at(9.0), deformation().at(4.0))
        still = rc.Trajectory([0.0, 1.0], [rc.Pose([2.0, 0.0, 0.0])] * 2)
        np.testing.assert_array_equal(still.at(9.0).position, [2.0, 0.0, 0.0])
        trajectory().at(4.0)


def test_epochs_are_rounded_without_complaint() -> None:
    start = 1.7e9  # [s]; the spacing of numbers there is 2e-7 s
    motion = rc.Trajectory([start, start + 1.0], [rc.Pose(), rc.Pose([1.0, 0.0, 0.0])], extrapolate="error")
    motion.at(start + 1.0 + 4e-7)
    with pytest.raises(ValueError, match="time: expected"):
        motion.at(start + 1.0 + 1e-5)


def test_frames_after_the_end_hear_of_it() -> None:
    waveform = rc.Waveform(start_frequency=60e9, slope=2e13, sample_rate=2e6, num_samples=32, num_chirps=4)
    body = rc.Body(MESH, motion=trajectory(), name="part")
    simulator = rc.Simulator(rc.Scene([body]), rc.Radar(waveform), resolution=64, sampling="point")
    with pytest.warns(UserWarning, match=r"time: expected 1 to 4 s, the times of this Trajectory, got 4\.5"):
        simulator.frame(4.5)
    body = rc.Body(MESH, motion=trajectory(extrapolate="error"), name="part")
    with pytest.raises(ValueError, match=r"time: expected 1 to 4 s, the times of this Trajectory, got 4\.5"):
        rc.Simulator(rc.Scene([body]), rc.Radar(waveform), resolution=64, sampling="point").frame(4.5)
