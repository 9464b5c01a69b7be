"""Inputs of single files: OBJ, scenes, antenna patterns, robots."""

from __future__ import annotations

import json
import math
import tomllib
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

import radarcore as rc
from fuzz.cases import Case, damaged_tree
from radarcore.geometry.mesh_files import load_mesh, load_meshes
from radarcore.models.robots.arm import RobotArm
from radarcore.radar.pattern import TabulatedPattern
from scene_files import EXAMPLES, PARTS
from solids import CUBE_VERTICES

# OBJ.

_CUBE = f"""\
# a cube
mtllib cube.mtl
o cube
{CUBE_VERTICES}vt 0 0
vn 0 0 1
g sides
usemtl steel
f 4 3 2 1
f 5/1/1 6/1/1 7/1/1 8/1/1
f -8//1 -7//1 -3//1 -4//1
f 2 3 7 \\
6
usemtl glass
f 3 4 8 7
f 4 1 5 8
"""


def obj_seeds() -> list[Case]:
    texts = (_CUBE.encode(), PARTS.encode(), ("\ufeff" + _CUBE).encode("utf-16"))
    return [{"mesh.obj": data} for data in texts]


def make_obj(random: Random) -> Case:
    """Statements with any indices and numbers; polygons of corners on a grid, which meet, repeat and cross."""
    lift = random.choice((0.0, 0.0, 0.5))
    lines = [f"v {i % 5} {i // 5} {lift * random.random()}" for i in range(random.choice((25, 25, 25, 3, 0)))]
    for _ in range(random.choice((1, 3, 10, 30))):
        match random.randrange(6):
            case 0:
                lines.append("v " + " ".join(_obj_number(random) for _ in range(random.choice((2, 3, 3, 3, 4, 6)))))
            case 1 | 2 | 3:
                number = random.choice((3, 3, 3, 3, 3, 4, 5, 8, 30, 300, 2))
                corners = " ".join(_corner(random) for _ in range(number)) + " "
                lines.append("f " + corners * random.choice((1, 1, 1, 1, 1, 1, 1, 1, 2, 400)))
            case 4:
                word, name = random.choice(("o", "g", "usemtl", "mtllib")), random.choice(("", "a", "b c", "\u00e9"))
                lines.append(f"{word} {name}")
            case _:
                lines.append(random.choice(("l 1 2", "p 1", "vt 0 0", "vn 0 0 1", "s off", "call x", "\\", "curv 1 2")))
    text = random.choice(("\n", "\n", "\n", "\r\n", "\r")).join(lines)
    return {"mesh.obj": text.encode(random.choice(("utf-8", "utf-8", "utf-8", "utf-16", "latin-1")), "replace")}


def _obj_number(random: Random) -> str:
    hostile = random.choice(("1e15", "9e14", "1e308", "1e-320", "-0", "nan", "inf", "+.5", "1e999", "0x1"))
    return hostile if random.random() < 0.01 else f"{random.uniform(-9, 9):.3f}"


def _corner(random: Random) -> str:
    if random.random() < 0.01:
        index = random.choice((-random.randint(1, 25), -random.randint(1, 25), 0, 26, 2**32 + 1, 2**64))
        return f"{index}{random.choice(('', '', '/1', '//1', '/1/1', '/x', '/'))}"
    return str(random.randint(1, 25))


def read_obj(folder: Path) -> None:
    path = folder / "mesh.obj"
    mesh = load_mesh(path)
    assert np.isfinite(mesh.vertices).all()
    assert mesh.triangles.max(initial=0) < len(mesh.vertices)
    parts = load_meshes(path, split_by="material").values()
    # Facets that two parts list in both windings are one of the whole.
    assert sum(len(part.triangles) + part.num_merged for part in parts) == len(mesh.triangles) + mesh.num_merged


# Scene files.

_RARE = """\
[radar]
start_frequency = 60e9
stop_frequency = 61e9
sample_rate = 2e6
num_samples = 32
tx = [[0, 0, 0], [0, 0.002, 0]]
rx = [[0, 0, 0.01], [0, 0.0025, 0.01]]
polarization = "vertical"
rx_patterns = [{ gain_db = 3.0 }, { path = "pattern.csv" }]
receiver = { output = "real", noise_figure_db = 12.0 }

[sensor]
pose = { position = [0, 0, 1], rpy_deg = [0, 5, 0] }
motion = { kind = "linear", velocity = [0.1, 0, 0], angular_velocity = [0, 0, 0.1] }

[run]
stop = 0.2
resolution = [64, 32]
sampling = "fast"
rcs_floor = 0.01
ray_budget = 100000
seed = 3

[[material]]
name = "oak"
permittivity = [2.0, 0.1]
thickness = 0.01
scattering = 0.3

[[body]]
name = "table"
shape = { kind = "mesh", path = "mesh.obj", scale = 0.2 }
material = "oak"
materials = { steel = "metal", glass = { permittivity = "concrete", roughness = 0.001 } }
pose = { position = [3, 0, 0.5], wxyz = [1, 0, 0, 0] }

[[body]]
shape = { kind = "trihedral", leg = 0.1, shape = "square" }
attached_to = "table"

[[body]]
shape = { kind = "disc", radius = 0.1 }
motion = { kind = "trajectory", times = [0, 1], poses = [{ position = [2, 0, 0] }, { look_at = [0, 0, 0] }] }

[[body]]
shape = { kind = "capsule", radius = 0.1, length = 0.5 }
pose = { position = [4, 2, 0] }

[[arm]]
pose = { position = [6, 0, 0] }
joints = { kind = "rest", angles_deg = [0, -90, 90, 0, 0, 0] }

[[arm]]
name = "own"
model = "robot.urdf"
pose = { position = [15, 0, 0] }
joints = { kind = "trajectory", times = [0, 1], angles_deg = [[0, 0.1], [10, 0.1]] }
"""
"""A scene with the entries that the examples do not have."""

_PATTERN = "azimuth_deg, elevation_deg, gain_db\n-90, -90, 0\n-90, 90, 1\n90, -90, 2\n90, 90, 3\n"

_ROBOT = """\
<?xml version="1.0"?>
<robot name="two">
  <link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="arm"><collision><origin xyz="0 0 0.1" rpy="0 0 0"/>
    <geometry><cylinder radius="0.03" length="0.2"/></geometry></collision></link>
  <link name="hand"><collision><geometry><mesh filename="mesh.obj" scale="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="tool0"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.1"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="end" type="fixed"><parent link="hand"/><child link="tool0"/></joint>
</robot>
"""

_BESIDE = {"mesh.obj": PARTS.encode(), "pattern.csv": _PATTERN.encode(), "robot.urdf": _ROBOT.encode()}
_BESIDE["wedge.obj"] = (EXAMPLES[0].parent / "wedge.obj").read_bytes()
"""Files that a scene names."""


def _toml(value: Any) -> str:
    """A value in TOML; tables inline."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {_toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    return '""' if value is None else json.dumps(value)


def _scene(tree: dict[str, Any]) -> Case:
    text = "".join(f"{json.dumps(key)} = {_toml(value)}\n" for key, value in tree.items())
    return {"scene.toml": text.encode("utf-8", "replace"), **_BESIDE}


@cache
def _trees() -> list[dict[str, Any]]:
    return [tomllib.loads(text) for text in (_RARE, *(path.read_text() for path in EXAMPLES))]


def scene_seeds() -> list[Case]:
    return [_scene(tree) for tree in _trees()]


def make_scene(random: Random) -> Case:
    tree = random.choice(_trees())
    part = random.choice(sorted(tree))
    if random.random() < 0.7:  # most of the tree is of no interest to a fault in one part
        return _scene(tree | {part: damaged_tree({part: tree[part]}, random).get(part, [])})
    return _scene(damaged_tree(tree, random))


def read_scene(folder: Path) -> None:
    rc.load_scene(folder / "scene.toml")


# Antenna patterns and robots.


def pattern_seeds() -> list[Case]:
    return [{"pattern.csv": data} for data in (_PATTERN.encode(), _PATTERN.replace("\n", "\r\n").encode("utf-8-sig"))]


def make_pattern(random: Random) -> Case:
    numbers = ("-90", "0", "90", "180", "-180", "1e308", "-1e308", "nan", "1e-320", "", "x", '"', "400", "360")
    rows = [_PATTERN.splitlines()[0]]
    for azimuth in random.sample(numbers[:5], random.randint(1, 4)):
        rows += [f"{azimuth},{elevation},{random.uniform(-9, 9)}" for elevation in (-90, 0, 90)]
    for _ in range(random.randrange(3)):
        row = random.randrange(len(rows))
        entries = rows[row].split(",")
        entries[random.randrange(len(entries))] = random.choice(numbers)
        rows[row] = ",".join(entries)
    return {"pattern.csv": "\n".join(rows).encode()}


def read_pattern(folder: Path) -> None:
    pattern = TabulatedPattern.load(folder / "pattern.csv")
    assert np.isfinite(pattern.gain(0.1, 0.2))


def robot_seeds() -> list[Case]:
    return [{"robot.urdf": _ROBOT.encode(), "mesh.obj": PARTS.encode()}]


def make_robot(random: Random) -> Case:
    """The robot with words in the place of others."""
    words = ["0", "-1", "nan", "1e308", "1e-320", "", "x", "0 0 0", "/dev/zero"]
    words += ["base", "arm", "tool0", "fixed", "prismatic"]
    pieces = _ROBOT.split('"')
    for _ in range(random.choice((1, 1, 2, 5))):
        pieces[random.randrange(len(pieces) // 2) * 2 + 1] = random.choice(words)
    return {"robot.urdf": '"'.join(pieces).encode(), "mesh.obj": PARTS.encode()}


def read_robot(folder: Path) -> None:
    arm = RobotArm.from_urdf(folder / "robot.urdf")
    arm.link_poses(np.zeros(len(arm.joint_names)))
