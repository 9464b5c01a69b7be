"""3MF files (.3mf): all triangles of the build, in metres.

3MF Core Specification 1.3: sections 3.4 (unit, build, items), 4.1 (meshes) and 4.2 (components); Production Extension
(objects in other parts of the package).
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

_CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
_PRODUCTION = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}"
_RELATIONSHIP = "{http://schemas.openxmlformats.org/package/2006/relationships}Relationship"
_MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"

_UNITS = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
"""Metres per unit."""

_MOST_PARTS = 10_000
"""Largest number of objects in a build: nested components may multiply without limit."""

_Part = tuple[NDArray[np.float64], NDArray[np.int64]]


def load_3mf(path: Path) -> _Part:
    """Vertices (n, 3) [m] and triangles (m, 3) of all items of a file's build, each at its place.

    Supports are left out. Parts with a mirroring transform keep their normals outwards.
    """
    with zipfile.ZipFile(path) as package:
        relations = ET.fromstring(package.read("_rels/.rels"))
        root = next(
            (each.get("Target", "") for each in relations.iter(_RELATIONSHIP) if each.get("Type") == _MODEL), ""
        )
        build = _Build(package)
        model = build.model(root)
        unit = model.get("unit", "millimeter")
        if unit not in _UNITS:
            raise ValueError(f"unit: expected {', '.join(_UNITS)}, got {unit!r}")
        build.unit = _UNITS[unit]
        for item in model.iterfind(f"{_CORE}build/{_CORE}item"):
            build.add(item, root, np.eye(4))
    vertices = [np.empty((0, 3)), *(vertices for vertices, _ in build.parts)]
    starts = np.cumsum([len(part) for part in vertices])
    triangles = [rows + start for (_, rows), start in zip(build.parts, starts, strict=False)]
    return np.concatenate(vertices), np.concatenate([np.empty((0, 3), np.int64), *triangles])


class _Build:
    """Collects the objects of a build, each transformed to its place."""

    def __init__(self, package: zipfile.ZipFile) -> None:
        self.package = package
        self.unit = 1.0
        self.parts: list[_Part] = []
        self._models: dict[str, ET.Element] = {}
        self._meshes: dict[int, _Part] = {}

    def model(self, name: str) -> ET.Element:
        """Root of a part of the package."""
        if name not in self._models:
            self._models[name] = ET.fromstring(self.package.read(name.lstrip("/")))
        return self._models[name]

    def add(
        self, reference: ET.Element, name: str, placed: NDArray[np.float64], above: tuple[ET.Element, ...] = ()
    ) -> None:
        """Add the object that an item or a component refers to."""
        name = reference.get(f"{_PRODUCTION}path", name)
        wanted = reference.get("objectid")
        found = (one for one in self.model(name).iterfind(f"{_CORE}resources/{_CORE}object") if one.get("id") == wanted)
        if (element := next(found, None)) is None or element in above:
            raise ValueError(f"expected an object {wanted!r}, got {'one within itself' if above else 'none'}")
        if element.get("type") in ("support", "solidsupport"):
            return
        placed = placed @ _transform(reference.get("transform"))
        for component in element.iterfind(f"{_CORE}components/{_CORE}component"):
            self.add(component, name, placed, (*above, element))
        if (mesh := element.find(f"{_CORE}mesh")) is not None:
            if len(self.parts) >= _MOST_PARTS:
                raise ValueError(f"expected at most {_MOST_PARTS} objects in the build, got more")
            vertices, triangles = self._mesh(mesh)
            linear, shift = placed[:3, :3], placed[:3, 3]
            is_mirrored = np.linalg.det(linear) < 0.0
            self.parts.append(
                (self.unit * (vertices @ linear.T + shift), triangles[:, ::-1] if is_mirrored else triangles)
            )

    def _mesh(self, mesh: ET.Element) -> _Part:
        if id(mesh) not in self._meshes:
            corners = [[vertex.attrib[axis] for axis in "xyz"] for vertex in mesh.iter(f"{_CORE}vertex")]
            rows = [[face.attrib[corner] for corner in ("v1", "v2", "v3")] for face in mesh.iter(f"{_CORE}triangle")]
            vertices = np.array(corners, np.float64).reshape(-1, 3)
            triangles = np.array(rows, np.int64).reshape(-1, 3)
            if ((triangles < 0) | (triangles >= len(vertices))).any():
                raise ValueError(f"expected vertex numbers from 0 to {len(vertices) - 1}, got {triangles.max()}")
            self._meshes[id(mesh)] = vertices, triangles
        return self._meshes[id(mesh)]


def _transform(text: str | None) -> NDArray[np.float64]:
    """Matrix (4, 4) for column vectors; the file has twelve numbers for row vectors, the shift last."""
    matrix = np.eye(4)
    if text is not None:
        matrix[:3] = np.array(text.split(), np.float64).reshape(4, 3).T
    return matrix
