"""Triangle meshes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.geometry.pose import Pose
from radarcore.records import sealed


@sealed
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
        Show a progress bar in a terminal when the build takes more than a second.

    Attributes
    ----------
    vertices : (n, 3) float64
        As given.
    triangles : (m - num_dropped - num_merged, 3) uint32
        Without degenerate triangles (area below 1e-18 m^2).
    num_dropped : int
        Degenerate triangles left out.
    num_merged : int
        Triangles left out of surfaces listed in both windings. Both windings stay if such a surface meets others at an
        edge, as for two bodies that share a face.

    is_reflector : bool
        True for `shapes.dihedral` and `shapes.trihedral`; a simulator warns if the radar sees only their back.

    Raises
    ------
    ValueError
        For coordinates that are not finite and vertex numbers out of range; says which row.

    See Also
    --------
    load_mesh : Mesh of a file.
    shapes.box : One of the shapes known on paper.
    mesh_report : Whether a mesh is fine enough.
    Body : A mesh with a material and a motion.

    Examples
    --------
    >>> mesh = rc.Mesh([[0, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1]])
    >>> mesh
    <Mesh: 1 triangles, 3 vertices, smooth>
    >>> mesh.area
    0.5
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    num_dropped: int
    num_merged: int
    crease_angle_deg: float
    shading: str
    _core: _core.Surface
    is_reflector: bool

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
        check.degrees("crease_angle_deg", self.crease_angle_deg)
        rows = _triangles(triangles, len(self.vertices))
        listed = first_listings(self.vertices, rows)
        self.num_merged = 0 if listed is None else int(np.count_nonzero(~listed))
        rows = rows if listed is None else rows[listed]
        crease_angle = np.deg2rad(self.crease_angle_deg) if shading == "smooth" else None
        with notice.progress_if_long("building", "triangle", len(rows), shown=progress) as report:

            def tell(thousandths: int) -> None:
                report(thousandths * len(rows) // 1000)

            self._core = _core.Surface(self.vertices, rows, crease_angle=crease_angle, report=tell)
        kept = self._core.kept()
        self.num_dropped = 0 if kept is None else len(rows) - len(kept)
        self.triangles = rows if kept is None else rows[kept]
        self.is_reflector = False
        self.vertices.flags.writeable = False
        self.triangles.flags.writeable = False
        if len(rows) > 0 and len(self.triangles) == 0:
            notice.warn(
                f"triangles: expected some with an area above 1e-18 m^2, got {len(rows)} degenerate ones; "
                "the mesh is empty",
            )

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Smallest and largest coordinates of the triangles, (2, 3) [m]; NaN for an empty mesh."""
        used = used_by(self.triangles, len(self.vertices))
        return check.frozen(bounds_of(self.vertices if used.all() else self.vertices[used]))

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
        others = self.num_dropped, self.num_merged, self.is_reflector
        return _restore_mesh, (self.vertices, self.triangles, others, self.crease_angle_deg, self.shading)

    def __repr__(self) -> str:
        dropped = f", {self.num_dropped} dropped" if self.num_dropped else ""
        dropped += f", {self.num_merged} merged" if self.num_merged else ""
        return f"<Mesh: {len(self.triangles)} triangles{dropped}, {len(self.vertices)} vertices, {self.shading}>"


def used_by(triangles: NDArray[np.uint32], num_vertices: int) -> NDArray[np.bool_]:
    """True for vertices of any of the triangles, (vertex,); np.unique sorts, which takes ten times longer."""
    used = np.zeros(num_vertices, dtype=np.bool_)
    used[triangles] = True
    return used


def bounds_of(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest and largest coordinates of points (n, 3), (2, 3) [m]; NaN without points."""
    if len(points) == 0:
        return np.full((2, 3), np.nan)
    # Axis by axis: numpy takes twenty times longer along the first axis of three columns.
    return np.array([[extreme(axis) for axis in points.T] for extreme in (np.min, np.max)])


def nearest_point(place: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """The point of triangles (triangle, 3, 3) nearest to a place: on an edge, or inside of one of them."""
    edges = np.roll(corners, -1, axis=1) - corners
    along = np.clip(((place - corners) * edges).sum(axis=-1) / (edges * edges).sum(axis=-1), 0.0, 1.0)
    on_edges = corners + along[..., None] * edges
    gaps = np.square(on_edges - place).sum(axis=-1)
    triangle, edge = np.unravel_index(int(gaps.argmin()), gaps.shape)

    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    heights = ((place - corners[:, 0]) * normals).sum(axis=-1)
    feet = place - heights[:, None] * normals
    sides = (np.cross(edges, feet[:, None] - corners) * normals[:, None]).sum(axis=-1)
    inside = np.where((sides >= 0.0).all(axis=1), np.square(heights), np.inf)
    foot = int(inside.argmin())
    nearest: NDArray[np.float64] = feet[foot] if inside[foot] < gaps[triangle, edge] else on_edges[triangle, edge]
    return nearest


def merged_mesh(parts: Sequence[tuple[Mesh, Pose]]) -> Mesh:
    """Mesh of several, each at its pose."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh, _ in parts)])
    return Mesh(
        np.vstack([pose.apply(mesh.vertices) for mesh, pose in parts]),
        np.vstack([mesh.triangles.astype(np.int64) + start for (mesh, _), start in zip(parts, first, strict=False)]),
    )


def _restore_mesh(
    vertices: ArrayLike, triangles: ArrayLike, others: tuple[int, int, bool], crease_angle_deg: float, shading: str
) -> Mesh:
    """Mesh from its pickle; the tree is built again."""
    mesh = Mesh(vertices, triangles, crease_angle_deg=crease_angle_deg, shading=shading)
    for name, value in zip(("num_dropped", "num_merged", "is_reflector"), others, strict=True):
        object.__setattr__(mesh, name, value)
    return mesh


def as_reflector(mesh: Mesh) -> Mesh:
    """The mesh as a corner reflector, whose normals point to where it opens."""
    object.__setattr__(mesh, "is_reflector", True)
    return mesh


def _numbers(name: str, value: ArrayLike, shape: str, kinds: str) -> NDArray[Any]:
    """Array of some kinds of number (NumPy's letters); an empty one may be of any."""
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


def first_listings(vertices: NDArray[np.float64], triangles: NDArray[np.uint32]) -> NDArray[np.bool_] | None:
    """Triangles to keep, (triangle,), so that no surface is listed in both windings; None if no two triangles coincide.

    The kept winding fits its neighbours and faces outwards on a closed surface. Both windings stay on a surface that
    meets others at an edge, where two bodies may share a face, and of a triangle without neighbours.
    """
    # Triangles coincide if the sums of their corners' hashes are equal; a place is a set of such triangles.
    hashes = position_hashes(vertices)
    keys = hashes[triangles].sum(axis=1, dtype=np.uint64)
    in_order = np.sort(keys)
    if not (in_order[1:] == in_order[:-1]).any():
        return None
    from scipy.sparse import coo_array  # takes longer to load than the rest
    from scipy.sparse.csgraph import connected_components

    def components(first: NDArray[np.int64], second: NDArray[np.int64], num_nodes: int) -> NDArray[np.int64]:
        graph = coo_array((np.ones(len(first), np.int8), (first, second)), (num_nodes, num_nodes))
        labels: NDArray[np.int64] = connected_components(graph, directed=False)[1].astype(np.int64)
        return labels

    _, places = np.unique(keys, return_inverse=True)
    corners = np.unique(hashes, return_inverse=True)[1][triangles].astype(np.int64)
    is_degenerate = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    windings = np.sign(np.diff(corners, axis=1, append=corners[:, :1])).sum(axis=1)  # of the places: 1 or -1
    is_doubled = np.bincount(places, windings > 0).astype(bool) & np.bincount(places, windings < 0).astype(bool)

    # Number of places that meet at each edge.
    after, owners = np.roll(corners, -1, axis=1), np.repeat(np.arange(len(triangles)), 3)
    ends = np.minimum(corners, after) * len(vertices) + np.maximum(corners, after)
    edges = np.unique(ends, return_inverse=True)[1].ravel()
    num_places = int(places.max()) + 1
    pairs = np.stack(np.divmod(np.unique(edges * num_places + places[owners]), num_places), axis=-1)
    num_meeting = np.bincount(pairs[:, 0])
    lowest = pairs[np.cumsum(num_meeting) - num_meeting, 1]

    # Connected surfaces of places with both windings, bounded by edges where more than two meet.
    inner = (num_meeting[pairs[:, 0]] == 2) & is_doubled[pairs[:, 1]]
    surfaces = components(pairs[inner, 1], num_places + pairs[inner, 0], num_places + len(num_meeting))[:num_places]
    is_isolated = np.bincount(surfaces, is_doubled) > 1
    is_isolated[surfaces[pairs[num_meeting[pairs[:, 0]] > 2, 1]]] = False
    is_merged: NDArray[np.bool_] = (is_doubled & is_isolated[surfaces])[places] & ~is_degenerate

    # Triangles belong to one side if they run through their common edge in opposite directions.
    is_forward = (corners < after).ravel() ^ (places[owners] != lowest[edges])
    crossed = num_meeting[edges] == 2
    nodes = len(triangles) + 2 * edges + is_forward
    sides = components(owners[crossed], nodes[crossed], len(triangles) + 2 * len(num_meeting))[: len(triangles)]
    with np.errstate(all="ignore"):  # infinite coordinates are refused later
        a, b, c = (vertices[triangles[:, i]] - vertices.mean(axis=0) for i in range(3))
        volumes = np.bincount(sides, (a * np.cross(b, c)).sum(axis=1))[sides]

    # Keep the triangle of the larger side of every place, or the first.
    order = np.lexsort((np.arange(len(triangles)), -volumes, places))
    kept = ~is_merged
    kept[order[np.diff(places[order], prepend=-1) > 0]] = True
    return kept


_FACTORS = np.array([0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)
"""Odd multipliers for hashes (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014)."""


def position_hashes(positions: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Hashes of positions (n, 3), equal for equal ones; 0.0 and -0.0 are equal."""
    return _mixed((_mixed((positions + 0.0).view(np.uint64)) * _FACTORS).sum(axis=1, dtype=np.uint64))


def _mixed(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Values with every bit mixed into all others."""
    for factor in _FACTORS[1:]:
        values = (values ^ (values >> np.uint64(30))) * factor
    return values ^ (values >> np.uint64(31))
