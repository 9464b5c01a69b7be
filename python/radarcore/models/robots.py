"""Real meshes of a UR10 arm and of a human, from the package example-robot-data (extra `robots`)."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.files import load_mesh
from radarcore.geometry.mesh import Mesh
from radarcore.models import urdf
from radarcore.models.arm import JointAngles, RobotArm


class Link(NamedTuple):
    """One rigid part of a model."""

    name: str
    vertices: NDArray[np.float64]
    """(n, 3) in mesh coordinates [m]."""
    triangles: NDArray[np.int64]
    """(m, 3) rows of `vertices`."""
    pose: NDArray[np.float64]
    """(4, 4) from mesh coordinates to those of the model."""


# ISB axes (x forward, y up, z right) to ours (x forward, y left, z up): (x, y, z) -> (x, -z, y).
_ISB_TO_Z_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

_HUMAN = "human_description/robots/human.urdf"


def is_available() -> bool:
    """True when the extra `robots` is installed."""
    try:
        importlib.metadata.distribution("example-robot-data")
        import trimesh  # noqa: F401  # only whether it is there
    except ImportError:
        return False
    return True


def through_obj(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> Mesh:
    """A mesh, written to an OBJ file and read back by radarcore's own reader."""
    import trimesh

    with TemporaryDirectory() as directory:
        path = Path(directory) / "mesh.obj"
        trimesh.Trimesh(vertices, triangles, process=False).export(path)
        return load_mesh(path)


def ur10_links(joint_angles: JointAngles) -> list[Link]:
    """Collision meshes of a UR10 (7 closed or nearly closed meshes, 5862 triangles) in ``base_link``.

    Parameters
    ----------
    joint_angles : (6,)
        Shoulder pan, shoulder lift, elbow, wrist 1, 2, 3 [rad].
    """
    return _links("urdf/ur10_robot.urdf", "collision", joint_angles)


def human_links(joint_angles: Mapping[str, float] | None = None) -> list[Link]:
    """Meshes of a human who faces +x and stands on the floor z = 0 (23 closed meshes, 1.8 m tall).

    Parameters
    ----------
    joint_angles : mapping, optional
        Angle [rad] by name of the URDF joint, such as ``left_knee_Z``; those left out are zero (arms hanging).
    """
    links = _human_links(joint_angles or {})

    # Put the lowest vertex on the floor.
    lowest = _lowest(links)
    for link in links:
        link.pose[2, 3] -= lowest
    return links


def human_joints() -> dict[str, NDArray[np.float64]]:
    """Origins (3,) of the links of `human_links` with all joints at zero [m], by name: the joint that moves each."""
    model = urdf.read(_data_file(_HUMAN), geometry="visual")
    tree = RobotArm(model.joints, dict.fromkeys(model.links))
    floor = np.array([0.0, 0.0, _lowest(_human_links({}))])
    return {name: _ISB_TO_Z_UP[:3, :3] @ tree.link_pose(name, {}).position - floor for name in model.links}


def _human_links(joint_angles: Mapping[str, float]) -> list[Link]:
    """Every mesh of the human, in the pelvis' coordinates with z up."""
    return [link._replace(pose=_ISB_TO_Z_UP @ link.pose) for link in _links(_HUMAN, "visual", joint_angles)]


def _lowest(links: list[Link]) -> float:
    """Height of the lowest vertex [m]."""
    return float(min((link.vertices @ link.pose[2, :3] + link.pose[2, 3]).min() for link in links))


def _links(urdf_file: str, geometry: Literal["visual", "collision"], joint_angles: JointAngles) -> list[Link]:
    """Every mesh of a URDF file of the package, posed in its root link."""
    model = urdf.read(_data_file(urdf_file), geometry=geometry)
    tree = RobotArm(model.joints, dict.fromkeys(model.links))
    links: list[Link] = []
    for name, parts in model.links.items():
        for part in parts:
            if not isinstance(part.source, Path):
                continue  # the arm's tool: a box of 1 cm
            vertices, triangles = _read_mesh(part.source)
            pose = np.eye(4)
            placed = tree.link_pose(name, joint_angles) @ part.origin
            pose[:3, :3], pose[:3, 3] = placed.rotation, placed.position
            links.append(Link(f"{name}/{part.source.stem}", vertices * part.scale, triangles, pose))
    return links


@cache
def _read_mesh(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Read a mesh; equal vertices are merged (STL has none in common)."""
    try:
        import trimesh
    except ImportError:
        raise ImportError("robot and human meshes need trimesh: pip install radarcore[robots]") from None
    mesh: Any = trimesh.load(path, force="mesh")
    vertices, triangles = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64)
    vertices.flags.writeable = triangles.flags.writeable = False
    return vertices, triangles


def _data_file(end: str) -> Path:
    """Path of the package's file whose path ends so, wherever the package is installed."""
    try:
        files = importlib.metadata.files("example-robot-data") or []
    except importlib.metadata.PackageNotFoundError:
        raise ImportError("robot and human meshes need example-robot-data: pip install radarcore[robots]") from None
    return Path(str(next(file.locate() for file in files if str(file).endswith("/" + end))))
