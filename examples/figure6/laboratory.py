"""The laboratory of the experiment in MuJoCo: a UR10 with the radar, a cylinder on a table, and a person who walks.

The robot comes from its URDF file, driven by joint velocities. The person is 16 mocap bodies, placed by a gait model.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import mujoco
import numpy as np

import radarcore as rc
from radarcore.adapters.mujoco import LiveModel, spec_from_urdf
from radarcore.models.robots.named import UR10, data_file

STEP = 1.0 / 480.0
"""Time step of the physics [s]."""

BASE_HEIGHT = 0.7
CYLINDER_RADIUS = 0.06
START_DEG = [0.0, -112.025, 134.611, -22.586, 90.0, 0.0]
PATH = [[4.0, 1.7], [2.9, 1.0], [2.9, -0.7], [4.0, -1.7]]
_HUMAN = rc.models.Human(height=1.75, speed=1.0, path=PATH)
_PERSON = _HUMAN.bodies(name="person", subdivisions=3)
_PERSON_NAMES = [str(body.name) for body in _PERSON]
MATERIALS = {"table": "wood", "floor": "concrete", "wall": "plasterboard"}

WORLD = f"""
<mujoco>
  <option timestep="{STEP!r}" gravity="0 0 0"><flag contact="disable"/></option>
  <worldbody>
    <geom name="floor" type="plane" size="3 3 1" pos="2 0 0"/>
    <geom name="wall" type="box" size="0.05 3 1.4" pos="5 0 1.4"/>
    <geom name="table" type="box" size="0.3 0.5 0.02" pos="2.5 0.164 0.77"/>
    <geom name="cylinder" type="cylinder" size="{CYLINDER_RADIUS} 0.25" pos="2.4 0.164 1.04"/>
  </worldbody>
</mujoco>
"""


class Laboratory:
    """The physics, step by step, with observers called after each step.

    Attributes
    ----------
    live : LiveModel
        All that the radar sees, with its poses.
    on_step : list of callables
        Called with the time [s] after every step.
    """

    def __init__(self, start: float) -> None:
        self.model, self.data = _model()
        self.live = LiveModel(
            self.model,
            groups=range(6),  # meshes of a URDF's collisions are in one that viewers hide
            materials=MATERIALS | dict.fromkeys(_PERSON_NAMES, "skin"),
        )
        arm = rc.models.RobotArm.ur10()
        self._line = rc.models.cartesian_line(
            arm, np.deg2rad(START_DEG), direction=[1.0, 0.0, 0.0], speed=0.25, duration=3.45, start_time=0.75
        )
        self._mocap = [int(self.model.body(name).mocapid[0]) for name in _PERSON_NAMES]
        self.on_step: list[Callable[[float], None]] = []
        self._lock = threading.Lock()
        self.data.time = start
        self.data.qpos[:] = self._line.angles(start)
        self._place_person()
        self.live.update(self.data)

    def advance(self, time: float) -> None:
        """Step on to a time [s]."""
        with self._lock:
            while self.data.time < time - 1e-9:
                self._drive()
                mujoco.mj_step(self.model, self.data)
                self._place_person()
                self.live.update(self.data)
                for tell in self.on_step:
                    tell(float(self.data.time))

    def stop(self) -> None:
        """Tell nobody any more."""
        with self._lock:
            self.on_step.clear()

    def _drive(self) -> None:
        """Joint velocities that bring the arm to its line by the next step."""
        due = self._line.angles(self.data.time + STEP)
        self.data.qvel[:] = (due - self.data.qpos) / STEP

    def _place_person(self) -> None:
        (segments,) = _HUMAN.link_poses_at([self.data.time])
        for number, pose in zip(self._mocap, segments, strict=True):
            self.data.mocap_pos[number] = pose[:, 3]
            mujoco.mju_mat2Quat(self.data.mocap_quat[number], pose[:, :3].ravel())


def _model() -> tuple[mujoco.MjModel, mujoco.MjData]:
    world = mujoco.MjSpec.from_string(WORLD)
    frame = world.worldbody.add_frame(pos=[0.0, 0.0, BASE_HEIGHT])
    world.attach(spec_from_urdf(data_file(UR10)), prefix="ur10_", frame=frame)

    # The radar, 5 cm in front of the flange.
    mounting = rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, mounting.rotation.ravel())
    world.body("ur10_tool0").add_site(name="radar", pos=mounting.position, quat=quaternion)

    # The person: a mocap body for every segment.
    for body, name in zip(_PERSON, _PERSON_NAMES, strict=True):
        world.add_mesh(
            name=name, uservert=body.mesh.vertices.ravel().tolist(), userface=body.mesh.triangles.ravel().tolist()
        )
        placed = world.worldbody.add_body(name=name, mocap=True)
        placed.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)
    model = world.compile()
    return model, mujoco.MjData(model)


def trunk() -> rc.Mesh:
    """Surface of the person's trunk, in the axes of its mocap body."""
    return next(body.mesh for body in _PERSON if body.name == "person/trunk")
