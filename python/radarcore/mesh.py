"""Triangle meshes: checked, ready to be traced, and read from files."""

from __future__ import annotations

import errno
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check

_LONG_BUILD = 1_000_000
"""Triangles that are built in less than a second."""


class Mesh:
    """Triangles of one body, in its own coordinates.

    Parameters
    ----------
    vertices : (n, 3) array_like
        Positions [m].
    triangles : (m, 3) array_like of int
        Rows of `vertices`, anticlockwise seen from outside.
    crease_angle_deg : float
        Facets that meet below this angle [degrees] stand for a curved surface.
    shading : "smooth" or "flat"
        Smooth: hits on such facets get interpolated normals and the distance of the curved surface.
    progress : bool
        Show a progress bar for a mesh of more than a million triangles when run in a terminal.

    Attributes
    ----------
    vertices : (n, 3) float64
        As given.
    triangles : (m - num_dropped, 3) uint32
        Without degenerate triangles (area below 1e-18 m^2).
    num_dropped : int
        Degenerate triangles left out.

    Raises
    ------
    ValueError
        For coordinates that are not finite and vertex numbers out of range; says which row.
    """

    __slots__ = ("_surface", "crease_angle_deg", "num_dropped", "shading", "triangles", "vertices")

    vertices: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    num_dropped: int
    crease_angle_deg: float
    shading: str
    _surface: _core.Surface

    def __init__(
        self,
        vertices: ArrayLike,
        triangles: ArrayLike,
        *,
        crease_angle_deg: float = 45.0,
        shading: str = "smooth",
        progress: bool = True,
    ) -> None:
        self.vertices = _vertices(vertices)
        self.shading = check.choice("shading", shading, ("smooth", "flat"))
        self.crease_angle_deg = check.non_negative("crease_angle_deg", crease_angle_deg, "degrees")
        rows = _triangles(triangles, len(self.vertices))
        crease_angle = np.deg2rad(self.crease_angle_deg) if shading == "smooth" else None
        with _bar(len(rows), progress) as report:
            self._surface = _core.Surface(self.vertices, rows, crease_angle=crease_angle, report=report)
        kept = self._surface.kept()
        self.num_dropped = 0 if kept is None else len(rows) - len(kept)
        self.triangles = rows if kept is None else rows[kept]
        self.vertices.flags.writeable = False
        self.triangles.flags.writeable = False
        if len(rows) > 0 and len(self.triangles) == 0:
            warnings.warn(
                f"triangles: expected some with an area above 1e-18 m^2, got {len(rows)} degenerate ones; "
                "the mesh is empty",
                stacklevel=2,
            )

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Smallest and largest coordinates of the triangles, (2, 3) [m]; NaN for an empty mesh."""
        if len(self.triangles) == 0:
            return np.full((2, 3), np.nan)
        used = self.vertices[np.unique(self.triangles)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @property
    def area(self) -> float:
        """Area of all triangles [m^2]."""
        return float(0.5 * np.linalg.norm(self._cross_products(), axis=1).sum())

    @property
    def volume(self) -> float:
        """Enclosed volume [m^3]; positive when the triangles of a closed mesh face outwards."""
        corners = self.vertices[self.triangles]
        return float((corners[:, 0] * self._cross_products()).sum() / 6.0)

    def _cross_products(self) -> NDArray[np.float64]:
        a, b, c = np.moveaxis(self.vertices[self.triangles], 1, 0)
        return np.cross(b - a, c - a)

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore_mesh, (self.vertices, self.triangles, self.num_dropped, self.crease_angle_deg, self.shading)

    def __repr__(self) -> str:
        dropped = f", {self.num_dropped} dropped" if self.num_dropped else ""
        return f"<Mesh: {len(self.triangles)} triangles{dropped}, {len(self.vertices)} vertices, {self.shading}>"


@contextmanager
def _bar(num_triangles: int, progress: bool) -> Iterator[Callable[[float], None] | None]:
    """What is told the share of a long build that is done, and shows it."""
    if num_triangles <= _LONG_BUILD or not progress:
        yield None
        return
    from tqdm import tqdm  # heavier than the rest of the import

    with tqdm(total=num_triangles, desc="building", unit="triangle", unit_scale=True, disable=None) as bar:

        def report(share: float) -> None:
            bar.update(round(share * num_triangles) - bar.n)

        yield report


def _restore_mesh(
    vertices: ArrayLike, triangles: ArrayLike, num_dropped: int, crease_angle_deg: float, shading: str
) -> Mesh:
    """The mesh that was pickled; its tree is built again."""
    mesh = Mesh(vertices, triangles, crease_angle_deg=crease_angle_deg, shading=shading)
    mesh.num_dropped = num_dropped
    return mesh


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


def _numbers(name: str, value: ArrayLike, shape: str, kinds: str) -> NDArray[Any]:
    """An array of some kinds of number (NumPy's letters); an empty one may be of any."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name}: expected shape {shape}, got rows of different lengths") from None
    if array.size > 0 and array.dtype.kind not in kinds:
        raise TypeError(f"{name}: expected {'numbers' if 'f' in kinds else 'integers'}, got {array.dtype}")
    return array


def _vertices(value: ArrayLike) -> NDArray[np.float64]:
    array = np.array(_numbers("vertices", value, "(n, 3)", "fiu"), dtype=np.float64, order="C")
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"vertices: expected shape (n, 3), got {array.shape}")
    return array


def _triangles(value: ArrayLike, num_vertices: int) -> NDArray[np.uint32]:
    array = _numbers("triangles", value, "(m, 3)", "iu")
    if array.size == 0:
        array = np.zeros((0, 3), dtype=np.int64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"triangles: expected shape (m, 3), got {array.shape}")
    bad = ((array < 0) | (array >= num_vertices)).any(axis=1)
    if bad.any():
        row = int(bad.argmax())
        raise ValueError(
            f"triangles: expected vertex numbers from 0 to {num_vertices - 1}, got {array[row].tolist()} at row {row}"
        )
    return np.array(array, dtype=np.uint32, order="C")
