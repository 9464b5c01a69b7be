"""Arms by name: kinematics by the makers' tables, shapes by an own count of their files."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import radarcore as rc
from arms import matrix, needs_robots
from radarcore.models import RobotArm, robots
from radarcore.models.robots import urdf
from radarcore.models.robots.named import ARMS, data_file

pytestmark = needs_robots
needs_collada = pytest.mark.skipif(
    not importlib.util.find_spec("collada"), reason="needs the extra `robots`: pip install radarcore[robots]"
)

# Denavit-Hartenberg parameters by Universal Robots: d1, a2, a3, d4, d5, d6 [m].
UR = {
    "ur3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "ur5": (0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "ur10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
}
# Craig's parameters by Franka Emika: a, d [m] and alpha [quarter turns] of every joint; the flange is 0.107 m out.
PANDA = [(0, 0.333, 0), (0, 0, -1), (0, 0.316, 1), (0.0825, 0, 1), (-0.0825, 0.384, -1), (0, 0, 1), (0.088, 0, 1)]


@cache
def arm(name: str, meshes: str | None) -> RobotArm:
    return RobotArm.named(name, meshes=meshes)  # type: ignore[arg-type]


def turn(*rpy: float) -> rc.Pose:
    return rc.Pose.from_rpy([0.0, 0.0, 0.0], rpy)


@pytest.mark.parametrize("name", UR)
def test_flange_of_universal_robots_is_where_their_parameters_put_it(name: str) -> None:
    d1, a2, a3, d4, d5, d6 = UR[name]
    quarter = np.pi / 2
    table = [(0, d1, quarter), (a2, 0, 0), (a3, 0, 0), (0, d4, quarter), (0, d5, -quarter), (0, d6, 0)]
    for angles in np.random.default_rng(5).uniform(-np.pi, np.pi, (5, 6)):
        expected = rc.Pose()
        for q, (a, d, alpha) in zip(angles, table, strict=True):
            expected = expected @ turn(0.0, 0.0, q) @ rc.Pose([a, 0.0, d]) @ turn(alpha, 0.0, 0.0)
        # `base` is the makers' base frame. The files round to 1e-5 m and take pi/2 to 1e-10.
        found = arm(name, None).link_pose("base", angles).inverse() @ arm(name, None).link_pose("tool0", angles)
        np.testing.assert_allclose(matrix(found), matrix(expected), atol=2e-5)


def test_flange_of_the_panda_is_where_its_parameters_put_it() -> None:
    panda = arm("panda", None)
    assert panda.joint_names == tuple(f"panda_joint{number}" for number in range(1, 8))
    for angles in np.random.default_rng(6).uniform(-1.5, 1.5, (5, 7)):
        expected = rc.Pose()
        for q, (a, d, quarters) in zip(angles, PANDA, strict=True):
            expected = expected @ turn(quarters * np.pi / 2, 0.0, 0.0) @ rc.Pose([a, 0.0, 0.0])
            expected = expected @ turn(0.0, 0.0, q) @ rc.Pose([0.0, 0.0, d])
        found = panda.link_pose("panda_link8", angles)
        np.testing.assert_allclose(matrix(found), matrix(expected @ rc.Pose([0.0, 0.0, 0.107])), atol=1e-9)


@pytest.mark.parametrize("name", ["panda", "kinova", "xarm7", "so100", "so101"])
def test_links_are_where_mujoco_puts_them(name: str) -> None:
    mujoco: Any = pytest.importorskip("mujoco", reason="needs the extra `mujoco`: pip install radarcore[mujoco]")
    root = ET.parse(data_file(ARMS[name].file)).getroot()
    for link in root.iterfind("link"):
        for element in [*link.iterfind("visual"), *link.iterfind("collision")]:
            link.remove(element)  # shapes do not matter, and MuJoCo does not read all of them
    compiler = ET.SubElement(ET.SubElement(root, "mujoco"), "compiler")
    compiler.attrib |= {"fusestatic": "false", "boundmass": "1", "boundinertia": "1", "balanceinertia": "true"}
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    state = mujoco.MjData(model)
    known = arm(name, None)
    angles = np.random.default_rng(7).uniform(-1.0, 1.0, len(known.joint_names))
    for joint, angle in zip(known.joint_names, angles, strict=True):
        state.joint(joint).qpos[0] = angle
    mujoco.mj_kinematics(model, state)
    bodies = {model.body(number).name for number in range(model.nbody)} & set(known.links)
    assert len(bodies) >= len(known.joint_names)
    for link in bodies:
        ours = known.link_pose(link, angles)
        np.testing.assert_allclose(ours.position, state.body(link).xpos, atol=1e-9)
        np.testing.assert_allclose(ours.rotation, state.body(link).xmat.reshape(3, 3), atol=1e-9)


def test_every_arm_has_its_joints() -> None:
    for name in ARMS:
        assert len(arm(name, None).joint_names) == (7 if name in ("panda", "xarm7") else 6), name


@pytest.mark.parametrize(  # the others have large files
    ("name", "count"), [("ur5", 5328), ("ur10", 5862), ("panda", 2396), ("xarm7", 41096)]
)
def test_arms_have_closed_shapes_that_face_outwards(name: str, count: int) -> None:
    found = arm(name, "collision")
    assert found.name == name
    meshes = [mesh for mesh in found.links.values() if mesh is not None]
    assert len(meshes) >= 5
    assert sum(len(mesh.triangles) for mesh in meshes) == count
    assert min(mesh.volume for mesh in meshes) > 1e-5  # 10 ml: a finger
    assert len(found.moving(np.zeros(len(found.joint_names))).bodies()) == len(meshes)


def test_joints_count_from_the_base_outwards() -> None:
    # The file has them in the opposite order.
    names = "shoulder_pan shoulder_lift elbow_flex wrist_flex wrist_roll gripper"
    assert arm("so101", None).joint_names == tuple(names.split())


def test_marks_for_the_eye_are_no_bodies() -> None:
    assert arm("ur5", "collision").links["ee_link"] is None


def triangles_in(path: Path) -> int:
    """Triangles of a DAE file that shows every geometry once, by its text."""
    return sum(map(int, re.findall(r'<triangles[^>]* count="(\d+)"', path.read_text(encoding="utf-8"))))


@needs_collada
def test_visual_shapes_have_all_triangles_of_their_files() -> None:
    counts = {}
    for name in ("ur5", "panda"):
        model = urdf.read(data_file(ARMS[name].file), geometry="visual", held=ARMS[name].held)
        # Two of the smaller ones of each; all of them take seconds.
        files = sorted(
            {p.source for parts in model.links.values() for p in parts}, key=lambda path: path.stat().st_size
        )
        for path in files[:2]:
            mesh = rc.load_mesh(path)
            counts[path.stem] = len(mesh.triangles) + mesh.num_dropped
            assert counts[path.stem] == triangles_in(path)
            assert mesh.volume > 1e-5
    assert counts == {"finger": 624, "hand": 7078, "base": 1932, "wrist3": 1658}


@needs_collada
def test_visual_and_plain_shapes_lie_in_the_same_place() -> None:
    # Without the big links: only wrists are read.
    model = urdf.read(data_file(ARMS["ur5"].file), geometry="visual")
    wrist = urdf.shapes_of(model._replace(links={"wrist_3_link": model.links["wrist_3_link"]}))["wrist_3_link"]
    plain = arm("ur5", "collision").links["wrist_3_link"]
    assert wrist is not None
    assert plain is not None
    np.testing.assert_allclose(wrist.bounds, plain.bounds, atol=1e-3)
    assert wrist.volume == pytest.approx(plain.volume, rel=0.01)


def test_every_arm_has_its_row() -> None:
    assert set(robots.arm_names()) == set(ARMS)
