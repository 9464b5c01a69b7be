"""A USD stage as bodies whose poses follow its time samples, or the simulator that runs on it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from importlib.util import find_spec
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from radarcore import check, notice
from radarcore.adapters.depth import radar_in_camera
from radarcore.adapters.usd.frames import Place, columns, homogeneous, polar
from radarcore.adapters.usd.surfaces import Surface, indices, points_of, surface_of
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.mesh_files import TO_Z_UP, transformed
from radarcore.geometry.pose import Pose, transforms
from radarcore.geometry.rotation import Matrix, rotations_about
from radarcore.motion.deformation import Deformation, DeformationFunction
from radarcore.motion.live import LiveGroup
from radarcore.motion.protocol import Motion
from radarcore.motion.samples import Samples
from radarcore.motion.skin import Skin
from radarcore.records import sealed
from radarcore.scene.body import Body
from radarcore.scene.library import as_material, materials
from radarcore.scene.material import Material
from radarcore.scene.scene import Scene

PURPOSES = ("default", "render")
"""Purposes of prims that are seen: neither proxies nor guides, such as collision shapes."""

_MOST_PRIMS, _LONGEST_PATH = 200_000, 10_000
"""Largest number of prims, with those of instances, and of characters in a path: instances may multiply without end."""

_MOST_STEPS, _LARGEST_TURN = 1_000_000, 90.0
"""Largest number of steps of a rotation, and of degrees in a step: a step is shorter than half a turn."""


def is_available() -> bool:
    """True when the extra `usd` is installed.

    See Also
    --------
    adapters.usd.StageScene : Needs it.

    Examples
    --------
    >>> rc.adapters.usd.is_available()
    True
    """
    return find_spec("pxr") is not None


def usd_module() -> Any:
    """The package `pxr`, or an ImportError that names the extra."""
    if not is_available():
        raise ImportError("USD stages need usd-core: pip install radarcore[usd]")
    import pxr
    from pxr import Tf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdSkel  # noqa: F401  # as attributes of the package

    return pxr


@sealed
class StageScene:
    """Meshes and primitives of a USD stage as bodies, in metres with z up.

    A prim with time samples, or below one, follows them: positions and angles are interpolated as in USD, and rates
    are the derivatives. Skinned meshes of UsdSkel, and meshes with time samples of their points, deform. Time code 0 is
    0 s.

    Parameters
    ----------
    stage : path or Usd.Stage
    time : float
        Time for everything without a motion: visibility, sizes, materials [s].
    live : bool or collection of str
        Paths of prims whose poses `follow` gives, with all prims below them; True: all rigid bodies of UsdPhysics.
    purposes : collection of str
        Purposes of prims that the radar sees. Default: "default" and "render", without proxies and guides.
    skip : collection of str
        Paths of prims that the radar does not see, with all prims below them: its own housing.
    materials : mapping of str to Material or str, optional
        Materials, also by name in ``radarcore.materials``, by the path of a prim or subset, the name or path of its
        material in the stage, of its physics material, or the path of a prim above; the first of these counts.
        Default: materials of the stage map to radarcore's by name, in lower case.
    default : Material or str
        Material of everything else.
    sagitta : float
        Largest distance of facets from curved primitives [m].
    interpolation : "linear" or "cubic"
        Between time samples: as USD does, or with continuous velocities, for recorded motion.

    Attributes
    ----------
    bodies : tuple of Body
        A body per prim, and per subset with a material of its own, called by its path.
    scene : Scene
        The bodies; ``Scene([*stage.bodies, ...])`` has more.
    prims : tuple of str
        Paths of all prims that were read, for `motion`.
    paths : tuple of str
        Paths of the live prims, in the order of `group`.
    group : LiveGroup, optional
        Motions of the live prims; None without any.

    Raises
    ------
    ImportError
        Without the extra `usd`.
    FileNotFoundError
        When there is no such file.
    ValueError
        For a file that is not USD, for faults of a prim, with its path, and for scales that change over time.

    See Also
    --------
    adapters.mujoco.LiveModel : Of MuJoCo.
    LiveGroup : Motions of other programs.

    Examples
    --------
    >>> from pxr import Usd, UsdGeom
    >>> stage = Usd.Stage.CreateInMemory()  # of a unit of 0.01 m, with y up
    >>> ball = UsdGeom.Sphere.Define(stage, "/ball")
    >>> ball.CreateRadiusAttr(10.0), ball.AddTranslateOp().Set((200.0, 50.0, 0.0))
    (Usd.Prim(</ball>).GetAttribute('radius'), True)
    >>> body = rc.adapters.usd.StageScene(stage).bodies[0]
    >>> body.name, body.motion.at(0.0).position.round(3).tolist()
    ('/ball', [2.0, 0.0, 0.5])
    """

    def __init__(
        self,
        stage: Any,
        *,
        time: float = 0.0,
        live: bool | Collection[str] = (),
        purposes: Collection[str] = PURPOSES,
        skip: Collection[str] = (),
        materials: Mapping[str, Material | str] | None = None,
        default: Material | str = "metal",
        sagitta: float = 5e-5,
        interpolation: str = "linear",
    ) -> None:
        self._pxr = usd_module()
        self._stage, self._purposes, self._skip = self._opened(stage), set(purposes), set(skip)
        self._materials = {name: as_material(f"materials[{name!r}]", each) for name, each in (materials or {}).items()}
        self._default, self._sagitta = as_material("default", default), check.positive("sagitta", sagitta, "m")
        self._is_cubic = check.choice("interpolation", interpolation, ("linear", "cubic")) == "cubic"
        self._rate = check.positive("timeCodesPerSecond", self._stage.GetTimeCodesPerSecond(), "Hz")
        self._code = self._pxr.Usd.TimeCode(check.time("time", time) * self._rate)
        self._every = self._pxr.Usd.TraverseInstanceProxies()
        self._world, self._made = Place(None, self._to_world(self._stage)), dict[Any, Any]()
        self._places, self._skinned = dict[str, Place](), dict[str, tuple[Any, Any, Any]]()
        self._mounts, self._known = dict[str, Pose](), set[str]()
        self.paths: tuple[str, ...] = self._live_paths(live)
        self.group: LiveGroup | None = LiveGroup(len(self.paths)) if self.paths else None
        stretches = polar(self._live_matrices(self._stage, self._code)[:, :3, :3])[1]
        self._live = dict(zip(self.paths, homogeneous(stretches), strict=True))
        self.bodies: tuple[Body, ...] = tuple(self._read())
        self.prims: tuple[str, ...] = tuple(self._places)
        self.scene: Scene = Scene(self.bodies)

    def _opened(self, stage: Any) -> Any:
        """The stage, read if it is a path."""
        if isinstance(stage, str | PathLike):
            if not Path(stage).is_file():
                raise FileNotFoundError(f"stage: expected a USD file, got none at {fspath(stage)}")
            try:
                stage = self._pxr.Usd.Stage.Open(fspath(stage))
            except self._pxr.Tf.ErrorException as error:
                raise ValueError(f"{fspath(stage)}: not a USD file: {' '.join(str(error).split())}") from None
        check.instance("stage", stage, self._pxr.Usd.Stage)
        if faults := stage.GetCompositionErrors():
            notice.warn(f"stage: {len(faults)} references fail, as {' '.join(str(faults[0]).split())}")
        return stage

    # What moves

    def _live_paths(self, live: bool | Collection[str]) -> tuple[str, ...]:
        """Paths of the prims that a program moves."""
        prims = self._pxr.Usd.PrimRange(self._stage.GetPseudoRoot(), self._every) if live is True else ()
        found = (str(prim.GetPath()) for prim in prims if prim.HasAPI(self._pxr.UsdPhysics.RigidBodyAPI))
        return tuple(found if isinstance(live, bool) else live)

    def _live_matrices(self, stage: Any, code: Any) -> Matrix:
        """Matrices (path, 4, 4) from the live prims of a stage to the world in metres with z up."""
        cache, prims = self._pxr.UsdGeom.XformCache(code), {path: stage.GetPrimAtPath(path) for path in self.paths}
        if missing := [path for path, prim in prims.items() if not prim]:
            raise ValueError(f"live: no prim {missing[0]!r} in the stage")
        return self._to_world(stage) @ columns([cache.GetLocalToWorldTransform(prim) for prim in prims.values()])

    def _to_world(self, stage: Any) -> Matrix:
        """Matrix (4, 4) from the units and axes of a stage to metres with z up."""
        unit = check.positive("metersPerUnit", self._pxr.UsdGeom.GetStageMetersPerUnit(stage), "m")
        return homogeneous(unit * TO_Z_UP[f"{self._pxr.UsdGeom.GetStageUpAxis(stage)}_UP"])

    def _place(self, prim: Any, place: Place, path: str) -> Place:
        """Frame of a prim below another."""
        if self.group is not None and path in self._live:
            return Place(self.group[self.paths.index(path)], self._live[path], is_live=True)
        if not (xform := self._pxr.UsdGeom.Xformable(prim)):
            return place
        place = self._world if xform.GetResetXformStack() else place
        for op in xform.GetOrderedXformOps():
            codes, kind = op.GetTimeSamples(), op.GetOpTypeToken(op.GetOpType())
            if kind.startswith("rotate") and len(codes) > 1 and not place.is_live:
                place = self._turned(place, op, kind.removeprefix("rotate"), codes)
            else:
                samples = [op.GetOpTransform(code) for code in codes]
                place = self._moved(place, codes, samples, op.GetOpTransform(self._code))
        return place

    def _moved(self, place: Place, codes: Sequence[float], samples: Sequence[Any], now: Any) -> Place:
        """Frame below another by a matrix that may have time samples."""
        if len(codes) > 1 and not place.is_live:
            matrices = columns(samples)
            if np.ptp(matrices, axis=0).any():
                return self._moving(place, np.array(codes) / self._rate, matrices)
        return place._replace(matrix=place.matrix @ columns(now))

    def _turned(self, place: Place, op: Any, axes: str, codes: Sequence[float]) -> Place:
        """Frame that turns about axes in another, in steps below half a turn."""
        degrees = np.array([op.Get(code) for code in codes], dtype=np.float64).reshape(len(codes), -1)
        largest = np.abs(np.diff(check.finite("rotate", degrees), axis=0)).max()
        if (num_steps := (len(codes) - 1) * max(np.ceil(largest / _LARGEST_TURN), 1.0)) > _MOST_STEPS:
            raise ValueError(f"rotate: expected smaller steps, got {largest:g} degrees")
        numbers = np.linspace(0.0, len(codes) - 1.0, int(num_steps) + 1)
        times = np.interp(numbers, np.arange(len(codes)), codes) / self._rate
        # A point turns about the first axis first, which is the last factor; the other way round if inverted.
        for axis in axes if op.IsInverseOp() else axes[::-1]:
            column = degrees[:, "XYZ".index(axis) if len(axes) > 1 else 0] * (-1.0 if op.IsInverseOp() else 1.0)
            angles = np.deg2rad(np.interp(numbers, np.arange(len(codes)), column))
            turns = rotations_about(np.eye(3)["XYZ".index(axis)] * angles[:, None])
            place = self._moving(place, times, homogeneous(turns))
        return place

    def _moving(self, place: Place, times: Matrix, matrices: Matrix) -> Place:
        """Frame that moves in another; motions through samples at the same times are evaluated together."""
        return place.moved(self._once(times.tobytes(), partial(Samples, times, self._is_cubic)), matrices)

    # What is seen

    def _read(self) -> Iterator[Body]:
        """Bodies of all prims that are seen."""
        usd, ignored, skinned = self._pxr.UsdGeom, set[str](), list[tuple[Any, str, Surface]]()
        pending = [(self._stage.GetPseudoRoot(), self._world, "", True)]
        upright = Pose(rotation=TO_Z_UP[f"{usd.GetStageUpAxis(self._stage)}_UP"].T)
        while pending:
            prim, place, path, is_seen = pending.pop()
            if len(self._places) > _MOST_PRIMS or len(path) > _LONGEST_PATH:
                raise ValueError(f"stage: expected at most {_MOST_PRIMS} prims with instances, got more")
            self._known.add(path)
            image = usd.Imageable(prim)
            is_hidden = image and image.GetVisibilityAttr().Get(self._code) == "invisible"
            is_seen = is_seen and path not in self._skip and not is_hidden
            # The radar may sit below what it does not see; faults there do not matter.
            with check.located(path or "stage") if is_seen else suppress(ValueError):
                place = self._places[path] = self._place(prim, place, path)
                self._mounts[path] = radar_in_camera("opengl") if prim.IsA(usd.Camera) else upright
                if prim.IsA(usd.PointInstancer):
                    pending += [(*each, is_seen) for each in self._instances(prim, place, path)][::-1]
                    continue
                if prim.IsA(self._pxr.UsdSkel.Root):
                    self._find_skins(prim, path)
                elif is_seen and prim.IsA(usd.Gprim) and image.ComputePurpose() in self._purposes:
                    unit = round(float(np.linalg.norm(place.matrix[:3, :3], 2)), 12)
                    read = partial(surface_of, prim, self._code, unit, self._sagitta)
                    if (surface := self._once((_source(prim), unit), read)) is None:
                        ignored.add(prim.GetTypeName())
                    elif path in self._skinned:
                        skinned.append((prim, path, surface))  # their skeletons may come later
                    else:
                        yield from self._bodies(prim, place, path, surface)
                children = prim.GetFilteredChildren(self._every)
                pending += [(child, place, f"{path}/{child.GetName()}", is_seen) for child in reversed(children)]
        for prim, path, surface in skinned:
            with check.located(path):
                yield from self._skinned_bodies(prim, path, surface)
        for name in {*self._materials, *self._skip} - self._known:
            near = check.near_names(name, sorted(self._known))
            raise ValueError(f"materials, skip: nothing is called {name!r}; {near}")
        if ignored:
            notice.warn(f"stage: prims of these types are not seen: {', '.join(sorted(ignored))}")

    def _instances(self, prim: Any, place: Place, path: str) -> Iterator[tuple[Any, Place, str]]:
        """Prototypes of a point instancer, each with the frame and the path of an instance."""
        instancer = self._pxr.UsdGeom.PointInstancer(prim)
        prototypes = [*map(self._stage.GetPrimAtPath, instancer.GetPrototypesRel().GetForwardedTargets())]
        numbers = indices(prim, "protoIndices", self._code, len(prototypes))
        names = ("positions", "orientations", "orientationsf", "scales")
        codes = sorted({code for name in names for code in prim.GetAttribute(name).GetTimeSamples()})
        *samples, now = [_instance_matrices(instancer, code) for code in [*codes, self._code]]
        if any(len(each) != len(numbers) for each in [*samples, now]) or not all(prototypes):
            raise ValueError("protoIndices: expected a prototype, and a position at all times, for every instance")
        is_seen = instancer.ComputeMaskAtTime(self._code) or [True] * len(numbers)
        for k in np.flatnonzero(is_seen).tolist():
            prototype = prototypes[numbers[k]]
            below = self._moved(place, codes, [each[k] for each in samples], now[k])
            yield prototype, below, f"{path}/{k}/{prototype.GetName()}"

    def _bodies(self, prim: Any, place: Place, path: str, surface: Surface, deformation: Any = None) -> Iterator[Body]:
        """A body per subset with a material of its own, and one for the rest."""
        points, triangles, faces = surface
        motion, stretch = place.motion(), place.stretch
        rest, parts = np.ones(len(faces), dtype=np.bool_), list[tuple[Any, str, Any]]()
        if prim.IsA(self._pxr.UsdGeom.Mesh):
            num_faces = self._pxr.UsdGeom.Mesh(prim).GetFaceCount(self._code)
            for subset in self._pxr.UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
                is_own = np.isin(faces, indices(subset.GetPrim(), "indices", self._code, num_faces)) & rest
                rest &= ~is_own
                parts.append((subset.GetPrim(), f"{path}/{subset.GetPrim().GetName()}", is_own))
            if len(codes := prim.GetAttribute("points").GetTimeSamples()) > 1 and deformation is None:
                samples = [points_of(prim, code) @ stretch for code in codes]
                deformation = Deformation(np.array(codes) / self._rate, samples)
        source = path if path in self._skinned else _source(prim)
        for part, name, is_own in [*parts, (prim, path, rest)]:
            if is_own.any():
                key = (source, name[len(path) :], stretch.round(12).tobytes())
                shape = transformed(points, triangles[is_own], homogeneous(stretch)[:3])
                mesh = self._once(key, partial(Mesh, *shape))
                yield Body(mesh, material=self._material(part, name), motion=motion, deformation=deformation, name=name)

    def _material(self, prim: Any, path: str) -> Material:
        """Material of a prim or subset: by the table, by names of its materials in the stage, or the default."""
        binding = self._pxr.UsdShade.MaterialBindingAPI(prim)
        bound = [binding.ComputeBoundMaterial(purpose)[0].GetPrim() for purpose in ("", "physics")]
        names = [name for each in bound if each for name in (str(each.GetPath()), each.GetName())]
        self._known.update([path, *names])
        above = [path.rsplit("/", depth)[0] for depth in range(1, path.count("/"))]
        chosen = [self._materials[name] for name in (path, *names, *above) if name in self._materials]
        chosen += [materials[name.lower()] for name in names if name.lower() in materials]
        return chosen[0] if chosen else self._default

    # Skins

    def _find_skins(self, prim: Any, root_path: str) -> None:
        """Note which meshes below a root of UsdSkel, or an instance of it, have joints."""
        cache, root, start = self._pxr.UsdSkel.Cache(), self._pxr.UsdSkel.Root(prim), len(str(prim.GetPath()))
        cache.Populate(root, self._every)
        for binding in cache.ComputeSkelBindings(root, self._every):
            skeleton = binding.GetSkeleton()
            for target in binding.GetSkinningTargets():
                path = root_path + str(target.GetPrim().GetPath())[start:]
                if target.HasBlendShapes() or target.GetSkinningMethod() == "dualQuaternion":
                    notice.warn(f"{path}: blend shapes and dual quaternions have no effect")
                if target.HasJointInfluences():
                    skeleton_path = root_path + str(skeleton.GetPath())[start:]
                    self._skinned[path] = skeleton_path, cache.GetSkelQuery(skeleton), target

    def _skinned_bodies(self, prim: Any, path: str, surface: Surface) -> Iterator[Body]:
        """Bodies of a mesh with joints, in the frame of its skeleton."""
        (points, triangles, faces), (skeleton, query, target) = surface, self._skinned[path]
        place, order = self._places[skeleton], list(query.GetJointOrder())
        chosen = np.array([order.index(joint) for joint in target.GetJointOrder() or order])
        influences = target.ComputeVaryingJointInfluences(len(points), self._code)
        joints, weights = np.array(influences or ([], []), dtype=np.float64).reshape(2, len(points), -1)
        if joints.size == 0 or joints.min() < 0 or joints.max() >= len(chosen) or not (weights.sum(axis=1) > 0.0).all():
            raise ValueError("skel:jointIndices, skel:jointWeights: expected joints of the skeleton for every point")
        points, triangles = transformed(points, triangles, columns(target.GetGeomBindTransform())[:3])
        frames = self._once(skeleton, lambda: self._joints(query, place))
        stretches = homogeneous(np.array([frame.stretch for frame in frames]))
        to_joints = stretches @ np.linalg.inv(columns(query.GetJointWorldBindTransforms()))
        # Weights in single precision add up to 1 but for rounding, which would pull at the vertices.
        weights /= weights.sum(axis=1, keepdims=True)
        motions = [frame.motion() for frame in frames]
        skin = Skin(motions, to_joints, points, chosen[joints.astype(np.int64)], weights)
        deformation = DeformationFunction(skin.at, len(points), skin.rate_at)
        yield from self._bodies(prim, place, path, (points, triangles, faces), deformation)

    def _joints(self, query: Any, place: Place) -> list[Place]:
        """Frames of the joints in the frame of their skeleton."""
        codes = animation.GetJointTransformTimeSamples() if (animation := query.GetAnimQuery()) else []
        *samples, now = [query.ComputeJointLocalTransforms(code) for code in [*codes, self._code]]
        root, places = Place(None, homogeneous(place.stretch)), list[Place]()
        for k, parent in enumerate(query.GetTopology().GetParentIndices()):
            above = root if parent < 0 else places[parent]
            places.append(self._moved(above, codes, [each[k] for each in samples], now[k]))
        return places

    def _once(self, key: Any, make: Callable[[], Any]) -> Any:
        """Object that several prims share, made at the first call."""
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    def follow(self, stage: Any, time: float) -> None:
        """Take the poses of all live prims from a stage, at a time: velocities are differences of updates.

        Parameters
        ----------
        stage : Usd.Stage
            With the same prims. Time samples count at `time`, other values as they are now.
        time : float
            [s].

        See Also
        --------
        LiveGroup.update : With poses and velocities as arrays, in the order of `paths`.

        Examples
        --------
        >>> from pxr import Usd, UsdGeom
        >>> stage = Usd.Stage.CreateInMemory()
        >>> shift = UsdGeom.Sphere.Define(stage, "/ball").AddTranslateOp()
        >>> cell = rc.adapters.usd.StageScene(stage, live=["/ball"])
        >>> for step in range(2):
        ...     _ = shift.Set((50.0 * step, 0.0, 0.0))
        ...     cell.follow(stage, 0.1 * step)
        >>> cell.bodies[0].motion.rate_at(0.1)[:, 3].round(3).tolist()
        [5.0, 0.0, 0.0]
        """
        if self.group is None:
            raise ValueError("live: expected prims to follow, got none; StageScene(stage, live=True)")
        matrices = self._live_matrices(stage, self._pxr.Usd.TimeCode(time * stage.GetTimeCodesPerSecond()))
        self.group.update(time, transforms(polar(matrices[:, :3, :3])[0], matrices[:, :3, 3]))

    def motion(self, path: str) -> Motion:
        """Motion of a prim, for ``Simulator(radar_motion=...)``.

        The radar looks along the line of sight of a camera, upright in its image; along the x axis of other prims, with
        the stage's up axis up.

        See Also
        --------
        Simulator : Takes it as `radar_motion`.

        Examples
        --------
        >>> from pxr import Usd, UsdGeom
        >>> stage = Usd.Stage.CreateInMemory()
        >>> UsdGeom.Camera.Define(stage, "/eye").AddTranslateOp().Set((0.0, 100.0, 0.0))
        True
        >>> rc.adapters.usd.StageScene(stage).motion("/eye").at(0.0).rotation.round(3)[:, 0].tolist()
        [0.0, 1.0, 0.0]
        """
        if path not in self._places:
            raise ValueError(f"path: no prim {path!r} in the stage; {check.near_names(path, self._places)}")
        return self._places[path].motion(self._mounts[path])

    def __repr__(self) -> str:
        return f"<StageScene: {len(self.bodies)} bodies, {len(self.paths)} live prims>"


def _source(prim: Any) -> str:
    """Path of a prim, or in the prototype of its instance."""
    return str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())


def _instance_matrices(instancer: Any, code: Any) -> Matrix:
    """Matrices of USD (n, 4, 4) of a point instancer, whose rotations in half precision also stretch a little."""
    options = instancer.ExcludeProtoXform, instancer.IgnoreMask
    matrices = np.array(instancer.ComputeInstanceTransformsAtTime(code, code, *options)).reshape(-1, 4, 4)
    scales = np.array(instancer.GetScalesAttr().Get(code) or np.ones((len(matrices), 3)))[:, :, None]
    turned = check.finite("positions", matrices)[:, :3, :3] / np.where(scales == 0.0, 1.0, scales)
    matrices[:, :3, :3] = scales * polar(turned)[0]
    return matrices
