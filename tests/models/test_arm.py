"""Robot arms: kinematics against published values, URDF, exact velocities, and straight lines of the tool."""

import numpy as np
import pytest

import radarcore as rc
from arms import CHECK_POSE, ROUNDING, matrix, needs_robots, some_trajectory
from radarcore.models.robots.arm import RADAR_AT_TOOL0, RobotArm
from radarcore.models.robots.named import UR10, data_file
from solids import area_vectors, is_closed

MESH_TRIANGLES = {
    "base_link": 366,
    "shoulder_link": 986,
    "upper_arm_link": 1224,
    "forearm_link": 1074,
    "wrist_1_link": 886,
    "wrist_2_link": 840,
    "wrist_3_link": 486,
}


@pytest.fixture(scope="module")
def ur10():
    return RobotArm.ur10()


@pytest.fixture(scope="module")
def ur10_meshes():
    return RobotArm.named("ur10")


@pytest.fixture
def ur10_urdf():
    return data_file(UR10)


# Kinematics


@pytest.mark.parametrize(
    ("angles", "expected"), [(np.zeros(6), (1.1843, 0.25614, 0.0116)), (CHECK_POSE, (0.84109, 0.16394, 0.35914))]
)
def test_flange_is_where_the_published_kinematics_put_it(ur10, angles, expected):
    np.testing.assert_allclose(ur10.link_pose("tool0", angles).position, expected, atol=5e-6)  # their last digit


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


def test_moving_link_is_where_its_pose_says_on_a_moving_base(ur10):
    motion, base = some_trajectory(), rc.Linear(rc.Pose([1.0, 0.0, 0.0]), [0.5, 0.0, 0.0], [0.0, 0.0, 1.0])
    moving = ur10.moving(motion, base)
    for time in (0.0, 1.0, 3.0, 1.0):
        expected = base.at(time) @ ur10.link_pose("wrist_2_link", motion.angles(time))
        np.testing.assert_allclose(matrix(moving.link_motion("wrist_2_link").at(time)), matrix(expected), atol=ROUNDING)


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


# Shapes


@pytest.mark.parametrize("link", MESH_TRIANGLES)
def test_embedded_shapes_are_closed_with_normals_outwards(ur10, link):
    mesh = ur10.links[link]
    assert is_closed(mesh)
    assert mesh.volume > 1e-4
    assert mesh.num_dropped == 0
    assert np.linalg.norm(area_vectors(mesh).sum(axis=0)) < 1e-12
    assert link != "base_link" or abs(mesh.bounds[0, 2]) < 1e-15  # it stands on the mounting plane


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
