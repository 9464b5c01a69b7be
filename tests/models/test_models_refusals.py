"""Refusals of arms, joints, people and their paths name the argument, the expected and the given value."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from arms import CHECK_POSE, some_trajectory
from radarcore.models import Human, JointTrajectory, RobotArm
from radarcore.models.people.path import FloorPath
from radarcore.models.robots.joint import Joint
from radarcore.models.robots.line import cartesian_line

UR10 = RobotArm.ur10()
ALONG = [1.0, 0.0, 0.0]


def ring() -> RobotArm:
    joints = [Joint("a", "one", "two", kind="fixed"), Joint("b", "two", "one", kind="fixed")]
    return RobotArm(joints, {"base": None, "one": None, "two": None})


def line(direction: list[float], speed: float, duration: float) -> object:
    return cartesian_line(UR10, CHECK_POSE, direction, speed, duration)


def path(*waypoints: list[float]) -> FloorPath:
    return FloorPath(waypoints, 0.4)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: Human(speed=3.5), ValueError, r"speed: expected at most 2.78 m/s for a height of 1.75 m .* got 3.5"),
        (lambda: Human(breathing=0.0), ValueError, r"breathing: expected a positive number \[Hz\], got 0.0"),
        (lambda: Human(breathing=float("nan")), ValueError, r"breathing: expected a finite number \[Hz\], got nan"),
        (lambda: Human(breathing="slow"), TypeError, r"breathing: expected a number \[Hz\], got 'slow'"),
        (lambda: Human(path=[[0, 0]]), ValueError, "path: expected at least two waypoints, got 1"),
        (lambda: Human().segment_motion("tail"), ValueError, r"name: expected one of 'pelvis', .* got 'tail'"),
        (lambda: path([0, 0], [1, 0], [1, 0]), ValueError, "successive waypoints to differ, got the same at 1 and 2"),
        (lambda: path([0, 0], [5, 0], [0, 0]), ValueError, "turn of 180 degrees at waypoint 1 .* two right angles"),
        (
            lambda: path([0, 0], [5, 0], [5, 1], [0, 1]),
            ValueError,
            r"from waypoint 1 to 2: .* least 1.45 m, got 1;",
        ),
        (lambda: RobotArm.named("ur6"), KeyError, r"no arm 'ur6'; did you mean .*'ur5'"),
        (lambda: UR10.link_pose("tool", CHECK_POSE), KeyError, "no link 'tool'; did you mean 'tool0'"),
        (lambda: UR10.moving(CHECK_POSE).link_motion("fore_arm_link"), KeyError, "did you mean 'forearm_link'"),
        (lambda: UR10.link_pose("tool0", {"elbow": 1.0}), KeyError, "joint 'elbow'; did you mean 'elbow_joint'"),
        (lambda: UR10.link_pose("tool0", CHECK_POSE[:5]), ValueError, r"joint_angles: expected shape \(6,\), got \(5,"),
        (lambda: UR10.moving(some_trajectory(3)), ValueError, r"joint_motion: expected shape \(6,\), got \(3,\)"),
        (lambda: JointTrajectory([0.0], [[1.0]]), ValueError, "times: expected at least two, got 1"),
        (
            lambda: line([0.0, 1.0, 0.0], 2.0, 0.6),
            ValueError,
            "too much of the arm: joint 'shoulder_pan_joint' moves at",
        ),
        (lambda: line([0.0, 0.0, 0.0], 0.25, 1.0), ValueError, "direction: expected a direction, got zero"),
        (lambda: line(ALONG, 0.25, 0.4), ValueError, "duration: expected at least two ramps, 0.5 s, got 0.4"),
        (lambda: line(ALONG, 1e-9, 1e9), ValueError, "duration: expected at most 3600 s, got 1e.09"),
        (lambda: Joint("j", "a", "b", kind="ball"), ValueError, "kind: expected one of"),  # type: ignore[arg-type]
        (lambda: Joint("j", "a", "b", kind="revolute"), ValueError, "a direction for a revolute joint, got None for"),
        (lambda: Joint("j", "a", "b", kind="fixed", axis=(0, 0, 1)), ValueError, "axis: expected None for a fixed"),
        (lambda: Joint("j", "a", "b", axis=(0, 0, 0)), ValueError, "axis: expected a direction, got zero"),
        (ring, ValueError, "hang on 'base', got a ring of"),
    ],
)
def test_refusals_of_models_name_the_argument(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()
