"""Meshes of MuJoCo's geoms: its own triangles, and primitives made of ours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.geometry import shapes
from radarcore.geometry.mesh import Mesh

KINDS = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
"""Types of geoms, in the order of mjtGeom."""

_LARGEST_SPHERE = 2.5
"""Radius up to which spheres keep to the default sagitta [m]."""

_FINEST = 7
"""Subdivisions of larger ones."""


def geom_mesh(model: Any, geom: int, *, plane_size: float = 20.0, sagitta: float = 5e-5) -> Mesh:
    """Mesh of a geom, in its own coordinates.

    Parameters
    ----------
    model : MjModel
    geom : int
        Number of the geom.
    plane_size : float
        Edges of planes that the model leaves infinite [m].
    sagitta : float
        Largest distance of facets from primitives that are curved [m].

    Returns
    -------
    Mesh
        Planes face +z and are seen from both sides.

    See Also
    --------
    adapters.mujoco.LiveModel : Meshes of all geoms.
    Mesh : The result.

    Examples
    --------
    >>> import mujoco
    >>> ball = '<body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
    >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
    >>> mesh = rc.adapters.mujoco.geom_mesh(model, 0)
    >>> mesh.vertices.max().round(4).item()
    0.1
    """
    size, number = np.asarray(model.geom_size[geom], dtype=np.float64), int(model.geom_dataid[geom])
    match kind_of(model, geom):
        case "plane":
            edge = check.positive("plane_size", plane_size, "m")
            return _rectangle(*np.where(size[:2] > 0.0, 2.0 * size[:2], edge))
        case "hfield":
            return _height_field(model, number)
        case "sphere":
            return _ellipsoid(size[:1].repeat(3), sagitta)
        case "capsule":
            # Half of the length between the centres of the half-spheres.
            return shapes.capsule(size[0], 2.0 * (size[0] + size[1]), sagitta=sagitta)
        case "ellipsoid":
            return _ellipsoid(size, sagitta)
        case "cylinder":
            return shapes.cylinder(size[0], 2.0 * size[1], sagitta=sagitta)
        case "box":
            return shapes.box(2.0 * size)
        case _:
            return _own_mesh(model, number)


def kind_of(model: Any, geom: int) -> str:
    """Type of a geom, one of `KINDS`."""
    return KINDS[int(model.geom_type[geom])]


def mesh_of(model: Any, geom: int) -> int:
    """Number of the mesh of a geom; -1 for primitives."""
    return int(model.geom_dataid[geom]) if kind_of(model, geom) in ("mesh", "sdf") else -1


def meshes_of(model: Any, geoms: Iterable[int], **settings: float) -> list[Mesh]:
    """Meshes of geoms, each built once: geoms of the same file, or of the same type and size, share one."""
    made: dict[tuple[Any, ...], Mesh] = {}
    keys = []
    for geom in geoms:
        kind = kind_of(model, geom)
        is_of_file = kind in ("mesh", "sdf", "hfield")
        keys.append((kind, model.geom_dataid[geom] if is_of_file else tuple(model.geom_size[geom].tolist())))
        if keys[-1] not in made:
            made[keys[-1]] = geom_mesh(model, geom, **settings)
    return [made[key] for key in keys]


def _own_mesh(model: Any, number: int) -> Mesh:
    """Triangles of a mesh, about its centre of mass along its principal axes, as MuJoCo keeps them."""
    vertices = model.mesh_vert[model.mesh_vertadr[number] :][: model.mesh_vertnum[number]]
    faces = model.mesh_face[model.mesh_faceadr[number] :][: model.mesh_facenum[number]]
    return Mesh(np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64))


def _rectangle(x: float, y: float) -> Mesh:
    """Rectangle in the x-y plane that faces +z."""
    corners = 0.5 * np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return Mesh(corners, [[0, 1, 2], [0, 2, 3]])


def _ellipsoid(semi_axes: NDArray[np.float64], sagitta: float) -> Mesh:
    radius = float(semi_axes.max())
    settings: dict[str, Any] = {"subdivisions": _FINEST} if radius > _LARGEST_SPHERE else {"sagitta": sagitta}
    ball = shapes.sphere(radius, **settings)
    return Mesh(ball.vertices * (semi_axes / radius), ball.triangles)


def _height_field(model: Any, number: int) -> Mesh:
    """Top of a height field, its four sides and its bottom."""
    rows, columns = int(model.hfield_nrow[number]), int(model.hfield_ncol[number])
    x, y, top, depth = np.asarray(model.hfield_size[number], dtype=np.float64)
    heights = np.asarray(model.hfield_data[model.hfield_adr[number] :][: rows * columns], dtype=np.float64)
    grid_x, grid_y = np.meshgrid(np.linspace(-x, x, columns), np.linspace(-y, y, rows))
    surface = np.column_stack([grid_x.ravel(), grid_y.ravel(), top * heights])
    numbers = np.arange(rows * columns).reshape(rows, columns)
    corners = [numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]]
    upper = _halves([corner.ravel() for corner in corners])

    # The rim, anticlockwise from above, and the same points at the bottom with one in their middle.
    rim = np.concatenate([numbers[0, :-1], numbers[:-1, -1], numbers[-1, :0:-1], numbers[:0:-1, 0]])
    floor = surface[rim] * [1.0, 1.0, 0.0] - [0.0, 0.0, depth]
    below = len(surface) + np.arange(len(rim))
    middle = np.full(len(rim), len(surface) + len(rim))
    after, after_below = np.roll(rim, -1), np.roll(below, -1)
    sides = _halves([below, after_below, after, rim])
    bottom = np.column_stack([middle, after_below, below])
    return Mesh(np.vstack([surface, floor, [0.0, 0.0, -depth]]), np.vstack([upper, sides, bottom]))


def _halves(corners: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Two triangles of every quadrangle with the corners a, b, c, d."""
    a, b, c, d = corners
    return np.column_stack([a, b, c, a, c, d]).reshape(-1, 3)
