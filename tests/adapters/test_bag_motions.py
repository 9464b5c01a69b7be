"""Motions of bags: frames of TF, poses, rigid bodies and joints are where they were sent, in scene files too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

import radarcore as rc
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.motions import BagMotions
from radarcore.adapters.ros.poses import to_pose_stamped, to_transforms
from radarcore.models.robots.arm import RobotArm
from ros_bags import FORMATS, START_NS, header_of
from scene_files import RADAR

STEP_NS = 20_000_000
NUM = 21
VELOCITY = np.array([-0.5, 0.2, 0.1])
LATENCY_NS = 3_000_000
"""Between a stamp and the time at which its message is recorded."""


def time_of(k: int) -> float:
    return k * STEP_NS / 1e9


def flying(k: int) -> rc.Pose:
    """Constant velocity, and a turn about z at 1 rad/s."""
    return rc.Pose.from_rpy(np.array([2.0, 0.1, 0.3]) + VELOCITY * time_of(k), [0.0, 0.0, time_of(k)])


def angles_of(k: int) -> NDArray[np.float64]:
    return np.array([0.3, -1.2, 1.6, -0.4, 1.5, 0.2]) + 0.1 * time_of(k) * np.arange(6)


BASE = rc.Pose.from_rpy([0.0, 0.0, 0.5], [0.0, 0.0, np.pi / 2])
"""Of the frame "base" in "world"."""
Y_UP = rc.Pose.from_rpy([0.0, 0.0, 0.0], [np.pi / 2, 0.0, 0.0])
"""World of motion capture in ours."""


def write_motions(path: Path, kind: str = "mcap") -> Path:
    names = RobotArm.ur10().joint_names
    with BagWriter(path, kind) as bag:
        types = bag.types
        bag.write("/tf_static", to_transforms({"base": BASE}, time_ns=5, types=types), START_NS)
        for k in range(NUM):
            stamp = START_NS + k * STEP_NS
            sent = stamp + LATENCY_NS
            bag.write("/tf", to_transforms({"ball": flying(k)}, time_ns=stamp, frame_id="base", types=types), sent)
            bag.write("/mocap/ball/pose", to_pose_stamped(flying(k), time_ns=stamp, types=types), sent)
            in_y_up = Y_UP.inverse() @ flying(k)
            in_mocap = to_pose_stamped(in_y_up, time_ns=stamp).pose
            body = {"rigid_body_name": "ball", "markers": [], "pose": in_mocap}
            message = {"header": header_of(stamp), "frame_number": k, "rigidbodies": [body]}
            bag.write("/rigid_bodies", message, sent, type="mocap4r2_msgs/msg/RigidBodies")
            order = [5, 0, 1, 4, 3, 2]  # drivers sort joints by name or not at all
            state: dict[str, Any] = {"name": [f"ur_{names[i]}" for i in order], "position": angles_of(k)[order]}
            state |= {"header": header_of(stamp), "velocity": [], "effort": []}
            bag.write("/joint_states", state, sent, type="sensor_msgs/msg/JointState")
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_motions(tmp_path_factory.mktemp("motions") / "bag")


def assert_close(motion: Any, pose: rc.Pose, time: float) -> None:
    np.testing.assert_allclose(motion.at(time).position, pose.position, atol=1e-9)
    np.testing.assert_allclose(motion.at(time).rotation, pose.rotation, atol=1e-9)


@pytest.mark.parametrize("kind", FORMATS)
def test_every_kind_of_topic_gives_the_motion_that_was_sent(tmp_path: Path, kind: str) -> None:
    with BagReader(write_motions(tmp_path / "bag", kind)) as bag:
        recorded = BagMotions(bag)
        assert recorded.start_ns == START_NS  # by the stamps, not by when they were recorded
        ball = recorded.motion(frame="ball", within="base")
        in_world = recorded.motion("/tf", frame="ball")
        posed = recorded.motion("/mocap/ball/pose")
        body = recorded.motion("/rigid_bodies", frame="ball")
        times, angles = recorded.joints(names=[f"ur_{name}" for name in RobotArm.ur10().joint_names])
        assert recorded.span == (0.0, time_of(NUM - 1))
    for k in (0, 7, NUM - 1):
        assert_close(ball, flying(k), time_of(k))
        assert_close(posed, flying(k), time_of(k))
        assert_close(in_world, BASE @ flying(k), time_of(k))
        assert_close(rc.Attached(Y_UP, body), flying(k), time_of(k))
        np.testing.assert_array_equal(angles[k], angles_of(k))
    np.testing.assert_allclose(ball.rate_at(0.2)[:, 3], VELOCITY, atol=1e-9)
    np.testing.assert_array_equal(times, [time_of(k) for k in range(NUM)])


SCENE = """
[[body]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
motion = { kind = "bag", topic = "/rigid_bodies", frame = "ball", world = { rpy_deg = [90, 0, 0] } }

[[body]]
name = "rider"
shape = { kind = "sphere", radius = 0.05 }
motion = { kind = "bag", frame = "ball", offset = { position = [0, 0, 0.4] } }

[[arm]]
joints = { kind = "bag", topic = "/joint_states", prefix = "ur_" }
pose = { position = [0, -3, 0] }

[sensor]
motion = { kind = "bag", frame = "base", within = "world" }
"""


def test_a_scene_file_takes_motions_joints_and_the_sensor_from_a_bag(path: Path, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(RADAR + SCENE)
    with BagReader(path) as bag:
        simulation = rc.load_scene(scene, recorded=BagMotions(bag))
    bodies = {body.name: body for body in simulation.scene.bodies}
    arm = RobotArm.ur10().moving(lambda t: angles_of(0) + 0.1 * t * np.arange(6), base=rc.Pose([0.0, -3.0, 0.0]))
    for k in (0, 12, NUM - 1):
        assert_close(bodies["ball"].motion, flying(k), time_of(k))
        assert_close(bodies["rider"].motion, BASE @ flying(k) @ rc.Pose([0.0, 0.0, 0.4]), time_of(k))
        tool = bodies["arm/wrist_3_link"].motion
        assert_close(tool, arm.link_motion("wrist_3_link").at(time_of(k)), time_of(k))
    # Joints move at the ends of a recording, too: it is a part of a longer motion.
    expected = arm.link_motion("wrist_3_link").rate_at(0.2)
    for time in (0.0, time_of(NUM - 1)):
        moving = bodies["arm/wrist_3_link"].motion.rate_at(time)
        assert np.linalg.norm(moving[:, 3]) > 0.2 * np.linalg.norm(expected[:, 3])
    assert_close(simulation.radar_motion, BASE, 0.3)
    # Frames end with the poses.
    end = time_of(NUM - 1) - simulation.radar.waveform.duration
    assert (simulation.run.start, simulation.run.stop) == (0.0, end)


def test_frames_come_at_the_rate_of_the_radar(path: Path, tmp_path: Path) -> None:
    """Where it has one: frames back to back are no choice."""
    scene = tmp_path / "scene.toml"
    for interval, rate in (("", 40.0), ("frame_interval = 0.05\n", 20.0)):
        scene.write_text(RADAR + interval + SCENE)
        with BagReader(path) as bag:
            assert rc.load_scene(scene, recorded=BagMotions(bag)).run.rate == rate


def test_times_of_the_run_are_those_of_the_file_where_it_has_any(path: Path, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(RADAR + SCENE + "[run]\nstart = 0.25\nstop = 0.35\n")
    with BagReader(path) as bag:
        run = rc.load_scene(scene, recorded=BagMotions(bag)).run
    assert (run.start, run.stop) == (0.25, 0.35)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("/rigid_bodies", "/rigid", "body[0] 'ball': motion.topic: no topic '/rigid' in "),
        ("/joint_states", "/joints", "arm[0] 'arm': joints.topic: no topic '/joints' in "),
        ("/joint_states", "/tf", "arm[0] 'arm': joints.topic: expected sensor_msgs/msg/JointState, got tf2_msgs/"),
        ('prefix = "ur_"', 'prefix = "x"', "arm[0] 'arm': joints.names: no joint 'xshoulder_pan_joint', "),
        ('"base", within', '"bass", within', "sensor: motion.frame: no frame 'bass'; did you mean 'base'?"),
        (
            'frame = "ball", offset',
            "offset",
            "body[1] 'rider': motion.frame: expected one of ball, base, world for '/tf'",
        ),
        ('frame = "ball", world', 'frame = "bull", world', "body[0] 'ball': motion.frame: expected a body of"),
        ("/rigid_bodies", "/mocap/ball/pose", "body[0] 'ball': motion.frame: expected none for geometry_msgs/msg/Pose"),
        (
            "[sensor]",
            "[sensor]\npose = {}",
            "sensor: pose: a motion of a bag excludes it",
        ),
    ],
)
def test_faults_name_the_key_and_what_there_is(path: Path, tmp_path: Path, old: str, new: str, message: str) -> None:
    scene = tmp_path / "scene.toml"
    assert old in SCENE
    scene.write_text(RADAR + SCENE.replace(old, new, 1))
    with BagReader(path) as bag, pytest.raises(ValueError, match=r".") as error:
        rc.load_scene(scene, recorded=BagMotions(bag))
    assert str(error.value).startswith(f"{scene}: {message}")


def test_a_scene_that_needs_a_bag_says_so(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(RADAR + SCENE)
    with pytest.raises(ValueError, match=r"motion\.kind: expected another than 'bag' without a bag \(radarcore simul"):
        rc.load_scene(scene)


def test_gaps_are_bridged_with_one_warning(tmp_path: Path) -> None:
    """Motion capture that lost the body for 0.4 s."""
    with BagWriter(tmp_path / "bag") as bag:
        for k in [*range(10), *range(30, 40)]:
            stamp = START_NS + k * STEP_NS
            bag.write("/pose", to_pose_stamped(flying(k), time_ns=stamp, types=bag.types), stamp)
    with BagReader(tmp_path / "bag") as read:
        recorded = BagMotions(read)
        with pytest.warns(UserWarning, match=r"bag, /pose: no messages from 0\.18 to 0\.6 s; a spline goes through"):
            motion = recorded.motion("/pose")
        recorded.motion("/pose")
        whole = recorded.motion("/pose", max_gap=0.1)
    assert_close(motion, flying(20), time_of(20))  # of constant velocity
    with pytest.raises(ValueError, match="gap"):
        whole.at(time_of(20))


def test_motions_that_never_overlap_are_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for name, first in (("/a", 0), ("/b", 10)):
            for k in range(3):
                stamp = START_NS + (first + k) * STEP_NS
                bag.write(name, to_pose_stamped(flying(k), time_ns=stamp, types=bag.types), stamp)
    with BagReader(tmp_path / "bag") as read:
        recorded = BagMotions(read)
        recorded.motion("/a"), recorded.motion("/b")
        with pytest.raises(ValueError, match=r"one that ends at 0\.04 s and one that begins at 0\.2 s"):
            recorded.span  # noqa: B018
