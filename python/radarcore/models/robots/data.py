"""Files of the package example-robot-data (extra `robots`)."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.mesh import Mesh
from radarcore.geometry.mesh_files import load_mesh
from radarcore.geometry.pose import Pose
from radarcore.models.robots import urdf

UR10 = "urdf/ur10_robot.urdf"
HUMAN = "human_description/robots/human.urdf"
"""The files of the package, as `data_file` finds them."""


class LinkMesh(NamedTuple):
    """A mesh of a link as its file has it."""

    link: str
    name: str
    """Name of the file, without its suffix."""
    vertices: NDArray[np.float64]
    """(n, 3) [m]."""
    triangles: NDArray[np.int64]
    """(m, 3) rows of `vertices`."""
    origin: Pose
    """Pose in the link's coordinates."""


def is_available() -> bool:
    """True when the extra `robots` is installed.

    See Also
    --------
    models.robots.arm_names : Arms that it has.
    models.RobotArm.named : One of them.

    Examples
    --------
    >>> rc.models.robots.is_available()
    True
    """
    try:
        importlib.metadata.distribution("example-robot-data")
    except ImportError:
        return False
    return importlib.util.find_spec("trimesh") is not None  # to import it takes half a second


def through_obj(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> Mesh:
    """A mesh, written to an OBJ file and read back by radarcore's own reader.

    See Also
    --------
    load_mesh : Reads any file.
    models.robots.human_links : Meshes for it.

    Examples
    --------
    >>> rc.models.robots.through_obj(np.array([[0.0, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 2, 1]]))
    <Mesh: 1 triangles, 3 vertices, smooth>
    """
    trimesh = _trimesh()
    with TemporaryDirectory() as directory:
        path = Path(directory) / "mesh.obj"
        trimesh.Trimesh(vertices, triangles, process=False).export(path)
        return load_mesh(path)


def meshes_of(model: urdf.Model) -> Iterator[LinkMesh]:
    """The meshes of all links that have some."""
    for link, parts in model.links.items():
        for part in parts:
            if not isinstance(part.source, Path):
                continue  # the arm's tool: a box of 1 cm
            vertices, triangles = _read_mesh(part.source)
            yield LinkMesh(link, part.source.stem, vertices * part.scale, triangles, part.origin)


@cache
def _read_mesh(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Read a mesh; equal vertices are merged (STL has none in common)."""
    mesh: Any = _trimesh().load(path, force="mesh")
    vertices, triangles = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64)
    vertices.flags.writeable = triangles.flags.writeable = False
    return vertices, triangles


def _trimesh() -> Any:
    try:
        import trimesh
    except ImportError:
        raise ImportError("robot and human meshes need trimesh: pip install radarcore[robots]") from None
    return trimesh


def data_file(end: str) -> Path:
    """Path of the package's file whose path ends so, wherever the package is installed."""
    try:
        files = importlib.metadata.files("example-robot-data") or []
    except importlib.metadata.PackageNotFoundError:
        raise ImportError("robot and human meshes need example-robot-data: pip install radarcore[robots]") from None
    return Path(str(next(file.locate() for file in files if str(file).endswith("/" + end))))
