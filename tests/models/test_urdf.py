"""Arms of URDF files: kinematics on paper, shapes, meshes of packages, and files that are wrong."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from arms import ROUNDING, matrix, some_trajectory
from radarcore.models.robots.arm import RobotArm

URDF = """<?xml version="1.0"?>
<robot name="machine">
  <link name="base">
    <collision><origin xyz="0 0 0.05"/><geometry><box size="0.4 0.3 0.1"/></geometry></collision>
    <collision><origin xyz="1 0 0" rpy="0 1.5707963267948966 0"/>
      <geometry><cylinder radius="0.1" length="0.6"/></geometry></collision>
    <visual><geometry><mesh filename="missing.obj"/></geometry></visual>
  </link>
  <link name="slide"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
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

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def write_urdf(directory: Path, text: str = URDF, mesh: str = "meshes/part.obj", scale: str = "1 2 3") -> Path:
    (directory / "meshes").mkdir(exist_ok=True)
    (directory / "meshes" / "part.obj").write_text(TETRAHEDRON)
    path = directory / "machine.urdf"
    path.write_text(text.replace("{mesh}", mesh).replace("{scale}", scale))
    return path


def about(axis, angle):
    """Rotation about a coordinate axis."""
    return Rotation.from_euler(axis, angle).as_matrix()


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
    np.testing.assert_allclose(arm.links["slide"].bounds, [[-0.02] * 3, [0.02] * 3], atol=5e-5)
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
        ('<link name="tip"/>', '<link name="${tip}"/>', "got one with macros of xacro; expand it"),
        ('<link name="tip"/>', '<xacro:tool name="tip"/>', "got one with macros of xacro"),
        ('<robot name="machine">', f'<robot name="m" {XACRO}><xacro:arg name="a"/>', "got one with macros of xacro"),
        ('rpy="0.4 -0.5 0.6"', 'rpy="0 0 0" quat_xyzw="0 0 0 1"', "'rail', origin: expected rpy or quat_xyzw, got"),
        ('rpy="0.4 -0.5 0.6"', 'quat_xyzw="0 0 1"', "joint 'rail', quat_xyzw: expected 4 numbers, got '0 0 1'"),
        ('rpy="0.4 -0.5 0.6"', 'quat_xyzw="0 0 0 0"', "joint 'rail', origin: .*zero"),
        ("robot", "sdf", "expected <robot>, got <sdf>"),
        ('xyz="0.1 0.2 0.3"', 'xyz="0.1 0.2"', "joint 'rail', xyz: expected 3 numbers, got '0.1 0.2'"),
        ('velocity="0.5"', 'velocity="fast"', "joint 'rail', velocity: expected 1 number, got 'fast'"),
        ('type="fixed"', 'type="floating"', "joint 'weld': expected revolute, continuous, prismatic or fixed"),
        ('<parent link="wheel"/>', "", "joint 'hinge': expected <parent> and <child>, got no <parent>"),
        ('<child link="elbow"/>', '<child link="elbo"/>', "joint 'hinge', child: no link 'elbo'; did you mean 'elbow'"),
        ('xyz="0 2 0"', 'xyz="0 0 0"', "joint 'rail': axis: expected a direction, got zero"),
        ('radius="0.02"', 'radius="-0.02"', "link 'slide', collision: radius: expected a positive number"),
        ('<sphere radius="0.02"/>', "<cone/>", "expected mesh, box, cylinder or sphere, got <cone>"),
        ('<sphere radius="0.02"/>', "", "link 'slide', collision: expected a <geometry> with a shape"),
        ('<child link="tip"/>', '<child link="elbow"/>', "expected one to lead to every link"),
        ('<link name="tip"/>', '<link name="tip"/><link name="stray"/>', "expected one link without a parent"),
        ('scale="1 2 3"', 'scale="1 0 3"', "scale: expected numbers other than zero"),
        ('radius="0.02"', 'radius="1e308"', "link 'slide', collision: sagitta: expected at least"),
        ('xyz="0.1 0.2 0.3"', 'xyz="0.1 0.2 1e31"', "'rail', origin: position: expected coordinates within 1e.15 m"),
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


def test_quaternions_of_urdf_1_1_turn_origins(tmp_path):
    """A quarter turn about z, x y z w: the cylinder's axis of the box's link lies along x all the same."""
    half = np.sqrt(0.5)
    text = URDF.replace('rpy="0.4 -0.5 0.6"', f'quat_xyzw="0 0 {half} {half}"')
    text = text.replace('rpy="0 1.5707963267948966 0"', f'quat_xyzw="0 {half} 0 {half}"')
    arm = RobotArm.from_urdf(write_urdf(tmp_path, text))
    np.testing.assert_allclose(arm.link_pose("slide", [0, 0, 0]).rotation, about("z", 0.5 * np.pi), atol=ROUNDING)
    np.testing.assert_allclose(arm.links["base"].bounds, [[-0.2, -0.15, -0.1], [1.3, 0.15, 0.1]], atol=1e-9)


def test_expanded_files_of_xacro_are_read(tmp_path):
    """The tags keep the namespace of xacro."""
    text = URDF.replace('<robot name="machine">', f'<robot name="m" {XACRO}>')
    assert RobotArm.from_urdf(write_urdf(tmp_path, text), meshes=None).name == "m"


@pytest.mark.parametrize(("kind", "other"), [("collision", "visual"), ("visual", "collision")])
def test_urdf_with_only_the_other_kind_of_shapes_raises_a_warning(tmp_path, kind, other):
    shape = f'<{other}><geometry><box size="0.5 0.5 0.5"/></geometry></{other}>'
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="base">{shape}</link></robot>')
    with pytest.warns(
        UserWarning, match=rf"r\.urdf: no link has a <{kind}> shape.*; meshes='{other}' takes its 1 of kind"
    ):
        assert RobotArm.from_urdf(tmp_path / "r.urdf", meshes=kind).links == {"base": None}
    assert RobotArm.from_urdf(tmp_path / "r.urdf", meshes=None).links == {"base": None}


def test_mimicking_joints_are_announced(tmp_path):
    path = write_urdf(tmp_path, URDF.replace('<axis xyz="0 0 -1"/>', '<axis xyz="0 0 -1"/><mimic joint="rail"/>'))
    with pytest.warns(UserWarning, match="joint 'spin' mimics another"):
        assert "spin" in RobotArm.from_urdf(path, meshes=None).joint_names
