"""Poses and motions of scene files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.geometry.pose import Pose
from radarcore.models.robots.arm import RADAR_AT_TOOL0, RobotArm
from radarcore.models.robots.joint import JointAngles, JointTrajectory
from radarcore.models.robots.line import cartesian_line
from radarcore.motion.group import Attached
from radarcore.motion.linear import Linear
from radarcore.motion.protocol import Motion
from radarcore.motion.trajectory import Trajectory
from radarcore.scenefile.read import located, unknown
from radarcore.scenefile.tables import (
    ArmTable,
    BagMotionTable,
    JointStatesTable,
    JointTrajectoryTable,
    LinearTable,
    LineTable,
    PlacedTable,
    PoseTable,
    SensorTable,
)

Carriers = dict[str, Motion]
"""Motions by name, for what is attached to them."""


class Recorded(Protocol):
    """Motions that were recorded, as tables of kind "bag" name them; times count from the start of the recording."""

    @property
    def span(self) -> tuple[float, float] | None:
        """First and last common time of all requested motions [s]; None if none moves."""
        ...

    def motion(
        self, topic: str, *, frame: str | None, within: str | None, extrapolate: str | None, max_gap: float | None
    ) -> Motion:
        """Motion of a frame or body."""
        ...

    def joints(self, topic: str, names: Sequence[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (n,) [s] and positions (n, joint) [rad or m] of joints."""
        ...


def _pose(table: PoseTable) -> Pose:
    given = [name for name in ("rpy_deg", "wxyz", "xyzw", "look_at") if getattr(table, name) is not None]
    if len(given) > 1:
        raise ValueError(f"{given[1]}: expected one of rpy_deg, wxyz, xyzw and look_at, got also {given[0]}")
    if table.look_at is not None:
        if table.look_at[:2] == table.position[:2]:
            raise ValueError("look_at: expected a point not straight above or below (use rpy_deg for that)")
        return Pose.look_at(table.position, table.look_at)
    if table.wxyz is not None or table.xyzw is not None:
        return Pose.from_quaternion(table.position, wxyz=table.wxyz, xyzw=table.xyzw)
    return Pose.from_rpy(table.position, np.deg2rad(check.degrees("rpy_deg", table.rpy_deg or (0.0, 0.0, 0.0))))


def motion_of(table: PlacedTable, carriers: Carriers, recorded: Recorded | None = None) -> Motion:
    """The motion in the world."""
    own: Motion
    if isinstance(table.motion, BagMotionTable):
        if "pose" in table.model_fields_set:
            raise ValueError("pose: a motion of a bag excludes it; motion.world and motion.offset place the body")
        own = _recorded_motion(table.motion, recorded)
    elif table.motion is None or isinstance(table.motion, LinearTable):
        with located("pose."):
            own = _pose(table.pose)
        if table.motion is not None:
            own = Linear(own, table.motion.velocity, table.motion.angular_velocity)
    else:
        if "pose" in table.model_fields_set:
            raise ValueError("pose: expected none together with a trajectory, which has its own poses")
        poses = []
        for k, pose in enumerate(table.motion.poses):
            with located(f"motion.poses[{k}]."):
                poses.append(_pose(pose))
        with located("motion."):
            own = Trajectory(table.motion.times, poses, extrapolate=table.motion.extrapolate)
    return own if table.attached_to is None else Attached(carriers[table.attached_to], own)


def _recorded_motion(table: BagMotionTable, recorded: Recorded | None) -> Motion:
    """World of the scene from the world of the bag, from the moving frame, from the body."""
    with located("motion."):
        source = _needed("kind", recorded)
        world, offset = (_pose_named(name, pose) for name, pose in (("world", table.world), ("offset", table.offset)))
        options: dict[str, Any] = table.model_dump(include={"frame", "within", "extrapolate", "max_gap"})
        own = source.motion(table.topic, **options)
        if isinstance(own, Pose):
            return world @ own @ offset
        carried = own if offset == Pose() else Attached(own, offset)
        return carried if world == Pose() else Attached(world, carried)


def _pose_named(name: str, table: PoseTable) -> Pose:
    with located(f"{name}."):
        return _pose(table)


def _needed(key: str, recorded: Recorded | None) -> Recorded:
    if recorded is None:
        raise ValueError(f"{key}: expected another than 'bag' without a bag (radarcore simulate --bag), got 'bag'")
    return recorded


def sensor_motion_of(table: SensorTable, carriers: Carriers, recorded: Recorded | None = None) -> Motion:
    """The motion of the sensor in the world; `along_z` puts it on the flange of an arm."""
    if table.attached_to is not None and table.attached_to not in carriers:
        raise ValueError(f"attached_to: unknown {unknown(table.attached_to, carriers)}")
    if table.along_z is None:
        return motion_of(table, carriers, recorded)
    if table.attached_to is None:
        raise ValueError(
            "along_z: expected attached_to as well: the link of an arm, or the body, that carries the sensor"
        )
    if other := {"pose", "motion"} & table.model_fields_set:
        raise ValueError(f"along_z: expected it alone, got {' and '.join(sorted(other))} as well")
    return Attached(carriers[table.attached_to], Pose([0.0, 0.0, table.along_z]) @ RADAR_AT_TOOL0)


def joint_motion_of(arm: RobotArm, table: ArmTable, recorded: Recorded | None = None) -> JointTrajectory | JointAngles:
    """Joint angles of an arm: at rest, along a trajectory, along a line of the tool, or as they were recorded."""
    joints = table.joints
    if isinstance(joints, JointStatesTable):
        names = [f"{joints.prefix}{name}" for name in arm.joint_names]
        times, angles = _needed("kind", recorded).joints(joints.topic, names)
        if len(times) == 1:
            return list(angles[0])
        return JointTrajectory(times, angles, extrapolate=joints.extrapolate, ends="moving")
    if isinstance(joints, LineTable):
        options = joints.model_dump(exclude={"kind", "start_deg"})
        return cartesian_line(arm, _joint_angles(arm, "start_deg", joints.start_deg), **options)
    if not isinstance(joints, JointTrajectoryTable):
        return _joint_angles(arm, "angles_deg", joints.angles_deg)
    if len(joints.angles_deg) != len(joints.times):
        raise ValueError(f"angles_deg: expected {len(joints.times)} lists, one per time, got {len(joints.angles_deg)}")
    rows = [_joint_angles(arm, f"angles_deg[{k}]", row) for k, row in enumerate(joints.angles_deg)]
    return JointTrajectory(joints.times, np.array(rows).reshape(len(rows), -1), arm=arm, extrapolate=joints.extrapolate)


def _joint_angles(arm: RobotArm, name: str, values: list[float]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Joint angles [rad]; m for joints that slide."""
    if len(values) != len(arm.joint_names):
        raise ValueError(
            f"{name}: expected {len(arm.joint_names)} values ({', '.join(arm.joint_names)}), got {len(values)}"
        )
    turns = np.array([joint.kind != "prismatic" for joint in arm.moving_joints], dtype=bool)
    check.degrees(name, np.array(values)[turns])
    return np.array(values) * np.where(turns, np.deg2rad(1.0), 1.0)
