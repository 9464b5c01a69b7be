"""Poses and rates of everything in a MuJoCo model at once, from the arrays of MjData."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.adapters.mujoco.library import mujoco_module
from radarcore.geometry.pose import transforms

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

KINDS = {"geom": "geom", "camera": "cam", "site": "site"}
"""Objects that have a pose, and the names of their fields in MjModel and MjData."""

_FIXED = 0
"""mjCAMLIGHT_FIXED: a camera that sits on its body."""


@dataclass(frozen=True, eq=False)
class Places:
    """Geoms, cameras and sites, one after the other.

    Attributes
    ----------
    bodies : (place,) int
        Body that each is on.
    is_own_way : (place,) bool
        True for cameras that follow or look at a body instead of sitting on theirs.
    starts : dict
        Index of the first geom, camera and site.
    """

    bodies: Ints
    is_own_way: NDArray[np.bool_]
    starts: dict[str, int]

    @classmethod
    def of(cls, model: Any) -> Places:
        """All places of a model."""
        bodies = [np.asarray(getattr(model, f"{kind}_bodyid"), dtype=np.intp) for kind in KINDS.values()]
        free = [np.zeros(len(some), dtype=np.bool_) for some in bodies]
        free[list(KINDS).index("camera")][:] = np.asarray(model.cam_mode) != _FIXED
        starts = np.cumsum([0, *(len(some) for some in bodies)]).tolist()
        return cls(np.concatenate(bodies), np.concatenate(free), dict(zip(KINDS, starts, strict=False)))

    def move(self, model: Any) -> NDArray[np.bool_]:
        """True for places that ever move, (place,)."""
        is_welded = np.asarray(model.body_weldid)[self.bodies] == 0
        moves: NDArray[np.bool_] = ~is_welded | self.is_carried_by_mocap(model) | self.is_own_way
        return moves

    def is_carried_by_mocap(self, model: Any) -> NDArray[np.bool_]:
        """True for places on mocap bodies and their children, whose velocities MuJoCo does not know, (place,)."""
        carried: NDArray[np.bool_] = np.asarray(model.body_mocapid)[np.asarray(model.body_rootid)[self.bodies]] >= 0
        return carried


def settle(model: Any, data: Any) -> None:
    """Bring the poses and velocities in `data` to its qpos and qvel: after a step they lag one step behind."""
    mujoco = mujoco_module()
    for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_comVel):
        stage(model, data)


def poses(data: Any, chosen: Ints | slice = slice(None)) -> Floats:
    """``[rotation | position]`` of all places, or those chosen, to the world, (place, 3, 4)."""
    turns = np.concatenate([getattr(data, f"{kind}_xmat") for kind in KINDS.values()])[chosen]
    origins = np.concatenate([getattr(data, f"{kind}_xpos") for kind in KINDS.values()])[chosen]
    return transforms(turns.reshape(-1, 3, 3), origins)


def rates(model: Any, data: Any, bodies: Ints, points: Floats) -> tuple[Floats, Floats]:
    """Velocities [m/s] and angular velocities [rad/s] of points (n, 3) on bodies (n,), in world axes, (n, 3) each.

    MuJoCo keeps a body's velocity at the centre of mass of its kinematic tree.
    """
    twists = np.asarray(data.cvel)[bodies]
    angular, linear = twists[:, :3], twists[:, 3:]
    arms = points - np.asarray(data.subtree_com)[np.asarray(model.body_rootid)[bodies]]
    return linear + np.cross(angular, arms), angular
