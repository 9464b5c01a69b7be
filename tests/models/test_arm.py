"""Robot arms: kinematics against published values, URDF, exact velocities, and straight lines of the tool."""

import importlib.metadata
import math
import re
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from radarcore.models import robots
from radarcore.models.robots import data
from radarcore.models.robots.arm import RADAR_AT_TOOL0, RobotArm
from radarcore.models.robots.joint import Joint
from radarcore.models.robots.joint_trajectory import JointTrajectory
from radarcore.models.robots.line import cartesian_line
from radarcore.motion.group import Motions

needs_robots = pytest.mark.skipif(
    not robots.is_available(), reason="needs the extra `robots`: pip install radarcore[robots]"
)

CHECK_POSE = np.array([0.0, -1.2, 1.6, -0.4, 1.5708, 0.0])
MESH_TRIANGLES = {
    "base_link": 366,
    "shoulder_link": 986,
    "upper_arm_link": 1224,
    "forearm_link": 1074,
    "wrist_1_link": 886,
    "wrist_2_link": 840,
    "wrist_3_link": 486,
}
# Products of a dozen matrices of order one, in f64.
ROUNDING = 1e-14


@pytest.fixture(scope="module")
def ur10():
    return RobotArm.ur10()


@pytest.fixture(scope="module")
def ur10_meshes():
    return RobotArm.ur10_meshes()


@pytest.fixture
def ur10_urdf():
    return data.data_file(data.UR10)


def matrix(pose):
    return np.column_stack([pose.rotation, pose.position])


def some_trajectory(num_joints=6, seed=3):
    random = np.random.default_rng(seed)
    return JointTrajectory([0.5, 0.9, 1.6, 2.0], random.uniform(-2.0, 2.0, (4, num_joints)))


# Kinematics


@pytest.mark.parametrize(
    ("angles", "expected"), [(np.zeros(6), (1.1843, 0.25614, 0.0116)), (CHECK_POSE, (0.84109, 0.16394, 0.35914))]
)
def test_flange_is_where_the_published_kinematics_put_it(ur10, angles, expected):
    np.testing.assert_allclose(ur10.link_pose("tool0", angles).position, expected, atol=5e-6)  # their last digit


def test_tool_axes_in_the_check_pose(ur10):
    # Tool x is base y, tool y is base z, tool z is base x; 1.5708 is pi/2 to 4e-6.
    tool = ur10.link_pose("tool0", CHECK_POSE).rotation
    np.testing.assert_allclose(tool, np.roll(np.eye(3), 1, axis=0), atol=4e-6)


def test_joint_angles_by_name_leave_the_others_at_zero(ur10):
    named = ur10.link_pose("tool0", {"elbow_joint": 0.7, "wrist_3_joint": -1.0})
    assert named == ur10.link_pose("tool0", [0.0, 0.0, 0.7, 0.0, 0.0, -1.0])


@needs_robots
def test_embedded_kinematics_agree_with_urdf(ur10, ur10_urdf):
    described = RobotArm.from_urdf(ur10_urdf, meshes=None)
    assert described.name == ur10.name == "ur10"
    assert described.joint_names == ur10.joint_names
    for ours, theirs in zip(ur10.moving_joints, described.moving_joints, strict=True):
        assert ours.limits == pytest.approx(theirs.limits, abs=1e-9)
        assert ours.max_velocity == theirs.max_velocity
    for angles in np.random.default_rng(1).uniform(-np.pi, np.pi, (20, 6)):
        for link in ur10.links:
            ours, theirs = ur10.link_pose(link, angles), described.link_pose(link, angles)
            # The file has pi/2 to 5e-12.
            np.testing.assert_allclose(matrix(ours), matrix(theirs), atol=1e-10)


def test_jacobian_maps_joint_rates_to_the_velocity_of_the_link(ur10):
    motion = some_trajectory()
    moving = ur10.moving(motion)
    for link in ("tool0", "forearm_link"):
        rate = moving.link_motion(link).rate_at(1.2)
        rotation = moving.link_motion(link).at(1.2).rotation
        spin = rate[:, :3] @ rotation.T
        velocity = ur10.jacobian(link, motion.angles(1.2)) @ motion.rates(1.2)
        np.testing.assert_allclose(velocity[:3], rate[:, 3], atol=100 * ROUNDING)
        np.testing.assert_allclose(velocity[3:], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=100 * ROUNDING)


# Motion


@pytest.mark.parametrize("base", [None, rc.Linear(rc.Pose([1.0, 2.0, 0.5]), [0.3, -0.2, 0.1], [0.1, 0.4, -0.7])])
def test_link_velocities_equal_finite_differences(ur10, base):
    moving = ur10.moving(some_trajectory(), base)
    step = 1e-5  # error of the difference: step^2 / 6 x third derivatives of order 1e3, and 1e-16 / step
    for link in ur10.links:
        motion = moving.link_motion(link)
        for time in (0.7, 1.2, 1.9):
            difference = (matrix(motion.at(time + step)) - matrix(motion.at(time - step))) / (2.0 * step)
            np.testing.assert_allclose(motion.rate_at(time), difference, atol=1e-6)


def test_link_poses_stay_rotations(ur10):
    moving = ur10.moving(some_trajectory())
    for body in moving.bodies():
        rotation = body.motion.at(1.23).rotation
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=ROUNDING)


def test_moving_link_is_where_its_pose_says_on_a_moving_base(ur10):
    motion, base = some_trajectory(), rc.Linear(rc.Pose([1.0, 0.0, 0.0]), [0.5, 0.0, 0.0], [0.0, 0.0, 1.0])
    moving = ur10.moving(motion, base)
    for time in (0.0, 1.0, 3.0, 1.0):
        expected = base.at(time) @ ur10.link_pose("wrist_2_link", motion.angles(time))
        np.testing.assert_allclose(matrix(moving.link_motion("wrist_2_link").at(time)), matrix(expected), atol=ROUNDING)


def test_function_of_time_moves_like_its_closed_form(ur10):
    # Central differences over 0.5 ms of a sine: 4 step^4 / 5! x 1 is 1e-14; rounding 1e-16 / step is more.
    moving = ur10.moving(lambda t: CHECK_POSE + 0.3 * np.sin(t))

    class Exact:
        def angles(self, time):
            return CHECK_POSE + 0.3 * np.sin(time)

        def rates(self, time):
            return np.full(6, 0.3 * np.cos(time))

    exact = ur10.moving(Exact())
    for time in (0.0, 0.8):
        np.testing.assert_allclose(
            moving.link_motion("tool0").rate_at(time), exact.link_motion("tool0").rate_at(time), atol=1e-11
        )


def test_all_links_at_one_time_take_one_evaluation(ur10):
    calls = []

    def angles(time):
        calls.append(time)
        return CHECK_POSE * np.cos(time)

    bodies = ur10.moving(angles).bodies()
    motions = Motions([body.motion for body in bodies] + [rc.Attached(bodies[-1].motion, rc.Pose([0.0, 0.0, 0.1]))])
    for time in (0.1, 0.2):
        motions.poses_at(np.array([time]))
    assert calls == [0.1, 0.2]


def test_all_links_in_one_call_are_where_each_of_them_is(ur10):
    base = rc.Linear(rc.Pose([1.0, 0.0, 0.7]), velocity=[0.2, 0.0, 0.0], angular_velocity=[0.0, 0.0, 0.3])
    times = np.random.default_rng(6).uniform(0.0, 2.5, 20)
    trajectory = some_trajectory()
    for joint_motion in (trajectory, trajectory.angles, CHECK_POSE):
        moving = ur10.moving(joint_motion, base)
        poses, rates = moving.link_poses_at(times), moving.link_rates_at(times)
        assert poses.shape == rates.shape == (20, len(ur10.links), 3, 4)
        for number, link in enumerate(ur10.links):
            motion = moving.link_motion(link)
            np.testing.assert_allclose([matrix(motion.at(t)) for t in times], poses[:, number], atol=10 * ROUNDING)
            np.testing.assert_allclose([motion.rate_at(t) for t in times], rates[:, number], atol=1e-12)


def test_resting_arm_is_known_to_rest(ur10):
    bodies = ur10.moving(CHECK_POSE, rc.Pose([0.0, 0.0, 1.0])).bodies()
    assert rc.Scene(bodies).is_static
    assert not rc.Scene(ur10.moving(some_trajectory()).bodies()).is_static
    riding = ur10.moving(CHECK_POSE, rc.Linear(rc.Pose(), [1.0, 0.0, 0.0])).link_motion("tool0")
    np.testing.assert_allclose(riding.rate_at(0.0)[:, 3], [1.0, 0.0, 0.0], atol=ROUNDING)


def test_bodies_are_named_after_arm_and_link(ur10):
    moving = ur10.moving(CHECK_POSE)
    assert [body.name for body in moving.bodies()] == [f"ur10/{link}" for link in MESH_TRIANGLES]
    wood = rc.materials["wood"]
    left = moving.bodies(wood, "left")
    assert left[0].name == "left/base_link"
    assert all(body.material == wood for body in left)


def test_radar_on_the_flange_looks_along_tool_z(ur10):
    moving = ur10.moving(some_trajectory())
    radar = rc.Attached(moving.link_motion("tool0"), RADAR_AT_TOOL0)
    for time in (0.0, 1.3):
        tool, sensor = moving.link_motion("tool0").at(time), radar.at(time)
        np.testing.assert_allclose(sensor.rotation[:, 0], tool.rotation[:, 2], atol=ROUNDING)
        np.testing.assert_allclose(sensor.position, tool.position, atol=ROUNDING)
    # In the check pose it is upright and looks along the base's x.
    upright = rc.Attached(ur10.moving(CHECK_POSE).link_motion("tool0"), RADAR_AT_TOOL0).at(0.0)
    np.testing.assert_allclose(upright.rotation, np.eye(3), atol=4e-6)  # 1.5708 is pi/2 to 4e-6


def test_radar_on_the_arm_measures_its_own_speed_towards_a_wall(ur10):
    # From 0.25 s on at 0.25 m/s towards a plate at rest.
    line = cartesian_line(ur10, CHECK_POSE, [1.0, 0.0, 0.0], 0.25, 1.0)
    moving = ur10.moving(line)
    # 5 cm in front of the flange.
    radar_motion = rc.Attached(moving.link_motion("tool0"), rc.Pose([0.0, 0.0, 0.05]) @ RADAR_AT_TOOL0)
    radar = rc.bgt60tr13c(stop_frequency=61.5e9, start_frequency=60e9, num_samples=128, num_chirps=64)
    wall = rc.Body(rc.shapes.plate(1.0, 1.0), motion=rc.Pose([2.0, 0.16, 0.36]), name="wall")
    scene = rc.Scene([wall, *moving.bodies()])
    simulator = rc.Simulator(scene, radar, radar_motion=radar_motion, resolution=48, field_of_view_deg=(60.0, 60.0))
    frame = simulator.frame(0.5)
    distance = 2.0 - radar_motion.at(0.5).position[0]
    peak = rc.strongest_peak(frame.cube, radar.waveform, min_range=0.5)
    assert abs(peak.range - distance) < 0.5 * radar.waveform.range_resolution
    assert abs(peak.velocity + 0.25) < radar.waveform.velocity_resolution


# Shapes


def area_vectors(mesh):
    a, b, c = (mesh.vertices[index] for index in mesh.triangles.T)
    return 0.5 * np.cross(b - a, c - a)


def is_closed(mesh):
    """Every edge belongs to exactly two faces that run through it in opposite directions."""
    edges = {tuple(edge) for edge in mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()}
    return len(edges) == 3 * len(mesh.triangles) and all((b, a) in edges for a, b in edges)


@pytest.mark.parametrize("link", MESH_TRIANGLES)
def test_embedded_shapes_are_closed_with_normals_outwards(ur10, link):
    mesh = ur10.links[link]
    assert is_closed(mesh)
    assert mesh.volume > 1e-4
    assert mesh.num_dropped == 0
    assert np.linalg.norm(area_vectors(mesh).sum(axis=0)) < 1e-12


@pytest.mark.parametrize("joint", [joint.name for joint in RobotArm.ur10().joints])
def test_embedded_shapes_reach_from_joint_to_joint(ur10, joint):
    joint = next(j for j in ur10.joints if j.name == joint)
    if joint.child == "tool0":
        # The flange's face: the centre of a cap at tool0's origin, nothing beyond.
        to_tool = joint.origin.inverse().apply(ur10.links[joint.parent].vertices)
        assert np.linalg.norm(to_tool, axis=1).min() < 1e-9
        assert to_tool[:, 2].max() < 1e-9
        return
    # On the joint's axis, which every angle leaves in place, parent and child end in the same point: centres of caps.
    ends = []
    for vertices in (joint.origin.inverse().apply(ur10.links[joint.parent].vertices), ur10.links[joint.child].vertices):
        along = vertices @ joint.axis
        ends.append(along[np.linalg.norm(vertices - np.outer(along, joint.axis), axis=1) < 1e-9])
    gap = np.abs(np.subtract.outer(*ends)).min()
    assert gap < 1e-3  # half the wavelength at 150 GHz; a joint's housing is 90 to 150 mm wide


def test_embedded_base_stands_on_the_mounting_plane(ur10):
    assert ur10.links["base_link"].bounds[0, 2] == pytest.approx(0.0, abs=1e-15)


@needs_robots
@pytest.mark.parametrize(("link", "count"), MESH_TRIANGLES.items())
def test_real_meshes_have_all_their_triangles_and_face_outwards(ur10_meshes, link, count):
    mesh = ur10_meshes.links[link]
    assert len(mesh.triangles) == count
    assert mesh.num_dropped == 0
    assert mesh.volume > 1e-4


@needs_robots
@pytest.mark.parametrize("link", MESH_TRIANGLES)
def test_embedded_shapes_fill_the_boxes_of_the_real_meshes(ur10, ur10_meshes, link):
    # Rounded covers and cable outlets are left out: the base's outlet is 17 mm, the shoulder's cover 10 mm high.
    allowed = 0.018 if link == "base_link" else 0.011
    np.testing.assert_allclose(ur10.links[link].bounds, ur10_meshes.links[link].bounds, atol=allowed)


@needs_robots
def test_urdf_of_the_ur10_gives_the_same_meshes_without_the_way_through_obj(ur10_meshes, ur10_urdf):
    described = RobotArm.from_urdf(ur10_urdf)
    for link in MESH_TRIANGLES:
        # OBJ has eight digits after the point.
        np.testing.assert_allclose(described.links[link].bounds, ur10_meshes.links[link].bounds, atol=1e-8)


def test_missing_extra_names_what_to_install(monkeypatch):
    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "files", missing)
    with pytest.raises(ImportError, match=r"pip install radarcore\[robots\]"):
        RobotArm.ur10_meshes()


@needs_robots
def test_missing_trimesh_names_what_to_install(monkeypatch):
    data._read_mesh.cache_clear()
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ImportError, match=r"pip install radarcore\[robots\]"):
        RobotArm.ur10_meshes()


# URDF

URDF = """<?xml version="1.0"?>
<robot name="machine">
  <link name="base">
    <collision><origin xyz="0 0 0.05"/><geometry><box size="0.4 0.3 0.1"/></geometry></collision>
    <collision><origin xyz="1 0 0" rpy="0 1.5707963267948966 0"/>
      <geometry><cylinder radius="0.1" length="0.6"/></geometry></collision>
    <visual><geometry><mesh filename="missing.obj"/></geometry></visual>
  </link>
  <link name="slide"><collision><geometry><sphere radius="0.2"/></geometry></collision></link>
  <link name="wheel">
    <collision><origin xyz="0 0 1"/><geometry><mesh filename="{mesh}" scale="{scale}"/></geometry></collision>
  </link>
  <link name="elbow"/>
  <link name="tip"/>
  <joint name="rail" type="prismatic">
    <parent link="base"/><child link="slide"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/>
    <axis xyz="0 2 0"/><limit lower="-1" upper="2" velocity="0.5" effort="1"/>
  </joint>
  <joint name="spin" type="continuous">
    <parent link="slide"/><child link="wheel"/><axis xyz="0 0 -1"/>
  </joint>
  <joint name="hinge" type="revolute">
    <parent link="wheel"/><child link="elbow"/>
    <origin xyz="0 0 0.5"/><limit lower="-1" upper="1" velocity="2" effort="1"/>
  </joint>
  <joint name="weld" type="fixed">
    <parent link="elbow"/><child link="tip"/><origin xyz="0.3 0 0" rpy="0 0 1.5707963267948966"/>
  </joint>
</robot>
"""

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def write_urdf(directory: Path, text: str = URDF, mesh: str = "meshes/part.obj", scale: str = "1 2 3") -> Path:
    (directory / "meshes").mkdir(exist_ok=True)
    (directory / "meshes" / "part.obj").write_text(TETRAHEDRON)
    path = directory / "machine.urdf"
    path.write_text(text.replace("{mesh}", mesh).replace("{scale}", scale))
    return path


def about(axis, angle):
    """Rotation about a coordinate axis, from the textbook."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return matrix


def test_urdf_with_every_kind_of_joint_has_the_kinematics_on_paper(tmp_path):
    arm = RobotArm.from_urdf(write_urdf(tmp_path))
    assert arm.name == "machine"
    assert list(arm.links) == ["base", "slide", "wheel", "elbow", "tip"]
    assert arm.joint_names == ("rail", "spin", "hinge")
    assert [joint.kind for joint in arm.joints] == ["prismatic", "revolute", "revolute", "fixed"]
    assert [joint.limits for joint in arm.joints] == [(-1.0, 2.0), None, (-1.0, 1.0), None]
    assert [joint.max_velocity for joint in arm.joints] == [0.5, None, 2.0, None]

    # Roll, pitch and yaw about fixed axes; the axis is made a unit vector; a hinge without one turns about x.
    rail, spin, hinge = 0.7, 0.9, -0.4
    rotation = about("z", 0.6) @ about("y", -0.5) @ about("x", 0.4)
    position = np.array([0.1, 0.2, 0.3]) + rotation @ [0.0, rail, 0.0]
    rotation = rotation @ about("z", -spin)
    np.testing.assert_allclose(arm.link_pose("wheel", [rail, spin, hinge]).rotation, rotation, atol=ROUNDING)
    position = position + rotation @ [0.0, 0.0, 0.5]
    rotation = rotation @ about("x", hinge)
    tip = arm.link_pose("tip", [rail, spin, hinge])
    np.testing.assert_allclose(tip.position, position + rotation @ [0.3, 0.0, 0.0], atol=ROUNDING)
    np.testing.assert_allclose(tip.rotation, rotation @ about("z", 0.5 * np.pi), atol=ROUNDING)


def test_velocities_through_a_prismatic_joint_equal_finite_differences(tmp_path):
    moving = RobotArm.from_urdf(write_urdf(tmp_path), meshes=None).moving(some_trajectory(3))
    motion, step = moving.link_motion("tip"), 1e-5
    difference = (matrix(motion.at(1.2 + step)) - matrix(motion.at(1.2 - step))) / (2.0 * step)
    np.testing.assert_allclose(motion.rate_at(1.2), difference, atol=1e-6)


def test_urdf_shapes_have_their_size_and_place(tmp_path):
    arm = RobotArm.from_urdf(write_urdf(tmp_path))
    # Box and a cylinder turned to lie along x.
    np.testing.assert_allclose(arm.links["base"].bounds, [[-0.2, -0.15, -0.1], [1.3, 0.15, 0.1]], atol=1e-9)
    assert arm.links["base"].volume == pytest.approx(0.012 + np.pi * 0.006, rel=2e-3)  # facets inside the cylinder
    np.testing.assert_allclose(arm.links["slide"].bounds, [[-0.2] * 3, [0.2] * 3], atol=2e-4)
    np.testing.assert_allclose(arm.links["wheel"].bounds, [[0, 0, 1], [1, 2, 4]])
    assert arm.links["wheel"].volume == pytest.approx(1.0)
    assert arm.links["tip"] is None
    assert not any(RobotArm.from_urdf(tmp_path / "machine.urdf", meshes=None).links.values())


def test_mirrored_mesh_keeps_its_normals_outwards(tmp_path):
    arm = RobotArm.from_urdf(write_urdf(tmp_path, scale="1 -2 3"))
    assert arm.links["wheel"].volume == pytest.approx(1.0)
    np.testing.assert_allclose(arm.links["wheel"].bounds, [[0, -2, 1], [1, 0, 4]])


def test_packages_are_found_around_the_file_and_where_one_says(tmp_path):
    (tmp_path / "factory").mkdir()
    path = write_urdf(tmp_path / "factory", mesh="package://factory/meshes/part.obj")
    assert RobotArm.from_urdf(path).links["wheel"] is not None
    elsewhere = write_urdf(tmp_path, mesh="package://store/meshes/part.obj")
    assert RobotArm.from_urdf(elsewhere, package_directories={"store": tmp_path}).links["wheel"] is not None
    with pytest.raises(FileNotFoundError, match="package 'store' is not among package_directories"):
        RobotArm.from_urdf(elsewhere)


def test_missing_files_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"absent\.urdf"):
        RobotArm.from_urdf(tmp_path / "absent.urdf")
    with pytest.raises(FileNotFoundError, match=r"lost\.obj"):
        RobotArm.from_urdf(write_urdf(tmp_path, mesh="meshes/lost.obj"))
    with pytest.raises(FileNotFoundError, match=r"missing\.obj"):
        RobotArm.from_urdf(write_urdf(tmp_path), meshes="visual")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</robot>", "", r"\d\d: no element found"),
        ('<link name="elbow"/>', '<link name="elbow">', r"\d\d: mismatched tag"),
        ("robot", "sdf", "expected <robot>, got <sdf>"),
        ('xyz="0.1 0.2 0.3"', 'xyz="0.1 0.2"', "joint 'rail', xyz: expected 3 numbers, got '0.1 0.2'"),
        ('velocity="0.5"', 'velocity="fast"', "joint 'rail', velocity: expected 1 number, got 'fast'"),
        ('type="fixed"', 'type="floating"', "joint 'weld': expected revolute, continuous, prismatic or fixed"),
        ('<parent link="wheel"/>', "", "joint 'hinge': expected <parent> and <child>, got no <parent>"),
        ('<child link="elbow"/>', '<child link="elbo"/>', "joint 'hinge', child: no link 'elbo'; did you mean 'elbow'"),
        ('xyz="0 2 0"', 'xyz="0 0 0"', "joint 'rail', axis: expected a direction, got zero"),
        ('radius="0.2"', 'radius="-0.2"', "link 'slide', collision, radius: expected positive numbers"),
        ('<sphere radius="0.2"/>', "<cone/>", "expected mesh, box, cylinder or sphere, got <cone>"),
        ('<sphere radius="0.2"/>', "", "link 'slide', collision: expected a <geometry> with a shape"),
        ('<child link="tip"/>', '<child link="elbow"/>', "expected one to lead to every link"),
        ('<link name="tip"/>', '<link name="tip"/><link name="stray"/>', "expected one link without a parent"),
        ('scale="1 2 3"', 'scale="1 0 3"', "scale: expected numbers other than zero"),
        ('radius="0.2"', 'radius="1e308"', "link 'slide', collision: sagitta: expected at least"),
        (
            'xyz="0.1 0.2 0.3"',
            'xyz="0.1 0.2 1e31"',
            "joint 'rail', origin: position: expected coordinates within 1e.15 m",
        ),
        ('scale="1 2 3"', 'scale="1 2 1e308"', "vertices: expected coordinates below 1e15 m"),
    ],
)
def test_bad_urdf_says_where_and_what(tmp_path, old, new, message):
    path = write_urdf(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=rf"machine\.urdf:.*{message}"):
        RobotArm.from_urdf(path)


def test_mimicking_joints_are_announced(tmp_path):
    path = write_urdf(tmp_path, URDF.replace('<axis xyz="0 0 -1"/>', '<axis xyz="0 0 -1"/><mimic joint="rail"/>'))
    with pytest.warns(UserWarning, match="joint 'spin' mimics another"):
        assert "spin" in RobotArm.from_urdf(path).joint_names


def test_joints_in_a_ring_are_refused():
    joints = [Joint("a", "one", "two", kind="fixed"), Joint("b", "two", "one", kind="fixed")]
    with pytest.raises(ValueError, match="hang on 'base', got a ring of"):
        RobotArm(joints, {"base": None, "one": None, "two": None})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "ball"}, "kind: expected one of"),
        ({"kind": "revolute"}, "axis: expected a direction for a revolute joint, got None for 'j'"),
        ({"kind": "fixed", "axis": (0, 0, 1)}, "axis: expected None for a fixed joint"),
        ({"axis": (0, 0, 0)}, "axis: expected a direction, got zero"),
    ],
)
def test_bad_joints_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Joint("j", "a", "b", **arguments)


def test_unknown_names_are_answered_with_near_ones(ur10):
    with pytest.raises(KeyError, match="no link 'tool'; did you mean 'tool0'"):
        ur10.link_pose("tool", CHECK_POSE)
    with pytest.raises(KeyError, match="did you mean 'forearm_link'"):
        ur10.moving(CHECK_POSE).link_motion("fore_arm_link")
    with pytest.raises(KeyError, match="no moving joint 'elbow'; did you mean 'elbow_joint'"):
        ur10.link_pose("tool0", {"elbow": 1.0})
    with pytest.raises(ValueError, match=r"joint_angles: expected shape \(6,\), got \(5,\)"):
        ur10.link_pose("tool0", CHECK_POSE[:5])
    with pytest.raises(ValueError, match=r"joint_motion: expected shape \(6,\), got \(3,\)"):
        ur10.moving(some_trajectory(3))


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


@pytest.mark.parametrize(
    ("times", "angles", "message"),
    [
        ([0.0], [[1.0]], "times: expected at least two, got 1"),
        ([0.0, 1.0, 1.0], [[0.0]] * 3, "times: expected increasing"),
        ([0.0, 1.0], [[0.0]] * 3, r"angles: expected shape \(2, n\), got \(3, 1\)"),
        ([0.0, 1.0], [0.0, 1.0], r"angles: expected shape \(2, n\), got \(2,\)"),
        ([0.0, np.nan], [[0.0], [1.0]], "times: expected finite"),
    ],
)
def test_bad_trajectories_are_refused(times, angles, message):
    with pytest.raises(ValueError, match=message):
        JointTrajectory(times, angles)


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


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 1e200), (-0.3, 0.5, 0.4)])
def test_line_is_straight_at_constant_speed_and_keeps_the_orientation(ur10, direction):
    speed, duration, ramp = 0.25, 1.5, 0.25
    line = cartesian_line(ur10, CHECK_POSE, direction, speed, duration, start_time=2.0)
    tool = ur10.moving(line).link_motion("tool0")
    start, unit = ur10.link_pose("tool0", CHECK_POSE), np.array(direction) / math.hypot(*direction)
    for time in 2.0 + np.random.default_rng(7).uniform(0.0, duration, 300):
        pose, velocity = tool.at(time), tool.rate_at(time)[:, 3]
        way = pose.position - start.position
        assert np.linalg.norm(way - (way @ unit) * unit) < 2e-6  # the bound that is promised, in any direction
        np.testing.assert_allclose(pose.rotation, start.rotation, atol=2e-6)
        if ramp <= time - 2.0 <= duration - ramp:
            np.testing.assert_allclose(velocity, speed * unit, atol=1e-3)
    # It begins and ends at rest, speed x (duration - ramp) apart, and the knots are exact.
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


@pytest.mark.parametrize(
    ("angles", "direction", "speed", "duration", "message"),
    [
        (CHECK_POSE, [0.0, 1.0, 0.0], 2.0, 0.6, "asks too much of the arm: joint 'shoulder_pan_joint' moves at"),
        (CHECK_POSE, [0.0, 0.0, 0.0], 0.25, 1.0, "direction: expected a direction, got zero"),
        (CHECK_POSE, [1.0, 0.0, 0.0], -0.25, 1.0, "speed: expected a positive number"),
        (CHECK_POSE, [1.0, 0.0, 0.0], 0.25, 0.4, "duration: expected at least two ramps, 0.5 s, got 0.4"),
        (CHECK_POSE, [1.0, 0.0, 0.0], 1e-9, 1e9, "duration: expected at most 3600 s, got 1e.09"),
    ],
)
def test_lines_that_cannot_be_are_refused(ur10, angles, direction, speed, duration, message):
    with pytest.raises(ValueError, match=message):
        cartesian_line(ur10, angles, direction, speed, duration)


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
