"""Real meshes of a UR10 arm and of a human, from the package example-robot-data (extra `robots`)."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.body import Body
from radarcore.material import Material
from radarcore.mesh import load_mesh
from radarcore.motion import Pose


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


def is_available() -> bool:
    """True when the extra `robots` is installed."""
    try:
        importlib.metadata.distribution("example-robot-data")
        import trimesh  # noqa: F401  # only whether it is there
        import yourdfpy  # noqa: F401  # likewise
    except ImportError:
        return False
    return True


def link_bodies(links: list[Link], place: Pose, material: Material, directory: Path) -> list[Body]:
    """Bodies of a model that stands at `place`; every mesh is converted to OBJ in `directory` and read back."""
    import trimesh

    directory.mkdir(parents=True, exist_ok=True)
    bodies = []
    for number, link in enumerate(links):
        path = directory / f"{number:02d}_{link.name.replace('/', '_')}.obj"
        trimesh.Trimesh(link.vertices, link.triangles, process=False).export(path)
        pose = place @ Pose(link.pose[:3, 3], link.pose[:3, :3])
        bodies.append(Body(load_mesh(path), material=material, motion=pose, name=link.name.split("/")[0]))
    return bodies


def ur10_links(joint_angles: Sequence[float]) -> list[Link]:
    """Collision meshes of a UR10 (7 closed or nearly closed meshes, 5862 triangles) in ``base_link``.

    Parameters
    ----------
    joint_angles : (6,)
        Shoulder pan, shoulder lift, elbow, wrist 1, 2, 3 [rad].
    """
    return _links("urdf/ur10_robot.urdf", "collisions", _ur10_angles(joint_angles))


def human_links(joint_angles: dict[str, float] | None = None) -> list[Link]:
    """Meshes of a human who faces +x and stands on the floor z = 0 (23 closed meshes, 1.8 m tall).

    Parameters
    ----------
    joint_angles : dict, optional
        Angle [rad] by name of the URDF joint, such as ``left_knee_Z``; those left out are zero (arms hanging).
    """
    links = _links("human_description/robots/human.urdf", "visuals", joint_angles or {})
    links = [link._replace(pose=_ISB_TO_Z_UP @ link.pose) for link in links]

    # Put the lowest vertex on the floor.
    lowest = min((link.vertices @ link.pose[2, :3] + link.pose[2, 3]).min() for link in links)
    for link in links:
        link.pose[2, 3] -= lowest
    return links


def ur10_tool(joint_angles: Sequence[float]) -> NDArray[np.float64]:
    """Pose (4, 4) of the flange ``tool0`` in ``base_link``."""
    urdf = _posed_urdf("urdf/ur10_robot.urdf", _ur10_angles(joint_angles))
    return np.array(urdf.get_transform("tool0", "base_link"))


_UR10_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)


def _ur10_angles(joint_angles: Sequence[float]) -> dict[str, float]:
    if len(joint_angles) != len(_UR10_JOINTS):
        raise ValueError(f"joint_angles: expected {len(_UR10_JOINTS)} angles, got {len(joint_angles)}")
    return dict(zip(_UR10_JOINTS, joint_angles, strict=True))


def _links(urdf_file: str, kind: Literal["visuals", "collisions"], joint_angles: dict[str, float]) -> list[Link]:
    """Every mesh of a URDF file, posed in its root link."""
    urdf = _posed_urdf(urdf_file, joint_angles)
    links: list[Link] = []
    for link in urdf.robot.links:
        for element in getattr(link, kind):
            mesh = element.geometry.mesh
            if mesh is None:
                continue
            vertices, triangles = _read_mesh(mesh.filename)
            scale = np.ones(3) if mesh.scale is None else np.broadcast_to(mesh.scale, 3)
            origin = np.eye(4) if element.origin is None else element.origin
            pose = np.array(urdf.get_transform(link.name, urdf.base_link)) @ origin
            links.append(Link(f"{link.name}/{Path(mesh.filename).stem}", vertices * scale, triangles, pose))
    return links


def _posed_urdf(file: str, joint_angles: dict[str, float]) -> Any:
    """The parsed file with its joints at these angles [rad], all others at zero."""
    urdf = _urdf(file)
    names = urdf.actuated_joint_names
    if unknown := sorted(set(joint_angles) - set(names)):
        raise ValueError(f"joint_angles: expected names among {names}, got {unknown}")
    # An array of all joints: the parsed file is shared and keeps the angles of the last call.
    urdf.update_cfg(np.array([joint_angles.get(name, 0.0) for name in names]))
    return urdf


@cache
def _urdf(file: str) -> Any:
    """Parse a URDF file of the package; the meshes are read apart, so that nothing else has to be installed."""
    import yourdfpy

    return yourdfpy.URDF.load(str(_data_file(file)), load_meshes=False, build_scene_graph=True)


@cache
def _read_mesh(filename: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Read a mesh named by a ``package://`` address; equal vertices are merged (STL has none in common)."""
    import trimesh

    mesh: Any = trimesh.load(_data_file(filename.removeprefix("package://example-robot-data/")), force="mesh")
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
