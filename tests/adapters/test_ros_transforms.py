"""Trees of transforms: any frame in any other, against products of matrices worked out here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
import rosbags_types
from radarcore.adapters import ros

START = 1_700_000_000_000_000_000
TURN, SPEED, LIFT = 1.5, 0.8, 0.3
"""Of the base about z [rad/s] and along x [m/s], and of the lift along z [m/s]."""


def about_z(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def matrix(rotation: Any, position: Any) -> NDArray[np.float64]:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation, position
    return found


def base_at(time: float) -> NDArray[np.float64]:
    return matrix(about_z(TURN * time), [SPEED * time, 1.0, 0.0])


def lift_at(time: float) -> NDArray[np.float64]:
    return matrix(np.eye(3), [0.1, 0.0, 0.5 + LIFT * time])


CAMERA = matrix([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], [0.2, 0.0, 0.1])
"""An optical frame that looks along x of the lift: x right, y down, z forward."""

LIDAR = matrix(about_z(0.7), [0.0, 0.3, 1.1])


def transform(child: str, parent: str, placed: NDArray[np.float64], time: float = 0.0) -> SimpleNamespace:
    """A geometry_msgs/TransformStamped; the quaternion is found from the matrix by its largest part."""
    m = placed[:3, :3]
    squares = 1.0 + np.array(
        [m[0, 0] - m[1, 1] - m[2, 2], m[1, 1] - m[0, 0] - m[2, 2], m[2, 2] - m[0, 0] - m[1, 1], m.trace()]
    )
    products = np.array(
        [
            [squares[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
            [m[0, 1] + m[1, 0], squares[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[2], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3]],
        ]
    )
    k = int(squares.argmax())
    x, y, z, w = products[k] / (2.0 * np.sqrt(squares[k]))
    stamp_ns = START + round(time * 1e9)
    stamp = SimpleNamespace(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp, frame_id=parent),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(**dict(zip("xyz", placed[:3, 3].tolist(), strict=True))),
            rotation=SimpleNamespace(x=x, y=y, z=z, w=w),
        ),
    )


def tf(*transforms: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(transforms=list(transforms))


TIMES = np.arange(41) / 20.0
MOVING = [
    tf(transform("base_link", "odom", base_at(time), time), transform("lift", "base_link", lift_at(time), time))
    for time in TIMES.tolist()
]
STATIC = [
    tf(transform("depth_optical_frame", "lift", CAMERA), transform("lidar", "/base_link", LIDAR)),
    tf(transform("odom", "map", matrix(about_z(-0.3), [5.0, 6.0, 0.0])), transform("moon", "sky", np.eye(4))),
]
TREE = ros.TransformTree(MOVING, STATIC)

WORLD = matrix(about_z(-0.3), [5.0, 6.0, 0.0])
FRAMES = {
    "map": lambda time: np.eye(4),
    "odom": lambda time: WORLD,
    "base_link": lambda time: WORLD @ base_at(time),
    "lift": lambda time: WORLD @ base_at(time) @ lift_at(time),
    "lidar": lambda time: WORLD @ base_at(time) @ LIDAR,
    "depth_optical_frame": lambda time: WORLD @ base_at(time) @ lift_at(time) @ CAMERA,
}


def map_at(frame: str, within: str, time: float) -> NDArray[np.float64]:
    placed: NDArray[np.float64] = np.linalg.inv(FRAMES[within](time)) @ FRAMES[frame](time)
    return placed[:3]


@pytest.mark.parametrize("within", FRAMES)
@pytest.mark.parametrize("frame", FRAMES)
def test_every_frame_in_every_other_is_the_product_of_matrices(frame: str, within: str) -> None:
    motion = TREE.motion(frame, within, start_ns=START)
    for time in (0.0, 0.333, 1.2718, 2.0):  # stamps among them, and times between
        found = motion.at(time)
        expected = map_at(frame, within, time)
        # A uniform motion is a spline itself, to rounding.
        np.testing.assert_allclose(found.rotation, expected[:, :3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.position, expected[:, 3], rtol=0, atol=2e-11)
        if 0.0 < time < 2.0:
            step = 1e-4
            rate = (map_at(frame, within, time + step) - map_at(frame, within, time - step)) / (2.0 * step)
            np.testing.assert_allclose(motion.rate_at(time), rate, rtol=0, atol=1e-6)
    together = rc.Attached(motion).poses_at([0.4, 0.5])
    np.testing.assert_allclose(together, [map_at(frame, within, time) for time in (0.4, 0.5)], rtol=0, atol=2e-11)


def test_static_frames_are_poses() -> None:
    assert isinstance(TREE.motion("depth_optical_frame", "lift"), rc.Pose)
    assert isinstance(TREE.motion("map", "odom"), rc.Pose)
    assert isinstance(TREE.motion("lidar", "odom", start_ns=START), rc.Attached)


def test_radar_at_an_optical_frame_looks_along_its_z() -> None:
    for frame, axes in (("depth_optical_frame", None), ("lift", None), ("lift", "link")):
        radar = TREE.radar_motion(frame, "map", start_ns=START, axes=axes).at(0.7)
        # The camera looks along x of the lift, upright, so both are turned alike.
        expected = FRAMES["lift"](0.7)[:3, :3]
        np.testing.assert_allclose(radar.rotation, expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(radar.position, FRAMES[frame](0.7)[:3, 3], rtol=0, atol=1e-11)
    # Declared optical, a link's z is forward.
    upward = TREE.radar_motion("lift", "lift", axes="optical")
    np.testing.assert_array_equal(upward.at(0.0).apply([1.0, 0.0, 0.0]), [0.0, 0.0, 1.0])


def test_messages_that_went_through_their_bytes_make_the_same_tree() -> None:
    poses = {"camera": rc.Pose.from_rpy([1.0, 2.0, 3.0], [0.1, 0.2, 0.3]), "arm": rc.Pose([0.0, 1.0, 0.0])}
    sent = ros.to_transforms(poses, time_ns=START, frame_id="base", types=rosbags_types.typestore("ROS 2"))
    tree = ros.TransformTree(static=[rosbags_types.through_bytes("ROS 2", sent)])
    assert tree.frames == ("arm", "base", "camera")
    assert tree.parent("arm") == "base"
    assert tree.parent("base") is None
    seen = tree.motion("camera", "arm").at(0.0)
    np.testing.assert_allclose(seen.position, [1.0, 1.0, 3.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(seen.rotation, poses["camera"].rotation, rtol=0, atol=1e-15)


def test_series_are_the_poses_as_they_were_sent() -> None:
    series = TREE.series("lift")
    assert isinstance(series, ros.PoseSeries)
    assert (len(series), series.frame_id) == (41, "base_link")
    np.testing.assert_array_equal(series.times(START), TIMES)
    assert isinstance(TREE.series("lidar"), rc.Pose)


def test_the_last_static_transform_holds_also_against_moving_ones() -> None:
    places = [tf(transform("lift", "base_link", matrix(np.eye(3), [x, 0.0, 0.0]))) for x in (1.0, 2.0)]
    motion = ros.TransformTree(MOVING, places).motion("lift", "base_link")
    assert motion == rc.Pose([2.0, 0.0, 0.0])


def test_a_single_transform_rests() -> None:
    tree = ros.TransformTree(MOVING[:1])
    assert isinstance(tree.motion("lift", "odom"), rc.Pose)


LOOP = [tf(transform("a", "b", np.eye(4)), transform("b", "c", np.eye(4)), transform("c", "a", np.eye(4)))]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: TREE.motion("lidr", "map"),
            "frame: no frame 'lidr'; did you mean 'lidar'",
        ),
        (lambda: TREE.motion("lidar", "earth"), "within: no frame 'earth'; known: base_link,"),
        (
            lambda: TREE.motion("lidar", "moon"),
            "within: .* connect with 'lidar', got 'moon': the one hangs on 'map', the other on 'sky'",
        ),
        (lambda: TREE.series("map"), "frame: expected one with a parent, got the root 'map'"),
        (lambda: ros.TransformTree().motion("a", "b"), "frame: no frame 'a'; known: none"),
        (
            lambda: ros.TransformTree(LOOP).motion("a", "b"),
            "messages: expected a tree of frames, got the circle a < b < c < a",
        ),
        (
            lambda: ros.TransformTree(MOVING, [tf(transform("lift", "mast", np.eye(4)))]).series("lift"),
            "messages: expected one parent of 'lift', got 'mast' and 'base_link'",
        ),
        (lambda: TREE.radar_motion("lift", "map", axes="sideways"), "frame: expected one of 'optical'"),
    ],
)
def test_frames_that_are_not_there_name_those_that_are(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
