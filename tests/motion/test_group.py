"""Motions evaluated together: equal to every motion by itself, and each function of time evaluated once."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.models.robots.arm import RobotArm
from radarcore.motion.group import Inverse, Motions, is_static
from radarcore.motion.protocol import FunctionMotion, derivative, poses_at

TIMES = np.array([0.2, 0.9, 1.7])


def test_attached_motions_of_all_depths_are_those_by_themselves() -> None:
    turning = rc.Linear(rc.Pose([1.0, 2.0, 3.0]), [1.0, 0.0, 0.0], [0.0, 0.3, 0.2])
    swaying = FunctionMotion(lambda time: rc.Pose.from_rpy([np.sin(time), 0.0, 1.0], [0.1 * time, time, 0.0]))
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


class Counted:
    """A motion that counts its evaluations."""

    def __init__(self) -> None:
        self.asked = {"poses": 0, "rates": 0}

    def at(self, time: float) -> rc.Pose:
        self.asked["poses"] += 1
        return rc.Pose.from_rpy([time, 0.0, 1.0], [0.1 * time, 0.0, 0.2])

    def rate_at(self, time: float) -> np.ndarray:
        self.asked["rates"] += 1
        return derivative(lambda when: poses_at(FunctionMotion(Counted().at), [when])[0], time)


def chain(links: list[Any]) -> Any:
    return reduce(rc.Attached, links)


def lattice(counted: list[Any]) -> Any:
    """Twenty levels whose factors are both the level below: a million factors of one motion."""
    return reduce(lambda motion, _: rc.Attached(motion, motion), range(20), counted[0])


def with_inverses(counted: list[Any]) -> Any:
    return reduce(lambda motion, link: Inverse(rc.Attached(motion, Inverse(link))), counted)


@pytest.mark.parametrize("shape", [chain, lattice, with_inverses])
def test_every_motion_in_a_tree_of_attached_ones_is_evaluated_once(shape: Callable[[list[Any]], Any]) -> None:
    counted = [Counted() for _ in range(20)]
    used = counted[:1] if shape is lattice else counted
    motion = shape(list(counted))
    pose = motion.at(0.3)
    assert [each.asked for each in used] == [{"poses": 1, "rates": 0}] * len(used)
    rate = motion.rate_at(0.3)
    assert [each.asked for each in used] == [{"poses": 2, "rates": 1}] * len(used)
    together = Motions([motion, rc.Attached(motion, motion)])
    assert np.array_equal(together.poses_at(np.array([0.3]))[0, 0, :, 3], pose.position)
    np.testing.assert_allclose(together.rates_at(np.array([0.3]))[0, 0], rate, rtol=1e-12, atol=1e-12)
    assert [each.asked for each in used] == [{"poses": 4, "rates": 2}] * len(used)


def test_sharing_costs_no_time_where_nothing_moves_nor_where_something_is_live() -> None:
    live = rc.Live()
    for factor, expected in ((rc.Pose([1e-3, 0.0, 0.0]), None), (live, -np.inf)):
        motion = reduce(lambda motion, _: rc.Attached(motion, motion), range(40), factor)
        assert motion.newest == expected
        assert is_static(motion) == (expected is None)
        assert Motions([motion]).newest == expected
    live.update(3.0, rc.Pose())
    assert motion.newest == 3.0


def test_links_of_one_arm_take_one_evaluation_wherever_they_occur() -> None:
    asked: list[float] = []

    def angles(time: float) -> np.ndarray:
        asked.append(time)
        return np.full(6, time)

    moving = RobotArm.ur10().moving(angles)
    rc.Attached(moving.link_motion("tool0"), rc.Attached(moving.link_motion("forearm_link"), rc.Pose())).at(0.5)
    assert asked == [0.5]


def test_subclass_of_attached_has_the_poses_that_it_says() -> None:
    class Lifted(rc.Attached):
        def poses_at(self, times: Any) -> Any:
            poses = super().poses_at(times).copy()
            poses[:, 2, 3] += 1.0
            return poses

    lifted = Lifted(rc.Pose([1.0, 0.0, 0.0]), FunctionMotion(lambda time: rc.Pose([time, 0.0, 0.0])))
    for motion in (lifted, rc.Attached(lifted)):
        assert motion.at(0.5).position.tolist() == [1.5, 0.0, 1.0]
        assert Motions([motion]).poses_at(np.array([0.5]))[0, 0, :, 3].tolist() == [1.5, 0.0, 1.0]
