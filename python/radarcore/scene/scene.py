"""A scene: bodies and point targets, and their surfaces in the core."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, count

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.geometry.mesh import bounds_of
from radarcore.motion.group import is_static
from radarcore.records import sealed
from radarcore.scene.body import Body, PointTarget
from radarcore.scene.interferer import Interferer


@dataclass(frozen=True, eq=False)
class Parts:
    """Bodies with meshes, and point targets, both in the scene's order.

    Attributes
    ----------
    meshed : tuple of Body
    mesh_numbers : (mesh,) int32
        Number in the scene of every body with a mesh.
    deforming : tuple of int
        Indices into `meshed` of the bodies that deform.
    are_still : (mesh,) bool
        True for bodies with meshes that never move.
    point_numbers : (point,) int32
        Number in the scene of every point target.
    positions, velocities : (point, 3) float64
        In the world [m] at time 0, and [m/s].
    """

    meshed: tuple[Body, ...]
    mesh_numbers: NDArray[np.int32]
    deforming: tuple[int, ...]
    are_still: NDArray[np.bool_]
    point_numbers: NDArray[np.int32]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @classmethod
    def of(cls, bodies: tuple[Body | PointTarget, ...]) -> Parts:
        """The parts of a scene."""
        meshed = [(i, body) for i, body in enumerate(bodies) if isinstance(body, Body)]
        points = [(i, body) for i, body in enumerate(bodies) if isinstance(body, PointTarget)]
        still = [is_static(body.motion) and body.deformation is None for _, body in meshed]
        return cls(
            meshed=tuple(body for _, body in meshed),
            mesh_numbers=np.array([i for i, _ in meshed], dtype=np.int32),
            deforming=tuple(k for k, (_, body) in enumerate(meshed) if body.deformation is not None),
            are_still=np.array(still, dtype=np.bool_),
            point_numbers=np.array([i for i, _ in points], dtype=np.int32),
            positions=np.array([point.position for _, point in points], dtype=np.float64).reshape(-1, 3),
            velocities=np.array([point.velocity for _, point in points], dtype=np.float64).reshape(-1, 3),
        )

    def vertices_at(self, mesh: int, time: float) -> NDArray[np.float64]:
        """Vertices of a body with a mesh at a time [s], (n, 3) in body coordinates [m]."""
        return np.ascontiguousarray(self.meshed[mesh].vertices_at(time))

    def bounds_at(self, mesh: int, time: float) -> NDArray[np.float64]:
        """Smallest and largest coordinates of a body with a mesh at a time [s], (2, 3) in body coordinates [m]."""
        body = self.meshed[mesh]
        return body.mesh.bounds if body.deformation is None else bounds_of(self.vertices_at(mesh, time))

    def vertex_rates_at(self, mesh: int, time: float) -> NDArray[np.float64]:
        """Velocities of the vertices of a body that deforms [m/s], (n, 3) in body coordinates."""
        deformation = self.meshed[mesh].deformation
        assert deformation is not None  # only asked for bodies that deform
        return np.ascontiguousarray(deformation.rate_at(time))


@sealed
class Scene:
    """Bodies and point targets; an empty scene is a scene without echoes.

    Parameters
    ----------
    bodies : iterable of Body, PointTarget and Interferer
        Parts of the scene; images and paths number bodies and points in this order.

    Attributes
    ----------
    bodies : tuple of Body and PointTarget
        As given.
    interferers : tuple of Interferer
        Other radars, as given.
    names : tuple of str
        One per body, all different; unnamed ones are called "body 3" or "point 3" by their place in the scene.
    interferer_names : tuple of str
        Likewise; unnamed ones are called "interferer 0".
    parts : Parts
        Bodies with meshes, and points, as separate arrays.

    See Also
    --------
    Body : A mesh with a material and a motion.
    PointTarget : A point of a given cross-section.
    Simulator : Received samples of it.
    load_scene : Scene of a file.

    Examples
    --------
    >>> rc.Scene([rc.Body(rc.shapes.sphere(0.1), name="ball"), rc.PointTarget([3.0, 0.0, 0.0])])
    <Scene: ball, point 1>
    """

    def __init__(self, bodies: Iterable[Body | PointTarget | Interferer] = ()) -> None:
        if not isinstance(bodies, Iterable):
            raise TypeError(f"bodies: expected a list of Body, PointTarget and Interferer, got {type(bodies).__name__}")
        given = tuple(bodies)
        for i, body in enumerate(given):
            if not isinstance(body, Body | PointTarget | Interferer):
                raise TypeError(
                    f"bodies: expected Body, PointTarget and Interferer, got {type(body).__name__} at index {i}"
                )
        self.bodies: tuple[Body | PointTarget, ...] = tuple(body for body in given if not isinstance(body, Interferer))
        self.interferers: tuple[Interferer, ...] = tuple(body for body in given if isinstance(body, Interferer))
        names = {body.name for body in given}
        more = count(len(given))

        def name_of(body: Body | PointTarget | Interferer, number: int) -> str:
            """Name of a body, or a default with its number, or the next number whose name is free."""
            kind = "body" if isinstance(body, Body) else "point" if isinstance(body, PointTarget) else "interferer"
            free = (name for k in chain([number], more) if (name := f"{kind} {k}") not in names)
            return body.name or next(free)

        self.names: tuple[str, ...] = tuple(name_of(body, i) for i, body in enumerate(self.bodies))
        self.interferer_names: tuple[str, ...] = tuple(name_of(other, i) for i, other in enumerate(self.interferers))
        _check_names(self.names + self.interferer_names)
        self.parts: Parts = Parts.of(self.bodies)

    @property
    def num_triangles(self) -> int:
        """Triangles of all bodies; a mesh that several share counts for each."""
        return sum(len(body.mesh.triangles) for body in self.parts.meshed)

    @property
    def memory(self) -> int:
        """Memory of all triangles, trees and vertices in the core [bytes].

        A mesh that several bodies share counts once, and once more for each of them that deforms.
        """
        meshed = self.parts.meshed
        surfaces = {id(body.mesh): body.mesh._core for body in meshed}
        deformed = [meshed[mesh].mesh._core for mesh in self.parts.deforming]
        return sum(sum(surface.memory) for surface in [*surfaces.values(), *deformed])

    @cached_property
    def _core(self) -> _core.Scene:
        return _core.Scene(
            [
                body.rcs if isinstance(body, PointTarget) else (body.mesh._core, body.deformation is not None)
                for body in self.bodies
            ]
        )

    @property
    def is_static(self) -> bool:
        """True when nothing ever moves."""
        return bool(self.parts.are_still.all()) and not self.parts.velocities.any()

    def __reduce__(self) -> tuple[type[Scene], tuple[tuple[Body | PointTarget | Interferer, ...]]]:
        return type(self), ((*self.bodies, *self.interferers),)

    def __repr__(self) -> str:
        return f"<Scene: {', '.join(self.names + self.interferer_names) or 'empty'}>"


def _check_names(names: tuple[str, ...]) -> None:
    """Raise an error if two bodies share a name: truth and pictures could not distinguish them."""
    if len(set(names)) == len(names):
        return
    first: dict[str, int] = {}
    for i, name in enumerate(names):
        if (other := first.setdefault(name, i)) != i:
            raise ValueError(
                f"bodies: expected names that differ, got {name!r} at index {other} and {i}; people and arms take a "
                "name for all of their parts: bodies(name=...)"
            )
