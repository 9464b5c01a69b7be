"""Robot descriptions in URDF: joints, and the shapes on the links."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.geometry import shapes
from radarcore.geometry.mesh import Mesh, merged_mesh
from radarcore.geometry.mesh_files import load_mesh, transformed
from radarcore.geometry.pose import Pose
from radarcore.geometry.urdf_files import parsed, warn_of_no_shapes
from radarcore.models.robots.joint import Joint

_SIZES = {"box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}, "sphere": {"radius": 1}}
"""Attributes of shapes, as their functions take them, and how many numbers each has."""


class Part(NamedTuple):
    """One shape on a link."""

    source: Path | Mesh
    """A file, or box, cylinder or sphere."""
    scale: NDArray[np.float64]
    """(3,) metres per unit of the file."""
    origin: Pose
    """Pose in the link's coordinates."""

    def mesh(self) -> Mesh:
        """The shape [m], before it is put at `origin`; a mirrored one keeps its normals outwards."""
        mesh = load_mesh(self.source) if isinstance(self.source, Path) else self.source
        return Mesh(*transformed(mesh.vertices, mesh.triangles, np.column_stack([np.diag(self.scale), np.zeros(3)])))


class Model(NamedTuple):
    """A URDF file."""

    name: str
    joints: list[Joint]
    links: dict[str, list[Part]]
    """Shapes by name of the link, in the order of the file."""


def read(
    path: str | PathLike[str],
    *,
    geometry: Literal["collision", "visual"] | None = "collision",
    package_directories: Mapping[str, str | PathLike[str]] | None = None,
    held: Collection[str] = (),
) -> Model:
    """Read a URDF file; arguments and errors as in `RobotArm.from_urdf`. Mesh files are not read yet.

    Joints that are `held` are fixed at zero.
    """
    if geometry not in ("collision", "visual", None):
        raise ValueError(f"meshes: expected 'collision', 'visual' or None, got {geometry!r}")
    reader = _Reader(Path(path), dict(package_directories or {}), held)
    root = parsed(path)
    if geometry is not None:
        warn_of_no_shapes(path, root, geometry, "meshes")
    links = {}
    for element in root.iterfind("link"):
        name = reader.attribute(element, "name", "link")
        links[name] = [reader.part(part, name) for part in element.iterfind(geometry)] if geometry else []
    if not links:
        raise reader.error("expected at least one <link>, got none")
    return Model(root.get("name", "robot"), [reader.joint(element) for element in root.iterfind("joint")], links)


def shapes_of(model: Model) -> dict[str, Mesh | None]:
    """One mesh per link in the link's coordinates; None for links without a shape."""
    return {
        link: merged_mesh([(part.mesh(), part.origin) for part in parts]) if parts else None
        for link, parts in model.links.items()
    }


class _Reader:
    """Turns elements of one file into records; every error names the file and the joint or link."""

    def __init__(self, path: Path, package_directories: dict[str, str | PathLike[str]], held: Collection[str]) -> None:
        self.path, self.package_directories, self.held = path, package_directories, held

    def error(self, text: str) -> ValueError:
        return ValueError(f"{self.path}: {text}")

    def attribute(self, element: ET.Element, name: str, where: str) -> str:
        value = element.get(name)
        if value is None:
            raise self.error(f"{where}: expected <{element.tag} {name}=...>, got none")
        return value

    def numbers(self, text: str, count: int, where: str) -> NDArray[np.float64]:
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            values = np.empty(0)
        if values.shape != (count,) or not np.isfinite(values).all():
            raise self.error(f"{where}: expected {count} number{'s' if count > 1 else ''}, got {text!r}")
        return values

    def origin(self, element: ET.Element, where: str) -> Pose:
        origin = element.find("origin")
        if origin is None:
            return Pose()
        xyz, rpy = (self.numbers(origin.get(name, "0 0 0"), 3, f"{where}, {name}") for name in ("xyz", "rpy"))
        quaternion = origin.get("quat_xyzw")  # URDF 1.1
        if quaternion is not None and "rpy" in origin.attrib:
            raise self.error(f"{where}, origin: expected rpy or quat_xyzw, got both")
        numbers = None if quaternion is None else self.numbers(quaternion, 4, f"{where}, quat_xyzw")
        with check.located(f"{self.path}: {where}, origin"):
            return Pose.from_rpy(xyz, rpy) if numbers is None else Pose.from_quaternion(xyz, xyzw=numbers)

    def joint(self, element: ET.Element) -> Joint:
        name = self.attribute(element, "name", "joint")
        where = f"joint {name!r}"
        kind = self.attribute(element, "type", where)
        if kind not in ("revolute", "continuous", "prismatic", "fixed"):
            raise self.error(f"{where}: expected revolute, continuous, prismatic or fixed, got {kind!r}")
        if element.find("mimic") is not None and name not in self.held:
            notice.warn(f"{self.path}: {where} mimics another; it is a joint of its own here")
        parent, child = element.find("parent"), element.find("child")
        if parent is None or child is None:
            raise self.error(
                f"{where}: expected <parent> and <child>, got no <{'child' if parent is not None else 'parent'}>"
            )
        ends = self.attribute(parent, "link", where), self.attribute(child, "link", where)
        origin = self.origin(element, where)
        if kind == "fixed" or name in self.held:
            return Joint(name, *ends, origin, kind="fixed")

        axis = element.find("axis")
        direction = self.numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"), 3, f"{where}, axis")
        limit = element.find("limit")
        limits: Any = None
        max_velocity = None
        if limit is not None:
            if kind != "continuous":
                limits = tuple(
                    self.numbers(limit.get(bound, "0"), 1, f"{where}, {bound}").item() for bound in ("lower", "upper")
                )
            if (velocity := limit.get("velocity")) is not None:
                max_velocity = self.numbers(velocity, 1, f"{where}, velocity").item()
        turns = cast(Literal["revolute", "prismatic"], "revolute" if kind == "continuous" else kind)
        with check.located(f"{self.path}: {where}"):
            return Joint(name, *ends, origin, direction, turns, limits, max_velocity)

    def part(self, element: ET.Element, link: str) -> Part:
        where = f"link {link!r}, {element.tag}"
        geometry = element.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
        if shape is None:
            raise self.error(f"{where}: expected a <geometry> with a shape, got none")
        source, scale = self.source(shape, where), shape.get("scale", "1 1 1")
        factors = self.numbers(scale, 3, f"{where}, scale") if shape.tag == "mesh" else np.ones(3)
        if not factors.all():
            raise self.error(f"{where}, scale: expected numbers other than zero, got {scale!r}")
        return Part(source, factors, self.origin(element, where))

    def source(self, shape: ET.Element, where: str) -> Path | Mesh:
        if shape.tag == "mesh":
            return self.mesh_file(self.attribute(shape, "filename", where))
        if shape.tag not in _SIZES:
            raise self.error(f"{where}: expected mesh, box, cylinder or sphere, got <{shape.tag}>")
        sizes = [
            self.numbers(self.attribute(shape, name, where), count, f"{where}, {name}")
            for name, count in _SIZES[shape.tag].items()
        ]
        with check.located(f"{self.path}: {where}"):
            mesh: Mesh = getattr(shapes, shape.tag)(*(size if len(size) > 1 else size.item() for size in sizes))
        return mesh

    def mesh_file(self, filename: str) -> Path:
        """Path of a mesh: ``package://name/...``, ``file://...``, or relative to the URDF file."""
        if filename.startswith("package://"):
            package, _, rest = filename.removeprefix("package://").partition("/")
            directory = self.package_directories.get(package)
            if directory is None:
                directory = next((d for d in self.path.resolve().parents if d.name == package), None)
            if directory is None:
                raise FileNotFoundError(
                    2,
                    f"{self.path}: package {package!r} is not among package_directories, and not around the file",
                    filename,
                )
            file = Path(directory) / rest
        else:
            file = self.path.parent / filename.removeprefix("file://")
        if not file.is_file():
            raise FileNotFoundError(2, f"{self.path}: no such mesh", str(file))
        return file
