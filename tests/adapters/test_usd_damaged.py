"""Damaged and hostile USD stages, and wrong arguments: the documented error with the prim, or a warning."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters.usd import StageScene
from usd_stages import Usd, UsdGeom, UsdShade, UsdSkel, add_arm, add_box, add_mesh, new_stage

Change = Callable[[Any], object]
NAN = float("nan")


def box_with(change: Change) -> Change:
    """A stage with a box that is changed by a function."""

    def make(stage: Any) -> object:
        return change(add_box(stage, "/World/box"))

    return make


def arm_with(change: Change) -> Change:
    """A stage with a skinned arm that is changed by a function of its mesh."""

    def make(stage: Any) -> object:
        add_arm(stage, [[0.0, 0.0], [20.0, -30.0]], [0.0, 10.0])
        return change(UsdSkel.BindingAPI(stage.GetPrimAtPath("/Person/arm")))

    return make


def instancer_with(positions: Any, numbers: Any, targets: Any) -> Change:
    """A stage with a point instancer of boxes."""

    def make(stage: Any) -> None:
        instancer = UsdGeom.PointInstancer.Define(stage, "/parts")
        add_box(stage, "/parts/box")
        instancer.CreatePrototypesRel().SetTargets(targets)
        instancer.CreateProtoIndicesAttr(numbers)
        instancer.CreatePositionsAttr(positions)

    return make


def samples(op: Any, *values: Any) -> None:
    for code, value in enumerate(values):
        op.Set(value, float(code))


def sheared(stage: Any) -> None:
    above = UsdGeom.Xform.Define(stage, "/World")
    above.AddScaleOp().Set((1.0, 2.0, 1.0))
    samples(add_box(stage, "/World/box").AddRotateZOp(), 0.0, 90.0)


FAULTS: dict[str, tuple[Change, str]] = {
    "vertex numbers": (
        box_with(lambda box: box.GetFaceVertexIndicesAttr().Set([0, 1, 99] * 8)),
        "/World/box: faceVertexIndices: expected numbers from 0 to 7, got 99",
    ),
    "negative vertex": (
        box_with(lambda box: box.GetFaceVertexIndicesAttr().Set([0, 1, -1] * 8)),
        "/World/box: faceVertexIndices: expected numbers from 0 to 7, got -1",
    ),
    "counts": (
        box_with(lambda box: box.GetFaceVertexCountsAttr().Set([4, 4])),
        "/World/box: faceVertexCounts: expected the sum 24, got 8",
    ),
    "negative count": (
        box_with(lambda box: box.GetFaceVertexCountsAttr().Set([28, -4])),
        "/World/box: faceVertexCounts: expected numbers from 0 to 24, got 28",
    ),
    "huge count": (
        box_with(lambda box: box.GetFaceVertexCountsAttr().Set([2**31 - 1] * 3)),
        "/World/box: faceVertexCounts: expected numbers from 0 to 24",
    ),
    "points": (
        box_with(lambda box: box.GetPointsAttr().Set([(NAN, 0.0, 0.0)] * 8)),
        "/World/box: points: expected finite",
    ),
    "subset": (
        box_with(lambda box: UsdShade.MaterialBindingAPI(box).CreateMaterialBindSubset("s", [6])),
        "/World/box: indices: expected numbers from 0 to 5, got 6",
    ),
    "radius": (
        lambda stage: UsdGeom.Sphere.Define(stage, "/ball").CreateRadiusAttr(-1.0),
        "/ball: radius: expected a positive number, got -1",
    ),
    "axis": (
        lambda stage: UsdGeom.Cone.Define(stage, "/cone").CreateAxisAttr("W"),
        "/cone: axis: expected one of 'X', 'Y', 'Z', got 'W'",
    ),
    "transform": (
        box_with(lambda box: box.AddTranslateOp().Set((NAN, 0.0, 0.0))),
        "/World/box: transform: expected finite",
    ),
    "scale over time": (
        box_with(lambda box: samples(box.AddScaleOp(), (1, 1, 1), (2, 1, 1))),
        "/World/box: transform: expected a scale without change over time",
    ),
    "shear": (sheared, "/World/box: transform: expected equal scales of all axes above a rotation"),
    "turns": (
        box_with(lambda box: samples(box.AddRotateZOp(UsdGeom.XformOp.PrecisionDouble), 0.0, 1e30)),
        "/World/box: rotate: expected smaller steps, got 1e+30 degrees",
    ),
    "points over time": (
        box_with(lambda box: samples(box.GetPointsAttr(), [(0, 0, 0)] * 8, [(0, 0, 0)] * 7)),
        "/World/box: ",
    ),
    "unit": (lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0.0), "metersPerUnit: expected a positive number"),
    "prototypes": (
        instancer_with([(0, 0, 0)] * 2, [0, 1], ["/parts/box"]),
        "/parts: protoIndices: expected numbers from 0 to 0, got 1",
    ),
    "no prototype": (
        instancer_with([(0, 0, 0)], [0], ["/nothing"]),
        "/parts: protoIndices: expected a prototype, and a position at all times",
    ),
    "positions": (
        instancer_with([(0, 0, 0)], [0, 0], ["/parts/box"]),
        "/parts: protoIndices: expected a prototype, and a position at all times",
    ),
    "an instancer in itself": (instancer_with([(0, 0, 0)], [0], ["/parts"]), "stage: expected at most 200000 prims"),
    "joints": (
        arm_with(lambda api: api.GetJointIndicesPrimvar().Set([0, 7] * 16)),
        "/Person/arm: skel:jointIndices, skel:jointWeights: expected joints of the skeleton for every point",
    ),
    "number of joints": (
        arm_with(lambda api: api.GetJointIndicesPrimvar().Set([0, 1] * 3)),
        "/Person/arm: skel:jointIndices",
    ),
    "weights": (
        arm_with(lambda api: api.GetJointWeightsPrimvar().Set([0.0] * 32)),
        "/Person/arm: skel:jointIndices, skel:jointWeights",
    ),
    "not a number": (
        arm_with(lambda api: api.GetJointWeightsPrimvar().Set([NAN] * 32)),
        "/Person/arm: skel:jointIndices, skel:jointWeights",
    ),
    "names of joints": (arm_with(lambda api: api.CreateJointsAttr(["upper", "tail"])), "/Person/arm: "),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_damaged_prims_are_refused_with_their_path(fault: str) -> None:
    change, message = FAULTS[fault]
    stage = new_stage()
    change(stage)
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        StageScene(stage)


def test_faults_of_skipped_prims_do_not_matter() -> None:
    stage = new_stage()
    sheared(stage)
    add_box(stage, "/box")
    assert StageScene(stage, skip=["/World/box"]).scene.names == ("/box",)


def test_instances_of_instances_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("radarcore.adapters.usd.stage._MOST_PRIMS", 2000)
    stage = new_stage()
    add_box(stage, "/level0/box")
    for level in range(1, 12):
        for k in range(10):
            prim = UsdGeom.Xform.Define(stage, f"/level{level}/x{k}").GetPrim()
            prim.GetReferences().AddInternalReference(f"/level{level - 1}")
            prim.SetInstanceable(True)
    with pytest.raises(ValueError, match="stage: expected at most 2000 prims with instances"):
        StageScene(stage, purposes=())


def test_deep_stages_are_read() -> None:
    stage = new_stage()
    path = "".join(f"/p{k}" for k in range(1500))
    add_box(stage, path)
    assert StageScene(stage).scene.names == (path,)


def test_empty_stages_and_meshes_are_empty_scenes() -> None:
    stage = new_stage()
    assert StageScene(stage).bodies == ()
    UsdGeom.Mesh.Define(stage, "/nothing")
    add_mesh(stage, "/lines", [(0, 0, 0), (1, 0, 0)], [2], [0, 1])
    assert StageScene(stage).bodies == ()
    assert StageScene(stage).scene.names == ()


def test_a_mesh_of_scale_zero_has_no_triangles() -> None:
    stage = new_stage()
    add_box(stage, "/box").AddScaleOp().Set((0.0, 0.0, 0.0))
    with pytest.warns(UserWarning, match="the mesh is empty"):
        (body,) = StageScene(stage).bodies
    assert len(body.mesh.triangles) == 0


def test_skins_without_effect_are_named() -> None:
    stage = new_stage()
    add_arm(stage, [[0.0, 0.0], [20.0, -30.0]], [0.0, 10.0])
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Person/arm")).CreateSkinningMethodAttr("dualQuaternion")
    with pytest.warns(UserWarning, match="/Person/arm: blend shapes and dual quaternions have no effect"):
        StageScene(stage)


@pytest.mark.parametrize("content", [b"", b"#usda 1.0\ndef Mesh", b"PXR-USDC" + bytes(80), b"PK\x03\x04", b"v 0 0 0"])
@pytest.mark.parametrize("suffix", [".usd", ".usda", ".usdc", ".usdz", ".txt"])
def test_files_that_are_no_stages_are_refused(tmp_path: Path, content: bytes, suffix: str) -> None:
    file = tmp_path / f"bad{suffix}"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=rf"bad{suffix}: not a USD file"):
        StageScene(file)


def test_cut_files_are_refused_or_read_without_a_crash(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "whole.usdc"))
    for k in range(5):
        add_box(stage, f"/World/box{k}").AddTranslateOp().Set((k, 0.0, 0.0))
    stage.Save()
    whole = (tmp_path / "whole.usdc").read_bytes()
    for k, size in enumerate(np.linspace(1, len(whole) - 1, 15).astype(int)):
        (tmp_path / f"cut{k}.usdc").write_bytes(whole[:size])
        with pytest.raises(ValueError, match="not a USD file"):
            StageScene(tmp_path / f"cut{k}.usdc")


def test_references_that_are_missing_are_named(tmp_path: Path) -> None:
    stage = new_stage()
    add_box(stage, "/World/box")
    stage.GetPrimAtPath("/World/box").GetReferences().AddReference("./gone.usd")
    with pytest.warns(UserWarning, match=r"1 references fail, as .*gone\.usd"):
        assert len(StageScene(stage).bodies) == 1


ARGUMENTS: dict[str, tuple[Callable[[Any], object], type[Exception], str]] = {
    "stage": (lambda _: StageScene(3), TypeError, "stage: expected Stage, got int"),
    "path": (lambda _: StageScene("no.usd"), FileNotFoundError, "stage: expected a USD file, got none at no.usd"),
    "materials": (
        lambda stage: StageScene(stage, materials={"/World/bix": "wood"}),
        ValueError,
        "materials, skip: nothing is called '/World/bix'; did you mean '/World/box'",
    ),
    "material": (lambda stage: StageScene(stage, default=3), TypeError, "default: expected Material or a name"),
    "skip": (
        lambda stage: StageScene(stage, skip=["/x"]),
        ValueError,
        "materials, skip: nothing is called '/x'",
    ),
    "live": (lambda stage: StageScene(stage, live=["/x"]), ValueError, "live: no prim '/x' in the stage"),
    "interpolation": (
        lambda stage: StageScene(stage, interpolation="held"),
        ValueError,
        "interpolation: expected one of 'linear', 'cubic', got 'held'",
    ),
    "follow": (
        lambda stage: StageScene(stage).follow(stage, 0.0),
        ValueError,
        "live: expected prims to follow, got none",
    ),
    "other stage": (
        lambda stage: StageScene(stage, live=["/World/box"]).follow(new_stage(), 0.0),
        ValueError,
        "live: no prim '/World/box' in the stage",
    ),
}


@pytest.mark.parametrize("argument", ARGUMENTS)
def test_wrong_arguments_are_refused(argument: str) -> None:
    call, kind, message = ARGUMENTS[argument]
    stage = new_stage()
    add_box(stage, "/World/box")
    with pytest.raises(kind, match=f"^{re.escape(message)}"):
        call(stage)


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("radarcore.adapters.usd.stage.find_spec", lambda _: None)
    with pytest.raises(ImportError, match=r"USD stages need usd-core: pip install radarcore\[usd\]"):
        StageScene("cell.usd")
    assert not rc.adapters.usd.is_available()
