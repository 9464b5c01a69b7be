"""Motions of an arm: trajectories of its joints, and straight lines of the tool."""

import math
import re
import warnings

import numpy as np
import pytest

from arms import CHECK_POSE, ROUNDING
from radarcore.models.robots.arm import RobotArm
from radarcore.models.robots.joint import JointTrajectory
from radarcore.models.robots.line import cartesian_line


@pytest.fixture(scope="module")
def ur10():
    return RobotArm.ur10()


# Trajectories of the joints


def test_joint_trajectory_passes_its_knots_smoothly_and_rests_at_both_ends():
    times = np.array([1.0, 1.5, 2.5, 3.0])
    angles = np.random.default_rng(5).normal(size=(4, 2))
    motion = JointTrajectory(times, angles)
    for time, row in zip(times, angles, strict=True):
        np.testing.assert_allclose(motion.angles(time), row, atol=ROUNDING)
    for time in (0.0, 1.0):
        np.testing.assert_allclose(motion.angles(time), angles[0], atol=ROUNDING)
    np.testing.assert_allclose(motion.angles(9.0), angles[-1], atol=ROUNDING)
    for time in (0.0, 1.0, 3.0, 9.0):
        np.testing.assert_allclose(motion.rates(time), 0.0, atol=100 * ROUNDING)
    # C2: velocity is continuous, and so is its slope across the knots, up to a step's worth of the third derivative.
    step = 1e-6
    for knot in (1.5, 2.5):
        left = (motion.rates(knot) - motion.rates(knot - step)) / step
        right = (motion.rates(knot + step) - motion.rates(knot)) / step
        np.testing.assert_allclose(left, right, atol=1e-3)  # the third derivative is of order 100
    difference = (motion.angles(2.0 + step) - motion.angles(2.0 - step)) / (2.0 * step)
    np.testing.assert_allclose(motion.rates(2.0), difference, atol=1e-8)


def test_joint_trajectory_of_a_measurement_moves_at_its_ends():
    """Straight lines stay straight; by default they would bend, to begin and end at rest."""
    times = np.array([0.0, 0.1, 0.25, 0.4])
    angles = times[:, None] * [1.0, -2.0] + [0.1, 0.2]
    motion = JointTrajectory(times, angles, ends="moving")
    for time in (0.0, 0.17, 0.4):
        np.testing.assert_allclose(motion.rates(time), [1.0, -2.0], atol=1e-12)
        np.testing.assert_allclose(motion.angles(time), time * np.array([1.0, -2.0]) + [0.1, 0.2], atol=1e-12)
    np.testing.assert_allclose(JointTrajectory(times, angles).rates(0.0), [0.0, 0.0], atol=1e-12)
    with pytest.raises(ValueError, match="ends: expected one of 'rest', 'moving', got 'free'"):
        JointTrajectory(times, angles, ends="free")


def test_joints_beyond_their_limits_are_named_with_the_values(ur10):
    # From rest to rest over 2 rad in 1 s: a cubic with its peak of 1.5 x 2 rad/s in the middle, away from the knots.
    elbow = np.zeros((2, 6))
    elbow[1, 0] = 2.0
    with pytest.warns(UserWarning, match=r"'shoulder_pan_joint' moves at 3 rad/s at 0.5 s, its limit is 2.16 rad/s"):
        JointTrajectory([0.0, 1.0], elbow, arm=ur10)
    # Rest at 3.1 rad between slopes: the spline overshoots pi between the knots, which keep to it.
    elbow = np.zeros((4, 6))
    elbow[:, 2] = [0.0, 3.1, 3.1, 0.0]
    with pytest.warns(UserWarning, match=r"'elbow_joint' is at 3.* rad at 7.5 s, its limits are -3.1"):
        JointTrajectory([0.0, 5.0, 10.0, 15.0], elbow, arm=ur10)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        JointTrajectory([0.0, 2.0], [CHECK_POSE, CHECK_POSE + 0.5], arm=ur10)
    with pytest.raises(ValueError, match=r"angles: expected shape \(2, 6\)"):
        JointTrajectory([0.0, 1.0], [[0.0], [1.0]], arm=ur10)


# Straight lines


@pytest.mark.parametrize("direction", [(0.0, 3.0, 0.0), (0.0, 0.0, 1e200), (-0.3, 0.5, 0.4)])
def test_line_is_straight_at_constant_speed_and_keeps_the_orientation(ur10, direction):
    speed, duration, ramp = 0.25, 1.5, 0.25
    line = cartesian_line(ur10, CHECK_POSE, direction, speed, duration, start_time=2.0)
    tool = ur10.moving(line).link_motion("tool0")
    start, unit = ur10.link_pose("tool0", CHECK_POSE), np.array(direction) / math.hypot(*direction)
    for time in 2.0 + np.random.default_rng(7).uniform(0.0, duration, 60):
        pose, velocity = tool.at(time), tool.rate_at(time)[:, 3]
        way = pose.position - start.position
        assert np.linalg.norm(way - (way @ unit) * unit) < 2e-6  # the bound that is promised, in any direction
        np.testing.assert_allclose(pose.rotation, start.rotation, atol=2e-6)
        if ramp <= time - 2.0 <= duration - ramp:
            np.testing.assert_allclose(velocity, speed * unit, atol=1e-3)
    # It begins and ends at rest over a distance of speed x (duration - ramp), and the knots are exact.
    end = start.position + speed * (duration - ramp) * unit
    np.testing.assert_allclose(tool.at(9.0).position, end, atol=1e-9)
    np.testing.assert_allclose(tool.rate_at(2.0)[:, 3], 0.0, atol=1e-9)
    np.testing.assert_allclose(tool.rate_at(3.5)[:, 3], 0.0, atol=1e-9)
    for time, row in zip(line.times, [line.angles(t) for t in line.times], strict=True):
        way = ur10.link_pose("tool0", row).position - start.position
        assert np.linalg.norm(way - (way @ unit) * unit) < 1e-9, time


def test_ramps_of_a_line_have_a_bounded_acceleration(ur10):
    speed, ramp = 0.25, 0.25
    line = cartesian_line(ur10, CHECK_POSE, [1.0, 0.0, 0.0], speed, 1.0, ramp_time=ramp)
    tool, step = ur10.moving(line).link_motion("tool0"), 1e-3
    times = np.arange(-0.05, 1.05, step)
    velocity = np.array([tool.rate_at(t)[0, 3] for t in times])
    acceleration = np.diff(velocity) / step
    assert np.abs(acceleration).max() <= 1.5 * speed / ramp * 1.01
    # Continuous: no step larger than the jerk 6 speed / ramp^2 makes in one sample; a jump to 1 m/s^2 would be 40 x it.
    assert np.abs(np.diff(acceleration)).max() < 1.5 * 6.0 * speed / ramp**2 * step


def test_line_ends_where_the_arm_is_stretched(ur10):
    # Without a turn of the base, wrist_1 moves along the line as the tool does, until the arm is stretched.
    wrist = ur10.link_pose("wrist_1_link", CHECK_POSE).position
    reach = np.sqrt((0.612 + 0.5723) ** 2 - (wrist[2] - 0.1273) ** 2) - wrist[0]
    with pytest.raises(ValueError, match="leaves the reach of 'tool0'") as refusal:
        cartesian_line(ur10, CHECK_POSE, [1.0, 0.0, 0.0], 0.25, 8.0)
    found = re.search(r"after (0\.\d+) of 1\.938 m", str(refusal.value))
    assert found is not None
    assert reach - 0.25 * 20e-3 < float(found[1]) < reach + 5e-4  # one distance of knots; the last digit
    # It is accepted up to 5 mm before that: the line ends slowly, which keeps the elbow within its rate.
    cartesian_line(ur10, CHECK_POSE, [1.0, 0.0, 0.0], 0.25, (reach - 0.005) / 0.25 + 0.25)


def test_line_to_a_target_ends_there(ur10):
    start = ur10.link_pose("tool0", CHECK_POSE).position
    target = start + np.array([0.1, -0.2, 0.15])
    way = target - start
    line = cartesian_line(ur10, CHECK_POSE, way, 0.25, np.linalg.norm(way) / 0.25 + 0.25)
    np.testing.assert_allclose(ur10.link_pose("tool0", line.angles(99.0)).position, target, atol=1e-9)
