"""Mesh files: OBJ by the core, 3MF here, COLLADA by pycollada, other formats by trimesh."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from itertools import count
from os import PathLike, fspath
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, check
from radarcore.geometry.mesh import Mesh

SUFFIXES = (".obj", ".stl", ".ply", ".off", ".glb", ".gltf", ".dae", ".3mf")
"""Ends of the names of mesh files."""

_FORMS = {".stl": " of an STL file (binary, or text from 'solid' to 'endsolid')"}
"""Forms of a file, for messages."""

_Y_UP = (".glb", ".gltf")
"""Formats with y up (glTF 2.0, 3.4)."""

STEP_SUFFIXES = (".step", ".stp")
"""Suffixes of STEP files, which trimesh reads with cascadio, in metres."""

_BEGINNING = 40
"""Bytes of a file that are shown."""

_LOOK = 100_000
"""Bytes of a file in which vertices are looked for."""


def load_mesh(path: str | PathLike[str], *, scale: float = 1.0, **options: Any) -> Mesh:
    """Read a mesh file as one body.

    OBJ and 3MF need nothing else; DAE is read by pycollada and every other format by trimesh (``pip install
    radarcore[mesh]``), STEP by cascadio besides (``pip install cascadio``).

    Parameters
    ----------
    path : path
        OBJ, or STL, PLY, GLB, DAE, 3MF, STEP, ...
    scale : float
        Metres per unit of the file: 1e-3 for a file in millimetres. DAE, 3MF, STEP and glTF files say their unit
        themselves, and their metres are scaled. DAE and glTF files are turned to z up.
    **options
        `crease_angle_deg`, `shading` and `progress` of `Mesh`.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    ValueError
        When the file does not hold what its format promises; names the line where it can.
    ImportError
        When a format needs a package that is not installed; names it.

    See Also
    --------
    load_meshes : The parts of a file as several bodies.
    mesh_report : Whether a mesh is fine enough.
    Body : A mesh with a material and a motion.

    Examples
    --------
    >>> np.savetxt("part.obj", ["v 0 0 0", "v 0 200 0", "v 0 0 200", "f 1 3 2"], fmt="%s")
    >>> part = rc.load_mesh("part.obj", scale=1e-3)
    >>> print(part, f"{part.area:.3f} m^2")
    <Mesh: 1 triangles, 3 vertices, smooth> 0.020 m^2
    """
    factor = check.positive("scale", scale, "m per unit")
    vertices, triangles = _load_obj(path)[:2] if _is_obj(path) else _load_other(Path(path))
    return Mesh(vertices * factor, triangles, **options)


def load_meshes(
    path: str | PathLike[str], *, split_by: str = "object", scale: float = 1.0, **options: Any
) -> dict[str, Mesh]:
    """Read an OBJ file as several bodies, split by its objects, groups or materials.

    Parameters
    ----------
    path : path
        An OBJ file.
    split_by : "object", "group" or "material"
        The OBJ keyword that separates bodies: ``o``, ``g`` or ``usemtl``.
    scale, **options
        As for `load_mesh`.

    Returns
    -------
    meshes : dict
        By name, in the order of the file; "" for faces before the first name. Parts without faces are left out.

    See Also
    --------
    load_mesh : All of a file as one body.

    Examples
    --------
    >>> lines = ["o left", "v 0 0 0", "v 0 1 0", "v 0 0 1", "f 1 3 2", "o right", "v 0 -1 0", "f 1 4 3"]
    >>> np.savetxt("parts.obj", lines, fmt="%s")
    >>> rc.load_meshes("parts.obj")
    {'left': <Mesh: 1 triangles, 3 vertices, smooth>, 'right': <Mesh: 1 triangles, 3 vertices, smooth>}
    """
    kinds = ("object", "group", "material")
    kind = kinds.index(check.choice("split_by", split_by, kinds))
    if not _is_obj(path):
        raise ValueError(f"path: expected an OBJ file, got {fspath(path)}")
    factor = check.positive("scale", scale, "m per unit")
    vertices, triangles, parts = _load_obj(path)
    numbers, names = parts[kind]
    # Sort the triangles by part once, rather than look through all of them for each part.
    order = np.argsort(numbers, kind="stable")
    found, starts = np.unique(numbers[order], return_index=True)
    meshes = {}
    for number, part in zip(found, np.split(triangles[order], starts[1:]), strict=False):
        used, rows = np.unique(part, return_inverse=True)
        meshes[names[number]] = Mesh(vertices[used] * factor, rows.reshape(-1, 3), **options)
    return meshes


def _is_obj(path: str | PathLike[str]) -> bool:
    return Path(path).suffix.lower() == ".obj"


def _load_obj(path: str | PathLike[str]) -> Any:
    """Vertices, triangles and parts of an OBJ file."""
    try:
        return _core.load_obj(fspath(path))
    except ValueError as error:
        if _has_vertices(Path(path)):
            raise
        raise ValueError(f"{error}; {_beginning(Path(path))}") from None


def _load_other(path: Path) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Vertices and triangles of a file that is no OBJ file."""
    path.open("rb").close()  # an OSError of its own where there is no file
    kind = path.suffix.lower()
    read = _load_collada if kind == ".dae" else _load_3mf if kind == ".3mf" else _load_with_trimesh
    try:
        vertices, triangles = read(path)
    except ImportError:
        raise
    except Exception as error:  # whatever their many readers raise, the user wants the path
        expected = (
            "" if kind in SUFFIXES else f"expected a mesh file ({', '.join(SUFFIXES)}), got {kind or 'no suffix'}: "
        )
        raise ValueError(f"{path}: {expected}{error}; {_beginning(path)}") from error
    if len(triangles) == 0:
        raise ValueError(f"{path}: expected faces{_FORMS.get(kind, '')}, got none; {_beginning(path)}")
    return vertices, triangles


def _load_with_trimesh(path: Path) -> tuple[NDArray[np.float64], NDArray[Any]]:
    kind = path.suffix.lower()
    try:
        import trimesh

        mesh = trimesh.load_mesh(path)
    except ImportError as error:
        and_, besides = (" and cascadio", " cascadio") if kind in STEP_SUFFIXES else ("", "")
        raise ImportError(
            f"{path}: reading {path.suffix or 'this'} files needs trimesh{and_}: pip install radarcore[mesh]{besides} "
            f"({error})"
        ) from error
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    if mesh.units is not None:
        vertices = vertices * trimesh.units.unit_conversion(mesh.units, "m")
    return vertices @ TO_Z_UP["Y_UP"].T if kind in _Y_UP else vertices, np.asarray(mesh.faces)


def _has_vertices(path: Path) -> bool:
    """True for a file that has vertices of an OBJ file near its beginning."""
    with path.open("rb") as file:
        return any(line.split()[:1] == [b"v"] for line in file.readlines(_LOOK))


def _beginning(path: Path) -> str:
    """Beginning of a file, as text for messages."""
    with path.open("rb") as file:
        head = file.read(_BEGINNING)
    if not head:
        return "the file is empty"
    if head.startswith(b"version https://git-lfs"):
        return "the file is a pointer of Git LFS: fetch its content by git lfs pull"
    if all(byte >= 32 or byte in b"\t\n\r" for byte in head):
        return f"the file begins with {head.decode('utf-8', 'replace')!r}"
    return f"the file begins with the bytes {head[:8].hex(' ')}"


# Axes of a file (columns: its x, y and z) in a frame with z up, by COLLADA 1.4.1, table of <up_axis>: right, up and
# towards the viewer are -y, x, z (X_UP), x, y, z (Y_UP) and x, z, -y (Z_UP).
TO_Z_UP = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "Z_UP": np.eye(3),
}


def _load_collada(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (n, 3) [m] and triangles (m, 3) of all geometry that the scene of a file shows.

    Transforms of the nodes, the unit and the up axis of the file are applied; one without the latter has y up.
    Polygons become fans of triangles; lines, materials and skins are left out. Parts that are mirrored by their
    transforms keep their normals outwards.

    Raises
    ------
    ImportError
        Without pycollada; other exceptions concern the content of the file.
    """
    try:
        from collada import Collada, common, polylist, triangleset
    except ImportError as error:
        raise ImportError(f"{path}: reading .dae files needs pycollada: pip install radarcore[mesh]") from error
    # Textures that are missing, cameras of other programs and the like are no matter.
    document = Collada(str(path), ignore=[common.DaeUnsupportedError, common.DaeBrokenRefError])
    about = document.assetInfo
    to_metres = (1.0 if about.unitmeter is None else float(about.unitmeter)) * TO_Z_UP[about.upaxis]
    parts: list[_Part] = []
    for geometry in [] if document.scene is None else document.scene.objects("geometry"):
        placed = to_metres @ np.asarray(geometry.matrix, dtype=np.float64)[:3]
        for part in geometry.original.primitives:
            if isinstance(part, polylist.Polylist):
                part = part.triangleset()  # the same surface
            if not isinstance(part, triangleset.TriangleSet) or part.vertex is None or len(part) == 0:
                continue
            parts.append(
                transformed(np.asarray(part.vertex, np.float64), np.asarray(part.vertex_index, np.int64), placed)
            )
    return _joined(parts)


_Part = tuple[NDArray[np.float64], NDArray[np.int64]]


def transformed(vertices: NDArray[np.float64], triangles: NDArray[Any], placed: NDArray[np.float64]) -> _Part:
    """Vertices and triangles under a map (3, 4); mirrored ones keep their normals outwards."""
    is_mirrored = np.linalg.slogdet(placed[:, :3]).sign < 0.0  # determinants may overflow
    return vertices @ placed[:, :3].T + placed[:, 3], triangles[:, ::-1] if is_mirrored else triangles


def _joined(parts: Sequence[_Part]) -> _Part:
    """Vertices (n, 3) and triangles (m, 3) of all parts."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    triangles = [rows + start for (_, rows), start in zip(parts, starts, strict=False)]
    vertices = [np.empty((0, 3)), *(vertices for vertices, _ in parts)]
    return np.concatenate(vertices), np.concatenate([np.empty((0, 3), np.int64), *triangles])


_CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
_PRODUCTION = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}"
_RELATIONSHIP = "{http://schemas.openxmlformats.org/package/2006/relationships}Relationship"
_MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"

_UNITS = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
"""Metres per unit."""

_MOST_OBJECTS, _DEEPEST = 10_000, 100
"""Largest number of objects in a build, and within each other: components may multiply without limit."""


def _load_3mf(path: Path) -> _Part:
    """Vertices [m] and triangles of a build; parts of it may be in other files of the package."""
    with zipfile.ZipFile(path) as package:
        relations = ET.fromstring(package.read("_rels/.rels"))
        models = {f"/{name}": ET.fromstring(package.read(name)) for name in package.namelist() if ".model" in name}
    root = next((each.get("Target", "") for each in relations.iter(_RELATIONSHIP) if each.get("Type") == _MODEL), "")
    root = f"/{root.lstrip('/')}"
    objects = {
        (name, one.get("id")): one
        for name, model in models.items()
        for one in model.iterfind(f"{_CORE}resources/{_CORE}object")
    }
    unit = models[root].get("unit", "millimeter")
    if unit not in _UNITS:
        raise ValueError(f"unit: expected {', '.join(_UNITS)}, got {unit!r}")
    parts: list[_Part] = []
    numbers = count(1)

    def add(reference: ET.Element, name: str, placed: NDArray[np.float64], depth: int = 0) -> None:
        """Add the object that an item or a component refers to."""
        if next(numbers) > _MOST_OBJECTS or depth > _DEEPEST:
            raise ValueError(f"expected at most {_MOST_OBJECTS} objects, {_DEEPEST} within each other, got more")
        name = reference.get(f"{_PRODUCTION}path", name)
        if (element := objects.get((name, reference.get("objectid")))) is None:
            raise ValueError(f"expected an object {reference.get('objectid')!r}, got none")
        if element.get("type") in ("support", "solidsupport"):
            return
        placed = placed @ _transform(reference.get("transform"))
        for component in element.iterfind(f"{_CORE}components/{_CORE}component"):
            add(component, name, placed, depth + 1)
        if (mesh := element.find(f"{_CORE}mesh")) is not None:
            parts.append(transformed(*_mesh_of(mesh), _UNITS[unit] * placed[:3]))

    for item in models[root].iterfind(f"{_CORE}build/{_CORE}item"):
        add(item, root, np.eye(4))
    return _joined(parts)


def _mesh_of(mesh: ET.Element) -> _Part:
    """Vertices and triangles of an element."""
    corners = [[vertex.attrib[axis] for axis in "xyz"] for vertex in mesh.iter(f"{_CORE}vertex")]
    rows = [[face.attrib[corner] for corner in ("v1", "v2", "v3")] for face in mesh.iter(f"{_CORE}triangle")]
    vertices, triangles = np.array(corners, np.float64).reshape(-1, 3), np.array(rows, np.int64).reshape(-1, 3)
    if ((triangles < 0) | (triangles >= len(vertices))).any():
        raise ValueError(f"expected vertex numbers from 0 to {len(vertices) - 1}, got {triangles.max()}")
    return vertices, triangles


def _transform(text: str | None) -> NDArray[np.float64]:
    """Matrix (4, 4) for column vectors; the file has twelve numbers for row vectors, the shift last."""
    matrix = np.eye(4)
    if text is not None:
        matrix[:3] = np.array(text.split(), np.float64).reshape(4, 3).T
    return matrix
