"""Mesh files: OBJ by the core, COLLADA by pycollada, other formats by trimesh."""

from __future__ import annotations

import errno
import os
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, check
from radarcore.geometry.collada import load_collada
from radarcore.geometry.mesh import Mesh

SUFFIXES = (".obj", ".stl", ".ply", ".off", ".glb", ".gltf", ".dae", ".3mf")
"""Ends of the names of mesh files."""

_FORMS = {".stl": " of an STL file (binary, or text from 'solid' to 'endsolid')"}
"""Forms of a file, for messages."""

_BEGINNING = 40
"""Bytes of a file that are shown."""

_LOOK = 100_000
"""Bytes of a file in which vertices are looked for."""


@check.knows_keywords
def load_mesh(path: str | PathLike[str], *, scale: float = 1.0, **options: Any) -> Mesh:
    """Read a mesh file as one body.

    OBJ is read by the core; DAE by pycollada and every other format by trimesh (``pip install radarcore[mesh]``).

    Parameters
    ----------
    path : path
        OBJ, or STL, PLY, GLB, DAE, ...
    scale : float
        Metres per unit of the file: 1e-3 for a file in millimetres. A DAE file says its unit and its up axis itself:
        it is turned to z up and its metres are scaled.
    **options
        `crease_angle_deg`, `shading` and `progress` of `Mesh`.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    ValueError
        When the file does not hold what its format promises; names the line where it can.
    ImportError
        When a format needs trimesh or pycollada and it is not installed.

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


@check.knows_keywords
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
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    kind = path.suffix.lower()
    try:
        vertices, triangles = load_collada(path) if kind == ".dae" else _load_with_trimesh(path)
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
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(
            f"{path}: reading {path.suffix or 'this'} files needs trimesh: pip install radarcore[mesh]"
        ) from error
    mesh = trimesh.load_mesh(path)
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)


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
