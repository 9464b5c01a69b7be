"""Parts of a scene: bodies and ideal point targets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.pose import Pose, checked_position
from radarcore.motion.deformation import AnyDeformation, as_deformation
from radarcore.motion.linear import Linear
from radarcore.motion.protocol import AnyMotion, Motion, as_motion
from radarcore.records import sealed
from radarcore.scene.library import materials
from radarcore.scene.material import Material
from radarcore.units import SPEED_OF_LIGHT


@sealed
@dataclass(eq=False)
class Body:
    """A mesh of one material that may move and change its shape.

    Parameters
    ----------
    mesh : Mesh
        Shape, in the body's own coordinates; bodies may share one.
    material : Material
        Default: ``materials["metal"]``.
    motion : Pose, Linear, Trajectory, Attached, Live or function of time
        Body to world; default: the world's own frame.
    deformation : Deformation or function of time, optional
        Vertices of the mesh over time in body coordinates; a function maps a time [s] to all vertices, (n, 3) [m].
        Rates of a function are differences over 0.5 ms. Default: the body is rigid. Speckle and smooth
        shading belong to the mesh as it was given: where facets meet below the crease angle, its own vertices say.
    name : str, optional
        Name in tables and pictures.

    See Also
    --------
    PointTarget : A point of a given cross-section.
    Scene : Takes bodies and points.
    shapes.box : One of the shapes of a mesh.
    materials : Its possible materials.

    Examples
    --------
    >>> box = rc.Body(rc.shapes.box(0.2), material=rc.materials["wood"], motion=rc.Pose([2.0, 0.0, 0.0]), name="box")
    >>> image = rc.Simulator(rc.Scene([box]), rc.bgt60tr13c()).depth_image(0.0)
    >>> print(f"{image.distance.min():.2f} m")
    1.90 m
    """

    mesh: Mesh
    material: Material
    motion: Motion
    deformation: AnyDeformation | None
    name: str | None

    def __init__(
        self,
        mesh: Mesh,
        *,
        material: Material | None = None,
        motion: AnyMotion | None = None,
        deformation: AnyDeformation | Callable[[float], ArrayLike] | None = None,
        name: str | None = None,
    ) -> None:
        material = materials["metal"] if material is None else material
        self.mesh = check.instance("mesh", mesh, Mesh)
        if not isinstance(material, Material):
            raise TypeError(f"material: expected Material (one of radarcore.materials), got {material!r}")
        self.material = material
        self.motion = Pose() if motion is None else as_motion("motion", motion)
        self.deformation = None if deformation is None else as_deformation(deformation, len(mesh.vertices))
        self.name = name

    def vertices_at(self, time: float) -> NDArray[np.float64]:
        """Vertices of the mesh at a time [s], (n, 3) in body coordinates [m]."""
        return self.mesh.vertices if self.deformation is None else self.deformation.at(time)


@sealed
@dataclass(eq=False)
class PointTarget:
    """An ideal point of a given radar cross-section: no shadow, no phase of its own.

    Its echo follows the gain of the antennas in every direction. Its truth is NaN outside of the field of view.

    Parameters
    ----------
    position : (3,) array_like
        Position in the world at absolute time 0 [m].
    rcs : float
        Radar cross-section [m^2].
    velocity : (3,) array_like
        Constant velocity in the world [m/s].
    name : str, optional
        Name in tables and pictures.

    See Also
    --------
    Body : A mesh, which has shadows and an echo of its own.
    Scene : Takes bodies and points.

    Examples
    --------
    >>> point = rc.PointTarget([3.0, 0.0, 0.0], rcs=0.5, velocity=[-1.0, 0.0, 0.0])
    >>> truth = rc.Simulator(rc.Scene([point]), rc.bgt60tr13c()).frame(0.0).truth
    >>> print(f"{truth.range[0]:.2f} m, {truth.velocity[0]:.1f} m/s")
    2.99 m, -1.0 m/s
    """

    position: NDArray[np.float64]
    rcs: float
    velocity: NDArray[np.float64]
    name: str | None

    def __init__(
        self,
        position: ArrayLike,
        rcs: float = 1.0,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        *,
        name: str | None = None,
    ) -> None:
        self.position = check.frozen(checked_position("position", position))
        self.rcs = check.non_negative("rcs", rcs, "m^2")
        speeds = check.below("velocity", check.array("velocity", velocity, (3,)), SPEED_OF_LIGHT, "m/s")
        self.velocity = check.frozen(speeds)
        self.name = name


def motion_of(body: Body | PointTarget) -> Motion:
    """Motion of a body, or of a point at constant velocity."""
    return body.motion if isinstance(body, Body) else Linear(Pose(body.position), velocity=body.velocity)
