"""What a scene is made of: bodies and ideal point targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.material import Material, materials
from radarcore.mesh import Mesh
from radarcore.motion import AnyMotion, Motion, Pose, as_motion


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid mesh of one material that may move.

    Parameters
    ----------
    mesh : Mesh
        Shape, in the body's own coordinates; bodies may share one.
    material : Material
        Default: ``materials["metal"]``.
    motion : Pose, Linear, Trajectory, Attached or function of time
        Body to world; default: the world's own frame.
    name : str, optional
        For tables and pictures.
    """

    mesh: Mesh
    material: Material
    motion: Motion
    name: str | None

    def __init__(
        self,
        mesh: Mesh,
        *,
        material: Material | None = None,
        motion: AnyMotion | None = None,
        name: str | None = None,
    ) -> None:
        material = materials["metal"] if material is None else material
        if not isinstance(mesh, Mesh):
            raise TypeError(f"mesh: expected Mesh, got {type(mesh).__name__}")
        if not isinstance(material, Material):
            raise TypeError(f"material: expected Material (one of radarcore.materials), got {material!r}")
        put = object.__setattr__
        put(self, "mesh", mesh)
        put(self, "material", material)
        put(self, "motion", Pose() if motion is None else as_motion("motion", motion))
        put(self, "name", name)


@dataclass(frozen=True, eq=False)
class PointTarget:
    """An ideal point of a given radar cross-section: no shadow, no phase of its own.

    Parameters
    ----------
    position : (3,) array_like
        Position in the world at absolute time 0 [m].
    rcs : float
        Radar cross-section [m^2].
    velocity : (3,) array_like
        Constant velocity in the world [m/s].
    name : str, optional
        For tables and pictures.
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
        put = object.__setattr__
        put(self, "position", check.frozen(check.array("position", position, (3,))))
        put(self, "rcs", check.non_negative("rcs", rcs, "m^2"))
        put(self, "velocity", check.frozen(check.array("velocity", velocity, (3,))))
        put(self, "name", name)
