"""MuJoCo models as scenes: surfaces against MuJoCo's own rays, velocities against its own, names, the loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from mujoco_models import CAMERA, RADAR, compiled, mujoco, polyhedron, posed_ur10
from radarcore.adapters.mujoco import LiveModel, frames, spec_from_urdf
from radarcore.models import RobotArm

GEOMS = {
    "plane": '<geom type="plane" size="0.4 0.3 1"/>',
    "sphere": '<geom type="sphere" size="0.3"/>',
    "capsule": '<geom type="capsule" size="0.1 0.25"/>',
    "ellipsoid": '<geom type="ellipsoid" size="0.3 0.2 0.1"/>',
    "cylinder": '<geom type="cylinder" size="0.15 0.25"/>',
    "box": '<geom type="box" size="0.1 0.2 0.3"/>',
    "mesh": '<geom type="mesh" mesh="stone 1"/>',
    "hfield": '<geom type="hfield" hfield="hills"/>',
}
HILLS = '<hfield name="hills" nrow="5" ncol="7" size="0.4 0.3 0.2 0.1" elevation="{}"/>'.format(
    " ".join(f"{h:.3f}" for h in np.random.default_rng(0).uniform(0.0, 1.0, 35))
)


@pytest.mark.parametrize("kind", GEOMS)
def test_surface_of_a_geom_is_where_mujocos_rays_hit_it(kind: str) -> None:
    pose = 'pos="1.5 0.1 0.9" euler="20 -60 35"'
    model, data = compiled(f"{CAMERA}<body {pose}>{GEOMS[kind]}</body>", top=f"<asset>{polyhedron(1)}{HILLS}</asset>")
    live = LiveModel(model)
    sensor = live.motion(camera="radar")
    simulator = rc.Simulator(live.scene, RADAR, radar_motion=sensor, field_of_view_deg=(50, 50), resolution=48)
    image = simulator.depth_image()
    assert mujoco.mjtGeom(int(model.geom_type[0])).name.lower() == f"mjgeom_{kind}"
    exact = np.full(image.distance.shape, np.inf)
    for pixel, direction in zip(np.ndindex(exact.shape), image.directions.reshape(-1, 3), strict=True):
        ray = sensor.at(0.0).rotation @ direction
        distance = mujoco.mj_ray(model, data, np.array([0.0, 0.0, 1.0]), ray, None, 1, -1, np.zeros(1, np.int32))
        exact[pixel] = distance if distance >= 0.0 else np.inf
    # MuJoCo's planes have a front alone.
    both = np.isfinite(exact) & np.isfinite(image.distance)
    assert both.sum() > 50
    assert (np.isfinite(exact) != np.isfinite(image.distance)).sum() <= 3  # rays along an edge
    # Facets lie up to 0.05 mm below curved surfaces, seen along the ray.
    depth = 5e-5 if kind in ("sphere", "capsule", "ellipsoid", "cylinder") else 1e-6
    error = np.abs(exact[both] - image.distance[both])
    assert (error <= depth / image.cos_incidence[both] + 1e-6).mean() > 0.99  # but at edges


def test_vertices_of_a_mesh_stay_where_the_model_has_them() -> None:
    points = np.array([[0.1, 0.0, 0.0], [0.5, 0.1, 0.0], [0.0, 0.9, 0.1], [0.2, 0.1, 0.4]])
    mesh = f'<asset><mesh name="m" scale="1 2 1" vertex="{" ".join(map(str, points.ravel()))}"/></asset>'
    quaternion, position = [0.5, 0.5, -0.5, 0.5], [3.0, 2.0, 1.0]
    geom = '<geom type="mesh" mesh="m" pos="0.1 0 0"/>'
    model, _ = compiled(f'<body pos="3 2 1" quat="0.5 0.5 -0.5 0.5">{geom}</body>', top=mesh)
    (body,) = LiveModel(model).bodies
    world = body.motion.at(0.0).apply(body.mesh.vertices)
    expected = rc.Pose.from_quaternion(position, wxyz=quaternion).apply(points * [1.0, 2.0, 1.0] + [0.1, 0.0, 0.0])
    distances = np.linalg.norm(world[:, None] - expected, axis=-1)
    assert len(world) == 4
    assert distances.min(axis=0).max() < 1e-6  # vertices are in single precision
    assert body.mesh.volume > 0.0


CHAIN = """
<body name="base" pos="1 0 1"><freejoint/><geom name="box" type="box" size=".1 .1 .2" mass="1"/>
  <camera name="eye" pos="0.1 0.2 0.3" euler="10 20 30"/>
  <body name="arm" pos="0.2 0 0"><joint type="hinge" axis="0 1 0"/><geom type="capsule" size=".05 .2" mass="1"/>
    <body pos="0.3 0.1 0"><joint type="slide" axis="1 0 1"/><geom type="sphere" size=".05" mass="1"/>
      <site name="tip" pos="0.1 0 0.1" euler="0 40 0"/></body></body></body>
<body pos="0 2 0"><joint type="ball"/><geom name="egg" type="ellipsoid" size=".1 .2 .3" pos="0.3 0 0"/></body>
"""


def test_poses_and_velocities_of_all_things_are_mujocos_own() -> None:
    model, data = compiled(CHAIN)
    # Any positions and velocities.
    rng = np.random.default_rng(0)
    mujoco.mj_integratePos(model, data.qpos, rng.standard_normal(model.nv), 1.0)
    data.qvel[:] = 3.0 * rng.standard_normal(model.nv)
    live = LiveModel(model)
    live.update(data)
    mujoco.mj_forward(model, data)
    things = [("GEOM", k, body.motion, rc.Pose()) for k, body in enumerate(live.bodies)]
    # A radar looks along the camera's line of sight, -z, upright: y up.
    radar = rc.Pose(rotation=np.column_stack([[0, 0, -1], [-1, 0, 0], [0, 1, 0]]))
    things.append(("CAMERA", 0, live.motion(camera="eye"), radar))
    things.append(("SITE", 0, live.motion(site="tip"), rc.Pose()))
    for kind, number, motion, turned in things:
        short = {"CAMERA": "cam"}.get(kind, kind.lower())
        place, axes = getattr(data, f"{short}_xpos")[number], getattr(data, f"{short}_xmat")[number].reshape(3, 3)
        np.testing.assert_allclose(motion.at(data.time).position, place, rtol=0, atol=1e-12)
        np.testing.assert_allclose(motion.at(data.time).rotation, axes @ turned.rotation, rtol=0, atol=1e-12)
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(model, data, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), number, velocity, 0)
        turning = np.cross(velocity[:3], motion.at(data.time).rotation, axisb=0).T
        expected = np.column_stack([turning, velocity[3:]])
        np.testing.assert_allclose(motion.rate_at(data.time), expected, rtol=0, atol=1e-10)


def test_poses_after_a_step_are_those_of_its_end() -> None:
    model, data = compiled('<body><freejoint/><geom size=".1"/></body>')
    data.qvel[0] = 1.0
    mujoco.mj_step(model, data)
    assert data.geom_xpos[0, 0] == 0.0  # one step behind
    live = LiveModel(model)
    live.update(data)
    assert live.bodies[0].motion.at(data.time).position[0] == pytest.approx(0.002, abs=1e-12)


def test_velocities_of_mocap_bodies_and_what_they_carry_are_differences() -> None:
    carried = '<body pos="0 0 0.5"><joint axis="0 0 1"/><geom name="carried" size=".1" pos="0.2 0 0"/></body>'
    model, data = compiled(f'<body name="hand" mocap="true"><geom name="hand" size=".1"/>{carried}</body>')
    live = LiveModel(model)
    for time in (0.0, 0.01):
        data.time, data.mocap_pos[0] = time, [1.0 + 2.0 * time, 0.0, 0.0]
        data.mocap_quat[0] = [np.cos(0.5 * time), 0.0, 0.0, np.sin(0.5 * time)]  # 1 rad/s about z
        live.update(data)
    assert not data.cvel.any()
    hand, other = (live.geom_motion(name).rate_at(0.01) for name in ("hand", "carried"))
    np.testing.assert_allclose(hand[:, 3], [2.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(
        hand[:2, :2], np.array([[0, -1], [1, 0]]) @ live.geom_motion("hand").at(0.01).rotation[:2, :2]
    )
    # Carried at 0.2 m, whose chord over 0.01 rad is 1e-5 short of the arc.
    np.testing.assert_allclose(other[:, 3], [2.0, 0.2, 0.0], atol=2e-3)


def test_positions_alone_give_velocities_by_differences() -> None:
    model, data = compiled('<body><joint type="slide" axis="1 0 0"/><geom name="cart" size=".1"/></body>')
    live, wrong = LiveModel(model, rates="differences"), LiveModel(model)
    for time in (0.0, 0.01):
        data.time, data.qpos[0] = time, 3.0 * time  # played back, qvel stays zero
        live.update(data)
        wrong.update(data)
    assert live.geom_motion("cart").rate_at(0.01)[0, 3] == pytest.approx(3.0, abs=1e-12)
    assert wrong.geom_motion("cart").rate_at(0.01)[0, 3] == 0.0


PARTS = f"""
<geom name="floor" type="plane" size="0 0 1" material="concrete"/>
<body name="robot" pos="1 0 1"><joint/>
  <geom type="mesh" mesh="stone 1" material="painted"/><geom type="mesh" mesh="stone 1" pos="0 1 0"/>
  <geom name="hull" type="box" size=".1 .1 .1" group="3"/><geom name="glass" size=".1" rgba="1 1 1 0"/></body>
<body name="case" pos="2 0 1">
  <geom name="lid" type="box" size=".1 .1 .1"/><geom type="box" size=".1 .1 .1" pos="1 0 0"/>
  <camera name="front" mode="targetbody" target="robot"/><site name="corner"/></body>{CAMERA}
"""
ASSETS = f'<asset>{polyhedron(1)}<material name="concrete"/><material name="painted"/></asset>'


def parts(**settings: Any) -> LiveModel:
    return LiveModel(compiled(PARTS, top=ASSETS)[0], **settings)


def test_bodies_are_the_visible_geoms_with_names_of_their_own() -> None:
    live = parts()
    assert live.scene.names == ("floor", "robot/stone 1", "robot/stone 1 2", "lid", "case/box")
    assert live.geoms == (0, 1, 2, 5, 6)
    assert parts(groups=(3,)).scene.names == ("hull",)
    three = LiveModel(compiled('<geom size=".1"/>' * 3)[0])
    assert three.scene.names == ("world/sphere", "world/sphere 2", "world/sphere 3")
    assert parts(skip=("case", "floor")).scene.names == ("robot/stone 1", "robot/stone 1 2")
    # Meshes are built once; geoms welded to the world are at rest.
    assert live.bodies[1].mesh is live.bodies[2].mesh
    assert live.bodies[3].mesh is live.bodies[4].mesh
    assert [isinstance(body.motion, rc.Pose) for body in live.bodies] == [True, False, False, True, True]
    np.testing.assert_allclose(live.bodies[0].mesh.bounds, [[-10, -10, 0], [10, 10, 0]])
    np.testing.assert_allclose(parts(plane_size=4.0).bodies[0].mesh.bounds, [[-2, -2, 0], [2, 2, 0]])


def test_materials_come_by_name_of_geom_material_mesh_or_body() -> None:
    plastic = rc.materials["abs"]
    chosen: dict[str, Any] = {"stone 1": plastic, "painted": "wood", "lid": "glass", "case": "pla"}
    found = [body.material for body in parts(materials=chosen, default="brick").bodies]
    assert found == [rc.materials[name] for name in ("concrete", "wood", "abs", "glass", "pla")]
    assert [body.material for body in parts(default="brick").bodies][2] == rc.materials["brick"]
    assert parts().bodies[2].material == rc.materials["metal"]


def test_camera_or_site_by_name_is_a_radar() -> None:
    live = parts()
    assert live.motion(camera="radar") is not None
    np.testing.assert_allclose(live.motion(camera="radar").at(0.0).rotation, np.eye(3), atol=1e-12)
    assert live.motion(site="corner").at(0.0).position.tolist() == [2.0, 0.0, 1.0]
    with pytest.raises(ValueError, match="Live: expected an update"):
        live.motion(camera="front").at(0.0)  # turns to a body that moves


@pytest.mark.parametrize(
    ("make", "kind", "message"),
    [
        (lambda: parts().motion(camera="rader"), ValueError, "no camera 'rader' in the model; did you mean 'radar'"),
        (lambda: parts().motion(site="tip"), ValueError, "site: no site 'tip' in the model; known: corner"),
        (lambda: parts().motion(), ValueError, "camera: expected a camera or a site, got neither"),
        (lambda: parts().motion(camera="radar", site="corner"), ValueError, "camera: .* got both"),
        (lambda: parts(skip=("casing",)), ValueError, "skip: no geom or body 'casing' .*; did you mean 'case'"),
        (lambda: parts(materials={"paint": "wood"}), ValueError, "materials: nothing .* 'paint'.* mean 'painted'"),
        (lambda: parts(materials={"lid": "woood"}), KeyError, "woood"),
        (lambda: parts(materials={"lid": 3}), TypeError, r"materials\['lid'\]: expected Material or a name"),
        (
            lambda: LiveModel("arm.xml"),
            TypeError,
            "^model: expected MjModel, got str; mujoco.MjModel.from_xml_path rea",
        ),
        (lambda: parts().update(parts().model), TypeError, "^data: expected MjData, got MjModel$"),
        (lambda: parts().update(compiled(CAMERA)[1]), ValueError, r"^data: .* \(nq, nbody\) = \(1, 3\), got \(0, 1\)$"),
    ],
)
def test_wrong_names_and_settings_are_errors_that_name_near_ones(
    make: Any, kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        make()


def test_flexible_bodies_are_warned_of() -> None:
    flex = '<flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" dim="2" mass="1"/>'
    model, _ = compiled(flex)
    with pytest.warns(UserWarning, match="flexible bodies and skins are not seen by the radar"):
        LiveModel(model)


def test_frames_without_a_rate_come_as_the_radar_sends_them() -> None:
    model, data = compiled(CAMERA + '<body pos="2 0 1"><freejoint/><geom size="0.2" mass="1"/></body>')
    live = LiveModel(model)
    slow = rc.Simulator(live.scene, rc.Radar(RADAR.waveform.replace(frame_interval=0.05)), resolution=16)
    times = [frame.time for frame in frames(slow, live, data, duration=0.2)]
    np.testing.assert_allclose(times, 0.05 * np.arange(4), atol=1e-9)


def falling(follow: bool) -> tuple[list[rc.Frame], list[float], Any]:
    """Frames of a ball that falls towards a radar below it."""
    up = '<camera name="radar" pos="0 0 0" xyaxes="0 -1 0 -1 0 0"/>'
    ball = '<body pos="0 0 3"><freejoint/><geom size="0.2" mass="1"/></body>'
    model, data = compiled(up + ball, option='timestep="0.002" gravity="0 0 -10"')
    live, seen = LiveModel(model), []
    simulator = rc.Simulator(live.scene, RADAR, radar_motion=live.motion(camera="radar"))
    found = []
    for frame in frames(simulator, live, data, duration=0.125, follow=follow, control=lambda d: seen.append(d.time)):
        found.append(frame)
        if not follow:
            # Physics steps to the very start, so that motion has no kink in the frame.
            assert data.time == pytest.approx(frame.time, abs=1e-9)
            assert frame.stats["series_residual"] < 1e-5
    # Before every step; steps before a frame may be shorter.
    assert np.diff(seen).max() < 0.002 + 1e-9
    assert np.diff(seen).min() > 0.0
    assert model.opt.timestep == 0.002
    return found, seen, data


def test_loop_follows_the_motion_in_a_frame_or_goes_on_from_its_start() -> None:
    for follow in (True, False):
        found, _, data = falling(follow)
        np.testing.assert_allclose([frame.time for frame in found], 0.025 * np.arange(5), atol=1e-12)
        for frame in found:
            assert frame.truth is not None
            middle = frame.time + 0.5 * RADAR.duration
            # Velocity follows gravity to the middle of the frame, 95 mm/s more, or keeps its value at the start.
            # MuJoCo's Euler steps of 2 ms have velocities that are half a step behind its positions: 3/4 of 10 m/s^2 in
            # a step.
            velocity = -10.0 * (middle if follow else frame.time)
            assert frame.truth.velocity[0] == pytest.approx(velocity, abs=0.016)
        assert data.time == pytest.approx(0.1 + (RADAR.duration if follow else 0.0), abs=2.1e-3)


def test_time_starts_again_after_clear() -> None:
    model, data = compiled('<body><freejoint/><geom name="ball" size=".1"/></body>')
    live = LiveModel(model)
    data.time = 1.0
    live.update(data)
    mujoco.mj_resetData(model, data)
    with pytest.raises(ValueError, match=r"expected 1 s, .* clear\(\) forgets the updates of a run before"):
        live.update(data)
    live.clear()
    live.update(data)
    assert live.newest == 0.0


# tool0 of that UR10 in its base_link.
TOOL = [0.84109, 0.16394, 0.35914]


def test_ur10_of_a_urdf_file_is_the_arm_of_the_models() -> None:
    model, data = posed_ur10()
    live = LiveModel(model, skip=("ur_ee_link",))
    live.update(data)
    np.testing.assert_allclose(data.body("ur_tool0").xpos - [0.0, 0.0, 0.8], TOOL, rtol=0, atol=1e-5)
    assert sum(len(body.mesh.triangles) for body in live.bodies) == 5862

    def angles(time: float) -> NDArray[np.float64]:
        return data.qpos + time * data.qvel

    arm = RobotArm.named("ur10").moving(angles, base=rc.Pose([0.0, 0.0, 0.8]))
    own = {body.name.rpartition("/")[2]: body for body in arm.bodies() if body.name}
    for body in live.bodies:
        other = own[str(body.name).partition("/")[0].removeprefix("ur_")]
        # MuJoCo turns meshes to their principal axes: points in the world tell.
        here, there = (b.motion.at(0.0).apply(b.mesh.vertices) for b in (body, other))
        np.testing.assert_allclose(
            [here.min(axis=0), here.max(axis=0)], [there.min(axis=0), there.max(axis=0)], atol=2e-6
        )
        point = here[0]
        velocities = [
            rate[:, :3] @ (pose.rotation.T @ (point - pose.position)) + rate[:, 3]
            for pose, rate in ((b.motion.at(0.0), b.motion.rate_at(0.0)) for b in (body, other))
        ]
        np.testing.assert_allclose(*velocities, rtol=0, atol=1e-6)


def test_urdf_with_what_mujoco_cannot_read_says_so(tmp_path: Any) -> None:
    def robot(name: str) -> str:
        mesh = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
        return f'<robot name="r"><link name="a">{mesh}{box}</link></robot>'

    path = tmp_path / "robot.urdf"
    path.write_text(robot("package://parts/part.dae"))
    with pytest.warns(UserWarning, match="reads STL, OBJ and MSH; 1 meshes are left out, as package://parts/part.dae"):
        spec_from_urdf(path, geometry="visual")
    assert spec_from_urdf(path).compile().ngeom == 1
    path.write_text(robot("package://parts/part.stl"))
    with pytest.raises(ValueError, match="packages: expected the folder of 'parts'"):
        spec_from_urdf(path, geometry="visual")
    with pytest.raises(ValueError, match=r"mesh package://parts/part\.stl is not there"):
        spec_from_urdf(path, geometry="visual", packages={"parts": tmp_path})
    (tmp_path / "parts").mkdir()
    block = rc.shapes.box(0.2)
    lines = [f"v {x} {y} {z}" for x, y, z in block.vertices] + [f"f {a} {b} {c}" for a, b, c in block.triangles + 1]
    (tmp_path / "parts" / "part.obj").write_text("\n".join(lines))
    path.write_text(robot("package://parts/part.obj"))
    (body,) = LiveModel(spec_from_urdf(path, geometry="visual").compile()).bodies
    assert body.mesh.volume == pytest.approx(0.008, rel=1e-6)


def test_groups_without_geoms_are_warned_of() -> None:
    with pytest.warns(UserWarning, match=r"^groups: expected some with geoms .* got \(4,\); the model has \[0, 3\]"):
        parts(groups=(4,))


def test_urdf_of_other_kinds_is_read_or_refused(tmp_path: Any) -> None:
    """Origins by quaternions, x y z w: a quarter turn about z; shapes of one kind alone; macros."""
    half, path = np.sqrt(0.5), tmp_path / "robot.urdf"
    origin = f'<origin xyz="1 0 0" quat_xyzw="0 0 {half} {half}"/>'
    box = f'<visual>{origin}<geometry><box size="1 2 3"/></geometry></visual>'
    path.write_text(f'<robot name="r"><link name="a">{box}</link></robot>')
    (body,) = LiveModel(spec_from_urdf(path, geometry="visual").compile()).bodies
    corners = body.motion.at(0.0).apply(body.mesh.vertices)
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [[0, -0.5, -1.5], [2, 0.5, 1.5]], atol=1e-9)
    with pytest.warns(UserWarning, match=r"no link has a <collision> shape.*; geometry='visual' takes its 1 of kind"):
        spec_from_urdf(path)
    path.write_text(path.read_text().replace("1 2 3", "1 2 ${height}"))
    with pytest.raises(ValueError, match="got one with macros of xacro"):
        spec_from_urdf(path)
