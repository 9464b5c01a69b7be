"""Poses, motion capture and joints in messages of ROS."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
import rosbags_types
from radarcore.adapters import ros
from radarcore.adapters.ros.bags import typed

STAMP = 1_700_000_000_123_456_789
HALF = float(np.sqrt(0.5))


def header(time_ns: int, frame_id: str = "world") -> SimpleNamespace:
    stamp = SimpleNamespace(sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    return SimpleNamespace(seq=0, stamp=stamp, frame_id=frame_id)


def pose_message(position: Any, quaternion: Any) -> SimpleNamespace:
    """A geometry_msgs/Pose; the quaternion as (x, y, z, w)."""
    return SimpleNamespace(
        position=SimpleNamespace(**dict(zip("xyz", position, strict=True))),
        orientation=SimpleNamespace(**dict(zip("xyzw", quaternion, strict=True))),
    )


def stamped(time_ns: int, position: Any = (0.0, 0.0, 0.0), frame_id: str = "world") -> SimpleNamespace:
    return SimpleNamespace(header=header(time_ns, frame_id), pose=pose_message(position, (0.0, 0.0, 0.0, 1.0)))


def test_quaternions_of_ros_have_w_last() -> None:
    """A quarter turn to the left about z."""
    pose = ros.from_pose(pose_message((1.0, 2.0, 3.0), (0.0, 0.0, HALF, HALF)))
    np.testing.assert_allclose(pose.apply([1.0, 0.0, 0.0]), [1.0, 3.0, 3.0], rtol=0, atol=1e-15)


def test_transforms_and_covariances_are_poses_too() -> None:
    bare = pose_message((1.0, 2.0, 3.0), (0.5, 0.5, 0.5, 0.5))
    transform = SimpleNamespace(translation=bare.position, rotation=bare.orientation)
    for message in (
        transform,
        SimpleNamespace(header=header(0), child_frame_id="a", transform=transform),
        SimpleNamespace(header=header(0), pose=bare),
        SimpleNamespace(header=header(0), pose=SimpleNamespace(pose=bare, covariance=np.zeros(36))),
    ):
        assert ros.from_pose(message) == ros.from_pose(bare)


@pytest.mark.parametrize("world", [None, "ROS 2"])
def test_pose_stamped_keeps_pose_and_stamp(world: str | None) -> None:
    pose = rc.Pose.from_rpy([1.0, -2.0, 0.3], [2.5, -0.4, 3.0])
    types = None if world is None else rosbags_types.typestore(world)
    message = ros.to_pose_stamped(pose, time_ns=STAMP, frame_id="map", types=types)
    if world is not None:
        message = rosbags_types.through_bytes(world, message)
    assert (message.header.frame_id, ros.header_nanoseconds(message)) == ("map", STAMP)
    again = ros.from_pose(message)
    np.testing.assert_array_equal(again.position, pose.position)
    np.testing.assert_allclose(again.rotation, pose.rotation, rtol=0, atol=1e-15)


def test_series_are_in_order_and_the_first_of_equal_stamps_counts() -> None:
    messages = [stamped(STAMP + ms * 10**6, (x, 0.0, 0.0)) for ms, x in ((20, 0.2), (0, 0.0), (10, 0.1), (10, 9.0))]
    with pytest.warns(UserWarning, match="messages: 1 of 4 messages repeat a stamp with other values"):
        series = ros.pose_series(messages)
    assert series.frame_id == "world"
    np.testing.assert_array_equal(series.times_ns, STAMP + np.array([0, 10, 20]) * 10**6)
    assert [pose.position[0] for pose in series.poses] == [0.0, 0.1, 0.2]
    np.testing.assert_array_equal(series.times(STAMP), [0.0, 0.01, 0.02])


def test_trajectory_of_a_series_counts_from_the_given_stamp() -> None:
    series = ros.pose_series([stamped(STAMP + k * 25_000_000, (0.05 * k, 0.0, 0.0)) for k in range(41)])
    motion = series.trajectory(STAMP, extrapolate="hold")
    assert isinstance(motion, rc.Trajectory)
    # 2 m/s, at times that are exact to rounding: with seconds since 1970 they would be 0.2 us off, 5e-6 of a step.
    np.testing.assert_allclose(motion.rate_at(0.4123)[:, 3], [2.0, 0.0, 0.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion.at(0.4123).position, [0.8246, 0.0, 0.0], rtol=0, atol=1e-14)
    assert ros.pose_series([stamped(STAMP)]).trajectory(STAMP) == rc.Pose()


def rigid_bodies(time_ns: int, bodies: dict[str, SimpleNamespace]) -> SimpleNamespace:
    """A mocap4r2_msgs/RigidBodies."""
    each = [SimpleNamespace(rigid_body_name=name, markers=[], pose=pose) for name, pose in bodies.items()]
    return SimpleNamespace(header=header(time_ns, "mocap"), frame_number=7, rigidbodies=each)


@pytest.mark.parametrize("world", [None, *rosbags_types.WORLDS])
def test_rigid_bodies_are_series_by_name_with_gaps_where_they_were_not_seen(world: str | None) -> None:
    turned, lost = (HALF, 0.0, 0.0, HALF), (0.0, 0.0, 0.0, 0.0)
    frames = [
        {"radar": pose_message((0.0, 1.0, k), turned), "arm": pose_message((k, 0.0, 0.0), lost if k == 1 else turned)}
        for k in range(3)
    ]
    frames[2]["arm"].position.x = np.nan
    frames.append({"radar": frames[0]["radar"], "arm": pose_message((3, 0.0, 0.0), turned)})
    messages: list[Any] = [rigid_bodies(STAMP + k, bodies) for k, bodies in enumerate(frames)]
    if world is not None:
        store, name = rosbags_types.typestore(world), "mocap4r2_msgs/msg/RigidBodies"
        messages = [rosbags_types.through_bytes(world, typed(store, name, message)) for message in messages]
    series = ros.rigid_body_series(messages)
    assert list(series) == ["radar", "arm"]
    assert [len(each) for each in series.values()] == [4, 2]
    np.testing.assert_array_equal(series["arm"].times_ns, [STAMP, STAMP + 3])
    assert [pose.position[0] for pose in series["arm"].poses] == [0.0, 3.0]
    assert series["radar"].frame_id == "mocap"
    # A quarter turn about x: left becomes up.
    np.testing.assert_allclose(series["radar"].poses[1].apply([0.0, 1.0, 0.0]), [0.0, 1.0, 2.0], rtol=0, atol=1e-15)


def joints(time_ns: int, **positions: float) -> SimpleNamespace:
    """A sensor_msgs/JointState without velocities."""
    return SimpleNamespace(
        header=header(time_ns), name=list(positions), position=list(positions.values()), velocity=[], effort=[]
    )


STATES = [
    joints(STAMP, shoulder=0.1, elbow=0.2),
    joints(STAMP + 5, finger=0.9),
    joints(STAMP + 20, elbow=0.4, shoulder=0.3),
    joints(STAMP + 10, shoulder=0.15, elbow=0.25, finger=0.8),
    SimpleNamespace(header=header(STAMP + 30), name=["shoulder"], position=[], velocity=[1.0], effort=[]),
]


def test_joints_are_told_apart_by_name_not_by_place() -> None:
    assert ros.joint_series(STATES).names == ("shoulder", "elbow", "finger")
    series = ros.joint_series(STATES, ["shoulder", "elbow"])
    np.testing.assert_array_equal(series.times_ns, [STAMP, STAMP + 10, STAMP + 20])
    np.testing.assert_array_equal(series.positions, [[0.1, 0.2], [0.15, 0.25], [0.3, 0.4]])
    np.testing.assert_array_equal(series.times(STAMP), [0.0, 1e-8, 2e-8])


def test_joints_come_in_the_order_that_is_asked_for() -> None:
    series = ros.joint_series(STATES, ["elbow", "shoulder"])
    np.testing.assert_array_equal(series.positions[-1], [0.4, 0.3])
    np.testing.assert_array_equal(ros.joint_series(STATES, ["finger"]).times_ns, [STAMP + 5, STAMP + 10])
