"""Rendered depth of MuJoCo: against our own rays, decoders with real buffers, and frames against frames from poses."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from mujoco_models import BACK_ENDS, CAMERA, RADAR, compiled, mujoco, polyhedron, skip_without_graphics
from radarcore.adapters import images
from radarcore.adapters.mujoco import DepthView, LiveModel

ROWS, COLUMNS = 90, 120
FOVY = 50.0
FOVX = float(np.rad2deg(2.0 * np.arctan(np.tan(np.deg2rad(0.5 * FOVY)) * COLUMNS / ROWS)))

# Up on the left a stone, below a box, between them a wall; nothing at the right.
WORLD = f"""{CAMERA}
<body name="stone" pos="1.6 0.45 1.25" euler="10 20 30"><freejoint/><geom type="mesh" mesh="stone 1" mass="1"/></body>
<body name="box" pos="1.9 -0.3 0.7" euler="0 20 10"><freejoint/><geom type="box" size=".2 .15 .1" mass="1"/></body>
<body name="hand" mocap="true" pos="1.2 0.1 0.75"><geom type="mesh" mesh="stone 2"/></body>
<geom name="wall" type="box" size=".05 .8 1" pos="3 0.7 1"/>
<site name="mount" pos="0.1 0 1" euler="0 5 10"/>
"""

RIDER = """<body name="rider" pos="0 0 1"><freejoint/><geom size=".01" mass="1" pos="-1 0 0"/>
<camera name="radar" xyaxes="0 -1 0 0 0 1" fovy="26"/></body>"""
"""A camera that moves."""


def compiled_world() -> tuple[Any, Any]:
    return compiled(WORLD, top=f"<asset>{polyhedron(1)}{polyhedron(2, 0.15)}</asset>")


def world() -> tuple[LiveModel, Any]:
    skip_without_graphics()
    model, data = compiled_world()
    return LiveModel(model), data


@pytest.fixture(scope="module")
def drawn() -> Iterator[tuple[LiveModel, Any, DepthView]]:
    live, data = world()
    with DepthView(live, camera="radar", rows=ROWS, columns=COLUMNS, far=10.0) as view:
        yield live, data, view


def cast(live: LiveModel, camera: str = "radar") -> rc.DepthImage:
    """View by our own rays."""
    simulator = rc.Simulator(
        live.scene,
        RADAR,
        radar_motion=live.motion(camera=camera),
        field_of_view_deg=(FOVX, FOVY),
        resolution=(ROWS, COLUMNS),
    )
    return simulator.depth_image(max(live.newest, 0.0))


def inner(body: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Pixels whose neighbours show the same body."""
    same = np.ones_like(body, dtype=np.bool_)
    for axis in (0, 1):
        for shift in (-1, 1):
            same &= body == np.roll(body, shift, axis)
    same[[0, -1]] = same[:, [0, -1]] = False
    return same & (body >= 0)


def test_rendered_depth_is_that_of_our_own_rays(drawn: tuple[LiveModel, Any, DepthView]) -> None:
    live, data, view = drawn
    seen, own = view.view(data), cast(live)
    inside = inner(own.body)
    assert inside.sum() > 2000
    assert set(own.body[inside].tolist()) == {0, 1, 2, 3}
    np.testing.assert_array_equal(seen.body[inside], own.body[inside])
    planar = own.distance[inside] / seen.depth.camera.slant(ROWS, COLUMNS)[inside]
    error = np.abs(seen.depth.depth[inside] - planar)
    assert np.quantile(error, 0.99) < 5e-6  # ridges of a stone are silhouettes of its facets
    # Pixels beyond are empty, with the edges of bodies between.
    assert ((seen.body < 0) != (own.body < 0)).mean() < 0.01


def test_twists_are_the_rates_of_the_rendered_depths() -> None:
    """A camera that moves and turns sees bodies that move and turn: rates by differences of images."""
    skip_without_graphics()
    box = '<body pos="2 0.1 1" euler="20 30 10"><freejoint/><geom type="box" size=".4 .5 .3" mass="1"/></body>'
    model, data = compiled(RIDER + box)
    live = LiveModel(model)
    start, velocity = data.qpos.copy(), 0.5 * np.random.default_rng(4).standard_normal(model.nv)
    data.qvel[:] = velocity
    step, views = 1e-3, []
    with DepthView(live, camera="radar", rows=60, columns=60, far=10.0) as view:
        for time in (0.0, step, 2.0 * step):
            data.qpos[:], data.time = start, time
            mujoco.mj_integratePos(model, data.qpos, data.qvel, time)
            views.append(view.view(data))
    before, middle, after = views
    u, v = np.meshgrid(*middle.depth.camera.plane(60, 60))
    rays = np.stack([np.ones_like(u), u, v], axis=-1)
    points = middle.depth.depth[..., None] * rays
    # Normals of the planes from neighbours; a plane that moves with w changes its depth along a ray d by n w / n d.
    inside = inner(middle.body) & (middle.body == 1)
    inside &= (before.body == 1) & (after.body == 1)
    with np.errstate(invalid="ignore"):
        down, right = (np.roll(points, -1, axis) - np.roll(points, 1, axis) for axis in (0, 1))
        normals = np.cross(down, right)
        velocity_there = middle.twists[1, :3] + np.cross(middle.twists[1, 3:], points)
        rate = (normals * velocity_there).sum(axis=-1) / (normals * rays).sum(axis=-1)
    # Edges have no normal: there the inverse depth, linear along the image of a plane, bends.
    inverse = 1.0 / middle.depth.depth
    for axis in (0, 1):
        inside &= np.abs(2.0 * inverse - np.roll(inverse, 1, axis) - np.roll(inverse, -1, axis)) < 1e-5
    found = (after.depth.depth[inside] - before.depth.depth[inside]) / (2.0 * step)
    assert inside.sum() > 200
    assert np.abs(found).max() > 0.3
    # Depths of single precision over 2 ms, and what a parabola leaves in 1 ms.
    assert np.quantile(np.abs(found - rate[inside]), 0.99) < 1e-3


def test_poses_and_rendered_depth_give_the_same_ranges_and_velocities() -> None:
    """Three spheres in the view of a camera that moves: one approaches, one recedes, one is carried by a mocap body."""
    skip_without_graphics()
    balls = [
        '<body pos="1.2 0.12 1.08"><freejoint/><geom size="0.1" mass="1"/></body>',
        '<body pos="2.2 -0.2 0.9"><freejoint/><geom size="0.1" mass="1"/></body>',
        '<body mocap="true" pos="3.2 0.25 0.95"><geom size="0.1"/></body>',
    ]
    model, data = compiled(RIDER + "".join(balls))
    live = LiveModel(model)
    simulator = rc.Simulator(
        live.scene, RADAR, radar_motion=live.motion(camera="radar"), field_of_view_deg=(26.0, 26.0), rcs_floor=1e-3
    )
    place = data.mocap_pos[0].copy()
    data.time, data.mocap_pos[0] = -0.01, place + np.array([0.01, 0.0, 0.0])  # -1 m/s, by the difference
    live.update(data)
    data.time, data.mocap_pos[0] = 0.0, place
    data.qvel[0], data.qvel[5] = 0.3, 0.2
    data.qvel[6], data.qvel[12] = -1.5, 1.2
    with DepthView(live, camera="radar", rows=300, columns=300, far=10.0) as view:
        seen = view.view(data)
    by_depth = rc.frame_from_depth(radar=RADAR, **seen.arguments)
    by_poses = simulator.frame()
    assert by_depth.time == by_poses.time == 0.0
    assert by_depth.truth is not None
    assert by_poses.truth is not None
    np.testing.assert_allclose(by_poses.truth.velocity[1:], [-1.79, 0.9, -1.3], rtol=0, atol=0.01)
    for number in (1, 2, 3):
        near = float(by_poses.truth.range[number])
        one, other = (
            rc.strongest_peak(frame, min_range=near - 0.3, max_range=near + 0.3) for frame in (by_depth, by_poses)
        )
        assert one is not None
        assert other is not None
        assert abs(one.range - other.range) < 1e-3
        assert abs(other.range - near) < 1e-3
        assert abs(one.velocity - other.velocity) < 0.02 * RADAR.waveform.velocity_resolution
        assert abs(other.velocity - by_poses.truth.velocity[number]) < 0.02 * RADAR.waveform.velocity_resolution
    # Truth of the image holds for its time, truth of poses for the middle of the frame.
    middle = by_depth.truth.range[1:] + 0.5 * RADAR.duration * by_depth.truth.velocity[1:]
    np.testing.assert_allclose(middle, by_poses.truth.range[1:], rtol=0, atol=1e-3)


def test_decoders_read_the_buffers_of_mujoco(drawn: tuple[LiveModel, Any, DepthView]) -> None:
    live, data, view = drawn
    seen = view.view(data)
    model = live.model
    far = model.vis.map.zfar * model.stat.extent
    with mujoco.Renderer(model, ROWS, COLUMNS) as renderer:
        renderer.enable_depth_rendering()
        option = mujoco.MjvOption()
        option.sitegroup[:] = False
        renderer.update_scene(data, "radar", option)
        metres = renderer.render()
    image = images.from_mujoco_renderer(metres, fovy_deg=float(model.cam_fovy[0]), far=far)
    inside = inner(seen.body)
    np.testing.assert_allclose(image.depth[inside], seen.depth.depth[inside], rtol=0, atol=5e-6)
    assert (image.valid == seen.depth.valid).mean() > 0.99
    assert image.camera == seen.depth.camera


def test_drawing_leaves_the_model_as_it_was_and_shows_what_the_radar_sees_alone() -> None:
    live, data = world()
    blind = LiveModel(live.model, skip=("wall",))
    model = live.model
    size, quality, colours = model.vis.global_.offwidth, model.vis.quality.numslices, model.geom_rgba.copy()
    with DepthView(blind, site="mount", rows=ROWS, columns=COLUMNS, fovy_deg=FOVY, far=10.0) as view:
        seen = view.view(data)
    assert (model.vis.global_.offwidth, model.vis.quality.numslices) == (size, quality)
    np.testing.assert_array_equal(model.geom_rgba, colours)
    assert set(np.unique(seen.body).tolist()) == {-1, 0, 1, 2}
    assert seen.depth.depth[seen.depth.valid].max() < 2.5  # no wall
    # The site looks 5 degrees down and 10 to the left: the former middle is on the right.
    with DepthView(live, camera="radar", rows=ROWS, columns=COLUMNS, far=10.0) as view:
        straight = view.view(data)
    columns = [np.nonzero(image.body == number)[1].mean() for image, number in ((seen, 2), (straight, 3))]
    assert columns[0] > columns[1] + 5


def test_materials_are_those_of_the_bodies() -> None:
    live, data = world()
    coats = {"stone": "concrete", "hand": rc.Material.lambertian(0.3)}
    live = LiveModel(live.model, materials=coats)
    with DepthView(live, camera="radar", rows=ROWS, columns=COLUMNS, frequency=77e9) as view:
        seen = view.view(data)
    concrete = abs(complex(rc.materials["concrete"].response(77e9)[0])) ** 2
    for body, reflectance, albedo in ((1, concrete, 0.0), (3, 0.0, 0.3)):
        assert np.unique(seen.reflectance[seen.body == body]) == pytest.approx([reflectance])
        assert np.unique(seen.albedo[seen.body == body]) == pytest.approx([albedo])
    assert not seen.reflectance[seen.body < 0].any()


def made(**settings: Any) -> Any:
    return DepthView(world()[0], **({"camera": "radar"} | settings))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: made(far=0.05), "far: expected more than near 0.1 m"),
        (lambda: made(camera=None, site="mount"), r"fovy_deg: expected an angle \[degrees\] with a site"),
        (lambda: made(fovy_deg=180.0), "fovy_deg: expected an angle between 0 and 180"),
        (lambda: made(camera="rader"), "camera: no camera 'rader'"),
    ],
)
def test_silly_views_are_errors(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def test_closed_view_says_so() -> None:
    live, data = world()
    view = DepthView(live, camera="radar", rows=8, columns=8)
    view.close()
    view.close()
    with pytest.raises(ValueError, match="DepthView: it is closed"):
        view.view(data)


_CHOICES = ("DISPLAY", "WAYLAND_DISPLAY", "PYOPENGL_PLATFORM")
"""Variables that choose the library, besides MUJOCO_GL."""

SCRIPT = """
import ctypes.util, sys
import numpy as np
from radarcore.adapters.mujoco import DepthView, LiveModel
{before}
from radarcore.adapters.mujoco.model import mujoco_module
mujoco = mujoco_module()
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
with DepthView(LiveModel(model), camera="radar", rows={rows}, columns={columns}, far=10.0) as view:
    np.save(sys.argv[2], view.view(data).depth.depth)
"""


def run(tmp_path: Path, back_end: str, before: str = "") -> subprocess.CompletedProcess[str]:
    model, _ = compiled_world()
    mujoco.mj_saveLastXML(str(tmp_path / "world.xml"), model)
    environment = {name: value for name, value in os.environ.items() if name not in _CHOICES}
    path = os.pathsep.join([str(Path(rc.__file__).parents[1]), environment.get("PYTHONPATH", "")])
    code = SCRIPT.format(before=before, rows=ROWS, columns=COLUMNS)
    command = [sys.executable, "-c", code, str(tmp_path / "world.xml"), str(tmp_path / "depth.npy")]
    environment |= {"MUJOCO_GL": back_end, "PYTHONPATH": path}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


@pytest.mark.skipif(len(BACK_ENDS) < 2, reason="needs both libegl1 and libosmesa6")
def test_both_libraries_draw_the_same_and_close_without_a_word(
    tmp_path: Path, drawn: tuple[LiveModel, Any, DepthView]
) -> None:
    other = next(name for name in BACK_ENDS if name != os.environ.get("MUJOCO_GL"))
    done = run(tmp_path, other)
    assert (done.returncode, done.stderr) == (0, "")
    _, data, view = drawn
    np.testing.assert_allclose(np.load(tmp_path / "depth.npy"), view.view(data).depth.depth, rtol=0, atol=1e-5)


NO_LIBRARY = """
ctypes.util.find_library = lambda name: None
load = ctypes.CDLL.__init__
def refuse(self, name, *rest, **more):
    if any(part in str(name) for part in ("EGL", "OSMesa", "GL.so", "OpenGL")):
        raise OSError(f"{name}: cannot open shared object file: No such file or directory")
    load(self, name, *rest, **more)
ctypes.CDLL.__init__ = refuse
"""


@pytest.mark.parametrize("back_end", ["glfw", "egl"])
def test_without_a_library_to_draw_with_there_is_one_error_with_a_hint(tmp_path: Path, back_end: str) -> None:
    done = run(tmp_path, back_end, NO_LIBRARY)
    assert done.returncode == 1
    assert "Exception ignored" not in done.stderr
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith(
        "ImportError: rendering needs an OpenGL library that draws without a display: Debian packages"
    )
    assert "libosmesa6, and MUJOCO_GL=egl or MUJOCO_GL=osmesa in the environment" in last
    assert f"; MUJOCO_GL={back_end}: " in last
