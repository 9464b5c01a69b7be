"""Motion of USD stages: time samples against closed forms and against pxr, skins against rigid links, live stages."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters.usd import StageScene
from usd_stages import Gf, Usd, UsdGeom, UsdPhysics, UsdSkel, Vt, add_arm, add_box, new_stage

PI = np.pi
RATE = 10.0
"""Time codes per second of the stages."""


def position_and_velocity(motion: Any, time: float) -> tuple[np.ndarray, np.ndarray]:
    return motion.at(time).position, motion.rate_at(time)[:, 3]


def test_a_shift_between_time_samples_is_linear_and_rests_beyond_them() -> None:
    stage = new_stage(0.01)
    shift = add_box(stage, "/box").AddTranslateOp()
    for code, x in ((5.0, 100.0), (10.0, 300.0), (20.0, 200.0)):
        shift.Set((x, 0.0, 50.0), code)
    motion = StageScene(stage).bodies[0].motion
    rows = [(0.0, 1.0, 0.0), (0.75, 2.0, 4.0), (1.0, 3.0, -1.0), (1.5, 2.5, -1.0), (2.0, 2.0, -1.0), (3.0, 2.0, 0.0)]
    for time, x, speed in rows:
        position, velocity = position_and_velocity(motion, time)
        np.testing.assert_allclose(position, [x, 0.0, 0.5], atol=1e-12)
        np.testing.assert_allclose(velocity, [speed, 0.0, 0.0], atol=1e-9)


def test_a_fast_turn_below_a_scale_is_a_circle_at_constant_speed() -> None:
    stage = new_stage(0.01, "Y")
    spin = UsdGeom.Xform.Define(stage, "/World")
    turn = spin.AddRotateYOp()
    turn.Set(30.0, 0.0)
    turn.Set(30.0 + 5.0 * 360.0, 20.0)  # 5 turns in 2 s
    spin.AddScaleOp().Set((2.0, 2.0, 2.0))
    add_box(stage, "/World/box").AddTranslateOp().Set((50.0, 0.0, 0.0))
    (body,) = StageScene(stage).bodies
    speed = 5.0 * PI
    for time in (0.0, 0.013, 0.7, 1.99):
        angle = PI / 6.0 + speed * time
        position, velocity = position_and_velocity(body.motion, time)
        np.testing.assert_allclose(position, [np.cos(angle), np.sin(angle), 0.0], atol=1e-9)
        np.testing.assert_allclose(velocity, speed * np.array([-np.sin(angle), np.cos(angle), 0.0]), atol=1e-8)
    assert body.mesh.volume == pytest.approx(0.02**3)


def test_a_pendulum_of_frames_has_the_velocity_of_the_product_rule() -> None:
    stage = new_stage()
    cart = UsdGeom.Xform.Define(stage, "/cart")
    drive = cart.AddTranslateOp()
    drive.Set((0.0, 0.0, 0.0), 0.0)
    drive.Set((3.0, 0.0, 0.0), 10.0)
    arm = UsdGeom.Xform.Define(stage, "/cart/arm")
    turn = arm.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    for code, angle in ((0.0, 0.0), (10.0, 2.0)):
        turn.Set(Gf.Quatd(np.cos(angle / 2.0), 0.0, 0.0, np.sin(angle / 2.0)), code)
    add_box(stage, "/cart/arm/hand").AddTranslateOp().Set((0.5, 0.0, 0.0))
    motion = StageScene(stage).motion("/cart/arm/hand")
    for time in (0.1, 0.5, 0.9):
        position, velocity = position_and_velocity(motion, time)
        angle = 2.0 * time
        np.testing.assert_allclose(position, [3 * time + 0.5 * np.cos(angle), 0.5 * np.sin(angle), 0], atol=1e-12)
        np.testing.assert_allclose(velocity, [3.0 - np.sin(angle), np.cos(angle), 0.0], atol=1e-9)


KINDS = ("Translate", "RotateX", "RotateZ", "RotateXYZ", "RotateZYX", "RotateYXZ", "Scale", "Pivot")


def add_random_ops(prim: Any, rng: np.random.Generator) -> None:
    """Operations of all kinds, some with time samples; one scale for all axes, without time samples."""
    for number, kind in enumerate(rng.choice(KINDS, 4)):
        suffix = f"s{number}"
        codes = [0.0, *np.sort(rng.uniform(1.0, 19.0, 2)), 20.0] if rng.random() < 0.6 and kind != "Scale" else [None]
        if kind == "Scale":
            op, values = prim.AddScaleOp(opSuffix=suffix), [Gf.Vec3f(float(rng.uniform(0.5, 2.0)))]
        elif kind in ("Translate", "Pivot"):
            op = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble, suffix)
            values = [Gf.Vec3d(*rng.uniform(-1.0, 1.0, 3)) for _ in codes]
        else:
            op = getattr(prim, f"Add{kind}Op")(UsdGeom.XformOp.PrecisionDouble, suffix)
            angles = rng.uniform(-200.0, 200.0, (len(codes), 3))
            values = [Gf.Vec3d(*row) if len(kind) > 7 else float(row[0]) for row in angles]
        for code, value in zip(codes, values, strict=True):
            op.Set(value) if code is None else op.Set(value, code)
        if kind == "Pivot" or (kind.startswith("Rotate") and rng.random() < 0.3):
            prim.AddXformOp(op.GetOpType(), op.GetPrecision(), suffix, True)
        if kind == "Pivot":
            prim.AddRotateYOp(opSuffix=suffix).Set(40.0)


@pytest.mark.parametrize("seed", range(12))
def test_motions_agree_with_pxr_between_time_samples(seed: int) -> None:
    rng = np.random.default_rng(seed)
    stage = new_stage(0.5)
    path = ""
    for depth in range(3):
        path += f"/p{depth}"
        add_random_ops(UsdGeom.Xform.Define(stage, path), rng)
    motion = StageScene(stage).motion(path)

    def exact(time: float) -> np.ndarray:
        cache = UsdGeom.XformCache(Usd.TimeCode(RATE * time))
        matrix = np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath(path))).T
        linear = matrix[:3, :3] / np.cbrt(np.linalg.det(matrix[:3, :3]))
        return np.column_stack([linear, 0.5 * matrix[:3, 3]])

    for time in rng.uniform(0.05, 1.95, 20):
        pose, step = motion.at(time), 1e-6
        np.testing.assert_allclose(np.column_stack([pose.rotation, pose.position]), exact(time), atol=2e-6)
        before, after = exact(time - step), exact(time + step)
        slope = (after - before) / (2.0 * step)
        np.testing.assert_allclose(motion.rate_at(time), slope, atol=1e-4 * max(1.0, np.abs(slope).max()))


def test_matrices_turn_at_a_constant_rate_between_time_samples() -> None:
    stage = new_stage(0.01)
    op = add_box(stage, "/box").AddTransformOp()
    for code in range(0, 11, 5):
        turn = Gf.Matrix4d(1.0).SetRotate(Gf.Rotation(Gf.Vec3d(0, 0, 1), 60.0 * code / 5.0))
        op.Set(Gf.Matrix4d().SetScale(3.0) * turn * Gf.Matrix4d().SetTranslate(Gf.Vec3d(100.0 * code, 0, 0)), code)
    (body,) = StageScene(stage).bodies
    for time in (0.0, 0.3, 0.8):
        angle = np.deg2rad(120.0) * time
        np.testing.assert_allclose(body.motion.at(time).rotation[:2, 0], [np.cos(angle), np.sin(angle)], atol=1e-12)
        np.testing.assert_allclose(body.motion.rate_at(time)[:, 3], [10.0, 0.0, 0.0], atol=1e-9)
        rate = np.deg2rad(120.0) * np.array([-np.sin(angle), np.cos(angle)])
        np.testing.assert_allclose(body.motion.rate_at(time)[:2, 0], rate, atol=1e-9)
    assert body.mesh.volume == pytest.approx(0.03**3)


def test_cubic_velocities_are_continuous_and_close_to_the_motion_that_was_sampled() -> None:
    stage = new_stage()
    prim = add_box(stage, "/box")
    shift, turn = prim.AddTranslateOp(), prim.AddRotateZOp(UsdGeom.XformOp.PrecisionDouble)
    step, omega = 1.0 / 30.0, 2.0 * PI
    for k in range(31):
        shift.Set((np.sin(omega * k * step), 0.0, 0.0), RATE * k * step)
        turn.Set(np.rad2deg(0.5 * np.sin(omega * k * step)), RATE * k * step)
    times = np.linspace(0.1, 0.9, 400)
    errors, jumps = {}, {}
    for kind in ("linear", "cubic"):
        motion = StageScene(stage, interpolation=kind).bodies[0].motion
        rates = np.array([motion.rate_at(t) for t in times])
        errors[kind] = np.abs(rates[:, 0, 3] - omega * np.cos(omega * times)).max()
        jumps[kind] = np.abs(np.diff(rates[:, 0, 3])).max()
    assert errors["linear"] < 0.5 * omega**2 * step * 1.05  # half a step of the acceleration
    # A spline's rate is off by a 24th of the fourth derivative times the cube of the step, in its middle.
    assert errors["cubic"] < 1.5 * omega**4 * step**3 / 24.0
    assert jumps["cubic"] < 0.3 * jumps["linear"]


def test_points_with_time_samples_deform() -> None:
    stage = new_stage(0.01)
    mesh = add_box(stage, "/box")
    points = np.array(mesh.GetPointsAttr().Get())
    for code in (0.0, 10.0):
        mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy((points * (1.0 + code)).astype(np.float32)), code)
    mesh.AddTranslateOp().Set((100.0, 0.0, 0.0))
    (body,) = StageScene(stage).bodies
    np.testing.assert_allclose(body.deformation.at(0.5), 0.06 * points, atol=1e-9)
    np.testing.assert_allclose(body.deformation.rate_at(0.5), 0.1 * points, atol=1e-9)
    np.testing.assert_allclose(body.motion.at(0.5).position, [1.0, 0.0, 0.0], atol=1e-12)


def test_instances_of_points_move() -> None:
    stage = new_stage(0.01)
    instancer = UsdGeom.PointInstancer.Define(stage, "/parts")
    add_box(stage, "/parts/box")
    instancer.CreatePrototypesRel().SetTargets(["/parts/box"])
    instancer.CreateProtoIndicesAttr([0, 0])
    positions = instancer.CreatePositionsAttr()
    positions.Set([(0.0, 0.0, 0.0), (0.0, 100.0, 0.0)], 0.0)
    positions.Set([(200.0, 0.0, 0.0), (0.0, 100.0, 50.0)], 10.0)
    bodies = StageScene(stage).bodies
    for body, start, speed in zip(bodies, ([0, 0, 0], [0, 1, 0]), ([2, 0, 0], [0, 0, 0.5]), strict=True):
        position, velocity = position_and_velocity(body.motion, 0.25)
        np.testing.assert_allclose(position, start + 0.25 * np.array(speed), atol=1e-9)
        np.testing.assert_allclose(velocity, speed, atol=1e-9)


def test_a_skinned_arm_moves_as_rigid_links() -> None:
    stage = new_stage()
    root = add_arm(stage, [[0.0, 0.0], [90.0, -45.0]], [0.0, 10.0])
    root.AddTranslateOp().Set((5.0, 0.0, 1.0))
    (body,) = StageScene(stage).bodies
    upper = rc.Linear(rc.Pose([5.0, 0.0, 1.0]), angular_velocity=[0.0, 0.0, PI / 2.0])
    lower = rc.Attached(upper, rc.Linear(rc.Pose([1.0, 0.0, 0.0]), angular_velocity=[0.0, 0.0, -PI / 4.0]))
    start = body.mesh.vertices
    for time in (0.0, 0.3, 0.85):
        vertices = body.motion.at(time).apply(body.deformation.at(time))
        velocities = body.deformation.rate_at(time)  # the motion of the skeleton rests
        for link, rows, shift in ((upper, slice(0, 8), 0.0), (lower, slice(8, 16), 1.0)):
            local = start[rows] - [shift, 0.0, 0.0]
            np.testing.assert_allclose(vertices[rows], link.at(time).apply(local), atol=1e-6)
            expected = local @ link.rate_at(time)[:, :3].T + link.rate_at(time)[:, 3]
            np.testing.assert_allclose(velocities[rows], expected, atol=2e-6)


def test_skins_of_point_instances_move_too() -> None:
    stage = new_stage()
    add_arm(stage, [[0.0, 0.0], [90.0, -45.0]], [0.0, 10.0])
    instancer = UsdGeom.PointInstancer.Define(stage, "/Crowd")
    instancer.CreatePrototypesRel().SetTargets(["/Person"])
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr([(0.0, 3.0, 0.0), (0.0, 0.0, 4.0)])
    arm, *crowd = StageScene(stage).bodies
    assert [body.name for body in crowd] == ["/Crowd/0/Person/arm", "/Crowd/1/Person/arm"]
    expected = arm.motion.at(0.6).apply(arm.deformation.at(0.6))
    assert np.abs(expected - arm.motion.at(0.0).apply(arm.mesh.vertices)).max() > 0.5
    for body, shift in zip(crowd, ([0.0, 3.0, 0.0], [0.0, 0.0, 4.0]), strict=True):
        np.testing.assert_allclose(body.motion.at(0.6).apply(body.deformation.at(0.6)), expected + shift, atol=1e-9)


def test_truth_of_a_skinned_arm_is_that_of_rigid_links() -> None:
    stage = new_stage()
    add_arm(stage, [[0.0, 0.0], [20.0, -30.0]], [0.0, 10.0]).AddTranslateOp().Set((2.0, -1.0, 0.0))
    upper = rc.Linear(rc.Pose([2.0, -1.0, 0.0]), angular_velocity=[0.0, 0.0, np.deg2rad(20.0)])
    lower = rc.Attached(upper, rc.Linear(rc.Pose([1.0, 0.0, 0.0]), angular_velocity=[0.0, 0.0, np.deg2rad(-30.0)]))
    box = rc.shapes.box([0.9, 0.2, 0.2])
    links = rc.Scene(
        [rc.Body(box, motion=rc.Attached(m, rc.Pose([x, 0, 0]))) for m, x in ((upper, 0.45), (lower, 0.55))]
    )
    radar = rc.Radar(rc.bgt60tr13c(num_chirps=16).waveform)
    skinned, rigid = (rc.Simulator(s, radar).frame(0.2) for s in (StageScene(stage).scene, links))
    nearest = np.nanargmin(rigid.truth.range)
    # Truth is of the nearest sample of a surface, and faces that deform are sampled.
    assert skinned.truth.range[0] == pytest.approx(rigid.truth.range[nearest], abs=1e-3)
    assert skinned.truth.velocity[0] == pytest.approx(rigid.truth.velocity[nearest], abs=1e-3)


@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_blended_skins_agree_with_pxr(unit: float) -> None:
    rng = np.random.default_rng(3)
    weights = rng.uniform(0.1, 1.0, (16, 2))
    weights /= weights.sum(axis=1, keepdims=True)
    stage = new_stage(unit, "Y")
    add_arm(stage, [[0.0, 0.0], [50.0, -80.0], [20.0, 30.0]], [0.0, 4.0, 10.0], weights)
    skeleton = UsdGeom.Xformable(stage.GetPrimAtPath("/Person/Skeleton"))
    skeleton.AddTranslateOp().Set((3.0, 2.0, 1.0))
    skeleton.AddScaleOp().Set((2.0, 2.0, 2.0))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Person/arm"))
    mesh.AddTranslateOp().Set((7.0, 7.0, 7.0))  # no matter: skins stand where their skeleton is
    UsdSkel.BindingAPI(mesh).CreateGeomBindTransformAttr(Gf.Matrix4d().SetTranslate(Gf.Vec3d(0.0, 0.25, 0.0)))
    (body,) = StageScene(stage).bodies
    root = UsdSkel.Root(stage.GetPrimAtPath("/Person"))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(skeleton))
    skin = cache.GetSkinningQuery(mesh.GetPrim())
    for time in (0.1, 0.4, 0.7):
        code = Usd.TimeCode(RATE * time)
        points = Vt.Vec3fArray(mesh.GetPointsAttr().Get())
        assert skin.ComputeSkinnedPoints(query.ComputeSkinningTransforms(code), points, code)
        world = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(skeleton.GetPrim()))
        expected = unit * (np.column_stack([points, np.ones(16)]) @ world)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
        placed = body.motion.at(time).apply(body.deformation.at(time))
        np.testing.assert_allclose(placed, expected, atol=1e-5 * unit)
        step = 1e-6
        slope = (body.deformation.at(time + step) - body.deformation.at(time - step)) / (2.0 * step)
        if time != 0.4:  # where velocities jump
            np.testing.assert_allclose(body.deformation.rate_at(time), slope, atol=1e-6)


def test_a_skin_may_come_before_its_skeleton_and_choose_some_joints() -> None:
    stage = new_stage()
    add_arm(stage, [[0.0, 0.0], [0.0, 90.0]], [0.0, 10.0])
    binding = UsdSkel.BindingAPI(stage.GetPrimAtPath("/Person/arm"))
    binding.CreateJointsAttr(["upper/lower", "upper"])  # indices count in this order
    stage.GetPrimAtPath("/Person").SetChildrenReorder(["arm", "Skeleton"])
    (body,) = StageScene(stage).bodies
    moved = body.deformation.at(1.0) - body.deformation.at(0.0)
    assert np.abs(moved[8:]).max() < 1e-6
    assert np.abs(moved[:8]).max() > 0.5


def live_stage() -> tuple[Any, Any, Any]:
    stage = new_stage(0.01, "Y")
    base = UsdGeom.Xform.Define(stage, "/World/arm")
    base.AddScaleOp().Set((2.0, 2.0, 2.0))
    ops = []
    for path in ("/World/arm/link", "/World/arm/link/tip"):
        xform = UsdGeom.Xform.Define(stage, path)
        ops.append((xform.AddTranslateOp(), xform.AddOrientOp()))
        UsdPhysics.RigidBodyAPI.Apply(xform.GetPrim())
    box = add_box(stage, "/World/arm/link/tip/box", (0.0, 0.0, 0.0), (10.0, 20.0, 30.0))
    box.AddTranslateOp().Set((5.0, 0.0, 0.0))
    add_box(stage, "/World/floor")
    return stage, *ops


@pytest.mark.parametrize("live", [True, ["/World/arm/link", "/World/arm/link/tip"]])
def test_live_prims_follow_the_stage(live: Any) -> None:
    stage, (shift, _), (tip_shift, turn) = live_stage()
    scene = StageScene(stage, live=live)
    assert scene.paths == ("/World/arm/link", "/World/arm/link/tip")
    body = next(b for b in scene.bodies if b.name.endswith("box"))
    for step in range(3):
        time = 0.01 * step
        shift.Set((100.0 * time, 0.0, 0.0))
        tip_shift.Set((0.0, 25.0, 0.0))
        turn.Set(Gf.Quatf(float(np.cos(time)), 0.0, float(np.sin(time)), 0.0))  # 2 rad/s about y
        scene.follow(stage, time)
    # Scaled by 2, in units of 0.01 m: the link has 2 m/s, and the box stands 0.1 m from the axis.
    angle = 0.04
    position, velocity = position_and_velocity(body.motion, 0.02)
    np.testing.assert_allclose(position, [0.04 + 0.1 * np.cos(angle), 0.1 * np.sin(angle), 0.5], atol=1e-6)
    np.testing.assert_allclose(velocity, [2.0 - 0.2 * np.sin(angle), 0.2 * np.cos(angle), 0.0], atol=1e-3)
    assert body.mesh.volume == pytest.approx(0.2 * 0.4 * 0.6)
    assert scene.group is not None
    assert scene.group.newest == 0.02


def test_arrays_of_a_simulator_move_live_prims_too() -> None:
    stage, *_ = live_stage()
    scene = StageScene(stage, live=["/World/arm/link/tip"])
    assert scene.group is not None
    scene.group.update(0.0, [rc.Pose([1.0, 2.0, 3.0])], velocities=[[4.0, 0.0, 0.0]])
    position, velocity = position_and_velocity(scene.motion("/World/arm/link/tip/box"), 0.5)
    np.testing.assert_allclose(position, [3.1, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(velocity, [4.0, 0.0, 0.0], atol=1e-12)


def test_scenes_of_stages_go_to_other_processes() -> None:
    stage = new_stage()
    add_arm(stage, [[0.0, 0.0], [20.0, -30.0]], [0.0, 10.0])
    spin = add_box(stage, "/box").AddRotateZOp()
    spin.Set(0.0, 0.0)
    spin.Set(90.0, 10.0)
    scene = StageScene(stage).scene
    copy = pickle.loads(pickle.dumps(scene))
    for one, other in zip(scene.bodies, copy.bodies, strict=True):
        np.testing.assert_array_equal(one.motion.rate_at(0.3), other.motion.rate_at(0.3))
        np.testing.assert_array_equal(one.vertices_at(0.3), other.vertices_at(0.3))
