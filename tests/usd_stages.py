"""USD stages for tests, written by pxr."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

HINT = "needs the extra `usd`: pip install radarcore[usd]"
pxr: Any = pytest.importorskip("pxr", reason=HINT)
from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdSkel, Vt  # noqa: E402, F401  # after the skip

BOX_COUNTS = [4] * 6
BOX_CORNERS = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]


def new_stage(unit: float = 1.0, up: str = "Z", rate: float = 10.0) -> Any:
    """An empty stage with `rate` time codes per second."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdGeom.SetStageUpAxis(stage, up)
    stage.SetTimeCodesPerSecond(rate)
    return stage


def box_points(low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    """Corners of a box, the last coordinate first."""
    return np.array([[x, y, z] for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])])


def add_mesh(stage: Any, path: str, points: Any, counts: Sequence[int], corners: Sequence[int]) -> Any:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(points, dtype=np.float32)))
    mesh.CreateFaceVertexCountsAttr(list(counts))
    mesh.CreateFaceVertexIndicesAttr([int(corner) for corner in corners])
    return mesh


def add_box(stage: Any, path: str, low: Sequence[float] = (-0.5,) * 3, high: Sequence[float] = (0.5,) * 3) -> Any:
    return add_mesh(stage, path, box_points(low, high), BOX_COUNTS, BOX_CORNERS)


def bind(stage: Any, prim: Any, name: str, purpose: str = "") -> None:
    """Bind a material of the stage, which is made if it is not there."""
    material = UsdShade.Material.Define(stage, f"/Looks/{name}")
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, materialPurpose=purpose)


def add_arm(stage: Any, angles: Sequence[Sequence[float]], codes: Sequence[float], weights: Any = None) -> Any:
    """Two skinned boxes along x: both turn about z at 0, the second one also at x = 1, by angles in degrees."""
    root = UsdSkel.Root.Define(stage, "/Person")
    skeleton = UsdSkel.Skeleton.Define(stage, "/Person/Skeleton")
    skeleton.CreateJointsAttr(["upper", "upper/lower"])
    at = [Gf.Matrix4d().SetTranslate(Gf.Vec3d(x, 0, 0)) for x in (0.0, 1.0)]
    skeleton.CreateBindTransformsAttr(at)
    skeleton.CreateRestTransformsAttr(at)
    animation = UsdSkel.Animation.Define(stage, "/Person/Skeleton/Animation")
    animation.CreateJointsAttr(["upper", "upper/lower"])
    animation.CreateTranslationsAttr([Gf.Vec3f(0, 0, 0), Gf.Vec3f(1, 0, 0)])
    animation.CreateScalesAttr([Gf.Vec3h(1, 1, 1)] * 2)
    rotations = animation.CreateRotationsAttr()
    for code, turns in zip(codes, angles, strict=True):
        half = np.deg2rad(np.array(turns)) / 2.0
        rotations.Set([Gf.Quatf(float(np.cos(a)), 0.0, 0.0, float(np.sin(a))) for a in half], code)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    points = np.concatenate(
        [box_points((0, -0.1, -0.1), (0.9, 0.1, 0.1)), box_points((1.1, -0.1, -0.1), (2, 0.1, 0.1))]
    )
    mesh = add_mesh(stage, "/Person/arm", points, BOX_COUNTS * 2, [*BOX_CORNERS, *(8 + k for k in BOX_CORNERS)])
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    weights = [[1, 0]] * 8 + [[0, 1]] * 8 if weights is None else weights
    binding.CreateJointIndicesPrimvar(False, 2).Set([0, 1] * 16)
    binding.CreateJointWeightsPrimvar(False, 2).Set([float(w) for row in weights for w in row])
    return root
