"""A MuJoCo model as bodies whose poses and velocities follow its MjData."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.adapters.mujoco.coating import geom_materials
from radarcore.adapters.mujoco.kinematics import Places, poses, rates, settle
from radarcore.adapters.mujoco.library import mujoco_module
from radarcore.adapters.mujoco.names import names_of, number_of
from radarcore.adapters.mujoco.tessellation import Meshes, kind_of, mesh_of
from radarcore.adapters.planar_depth import radar_in_camera
from radarcore.geometry.pose import as_pose
from radarcore.motion.attached import Attached
from radarcore.motion.live import LiveGroup
from radarcore.motion.protocol import Motion
from radarcore.scene.body import Body
from radarcore.scene.material import Material
from radarcore.scene.scene import Scene
from radarcore.sealed import sealed

RATES = ("model", "differences")
"""Sources of velocities: qvel, or differences of the poses of updates."""

SHOWN_GROUPS = (0, 1, 2)
"""Groups that MuJoCo's viewers show: visual geoms, by convention."""


@sealed
class LiveModel:
    """Geoms of a MuJoCo model as bodies, whose poses and velocities every `update` takes from an MjData.

    Meshes are built once. What is welded to the world is a body at rest; all else moves by one `LiveGroup`.

    Parameters
    ----------
    model : MjModel
    groups : collection of int
        Groups of geoms that the radar sees (``geom_group``). Default: 0, 1 and 2, which MuJoCo's viewers show.
    skip : collection of str
        Names of geoms, and of bodies with all geoms directly on them, that the radar does not see: its own housing.
    materials : mapping of str to Material or str, optional
        Materials, also by name in ``radarcore.materials``, by the name of a geom, of its material in MuJoCo, its mesh,
        or its body; the first of these counts. Default: a material in MuJoCo that is called as one of radarcore's.
    default : Material or str
        Material of all other geoms.
    plane_size : float
        Edges of planes that the model leaves infinite [m].
    sagitta : float
        Largest distance of facets from curved primitives [m].
    rates : "model" or "differences"
        Velocities by ``qvel``, or by differences of updates: for programs that set ``qpos`` alone. Those of mocap
        bodies and of cameras that follow a body are always differences.

    Attributes
    ----------
    model : MjModel
    geoms : tuple of int
        Numbers of the geoms, in the order of `bodies`. Left out are, besides those that were not asked for, geoms
        that are fully transparent.
    bodies : tuple of Body
        A body per geom, called as the geom or ``body/mesh``, ``body/box``.
    scene : Scene
        The bodies; ``Scene([*live.bodies, ...])`` has more.

    Raises
    ------
    ImportError
        Without the extra `mujoco`.
    ValueError
        For names that are not in the model, with near ones.

    See Also
    --------
    adapters.mujoco.frames : The loop of physics and frames.
    adapters.mujoco.spec_from_urdf : Models of robots.
    adapters.mujoco.DepthView : Rendered depth in place of meshes.
    LiveGroup : Motions of other programs.

    Examples
    --------
    >>> import mujoco
    >>> ball = '<body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
    >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
    >>> data = mujoco.MjData(model)
    >>> live = rc.adapters.mujoco.LiveModel(model)
    >>> live.update(data)
    >>> simulator = rc.Simulator(live.scene, rc.bgt60tr13c(num_chirps=16))
    >>> round(simulator.frame().truth.range[0].item(), 2)
    1.9
    """

    def __init__(
        self,
        model: Any,
        *,
        groups: Collection[int] = SHOWN_GROUPS,
        skip: Collection[str] = (),
        materials: Mapping[str, Material | str] | None = None,
        default: Material | str = "metal",
        plane_size: float = 20.0,
        sagitta: float = 5e-5,
        rates: str = "model",
    ) -> None:
        mujoco = mujoco_module()
        if not isinstance(model, mujoco.MjModel):
            hint = "; mujoco.MjModel.from_xml_path reads files" if isinstance(model, str | os.PathLike) else ""
            raise TypeError(f"model: expected MjModel, got {type(model).__name__}{hint}")
        self.model: Any = model
        self.groups: tuple[int, ...] = tuple(groups)
        self._by_differences = check.choice("rates", rates, RATES) == "differences"
        if model.nflex > 0 or model.nskin > 0:
            notice.warn("model: flexible bodies and skins are not seen by the radar: only geoms are taken")
        self.geoms: tuple[int, ...] = _geoms(model, self.groups, skip)
        if not self.geoms and model.ngeom > 0:
            there = sorted(set(model.geom_group.tolist()))
            notice.warn(f"groups: expected some with geoms that are seen, got {self.groups}; the model has {there}")

        # Poses of what is at rest; all else moves with the group.
        self._places = Places.of(model)
        moving = self._places.move(model)
        self._moving = np.flatnonzero(moving)
        at_rest = mujoco.MjData(model)
        settle(model, at_rest)
        self._group = LiveGroup(len(self._moving)) if len(self._moving) > 0 else None
        members = dict(zip(self._moving.tolist(), self._group.motions if self._group else (), strict=True))
        still = poses(at_rest)
        self._motions: list[Motion] = [members.get(place) or as_pose(still[place]) for place in range(len(moving))]
        unknown = self._places.is_carried_by_mocap(model) | self._places.is_own_way
        self._unknown = unknown[self._moving]

        meshes, names = Meshes(model, plane_size, sagitta), _body_names(model, self.geoms)
        coats = geom_materials(model, self.geoms, materials, default)
        self.bodies: tuple[Body, ...] = tuple(
            Body(meshes.of(geom), material=coat, motion=self._motions[geom], name=name)
            for geom, coat, name in zip(self.geoms, coats, names, strict=True)
        )
        self.scene: Scene = Scene(self.bodies)

    def update(self, data: Any, *, by_differences: bool | None = None) -> None:
        """Take poses and velocities from an MjData, at its time.

        Poses and velocities that `data` derives from qpos and qvel are brought up to these: after ``mj_step`` they lag
        one step behind.

        Parameters
        ----------
        data : MjData
        by_differences : bool, optional
            Velocities by differences of updates; default: as `rates` says. MuJoCo's Euler steps have velocities that
            are half a step behind the positions: between updates of every step, differences fit better.

        See Also
        --------
        adapters.mujoco.frames : Updates by itself.

        Examples
        --------
        >>> import mujoco
        >>> ball = '<body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
        >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
        >>> data = mujoco.MjData(model)
        >>> live = rc.adapters.mujoco.LiveModel(model)
        >>> mujoco.mj_step(model, data)
        >>> live.update(data)
        >>> live.newest
        0.002
        """
        if not isinstance(data, mujoco_module().MjData):
            raise TypeError(f"data: expected MjData, got {type(data).__name__}")
        sizes, expected = (len(data.qpos), len(data.xpos)), (self.model.nq, self.model.nbody)
        if sizes != expected:  # MuJoCo would write beyond its arrays
            raise ValueError(f"data: expected that of this model, of (nq, nbody) = {expected}, got {sizes}")
        settle(self.model, data)
        if self._group is None:
            return
        maps = poses(data, self._moving)
        if self._by_differences if by_differences is None else by_differences:
            self._group.update(data.time, maps)
            return
        linear, angular = rates(self.model, data, self._places.bodies[self._moving], maps[:, :, 3])
        linear[self._unknown] = np.nan
        angular = np.where(self._unknown[:, None], np.nan, angular)
        self._group.update(data.time, maps, velocities=linear, angular_velocities=angular)

    def clear(self) -> None:
        """Forget all updates: time may start again, as after ``mj_resetData``.

        See Also
        --------
        adapters.mujoco.LiveModel.update : Takes the newest state.

        Examples
        --------
        >>> import mujoco
        >>> ball = '<body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
        >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
        >>> data = mujoco.MjData(model)
        >>> live = rc.adapters.mujoco.LiveModel(model)
        >>> live.update(data)
        >>> live.clear()
        >>> live.newest
        -inf
        """
        if self._group is not None:
            self._group.clear()

    @property
    def newest(self) -> float:
        """Time of the newest update [s]; minus infinity before the first."""
        return -np.inf if self._group is None else self._group.newest

    def motion(self, *, camera: str | None = None, site: str | None = None) -> Motion:
        """Motion of a camera or a site by name, for ``Simulator(radar_motion=...)``.

        The radar looks along the camera's line of sight, upright in its image, or along the x axis of the site with z
        up.

        See Also
        --------
        adapters.mujoco.LiveModel.geom_motion : Motion of a geom.
        Simulator : Takes it as `radar_motion`.

        Examples
        --------
        >>> import mujoco
        >>> site = '<site name="radar" pos="0 0 1"/>'
        >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{site}</worldbody></mujoco>")
        >>> rc.adapters.mujoco.LiveModel(model).motion(site="radar").at(0.0).position.tolist()
        [0.0, 0.0, 1.0]
        """
        given = [(kind, name) for kind, name in (("camera", camera), ("site", site)) if name is not None]
        if len(given) != 1:
            raise ValueError(f"camera: expected a camera or a site, got {'both' if given else 'neither'}")
        ((kind, name),) = given
        motion = self._motions[self._places.starts[kind] + number_of(self.model, kind, name)]
        return Attached(motion, radar_in_camera("opengl")) if kind == "camera" else motion

    def geom_motion(self, geom: str) -> Motion:
        """Motion of a geom by name, whether the radar sees it or not.

        See Also
        --------
        adapters.mujoco.LiveModel.motion : Motion of a camera or a site.

        Examples
        --------
        >>> import mujoco
        >>> ball = '<body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
        >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
        >>> data = mujoco.MjData(model)
        >>> live = rc.adapters.mujoco.LiveModel(model)
        >>> live.update(data)
        >>> live.geom_motion("ball").at(0.0).position.tolist()
        [2.0, 0.0, 0.0]
        """
        return self._motions[number_of(self.model, "geom", geom)]

    def __repr__(self) -> str:
        return f"<LiveModel: {len(self.bodies)} geoms, {len(self._moving)} moving places>"


def _geoms(model: Any, groups: tuple[int, ...], skip: Collection[str]) -> tuple[int, ...]:
    """Numbers of the geoms that the radar sees."""
    geom_names, body_names = names_of(model, "geom"), names_of(model, "body")
    known = {*geom_names, *body_names} - {""}
    for name in skip:
        if name not in known:
            raise ValueError(f"skip: no geom or body {name!r} in the model; {check.near_names(name, sorted(known))}")
    transparent = is_transparent(model)
    return tuple(
        geom
        for geom, body in enumerate(model.geom_bodyid.tolist())
        if int(model.geom_group[geom]) in groups
        and not transparent[geom]
        and not {geom_names[geom], body_names[body]} & set(skip)
    )


def is_transparent(model: Any) -> NDArray[np.bool_]:
    """True for geoms that are not drawn: by their own colour, or else that of their material, (geom,)."""
    unset = (model.geom_rgba == [0.5, 0.5, 0.5, 1.0]).all(axis=1) & (model.geom_matid >= 0)
    of_material = np.zeros(len(model.geom_matid), dtype=np.bool_)
    painted = np.flatnonzero(unset)
    of_material[painted] = model.mat_rgba[model.geom_matid[painted], 3] == 0.0
    transparent: NDArray[np.bool_] = np.where(unset, of_material, model.geom_rgba[:, 3] == 0.0)
    return transparent


def _body_names(model: Any, geoms: tuple[int, ...]) -> list[str]:
    """Names of the geoms, or of their bodies and meshes or types; equal ones are numbered."""
    geom_names, body_names, mesh_names = (names_of(model, kind) for kind in ("geom", "body", "mesh"))

    def name(geom: int) -> str:
        body, mesh = body_names[int(model.geom_bodyid[geom])], mesh_of(model, geom)
        part = mesh_names[mesh] if mesh >= 0 and mesh_names[mesh] else kind_of(model, geom)
        return geom_names[geom] or (f"{body}/{part}" if body else part)

    given = [name(geom) for geom in geoms]
    taken, found = set(given), []
    seen: set[str] = set()
    for text in given:
        number, other = 1, text
        while other in seen or (number > 1 and other in taken):
            number += 1
            other = f"{text} {number}"
        seen.add(other)
        found.append(other)
    return found
