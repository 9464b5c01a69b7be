"""USD stages as scenes: units, axes, shapes, instances, what is seen, materials, names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters.usd import StageScene
from usd_stages import Gf, Usd, UsdGeom, UsdPhysics, UsdShade, add_box, add_mesh, bind, new_stage

PI = np.pi


def world_bounds(body: rc.Body) -> np.ndarray:
    placed = body.motion.at(0.0).apply(body.mesh.vertices[np.unique(body.mesh.triangles)])
    return np.array([placed.min(axis=0), placed.max(axis=0)])


@pytest.mark.parametrize(
    ("unit", "up", "position"),
    [(1.0, "Z", [3.0, 1.0, 0.5]), (0.01, "Y", [0.03, -0.005, 0.01]), (0.3, "Y", [0.9, -0.15, 0.3])],
)
def test_positions_and_sizes_are_in_metres_with_z_up(unit: float, up: str, position: list[float]) -> None:
    stage = new_stage(unit, up)
    UsdGeom.XformCommonAPI(UsdGeom.Xform.Define(stage, "/World")).SetTranslate((1.0, 0.0, 0.5))
    ball = UsdGeom.Sphere.Define(stage, "/World/ball")
    ball.CreateRadiusAttr(0.5)
    ball.AddTranslateOp().Set((2.0, 1.0, 0.0))
    (body,) = StageScene(stage, sagitta=1e-3).bodies
    assert body.name == "/World/ball"
    np.testing.assert_allclose(body.motion.at(0.0).position, position, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(body.mesh.vertices, axis=1), 0.5 * unit, rtol=1e-12)


SHAPES: dict[str, tuple[dict[str, Any], list[float], float]] = {
    "Cube": ({"size": 0.4}, [0.4, 0.4, 0.4], 0.064),
    "Sphere": ({"radius": 0.3}, [0.6, 0.6, 0.6], 4.0 / 3.0 * PI * 0.027),
    "Cylinder": ({"radius": 0.1, "height": 0.5}, [0.2, 0.2, 0.5], PI * 0.005),
    "Capsule": ({"radius": 0.1, "height": 0.5}, [0.2, 0.2, 0.7], PI * (0.005 + 4.0 / 3.0 * 0.001)),
    "Cone": ({"radius": 0.1, "height": 0.6}, [0.2, 0.2, 0.6], PI * 0.002),
    "Plane": ({"width": 0.4, "length": 0.6}, [0.4, 0.6, 0.0], 0.0),
}
AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}
"""Numbers of the extents of a shape along z, for one along another axis."""


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("kind", SHAPES)
def test_primitives_have_their_extent_volume_and_place(kind: str, axis: str) -> None:
    attributes, extent, volume = SHAPES[kind]
    stage = new_stage(0.1)
    prim = stage.DefinePrim("/shape", kind)
    for name, value in attributes.items():
        prim.GetAttribute(name).Set(10.0 * value)
    if prim.HasAttribute("axis"):
        prim.GetAttribute("axis").Set(axis)
    (body,) = StageScene(stage).bodies
    expected = {"X": [0.0, 0.6, 0.4], "Y": [0.4, 0.0, 0.6]}.get(axis) if kind == "Plane" else None
    expected = [extent[k] for k in AXES[axis]] if expected is None else expected
    np.testing.assert_allclose(np.diff(body.mesh.bounds, axis=0)[0], expected, atol=2e-4)
    np.testing.assert_allclose(body.mesh.bounds.mean(axis=0), 0.0, atol=1e-4)
    assert body.mesh.volume == pytest.approx(volume, rel=2e-3)


def test_round_shapes_keep_to_the_sagitta_under_scales() -> None:
    stage = new_stage(0.01)
    ball = UsdGeom.Sphere.Define(stage, "/ball")
    ball.CreateRadiusAttr(1.0)
    ball.AddScaleOp().Set((10.0, 20.0, 40.0))
    (fine,), (coarse,) = StageScene(stage).bodies, StageScene(stage, sagitta=1e-3).bodies
    exact = 4.0 / 3.0 * PI * 0.1 * 0.2 * 0.4
    assert fine.mesh.volume == pytest.approx(exact, rel=2e-3)
    assert len(coarse.mesh.triangles) < len(fine.mesh.triangles) / 10
    np.testing.assert_allclose(fine.mesh.bounds[1], [0.1, 0.2, 0.4], rtol=1e-3)


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (-1.0, 1.0, 1.0), (2.0, -1.0, 1.0), (-1.0, -1.0, -3.0)])
@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
def test_normals_point_outwards_also_of_mirrored_meshes(scale: tuple[float, ...], orientation: str) -> None:
    stage = new_stage()
    mesh = add_box(stage, "/box", (0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    mesh.AddRotateXYZOp().Set((20.0, -30.0, 50.0))
    mesh.AddScaleOp().Set(scale)
    mesh.CreateOrientationAttr(orientation)
    (body,) = StageScene(stage).bodies
    sign = 1.0 if orientation == "rightHanded" else -1.0
    assert body.mesh.volume == pytest.approx(sign * 6.0 * abs(np.prod(scale)))
    matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(mesh.GetPrim()))
    corner = [1.0, 2.0, 3.0, 1.0] @ matrix
    placed = body.motion.at(0.0).apply(body.mesh.vertices)
    assert np.abs(placed - corner[:3]).max(axis=1).min() < 1e-6


def test_polygons_that_are_not_convex_are_covered_once() -> None:
    outline = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)]
    for shift in range(6):
        stage = new_stage()
        add_mesh(stage, "/l", [(*p, 0) for p in outline], [6], np.roll(np.arange(6), shift))
        (body,) = StageScene(stage).bodies
        assert body.mesh.area == pytest.approx(4.0)


def test_holes_and_faces_without_area_are_left_out() -> None:
    stage = new_stage()
    mesh = add_mesh(
        stage, "/m", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4, 3, 2, 0], [0, 1, 2, 3, 0, 1, 2, 0, 1]
    )
    mesh.CreateHoleIndicesAttr([1])
    (body,) = StageScene(stage).bodies
    assert len(body.mesh.triangles) == 2


def test_a_subdivision_surface_is_its_control_mesh_with_a_warning() -> None:
    stage = new_stage()
    add_box(stage, "/box").CreateSubdivisionSchemeAttr("catmullClark")
    with pytest.warns(UserWarning, match="/box: the control mesh of a subdivision surface"):
        (body,) = StageScene(stage).bodies
    assert body.mesh.volume == pytest.approx(1.0)


def test_subsets_are_bodies_with_their_materials_and_the_rest_is_another() -> None:
    stage = new_stage()
    mesh = add_box(stage, "/box")
    bind(stage, mesh.GetPrim(), "Wood")
    for name, faces in (("Glass", [0, 1]), ("Steel", [2])):
        subset = UsdShade.MaterialBindingAPI(mesh).CreateMaterialBindSubset(name.lower(), faces)
        bind(stage, subset.GetPrim(), name)
    bodies = {body.name: body for body in StageScene(stage, materials={"Steel": "perfect_conductor"}).bodies}
    assert {name: len(body.mesh.triangles) for name, body in bodies.items()} == {
        "/box/glass": 4,
        "/box/steel": 2,
        "/box": 6,
    }
    assert [body.material for body in bodies.values()] == [
        rc.materials[m] for m in ("glass", "perfect_conductor", "wood")
    ]


def test_material_of_the_nearest_name_counts() -> None:
    stage = new_stage()
    for name in ("a", "b", "c", "d", "e", "f"):
        add_box(stage, f"/World/group/{name}")
    prims = {name: stage.GetPrimAtPath(f"/World/group/{name}") for name in "abcdef"}
    bind(stage, prims["a"], "Concrete")
    bind(stage, prims["b"], "Concrete")
    bind(stage, prims["c"], "Paint")
    bind(stage, prims["d"], "Rubber", "physics")
    bind(stage, prims["e"], "WOOD", "physics")
    table = {"/World/group/a": "glass", "/Looks/Paint": "abs", "Rubber": "pvc"}
    found = {body.name[-1]: body.material for body in StageScene(stage, materials=table, default="pmma").bodies}
    names = {"a": "glass", "b": "concrete", "c": "abs", "d": "pvc", "e": "wood", "f": "pmma"}
    assert found == {name: rc.materials[material] for name, material in names.items()}
    grouped = StageScene(stage, materials={"/World/group": "marble", "/World": "brick", "Paint": rc.Material(-1.0)})
    by_name = {body.name[-1]: body.material for body in grouped.bodies}
    assert by_name["c"] == rc.Material(-1.0)
    assert by_name["f"] == rc.materials["marble"]


def test_invisible_prims_proxies_guides_and_skipped_prims_are_not_seen() -> None:
    stage = new_stage()
    for name in ("seen", "hidden/below", "guide/below", "proxy", "render", "housing/below", "off"):
        add_box(stage, f"/{name}")
    UsdGeom.Imageable(stage.DefinePrim("/hidden", "Xform")).MakeInvisible()
    for name in ("guide", "proxy", "render"):
        UsdGeom.Imageable(
            stage.GetPrimAtPath(f"/{name}") if name != "guide" else stage.DefinePrim("/guide", "Xform")
        ).CreatePurposeAttr(name)
    stage.GetPrimAtPath("/off").SetActive(False)
    stage.CreateClassPrim("/_class")
    add_box(stage, "/_class/box")
    scene = StageScene(stage, skip=["/housing"])
    assert [body.name for body in scene.bodies] == ["/seen", "/render"]
    assert scene.motion("/housing/below").at(0.0) == rc.Pose()  # where a radar may sit
    assert [body.name for body in StageScene(stage, purposes=["guide"]).bodies] == ["/guide/below"]


def test_visibility_counts_at_the_time() -> None:
    stage = new_stage()
    box = add_box(stage, "/box")
    box.CreateVisibilityAttr().Set("invisible", 0.0)
    box.GetVisibilityAttr().Set("inherited", 10.0)
    assert len(StageScene(stage).bodies) == 0
    assert len(StageScene(stage, time=1.5).bodies) == 1


def test_types_without_a_surface_are_named_once() -> None:
    stage = new_stage()
    for k in range(3):
        stage.DefinePrim(f"/curve{k}", "BasisCurves")
    stage.DefinePrim("/patch", "NurbsPatch")
    with pytest.warns(UserWarning, match="these types are not seen: BasisCurves, NurbsPatch"):
        assert StageScene(stage).bodies == ()


def test_nested_instances_share_their_meshes_and_stand_where_they_are_put() -> None:
    stage = new_stage(0.01)
    stage.CreateClassPrim("/_bolt")
    add_box(stage, "/_bolt/body")
    bind(stage, stage.GetPrimAtPath("/_bolt/body"), "Glass")
    stage.CreateClassPrim("/_plate")
    for k in range(2):
        bolt = UsdGeom.Xform.Define(stage, f"/_plate/bolt{k}")
        bolt.GetPrim().GetReferences().AddInternalReference("/_bolt")
        bolt.GetPrim().SetInstanceable(True)
        bolt.AddTranslateOp().Set((100.0 * k, 0.0, 0.0))
    for k in range(3):
        plate = UsdGeom.Xform.Define(stage, f"/World/plate{k}")
        plate.GetPrim().GetReferences().AddInternalReference("/_plate")
        plate.GetPrim().SetInstanceable(True)
        plate.AddTranslateOp().Set((0.0, 0.0, 100.0 * k))
        plate.AddRotateZOp().Set(90.0 * k)
    bodies = {body.name: body for body in StageScene(stage).bodies}
    assert sorted(bodies) == [f"/World/plate{k}/bolt{j}/body" for k in range(3) for j in range(2)]
    assert len({id(body.mesh) for body in bodies.values()}) == 1
    assert {body.material for body in bodies.values()} == {rc.materials["glass"]}
    for k in range(3):
        turned = [np.cos(k * PI / 2), np.sin(k * PI / 2), k]
        np.testing.assert_allclose(bodies[f"/World/plate{k}/bolt1/body"].motion.at(0.0).position, turned, atol=1e-7)


def test_instances_of_points_have_their_own_places_turns_and_scales() -> None:
    stage = new_stage()
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/parts")
    instancer.AddTranslateOp().Set((0.0, 0.0, 5.0))
    add_box(stage, "/World/parts/box", (0.0, 0.0, 0.0), (1.0, 0.1, 0.1))
    cup = UsdGeom.Xform.Define(stage, "/World/parts/cup")
    cup.AddTranslateOp().Set((0.0, 0.0, 0.5))
    UsdGeom.Sphere.Define(stage, "/World/parts/cup/ball").CreateRadiusAttr(0.1)
    instancer.CreatePrototypesRel().SetTargets(["/World/parts/box", "/World/parts/cup"])
    instancer.CreateProtoIndicesAttr([0, 1, 0, 1])
    instancer.CreatePositionsAttr([(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (3.0, 0.0, 0.0), (4.0, 0.0, 0.0)])
    half = float(np.sqrt(0.5))
    instancer.CreateOrientationsAttr(
        [Gf.Quath(1, 0, 0, 0)] * 2 + [Gf.Quath(half, 0, 0, half), Gf.Quath(1, 0, 0, 0)]
    )  # not quite a unit quaternion
    instancer.CreateScalesAttr([(1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0)])
    instancer.InvisId(3, 0)
    bodies = {body.name: body for body in StageScene(stage).bodies}
    assert list(bodies) == ["/World/parts/0/box", "/World/parts/1/cup/ball", "/World/parts/2/box"]
    np.testing.assert_allclose(world_bounds(bodies["/World/parts/2/box"]), [[2.9, 0, 5], [3.0, 1, 5.1]], atol=1e-3)
    ball = bodies["/World/parts/1/cup/ball"]
    np.testing.assert_allclose(ball.motion.at(0.0).position, [2.0, 0.0, 6.0], atol=1e-7)
    assert ball.mesh.bounds[1, 0] == pytest.approx(0.2, rel=1e-6)
    assert bodies["/World/parts/0/box"].mesh is bodies["/World/parts/2/box"].mesh


def test_a_reset_of_the_transforms_starts_at_the_world() -> None:
    stage = new_stage(0.01)
    UsdGeom.Xform.Define(stage, "/moved").AddTranslateOp().Set((500.0, 0.0, 0.0))
    box = add_box(stage, "/moved/box")
    box.AddTranslateOp().Set((100.0, 0.0, 0.0))
    box.SetResetXformStack(True)
    (body,) = StageScene(stage).bodies
    np.testing.assert_allclose(body.motion.at(0.0).position, [1.0, 0.0, 0.0], atol=1e-12)


def test_a_radar_looks_along_a_camera_and_along_x_of_other_prims() -> None:
    for up in ("Y", "Z"):
        stage = new_stage(0.01, up)
        camera = UsdGeom.Camera.Define(stage, "/rig/eye")
        camera.AddTranslateOp().Set((100.0, 0.0, 0.0))
        camera.AddRotateXOp().Set(0.0 if up == "Y" else 90.0)
        UsdGeom.Xform.Define(stage, "/rig/mount").AddTranslateOp().Set((0.0, 200.0, 0.0))
        scene = StageScene(stage)
        eye, mount = scene.motion("/rig/eye").at(0.0), scene.motion("/rig/mount").at(0.0)
        # A camera of USD looks along -z with y up: with a horizontal view, towards +y of our world.
        np.testing.assert_allclose(eye.rotation, [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], atol=1e-12)
        np.testing.assert_allclose(eye.position, [1.0, 0.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(mount.rotation, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(mount.position, [0, 0, 2] if up == "Y" else [0, 2, 0], atol=1e-12)
    with pytest.raises(ValueError, match=r"path: no prim '/rig/eyes' in the stage; did you mean '/rig/eye'"):
        scene.motion("/rig/eyes")


def test_a_file_and_its_references_are_read(tmp_path: Path) -> None:
    part = Usd.Stage.CreateNew(str(tmp_path / "part.usdc"))
    add_box(part, "/part/box")
    part.SetDefaultPrim(part.GetPrimAtPath("/part"))
    part.Save()
    cell = Usd.Stage.CreateNew(str(tmp_path / "cell.usda"))
    UsdGeom.SetStageMetersPerUnit(cell, 1.0)
    cell.DefinePrim("/World/a").GetReferences().AddReference("./part.usdc")
    cell.DefinePrim("/World/b").GetPayloads().AddPayload("./part.usdc")
    cell.Save()
    scene = StageScene(tmp_path / "cell.usda")
    assert scene.scene.names == ("/World/a/box", "/World/b/box")
    assert repr(scene) == "<StageScene: 2 bodies, 0 live prims>"


def test_frames_of_a_stage_are_those_of_the_same_shapes() -> None:
    stage = new_stage(0.01, "Y")
    ball = UsdGeom.Sphere.Define(stage, "/ball")
    ball.CreateRadiusAttr(10.0)
    ball.AddTranslateOp().Set((200.0, 0.0, -30.0))
    bind(stage, ball.GetPrim(), "Wood")
    UsdPhysics.RigidBodyAPI.Apply(ball.GetPrim())
    own = rc.Body(rc.shapes.sphere(0.1), material=rc.materials["wood"], motion=rc.Pose([2.0, 0.3, 0.0]))
    radar = rc.Radar(rc.bgt60tr13c(num_chirps=4).waveform)
    cubes = [rc.Simulator(scene, radar).frame(0.0).cube for scene in (StageScene(stage).scene, rc.Scene([own]))]
    # Facets are laid differently, and the axes turn: the echo of a sphere is the same.
    np.testing.assert_allclose(cubes[0], cubes[1], atol=0.05 * np.abs(cubes[1]).max())
