"""The rates of every motion are differences of its poses: within, at and beyond the ends, in every mode."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import radarcore as rc
from radarcore.motion.group import Inverse, Motions
from radarcore.motion.protocol import FunctionMotion, poses_at

# Without a choice, motions say once that they go on at the velocity of their end.
pytestmark = pytest.mark.filterwarnings("ignore:.*the velocity")

EXTRAPOLATE = (None, "hold", "continue", "error")
STEP = 1e-5
"""Step of one-sided differences of second order [s]: off by 3e-11 of the third derivative and by 1e-10 of rounding."""
TOLERANCE = 2e-5
"""Tolerance of rates [m/s or 1/s]: third derivatives are below 1e5, a lost rate is 1e-2 or more."""

TIMES = [0.0, 0.4, 1.0, 1.5, 2.0]
POSES = [rc.Pose.from_rpy([k, 0.3 * k**2, np.sin(k)], [0.4 * k, 0.2 * k, -0.5 * k]) for k in range(5)]
TURNING = rc.Linear(rc.Pose([1.0, 2.0, 3.0]), [1.0, -0.5, 0.2], [0.1, 0.3, 0.8])
UR10 = rc.models.RobotArm.ur10()
ANGLES = np.outer([0.0, 0.5, 0.8, 1.0, 1.6], [1.0, -0.7, 0.9, 0.4, 0.3, -1.0])
PLATE = rc.shapes.plate(0.2, 0.1)
SHAPES = [PLATE.vertices * [1.0, 1.0 + 0.2 * k, 1.0] + [0.02 * k**2, 0.0, 0.01 * k] for k in range(5)]
PATH = [[4.0, 0.0], [1.0, 0.0], [1.0, 3.0]]


class Case(NamedTuple):
    """Values over time and their rates; the times of a series, at which derivatives may have steps."""

    values: Callable[[float], NDArray[np.float64]]
    rates: Callable[[float], NDArray[np.float64]]
    times: Sequence[float] = ()


def moved(motion: Any, times: Sequence[float] = ()) -> Case:
    return Case(lambda time: poses_at(motion, [time])[0], motion.rate_at, times)


def swaying(time: float) -> rc.Pose:
    return rc.Pose.from_rpy([np.sin(time), 0.0, 1.0], [0.1 * time, np.cos(time), 0.0])


def updated(live: Any, give: Callable[[float, rc.Pose, bool], None]) -> Any:
    """A live motion with velocities that are given, and that are not."""
    for k, (time, pose) in enumerate(zip(TIMES, POSES, strict=True)):
        give(time, pose, k in (1, 2))
    return live


def live() -> rc.Live:
    body = rc.Live()

    def give(time: float, pose: rc.Pose, with_rates: bool) -> None:
        rates: dict[str, Any] = {"velocity": [1.0, 0.5, 0.0], "angular_velocity": [0.3, 0.0, 0.5]} if with_rates else {}
        body.update(time, pose, **rates)

    return updated(body, give)  # type: ignore[no-any-return]


def group() -> Any:
    bodies = rc.LiveGroup(2)
    updated(bodies, lambda time, pose, _: bodies.update(time, [rc.Pose(), pose]))
    return bodies[1]


def transforms() -> Any:
    ros = rc.adapters.ros
    stamps = [int(1e9 * time) for time in TIMES]
    sent = [
        ros.to_transforms({frame: pose}, time_ns=stamp, frame_id=parent)
        for frame, parent in (("base", "map"), ("arm", "base"), ("head", "base"))
        for stamp, pose in zip(stamps, POSES, strict=True)
    ]
    return ros.TransformTree(sent).motion("arm", within="head", extrapolate="continue")


def captured() -> Any:
    seen = np.array([pose.position for pose in POSES])
    quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (5, 1))
    body = rc.adapters.optitrack.CapturedBody(seen, quaternions, np.full(5, 1e-4))
    return rc.adapters.optitrack.MotionCapture(np.array(TIMES), {"ball": body}).trajectory("ball", max_gap=None)


def deformed(deformation: Any, times: Sequence[float] = ()) -> Case:
    parts = rc.Scene([rc.Body(PLATE, deformation=deformation)]).parts
    return Case(lambda time: parts.vertices_at(0, time), lambda time: parts.vertex_rates_at(0, time), times)


def cases() -> Iterator[tuple[str, Case]]:
    yield "Pose", moved(POSES[1])
    yield "Linear", moved(TURNING)
    yield "Function", moved(FunctionMotion(swaying))
    yield "Attached", moved(rc.Attached(rc.Attached(TURNING, FunctionMotion(swaying)), TURNING))
    yield "Inverse", moved(Inverse(rc.Attached(TURNING, Inverse(FunctionMotion(swaying)))))
    yield "Live", moved(live(), TIMES)
    yield "LiveGroup", moved(group(), TIMES)
    yield "transforms of ROS", moved(transforms(), TIMES)
    yield "motion capture", moved(captured(), TIMES)
    yield "Deformation by a function", deformed(lambda time: SHAPES[1] * (1.0 + 0.1 * np.sin(time)))
    for extrapolate in EXTRAPOLATE:
        yield f"Trajectory, {extrapolate}", moved(rc.Trajectory(TIMES, POSES, extrapolate=extrapolate), TIMES)
        yield f"Deformation, {extrapolate}", deformed(rc.Deformation(TIMES, SHAPES, extrapolate=extrapolate), TIMES)
        for ends in ("rest", "moving"):
            joints = rc.models.JointTrajectory(TIMES, ANGLES, ends=ends, extrapolate=extrapolate)
            yield f"JointTrajectory, {ends}, {extrapolate}", Case(joints.angles, joints.rates, TIMES)
            yield f"RobotArm, {ends}, {extrapolate}", moved(UR10.moving(joints, TURNING).link_motion("tool0"), TIMES)
    for within in ("error", "interpolate"):
        gaps = rc.Trajectory(TIMES, POSES, extrapolate="continue", max_gap=0.5, within_gaps=within)
        yield f"Trajectory with gaps, {within}", moved(gaps, TIMES)
    line = rc.models.cartesian_line(UR10, [0.0, -1.57, 1.57, 1.57, 1.57, 0.0], [0.0, 0.0, -1.0], 0.2, 1.0)
    yield "cartesian_line", moved(UR10.moving(line).link_motion("tool0"), line.times.tolist())
    sweep = UR10.moving(lambda time: [0.5 * time, -1.57, np.sin(time), 1.57, 1.57, 0.0], FunctionMotion(swaying))
    yield "RobotArm by a function", moved(sweep.link_motion("tool0"))
    yield "RobotArm at rest", moved(UR10.moving(np.ones(6), TURNING).link_motion("tool0"))
    for speed in (0.0, 1.4):
        person = rc.models.Human(path=PATH, speed=speed)
        for segment in ("pelvis", "trunk", "right_shank", "left_hand", "right_foot"):
            yield f"Human at {speed} m/s, {segment}", moved(person.segment_motion(segment))


CASES = dict(cases())


def values_of(case: Case, time: float) -> NDArray[np.float64] | None:
    """Values, or None where the motion refuses a time beyond its ends or within a gap."""
    try:
        return case.values(time)
    except ValueError as error:
        if "time: " not in str(error):
            raise
        return None


@pytest.mark.parametrize("name", CASES)
@settings(max_examples=15, deadline=None, derandomize=True)
@given(time=st.one_of(st.floats(-0.09, 2.9), st.sampled_from([*TIMES, TIMES[0] - 0.05, TIMES[-1] + 0.7])))
def test_rates_are_differences_of_poses(name: str, time: float) -> None:
    case = CASES[name]
    near = [values_of(case, time + k * STEP) for k in range(-2, 3)]
    now = near[2]
    if now is None:
        with pytest.raises(ValueError, match="time: "):
            case.rates(time)
        return
    rates = case.rates(time)
    slopes = [
        sign * (4.0 * first - second - 3.0 * now) / (2.0 * STEP)
        for sign, first, second in ((-1.0, near[1], near[0]), (1.0, near[3], near[4]))
        if first is not None and second is not None
    ]
    agree = [np.abs(rates - slope).max() <= TOLERANCE for slope in slopes]
    # The velocity may have a step at the times of a series, as at a held end: either side is right.
    is_at_a_step = any(abs(time - step) <= 2.0 * STEP for step in case.times)
    assert any(agree) if is_at_a_step else all(agree), (time, rates, slopes)


def test_motions_together_have_the_rates_of_each() -> None:
    motions = [POSES[1], TURNING, FunctionMotion(swaying), live(), group(), transforms(), captured()]
    joints = rc.models.JointTrajectory(TIMES, ANGLES, ends="moving", extrapolate="continue")
    motions += [UR10.moving(joints, TURNING).link_motion("tool0")]
    motions += [rc.models.Human(path=PATH).segment_motion("left_hand")]
    motions += [rc.Attached(motion, Inverse(motion)) for motion in motions]
    times = np.array([-0.05, 0.7, 1.5, 2.3])
    together = Motions(motions).rates_at(times)
    single = np.stack([[motion.rate_at(time) for time in times] for motion in motions], axis=1)
    np.testing.assert_allclose(together, single, rtol=0.0, atol=1e-12)
    # A motion and its inverse are at rest.
    np.testing.assert_allclose(together[:, len(motions) // 2 :], 0.0, rtol=0.0, atol=1e-12)
