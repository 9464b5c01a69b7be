"""MuJoCo for tests; see `conftest.py` for what it draws with."""

from __future__ import annotations

from ctypes.util import find_library
from functools import cache
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters.mujoco import spec_from_urdf
from radarcore.adapters.mujoco.model import gl_context
from radarcore.models import robots
from radarcore.models.robots.named import UR10, data_file

BACK_ENDS = {name: library for name, library in (("egl", "EGL"), ("osmesa", "OSMesa")) if find_library(library)}

mujoco: Any = pytest.importorskip("mujoco", reason="needs the extra `mujoco`: pip install radarcore[mujoco]")


@cache
def _why_nothing_is_drawn() -> str | None:
    try:
        context = gl_context(16, 16)
        context.make_current()
        context.free()
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return None


def skip_without_graphics() -> None:
    if (reason := _why_nothing_is_drawn()) is not None:
        pytest.skip(f"needs a GL library (Debian: libegl1 libegl-mesa0 libgl1-mesa-dri, or libosmesa6): {reason}")


def compiled(bodies: str, *, top: str = "", option: str = 'timestep="0.002" gravity="0 0 0"') -> tuple[Any, Any]:
    """Model of a world with these bodies, and its data, forwarded."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option {option}/><statistic extent="1"/><visual><map znear="0.1" zfar="10"/></visual>{top}'
        f"<worldbody>{bodies}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


CAMERA = '<camera name="radar" pos="0 0 1" xyaxes="0 -1 0 0 0 1" fovy="50"/>'
"""Looks along the world's x axis, upright."""

# One antenna at the place of the camera, and velocities of up to 4 m/s.
RADAR = rc.Radar(
    rc.Waveform.from_sweep(
        start_frequency=60e9,
        stop_frequency=62e9,
        sample_rate=2e6,
        num_samples=128,
        num_chirps=64,
        chirp_interval=300e-6,
    )
)


def polyhedron(seed: int, radius: float = 0.3, num_points: int = 20) -> str:
    """A convex mesh of random points on a sphere, off its origin, for <asset>."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((num_points, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    points += [0.1, 0.05, -0.03]
    return f'<mesh name="stone {seed}" vertex="{" ".join(f"{x:.6f}" for x in points.ravel())}"/>'


def posed_ur10(*more: dict[str, Any]) -> tuple[Any, Any]:
    """A UR10 on a pedestal of 0.8 m, in a pose with known forward kinematics, and other geoms."""
    if not robots.is_available():
        pytest.skip("needs the extra `robots`: pip install radarcore[robots]")
    world = mujoco.MjSpec()
    for geom in more:
        world.worldbody.add_geom(**geom)
    camera = {"name": "radar", "pos": [-1.5, 0.0, 1.1], "quat": [0.5, 0.5, -0.5, -0.5], "fovy": 50.0}
    world.worldbody.add_camera(**camera)
    arm = spec_from_urdf(data_file(UR10))
    world.attach(arm, prefix="ur_", frame=world.worldbody.add_frame(pos=[0.0, 0.0, 0.8]))
    model = world.compile()
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = [0.0, -1.2, 1.6, -0.4, 1.5708, 0.0], [0.5, -1.0, 0.7, 0.3, -0.4, 2.0]
    return model, data
