"""A scene: bodies and point targets, and their surfaces in the core."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.motion.static import is_static
from radarcore.scene.body import Body, PointTarget


@dataclass(frozen=True)
class _Shape:
    """The vertices of the bodies that deform, and the core's scene with their surfaces."""

    vertices: dict[int, NDArray[np.float64]]
    surfaces: list[_core.Surface]
    core: _core.Scene


class Scene:
    """Bodies and point targets; an empty scene is a scene without echoes.

    Parameters
    ----------
    bodies : iterable of Body and PointTarget
        Their order gives the body numbers of images and paths.

    Attributes
    ----------
    bodies : tuple
        As given.
    names : tuple of str
        One per body; unnamed ones are called "body 3" or "point 3".
    """

    def __init__(self, bodies: Iterable[Body | PointTarget] = ()) -> None:
        if not isinstance(bodies, Iterable):
            raise TypeError(f"bodies: expected a list of Body and PointTarget, got {type(bodies).__name__}")
        self.bodies = tuple(bodies)
        for i, body in enumerate(self.bodies):
            if not isinstance(body, Body | PointTarget):
                raise TypeError(f"bodies: expected Body and PointTarget, got {type(body).__name__} at index {i}")
        self.names = tuple(
            body.name or f"{'body' if isinstance(body, Body) else 'point'} {i}" for i, body in enumerate(self.bodies)
        )

        # Meshes and points go separate ways; the numbers lead back to the scene's order.
        self._meshed = [(i, body) for i, body in enumerate(self.bodies) if isinstance(body, Body)]
        self._targets = [(i, body) for i, body in enumerate(self.bodies) if isinstance(body, PointTarget)]
        self._mesh_numbers = np.array([i for i, _ in self._meshed], dtype=np.int32)
        self._point_numbers = np.array([i for i, _ in self._targets], dtype=np.int32)
        self._rcs = np.array([target.rcs for _, target in self._targets], dtype=np.float64)
        self._positions = np.array([t.position for _, t in self._targets], dtype=np.float64).reshape(-1, 3)
        self._velocities = np.array([t.velocity for _, t in self._targets], dtype=np.float64).reshape(-1, 3)
        self._deforming = [b for b, (_, body) in enumerate(self._meshed) if body.deformation is not None]
        self._shape = self._shape_of({}, [body.mesh._surface for _, body in self._meshed])

    @property
    def num_triangles(self) -> int:
        """Triangles of all bodies; a mesh that several share counts for each."""
        return sum(len(body.mesh.triangles) for _, body in self._meshed)

    @property
    def memory(self) -> int:
        """Memory of all triangles, trees and vertices in the core [bytes].

        A mesh that several bodies share counts once, and once more for each of them that deforms.
        """
        meshes = [body.mesh._surface for _, body in self._meshed]
        surfaces = {id(surface): surface for surface in [*meshes, *self._shape.surfaces]}
        return sum(sum(surface.memory) for surface in surfaces.values())

    def _core_at(self, time: float, threads: int | None) -> _core.Scene:
        """The core's scene with the vertices of a time [s]; what has not changed since the last call stays as it is."""
        shape = self._shape
        vertices = {b: self._vertices(b, time) for b in self._deforming}
        moved = [b for b, new in vertices.items() if not np.array_equal(new, shape.vertices.get(b, ()))]
        if moved:
            surfaces = list(shape.surfaces)
            for b in moved:
                surfaces[b] = surfaces[b].deform(vertices[b], threads=threads)
            self._shape = shape = self._shape_of(vertices, surfaces)
        return shape.core

    def _shape_of(self, vertices: dict[int, NDArray[np.float64]], surfaces: list[_core.Surface]) -> _Shape:
        return _Shape(vertices, surfaces, _core.Scene(surfaces))

    @property
    def is_static(self) -> bool:
        """True when nothing ever moves."""
        return bool(self._are_still.all()) and not self._velocities.any()

    @cached_property
    def _are_still(self) -> NDArray[np.bool_]:
        """Bodies with meshes that never move, (body,)."""
        still = [is_static(body.motion) and body.deformation is None for _, body in self._meshed]
        return np.array(still, dtype=np.bool_)

    def _vertices(self, body: int, time: float) -> NDArray[np.float64]:
        """Vertices of a body with a mesh at a time [s], (n, 3) in body coordinates [m]."""
        return np.ascontiguousarray(self._meshed[body][1].vertices_at(time))

    def _vertex_rates(self, body: int, time: float) -> NDArray[np.float64]:
        """Their velocities [m/s]."""
        deformation = self._meshed[body][1].deformation
        assert deformation is not None  # only asked for bodies that deform
        return np.ascontiguousarray(deformation.rate_at(time))

    def __reduce__(self) -> tuple[type[Scene], tuple[tuple[Body | PointTarget, ...]]]:
        return type(self), (self.bodies,)

    def __repr__(self) -> str:
        return f"<Scene: {', '.join(self.names) or 'empty'}>"
