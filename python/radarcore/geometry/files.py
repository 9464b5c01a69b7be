"""Mesh files: OBJ by the core, other formats by trimesh."""

from __future__ import annotations

import errno
import os
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, check
from radarcore.geometry.mesh import Mesh


def load_mesh(path: str | PathLike[str], *, scale: float = 1.0, **options: Any) -> Mesh:
    """Read a mesh file as one body.

    OBJ is read by the core; every other format by trimesh (``pip install radarcore[mesh]``).

    Parameters
    ----------
    path : path
        OBJ, or STL, PLY, GLB, DAE, ... through trimesh.
    scale : float
        Metres per unit of the file: 1e-3 for a file in millimetres.
    **options
        `crease_angle_deg`, `shading` and `progress` of `Mesh`.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    ValueError
        When the file does not hold what its format promises; names the line where it can.
    ImportError
        When a format needs trimesh and it is not installed.
    """
    factor = check.positive("scale", scale, "m per unit")
    vertices, triangles = _core.load_obj(fspath(path))[:2] if _is_obj(path) else _load_with_trimesh(Path(path))
    if len(triangles) == 0:
        raise ValueError(f"{fspath(path)}: expected faces, got none")
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
    """
    kinds = ("object", "group", "material")
    kind = kinds.index(check.choice("split_by", split_by, kinds))
    if not _is_obj(path):
        raise ValueError(f"path: expected an OBJ file, got {fspath(path)}")
    factor = check.positive("scale", scale, "m per unit")
    vertices, triangles, parts = _core.load_obj(fspath(path))
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


def _load_with_trimesh(path: Path) -> tuple[NDArray[np.float64], NDArray[Any]]:
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(
            f"{path}: reading {path.suffix or 'this'} files needs trimesh: pip install radarcore[mesh]"
        ) from error
    try:
        mesh = trimesh.load_mesh(path)
    except Exception as error:  # whatever its many readers raise, the user wants the path
        raise ValueError(f"{path}: {error}") from error
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
