"""A MuJoCo model as bodies whose poses and velocities follow its MjData, and the loop of physics and frames."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from importlib.util import find_spec
from itertools import count
from math import ceil
from types import ModuleType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.adapters.depth import radar_in_camera
from radarcore.adapters.mujoco.tessellation import kind_of, mesh_of, meshes_of
from radarcore.geometry.pose import as_pose, transforms
from radarcore.motion.group import Attached
from radarcore.motion.live import KEPT, LiveGroup
from radarcore.motion.protocol import Motion
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import frame_rate
from radarcore.recording.frame import Frame
from radarcore.records import sealed
from radarcore.scene.body import Body
from radarcore.scene.library import as_material
from radarcore.scene.library import materials as library
from radarcore.scene.material import Material
from radarcore.scene.scene import Scene


def names_of(model: Any, kind: str) -> list[str]:
    """Names of all things of a kind, "geom", "body", "camera", "site", "mat" or "mesh"; empty ones have none."""
    addresses, text = getattr(model, f"name_{_KINDS.get(kind, kind)}adr"), bytes(model.names)
    return [text[start : text.index(b"\0", start)].decode() for start in addresses.tolist()]


def number_of(model: Any, kind: str, name: str) -> int:
    """Number of the thing of a kind with a name, or a ValueError that names near ones."""
    known = names_of(model, kind)
    if name not in known:
        raise ValueError(f"{kind}: no {kind} {name!r} in the model; {check.near_names(name, filter(None, known))}")
    return known.index(name)


_KINDS = {"camera": "cam"}
"""Kinds that MuJoCo's arrays shorten."""


GL_HINT = (
    "an OpenGL library that draws without a display: Debian packages libegl1 libegl-mesa0 libgl1-mesa-dri libgl1, or "
    "libosmesa6, and MUJOCO_GL=egl or MUJOCO_GL=osmesa in the environment before mujoco is imported"
)


def is_available() -> bool:
    """True when the extra `mujoco` is installed.

    See Also
    --------
    adapters.mujoco.LiveModel : Needs it.

    Examples
    --------
    >>> rc.adapters.mujoco.is_available()
    True
    """
    return find_spec("mujoco") is not None


def mujoco_module() -> ModuleType:
    """The package, or an ImportError that names the extra."""
    if not is_available():
        raise ImportError("MuJoCo models need mujoco: pip install radarcore[mujoco]")
    try:
        import mujoco
    except Exception as error:  # this loads the back end of MUJOCO_GL; every back end fails in its own way
        raise no_graphics(error) from error
    module: ModuleType = mujoco
    return module


def gl_context(columns: int, rows: int) -> Any:
    """A new context to draw into images of up to this size; where there is none, every library fails in its own way."""
    # A context that could not be made has nothing to free, and says nothing about it.
    return type("Context", (mujoco_module().GLContext,), {"_context": None})(columns, rows)


def no_graphics(error: object) -> ImportError:
    """The error where nothing can be drawn."""
    chosen = os.environ.get("MUJOCO_GL")
    setting = "MUJOCO_GL is not set" if chosen is None else f"MUJOCO_GL={chosen}"
    return ImportError(f"rendering needs {GL_HINT}; {setting}: {' '.join(str(error).split())}")


Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

KINDS = {"geom": "geom", "camera": "cam", "site": "site"}
"""Objects that have a pose, one kind after the other, and the names of their fields in MjModel and MjData."""

_FIXED = 0
"""mjCAMLIGHT_FIXED: a camera that sits on its body."""


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


def geom_materials(
    model: Any, geoms: Sequence[int], materials: Mapping[str, Material | str] | None, default: Material | str
) -> list[Material]:
    """Material of every geom.

    The entry of `materials` for the geom, its MuJoCo material, its mesh or its body, in this order; else the library
    material with the name of its MuJoCo material; else the default.
    """
    chosen = {name: as_material(f"materials[{name!r}]", value) for name, value in (materials or {}).items()}
    known = {name for kind in ("geom", "body", "mat", "mesh") for name in names_of(model, kind)} - {""}
    for name in chosen:
        if name not in known:
            raise ValueError(
                f"materials: nothing in the model is called {name!r}, no geom, material, mesh or body; "
                f"{check.near_names(name, sorted(known))}"
            )
    other, names, found = as_material("default", default), _geom_names(model), []
    for geom in geoms:
        material = names[geom][1]
        named = [chosen[name] for name in names[geom] if name in chosen]
        found.append(named[0] if named else library.get(material, other))
    return found


def _geom_names(model: Any) -> list[tuple[str, str, str, str]]:
    """Names of every geom, its material, its mesh and its body; empty for none."""
    geoms, materials, meshes, bodies = (names_of(model, kind) for kind in ("geom", "mat", "mesh", "body"))
    # The last one is for the number -1.
    materials, meshes = [*materials, ""], [*meshes, ""]
    owners = zip(model.geom_matid.tolist(), model.geom_bodyid.tolist(), strict=True)
    return [
        (geoms[geom], materials[paint], meshes[mesh_of(model, geom)], bodies[body])
        for geom, (paint, body) in enumerate(owners)
    ]


RATES = ("model", "differences")
"""Sources of velocities: qvel, or differences of the poses of updates."""

SHOWN_GROUPS = (0, 1, 2)
"""Groups that MuJoCo's viewers show: visual geoms, by convention."""


@sealed
class LiveModel:
    """Geoms of a MuJoCo model as bodies, whose poses and velocities every `update` takes from an MjData.

    Meshes are built once. Geoms welded to the world are static; all others move by one `LiveGroup`.

    Parameters
    ----------
    model : MjModel
    groups : collection of int
        Groups of geoms that the radar sees (``geom_group``). Default: 0, 1 and 2, which MuJoCo's viewers show.
    skip : collection of str
        Names of geoms, and of bodies with all geoms directly on them, that the radar does not see: its own housing.
    materials : mapping of str to Material or str, optional
        Materials, also by name in ``radarcore.materials``, by the name of a geom, of its material in MuJoCo, its mesh,
        or its body; the first of these counts. Default: MuJoCo materials map to radarcore's by name.
    default : Material or str
        Material of all other geoms.
    plane_size : float
        Edges of planes that the model leaves infinite [m].
    sagitta : float
        Largest distance of facets from curved primitives [m].
    rates : "model" or "differences"
        Velocities by ``qvel``, or by differences of updates: for programs that set ``qpos`` alone. Mocap bodies and
        cameras that follow a body always use differences.

    Attributes
    ----------
    model : MjModel
    geoms : tuple of int
        Numbers of the geoms, in the order of `bodies`. Fully transparent geoms are skipped, too.
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
        bodies = [np.asarray(getattr(model, f"{kind}_bodyid"), dtype=np.intp) for kind in KINDS.values()]
        self._starts = dict(zip(KINDS, np.cumsum([0, *map(len, bodies)]).tolist(), strict=False))
        body_of = np.concatenate(bodies)
        # MuJoCo knows no velocities of what mocap bodies carry, and of cameras that follow or look at another body.
        is_unknown = np.asarray(model.body_mocapid)[np.asarray(model.body_rootid)[body_of]] >= 0
        is_unknown[self._starts["camera"] : self._starts["site"]] |= np.asarray(model.cam_mode) != _FIXED
        is_moving = is_unknown | (np.asarray(model.body_weldid)[body_of] != 0)
        self._moving = np.flatnonzero(is_moving)
        self._moving_bodies, self._unknown = body_of[is_moving], is_unknown[is_moving]
        at_rest = mujoco.MjData(model)
        settle(model, at_rest)
        self._group = LiveGroup(len(self._moving)) if len(self._moving) > 0 else None
        members = dict(zip(self._moving.tolist(), self._group.motions if self._group else (), strict=True))
        still = poses(at_rest)
        self._motions: list[Motion] = [members.get(place) or as_pose(still[place]) for place in range(len(still))]

        meshes = meshes_of(model, self.geoms, plane_size=plane_size, sagitta=sagitta)
        names = _body_names(model, self.geoms)
        coats = geom_materials(model, self.geoms, materials, default)
        self.bodies: tuple[Body, ...] = tuple(
            Body(mesh, material=coat, motion=self._motions[geom], name=name)
            for mesh, geom, coat, name in zip(meshes, self.geoms, coats, names, strict=True)
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
            raise ValueError(f"data: expected data of this model, of (nq, nbody) = {expected}, got {sizes}")
        settle(self.model, data)
        if self._group is None:
            return
        maps = poses(data, self._moving)
        if self._by_differences if by_differences is None else by_differences:
            self._group.update(data.time, maps)
            return
        linear, angular = rates(self.model, data, self._moving_bodies, maps[:, :, 3])
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
        motion = self._motions[self._starts[kind] + number_of(self.model, kind, name)]
        return Attached(motion, radar_in_camera("opengl")) if kind == "camera" else motion

    def geom_motion(self, geom: str) -> Motion:
        """Motion of a geom by name, whether the radar sees it or not.

        See Also
        --------
        adapters.mujoco.LiveModel.motion : Motion of a camera or a site.

        Examples
        --------
        >>> live.geom_motion("ball").at(0.0).position.tolist()
        [2.0, 0.0, 0.0]
        """
        return self._motions[number_of(self.model, "geom", geom)]

    def __repr__(self) -> str:
        return f"<LiveModel: {len(self.bodies)} geoms, {len(self._moving)} moving places>"


def _geoms(model: Any, groups: tuple[int, ...], skip: Collection[str]) -> tuple[int, ...]:
    """Numbers of the geoms that the radar sees."""
    known = {*names_of(model, "geom"), *names_of(model, "body")} - {""}
    for name in skip:
        if name not in known:
            raise ValueError(f"skip: no geom or body {name!r} in the model; {check.near_names(name, sorted(known))}")
    transparent = is_transparent(model)
    return tuple(
        geom
        for geom, (name, _, _, body) in enumerate(_geom_names(model))
        if int(model.geom_group[geom]) in groups and not transparent[geom] and not {name, body} & set(skip)
    )


def is_transparent(model: Any) -> NDArray[np.bool_]:
    """True for invisible geoms: by their own colour, or else by their material's, (geom,)."""
    unset = (model.geom_rgba == [0.5, 0.5, 0.5, 1.0]).all(axis=1) & (model.geom_matid >= 0)
    alpha = model.geom_rgba[:, 3].copy()
    alpha[unset] = model.mat_rgba[model.geom_matid[unset], 3]
    transparent: NDArray[np.bool_] = alpha == 0.0
    return transparent


def _body_names(model: Any, geoms: tuple[int, ...]) -> list[str]:
    """Names of the geoms, or of their bodies and meshes or types; equal ones are numbered."""
    names = _geom_names(model)

    def name(geom: int) -> str:
        own, _, mesh, body = names[geom]
        part = mesh or kind_of(model, geom)
        return own or (f"{body}/{part}" if body else part)

    given, found = [name(geom) for geom in geoms], dict[str, None]()
    for text in given:
        others = (f"{text} {number}" for number in count(2))
        free = (other for other in others if other not in found and other not in given)
        found[next(free) if text in found else text] = None
    return list(found)


_UPDATES_PER_FRAME = KEPT // 2
"""Most updates in a frame: all are kept until it is simulated."""

_ROUNDING = 1e-9
"""Of sums of time steps [s]."""


class FrameSource(Protocol):
    """Maker of frames at a time [s]: a `Simulator` of the model's scene."""

    @property
    def radar(self) -> Radar:
        """Radar whose frames these are."""
        ...

    def frame(self, time: float) -> Frame:
        """Frame that starts at a time [s]."""
        ...


def frames(
    simulator: FrameSource,
    live: LiveModel,
    data: Any,
    *,
    duration: float | None = None,
    rate: float | None = None,
    control: Callable[[Any], object] | None = None,
    follow: bool = False,
) -> Iterator[Frame]:
    """Step the physics and simulate a radar frame at every multiple of 1/`rate`.

    The last step before a frame is as short as it has to be to end where the frame starts.

    Parameters
    ----------
    simulator : Simulator
        Of the scene of `live`.
    live : LiveModel
    data : MjData
        State of the physics, which the loop steps on. The first frame starts at its time.
    duration : float, optional
        Time from the first frame on in which frames start [s]; default: without an end.
    rate : float, optional
        Frames per second [Hz]; default: the radar's own, as of `Simulator.frames`.
    control : callable, optional
        Called with `data` before every step: sets ``ctrl``, ``mocap_pos``.
    follow : bool
        False: a frame is simulated as soon as it starts, with the velocities at that time; `data` has the state at its
        start. True: it is simulated when the physics has stepped past its end, as a sensor delivers it, and follows the
        positions step by step: for strong accelerations and contacts, at two to three times the run time.

    Yields
    ------
    frame : Frame
        In order; between them the program may read and change `data`.

    See Also
    --------
    adapters.mujoco.LiveModel : Poses and velocities of a model.
    Simulator.frames : Frames of motions that are known before.

    Examples
    --------
    >>> import mujoco
    >>> ball = '<body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
    >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
    >>> data = mujoco.MjData(model)
    >>> live = rc.adapters.mujoco.LiveModel(model)
    >>> simulator = rc.Simulator(live.scene, rc.bgt60tr13c(num_chirps=16))
    >>> [round(each.time, 3) for each in rc.adapters.mujoco.frames(simulator, live, data, duration=0.1, rate=40.0)]
    [0.0, 0.025, 0.05, 0.075]
    """
    period = 1.0 / (frame_rate(simulator.radar.waveform) if rate is None else check.positive("rate", rate, "Hz"))
    model, step = live.model, float(live.model.opt.timestep)
    mj_step = mujoco_module().mj_step
    start, frame_duration = float(data.time), simulator.radar.duration
    stride = max(1, ceil(frame_duration / step / _UPDATES_PER_FRAME))
    if duration is not None:
        duration = check.positive("duration", duration, "s")

    def advance(to: float, *, every: int = 0, exactly: bool = True) -> None:
        """Step until a time [s]; take poses after the last step, and after every `every` steps."""
        count = 0
        while (left := to - data.time) > _ROUNDING:
            if control is not None:
                control(data)
            model.opt.timestep = min(step, left) if exactly else step
            try:
                mj_step(model, data)
            finally:
                model.opt.timestep = step
            count += 1
            if to - data.time <= _ROUNDING or (every > 0 and count % every == 0):
                live.update(data, by_differences=follow or None)

    def stepped() -> Iterator[Frame]:
        live.update(data)
        number = 0
        while duration is None or number * period < duration - _ROUNDING:
            begin = start + number * period
            if follow:
                # Live motions need the poses before the start for their velocity.
                advance(begin - step, exactly=False)
            advance(begin)
            if follow:
                advance(begin + frame_duration, every=stride, exactly=False)
            yield simulator.frame(begin)
            number += 1

    return stepped()
