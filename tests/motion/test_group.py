"""Motions evaluated together: equal to every motion by itself, and each function of time evaluated once."""

from __future__ import annotations

import numpy as np

import radarcore as rc
from radarcore.models.robots.arm import RobotArm
from radarcore.motion.group import Motions
from radarcore.motion.protocol import poses_at

TIMES = np.array([0.2, 0.9, 1.7])


def test_attached_motions_of_all_depths_are_those_by_themselves() -> None:
    turning = rc.Linear(rc.Pose([1.0, 2.0, 3.0]), [1.0, 0.0, 0.0], [0.0, 0.3, 0.2])
    swaying = rc.Function(lambda time: rc.Pose.from_rpy([np.sin(time), 0.0, 1.0], [0.1 * time, time, 0.0]))
    spline = rc.Trajectory([0.0, 1.0, 2.0], [rc.Pose(), rc.Pose.from_rpy([1, 1, 0], [0, 0.5, 0]), rc.Pose([0, 2, 1])])
    once = rc.Attached(turning, spline)
    twice = rc.Attached(once, swaying)
    both = rc.Attached(twice, rc.Attached(swaying, once))
    at_rest = rc.Attached(rc.Pose([1.0, 0.0, 0.0]), rc.Pose([0.0, 1.0, 0.0]))
    # The order of bodies is the user's: carriers before and after what they carry.
    motions = [both, once, turning, at_rest, twice, swaying, spline, once]
    together = Motions(motions)
    poses = np.stack([poses_at(motion, TIMES) for motion in motions], axis=1)
    rates = np.stack([[motion.rate_at(time) for time in TIMES] for motion in motions], axis=1)
    np.testing.assert_allclose(together.poses_at(TIMES), poses, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(together.rates_at(TIMES), rates, rtol=0.0, atol=1e-14)


def test_links_and_a_sensor_on_one_of_them_take_one_evaluation() -> None:
    asked: list[float] = []

    def angles(time: float) -> np.ndarray:
        asked.append(time)
        return np.full(6, time)

    moving = RobotArm.ur10().moving(angles)
    sensor = rc.Attached(moving.link_motion("tool0"), rc.Pose([0.0, 0.0, 0.05]))
    Motions([*(body.motion for body in moving.bodies()), sensor]).poses_at(TIMES)
    assert asked == TIMES.tolist()


def test_function_that_carries_several_bodies_is_evaluated_once() -> None:
    asked: list[float] = []

    def carrier(time: float) -> rc.Pose:
        asked.append(time)
        return rc.Pose([time, 0.0, 0.0])

    platform = rc.Function(carrier)
    carried = [rc.Attached(platform, rc.Pose([0.0, y, 0.0])) for y in (0.0, 1.0, 2.0)]
    Motions([platform, *carried]).poses_at(TIMES)
    assert asked == TIMES.tolist()
