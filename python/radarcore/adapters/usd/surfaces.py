"""Triangles of prims: meshes, and primitives made of radarcore's shapes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.geometry import shapes
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.rotation import Matrix

Faces = NDArray[np.int64]
Surface = tuple[Matrix, Faces, Faces]
"""Vertices (n, 3) of a prim in its own coordinates, triangles (m, 3), and the face that each triangle is of, (m,)."""

_FINEST = 2e-5
"""Sagitta of the finest spheres, over their radius."""


def surface_of(prim: Any, time: Any, unit: float, sagitta: float) -> Surface | None:
    """Surface of a prim at a time code; None for types that have none.

    Parameters
    ----------
    prim : Usd.Prim
    time : Usd.TimeCode
    unit : float
        Length of a unit of the prim [m].
    sagitta : float
        Largest distance of facets from curved primitives [m].
    """

    def number(name: str) -> float:
        return check.positive(name, prim.GetAttribute(name).Get(time))

    def round_shape(make: Callable[..., Mesh], *sizes: float) -> Mesh:
        return make(*sizes, sagitta=max(sagitta / check.positive("scale", unit), _FINEST * sizes[0]))

    axis = str(prim.GetAttribute("axis").Get(time)) if prim.HasAttribute("axis") else "Z"
    match str(prim.GetTypeName()):
        case "Mesh":
            return _mesh(prim, time)
        case "Cube":
            shape = shapes.box(number("size"))
        case "Sphere":
            shape = round_shape(shapes.sphere, number("radius"))
        case "Capsule":
            length = number("height") + 2.0 * number("radius")
            shape = round_shape(shapes.capsule, number("radius"), length)
        case "Cylinder" | "Cone":
            shape = round_shape(shapes.cylinder, number("radius"), number("height"))
        case "Plane":
            # The width is along x, but along z of a plane across x; the length is along the other edge.
            edges = (number("width"), number("length"))
            x, y = 0.5 * np.array(edges if axis == "Z" else edges[::-1])
            corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
            return _along(axis, corners), np.array([[0, 1, 2], [0, 2, 3]]), np.zeros(2, dtype=np.int64)
        case _:
            return None
    vertices = shape.vertices.copy()
    if prim.GetTypeName() == "Cone":
        vertices[vertices[:, 2] > 0.0, :2] = 0.0
    return _along(axis, vertices), shape.triangles.astype(np.int64), np.zeros(len(shape.triangles), dtype=np.int64)


def _along(axis: str, vertices: Matrix) -> Matrix:
    """Vertices of a shape along z, along another axis."""
    return np.roll(vertices, "ZXY".index(check.choice("axis", axis, ("X", "Y", "Z"))), axis=1)


def points_of(prim: Any, time: Any) -> Matrix:
    """Points of a mesh at a time code, (n, 3)."""
    points = np.array(prim.GetAttribute("points").Get(time) or [], dtype=np.float64)
    return check.finite("points", points.reshape(-1, 3))


def indices(prim: Any, name: str, time: Any, number: int) -> Faces:
    """Integers of an attribute, from 0 to below a number."""
    found = np.array(prim.GetAttribute(name).Get(time) or [], dtype=np.int64)
    if (bad := found[(found < 0) | (found >= number)]).size > 0:
        raise ValueError(f"{name}: expected numbers from 0 to {number - 1}, got {bad[0]}")
    return found


def _mesh(prim: Any, time: Any) -> Surface:
    """Polygons of a mesh as triangles."""
    vertices = points_of(prim, time)
    corners = indices(prim, "faceVertexIndices", time, len(vertices))
    counts = indices(prim, "faceVertexCounts", time, len(corners) + 1)
    if counts.sum() != len(corners):
        raise ValueError(f"faceVertexCounts: expected the sum {len(corners)}, got {counts.sum()}")
    starts = np.cumsum(counts) - counts
    counts[indices(prim, "holeIndices", time, len(counts))] = 0
    scheme = prim.GetAttribute("subdivisionScheme")
    if scheme.HasAuthoredValue() and scheme.Get() != "none":
        notice.warn(f"{prim.GetPath()}: the control mesh of a subdivision surface is seen, without subdivision")
    triangles, faces = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for size in np.unique(counts[counts >= 3]).tolist():
        chosen = np.flatnonzero(counts == size)
        triangles.append(_fans(vertices, corners[starts[chosen, None] + np.arange(size)]).reshape(-1, 3))
        faces.append(np.repeat(chosen, size - 2))
    is_left_handed = prim.GetAttribute("orientation").Get(time) == "leftHanded"
    return vertices, np.concatenate(triangles)[:, :: -1 if is_left_handed else 1], np.concatenate(faces)


_LARGEST = 64
"""Largest number of corners that are tried."""


def _fans(vertices: Matrix, polygons: Faces) -> Faces:
    """Triangles (polygon, size - 2, 3) of polygons (polygon, size), as fans from a corner.

    A fan from a reflex corner also covers a polygon that is not convex if it sees all others, as in an L.
    """
    size = polygons.shape[1]
    is_open = np.full(len(polygons), size > 3)
    for _ in range(min(size, _LARGEST) if size > 3 else 0):
        a, *others = np.moveaxis(vertices[polygons[is_open]], 1, 0)
        normals = np.cross(np.array(others[:-1]) - a, np.array(others[1:]) - a)
        is_bad = ((normals * normals.sum(axis=0)).sum(axis=-1) < 0.0).any(axis=0)
        is_open[is_open] = is_bad
        polygons[is_open] = np.roll(polygons[is_open], 1, axis=1)
    first = np.broadcast_to(polygons[:, :1], (len(polygons), size - 2))
    return np.stack([first, polygons[:, 1:-1], polygons[:, 2:]], axis=-1)
