"""Straight lines of the tool."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import scaled
from radarcore.geometry.rotation import Matrix
from radarcore.models.robots.arm import RobotArm
from radarcore.models.robots.joint import JointAngles, JointTrajectory

# Bound on the distance of the tool from its place on the line [m], and of its orientation [rad], between knots.
LINE_ERROR = 1e-6

# Newton's iteration at the knots ends below this [m, rad] ...
_KNOT_ERROR = 1e-10
_MAX_ITERATIONS = 30
# ... takes no step above this [rad or m], and is damped by this [m or 1]: enough to end at a singular pose.
_MAX_STEP = 0.2
_DAMPING = 1e-4

# First distance of knots, and the shortest before the line counts as not feasible [s].
_KNOT_INTERVAL = 20e-3
_MIN_KNOT_INTERVAL = 0.5e-3

# Longest duration [s]: minutes of work, and megabytes of knots.
_MAX_DURATION = 3600.0


def cartesian_line(
    arm: RobotArm,
    start_angles: JointAngles,
    direction: ArrayLike,
    speed: float,
    duration: float,
    *,
    ramp_time: float = 0.25,
    start_time: float = 0.0,
    link: str = "tool0",
) -> JointTrajectory:
    """Joint motion that moves a link along a straight line at constant speed and keeps its orientation.

    The speed rises over `ramp_time` as ``speed (3 u^2 - 2 u^3)`` and falls likewise, with a continuous acceleration
    of at most ``1.5 speed / ramp_time``; the line is ``speed (duration - ramp_time)`` long. To reach a target at
    ``d = target - start``, pass ``d`` and ``norm(d) / speed + ramp_time``.

    Parameters
    ----------
    arm : RobotArm
    start_angles : (num_joints,) array_like, or mapping
        Joint angles [rad] where the line begins.
    direction : (3,) array_like
        In the coordinates of the root link, of any length.
    speed : float
        In the middle part [m/s].
    duration : float
        From rest to rest [s]: at least twice `ramp_time`, at most an hour.
    ramp_time, start_time : float
        Length of each of the two ramps, and when the motion begins [s].
    link : str
        Link whose origin stays on the line.

    Returns
    -------
    JointTrajectory
        Between its knots, with at most 20 ms between them, the link is within 1e-6 m of its place on the line and
        within 1e-6 rad of its orientation (checked three times in every interval).

    Raises
    ------
    ValueError
        When the line leaves the arm's reach, comes too near a singular pose, or asks a joint for more than its limits;
        says where.

    See Also
    --------
    models.JointTrajectory : The result.
    RobotArm.moving : Takes it.

    Examples
    --------
    >>> arm, start = rc.models.RobotArm.ur10(), [0.0, -1.57, 1.57, 1.57, 1.57, 0.0]
    >>> line = rc.models.cartesian_line(arm, start, direction=[0.0, 0.0, -1.0], speed=0.2, duration=1.0)
    >>> before, after = (arm.link_pose("tool0", line.angles(time)).position for time in (0.0, 1.0))
    >>> (after - before).round(3) + 0.0
    array([ 0.  ,  0.  , -0.15])
    """
    angles = arm.joint_array(start_angles)
    start = arm.link_pose(link, angles)
    unit = scaled(check.array("direction", direction, (3,)))
    if not (norm := np.linalg.norm(unit)) > 0.0:
        raise ValueError("direction: expected a direction, got zero")
    unit = unit / norm
    speed, ramp_time = check.positive("speed", speed, "m/s"), check.positive("ramp_time", ramp_time, "s")
    duration, start_time = check.positive("duration", duration, "s"), check.number("start_time", start_time, "s")
    if duration < 2.0 * ramp_time:
        raise ValueError(f"duration: expected at least two ramps, {2.0 * ramp_time:g} s, got {duration:g}")
    if duration > _MAX_DURATION:
        raise ValueError(f"duration: expected at most {_MAX_DURATION:g} s, got {duration:g}")
    length = speed * (duration - ramp_time)

    def distance_travelled(times: Matrix) -> Matrix:
        """Distance travelled [m], symmetric about the middle of the time."""
        past = np.minimum(times, duration - times)
        u = np.clip(past / ramp_time, 0.0, 1.0)
        first_half = speed * (ramp_time * (u**3 - 0.5 * u**4) + np.maximum(past - ramp_time, 0.0))
        return np.where(times <= 0.5 * duration, first_half, length - first_half)

    interval = _KNOT_INTERVAL
    while True:
        # Solve for the angles at the knots, each from the one before.
        times = _knots(duration, ramp_time, interval)
        rows = _joint_angles(arm, link, angles, start.position, start.rotation, unit, distance_travelled(times), length)
        trajectory = JointTrajectory(start_time + times, rows)

        # Look at the tool between the knots.
        between = (times[:-1, None] + np.diff(times)[:, None] * [0.25, 0.5, 0.75]).ravel()
        targets = start.position + distance_travelled(between)[:, None] * unit
        tool = arm.link_poses(trajectory.angles(start_time + between))[:, arm.link_number(link)]
        errors = np.abs(_error(tool, targets, start.rotation)).max(axis=-1)
        if errors.max() <= LINE_ERROR:
            break
        interval *= 0.5
        if interval < _MIN_KNOT_INTERVAL:
            worst = float(distance_travelled(between)[errors.argmax()])
            raise ValueError(
                f"direction: the line comes too near a singular pose after {worst:.3f} of {length:.3f} m, where the "
                f"joints move too abruptly to follow it"
            )
    if excesses := trajectory.excesses(arm):
        raise ValueError(f"direction, speed: the line asks too much of the arm: {'; '.join(excesses)}")
    return trajectory


def _joint_angles(
    arm: RobotArm,
    link: str,
    angles: Matrix,
    origin: Matrix,
    rotation: Matrix,
    unit: Matrix,
    distances: Matrix,
    length: float,
) -> Matrix:
    """Joint angles at the given distances along the line, (n, num_joints)."""
    rows, number = np.empty((len(distances), len(angles))), arm.link_number(link)
    for k, distance in enumerate(distances):
        # Newton's iteration with damped least squares: the damping only matters where the arm is nearly singular.
        for _ in range(_MAX_ITERATIONS):
            poses = arm.link_poses(angles)
            error = _error(poses[number], origin + distance * unit, rotation)
            if np.abs(error).max() <= _KNOT_ERROR:
                break
            jacobian = arm.jacobian_at(number, poses)
            step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + _DAMPING**2 * np.eye(6), error)
            angles = angles + step * min(1.0, _MAX_STEP / np.linalg.norm(step))
        else:
            smallest = np.linalg.svd(arm.jacobian(link, angles), compute_uv=False).min()
            raise ValueError(
                f"direction, duration: the line leaves the reach of {link!r} after {distances[max(k - 1, 0)]:.3f} of "
                f"{length:.3f} m: it stays {np.linalg.norm(error[:3]):.2g} m and {np.linalg.norm(error[3:]):.2g} rad "
                f"off, with {smallest:.2g} the smallest singular value of the Jacobian"
            )
        rows[k] = angles
    return rows


def _error(pose: Matrix, position: Matrix, rotation: Matrix) -> Matrix:
    """Deviation of maps (..., 4, 4) from a pose, (..., 6): displacement [m] and rotation vector [rad], if small."""
    turn = rotation @ pose[..., :3, :3].swapaxes(-1, -2)
    error = np.empty((*pose.shape[:-2], 6))
    error[..., :3] = position - pose[..., :3, 3]
    for k in range(3):
        after, last = (k + 1) % 3, (k + 2) % 3
        error[..., 3 + k] = 0.5 * (turn[..., last, after] - turn[..., after, last])
    return error


def _knots(duration: float, ramp_time: float, interval: float) -> Matrix:
    """Times from 0 to `duration`, the ends of the ramps among them."""
    ends = [0.0, ramp_time, duration - ramp_time, duration]
    pieces = [
        np.linspace(start, stop, max(2, 1 + int(np.ceil((stop - start) / interval))))[1:]
        for start, stop in pairwise(ends)
        if stop - start > 1e-9 * duration
    ]
    return np.concatenate([[0.0], *pieces])
