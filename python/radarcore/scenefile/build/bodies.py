"""Materials, bodies, points, people, arms and interferers of scene files."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from radarcore import check
from radarcore.adapters.usd.stage import StageScene
from radarcore.geometry import shapes
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.mesh_files import load_mesh, load_meshes
from radarcore.geometry.pose import Pose
from radarcore.models.people.human import Human
from radarcore.models.robots.arm import RobotArm
from radarcore.models.robots.joint import JointAngles, JointTrajectory
from radarcore.models.robots.named import arm_names
from radarcore.motion.group import Attached
from radarcore.motion.protocol import Motion
from radarcore.scene.body import Body, PointTarget
from radarcore.scene.interferer import Interferer
from radarcore.scene.library import materials
from radarcore.scene.material import Material
from radarcore.scenefile.build.cache import BuildCache
from radarcore.scenefile.build.motions import Carriers, Recorded, joint_motion_of, motion_of
from radarcore.scenefile.build.radar import radar_of
from radarcore.scenefile.read import located, place, unknown
from radarcore.scenefile.tables import (
    AnyMaterial,
    ArmTable,
    BodyTable,
    HumanTable,
    InterfererTable,
    LineTable,
    MaterialTable,
    MeshTable,
    NamedMaterialTable,
    PlacedTable,
    PointTable,
    SceneTable,
    UsdTable,
)

_Read = TypeVar("_Read")
AnyTable = BodyTable | PointTable | HumanTable | ArmTable | InterfererTable
AnyParts = list[Body] | list[PointTarget] | list[Interferer]


class Parts:
    """Builder of bodies, points, people, arms and interferers, each after its carrier."""

    def __init__(
        self, directory: Path, known: Mapping[str, Material], recorded: Recorded | None, kept: BuildCache
    ) -> None:
        self._directory, self._materials, self._recorded, self._kept = directory, known, recorded, kept
        self._carriers: Carriers = {}

    def build(self, table: SceneTable) -> tuple[list[Body | PointTarget | Interferer], Carriers]:
        """Parts in the order of the tables, and motions that can carry the sensor."""
        kinds = ("body", "point", "human", "arm", "interferer")
        tables: dict[str, AnyTable] = {
            place(kind, i, entry.name): entry for kind in kinds for i, entry in enumerate(getattr(table, kind))
        }
        _check_names(tables)
        built: dict[str, AnyParts] = {}
        while waiting := {where: entry for where, entry in tables.items() if where not in built}:
            # An attached part waits until its carrier is built.
            ready = {where: entry for where, entry in waiting.items() if _carrier(entry) in {None, *self._carriers}}
            if not ready:
                where, entry = next(iter(waiting.items()))
                raise ValueError(f"{where}: {self._no_carrier(str(_carrier(entry)), waiting)}")
            for where, entry in ready.items():
                with located(f"{where}: "):
                    built[where] = self._part(entry)
        return [part for where in tables for part in built[where]], self._carriers

    def _no_carrier(self, carrier: str, waiting: dict[str, AnyTable]) -> str:
        if carrier.partition("/")[0] in {other.name for other in waiting.values()}:
            return f"attached_to: expected a carrier that is not attached to this in turn, got {carrier!r}"
        return f"attached_to: unknown {unknown(carrier, self._carriers)}"

    def _part(self, entry: AnyTable) -> AnyParts:
        if isinstance(entry, PointTable):
            return [PointTarget(**entry.model_dump())]
        if isinstance(entry, InterfererTable):
            return [self._interferer(entry)]
        if isinstance(entry, BodyTable):
            return self._bodies(entry)
        return self._human(entry) if isinstance(entry, HumanTable) else self._arm(entry)

    def _bodies(self, table: BodyTable) -> list[Body]:
        """Bodies of a table: one, or one for each material of an OBJ file."""
        motion = motion_of(table, self._carriers, self._recorded)
        if table.name is not None:
            self._carriers[table.name] = motion
        rest = self._material(table.material)
        if isinstance(table.shape, UsdTable):
            return self._stage_bodies(table, motion, rest)
        if table.materials is None:
            return [Body(self._mesh(table.shape), material=rest, motion=motion, name=table.name)]
        with located("materials: "):
            own = {name: self._material(value) for name, value in table.materials.items()}
            meshes = self._meshes(table.shape)
            for name in own:
                if name not in meshes:
                    raise ValueError(f"no material {name!r} in the file; {check.near_names(name, meshes)}")
        prefix = "" if table.name is None else f"{table.name}/"
        return [
            Body(mesh, material=own.get(name, rest), motion=motion, name=f"{prefix}{name or 'rest'}")
            for name, mesh in meshes.items()
        ]

    def _stage_bodies(self, table: BodyTable, motion: Motion, rest: Material) -> list[Body]:
        """Bodies of a USD stage; its prims carry others, as ``NAME/World/arm``."""
        own = {name: self._material(value) for name, value in (table.materials or {}).items()}
        file, key = self._directory / table.shape.path, ("usd", table.shape, rest, *own.items())
        with located("shape."):
            stage: StageScene = self._kept.of(key, lambda: StageScene(file, materials=own, default=rest))
        is_fixed = motion == Pose()

        def placed(own: Motion) -> Motion:
            return own if is_fixed else Attached(motion, own)

        name = table.name or ""
        self._carriers |= {f"{name}{prim}": placed(stage.motion(prim)) for prim in stage.prims if prim}
        return [
            Body(
                body.mesh,
                material=body.material,
                motion=placed(body.motion),
                deformation=body.deformation,
                name=f"{name}{body.name}",
            )
            for body in stage.bodies
        ]

    def _interferer(self, table: InterfererTable) -> Interferer:
        with located("radar: "):
            radar = radar_of(table.radar, self._directory, self._kept)
        options = table.model_dump(include={"start", "rate", "drift_ppm", "start_phase", "name"})
        return Interferer(radar, motion_of(table, self._carriers, self._recorded), **options)

    def _material(self, value: AnyMaterial) -> Material:
        if isinstance(value, MaterialTable):
            with located("material."):
                return material_of(value)
        with located("material: "):
            return _named(value, self._materials)

    def _mesh(self, table: Any) -> Mesh:
        sizes = table.model_dump(exclude={"kind"}, exclude_none=True)
        if isinstance(table, MeshTable):
            return self._kept.of(("mesh", table), lambda: self._read(load_mesh, **sizes))
        make: Callable[..., Mesh] = getattr(shapes, table.kind)
        return self._kept.of(("shape", table), lambda: make(**sizes))

    def _meshes(self, table: Any) -> dict[str, Mesh]:
        """The parts of an OBJ file by their materials."""
        if not isinstance(table, MeshTable):
            raise ValueError(f"expected a shape of kind 'mesh' with an OBJ file, got {table.kind!r}")
        sizes = table.model_dump(exclude={"kind"}, exclude_none=True)
        return self._kept.of(("meshes", table), lambda: self._read(load_meshes, split_by="material", **sizes))

    def _read(self, load: Callable[..., _Read], path: str, **options: Any) -> _Read:
        file = self._directory / path
        with located("path: "):
            if not file.is_file():
                raise FileNotFoundError(f"expected a mesh file, got none at {file}")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # their warnings are errors here
                read = load(file, **options)
            if read == {} or (isinstance(read, Mesh) and len(read.triangles) == 0):
                raise ValueError(f"expected a mesh with faces, got none in {file}")
        return read

    def _human(self, table: HumanTable) -> list[Body]:
        walk = table.model_dump(exclude={"name", "material", "meshes"}) | {"breathing": table.breathing or None}
        human = self._kept.of(("human", repr(walk)), lambda: Human(**walk))
        make = human.mesh_bodies if table.meshes else human.bodies
        bodies = make(material=self._material(table.material), name=table.name)
        self._carriers |= {body.name: body.motion for body in bodies if body.name is not None}
        return bodies

    def _arm(self, table: ArmTable) -> list[Body]:
        arm = self._kept.of(("arm", table.model, table.meshes), lambda: self._arm_model(table))
        with located("joints."):
            joints = self._joint_motion(arm, table)
        moving = arm.moving(joints, base=motion_of(table, self._carriers, self._recorded))
        self._carriers |= {f"{table.name}/{link}": moving.link_motion(link) for link in arm.links}
        return moving.bodies(material=self._material(table.material), name=table.name)

    def _joint_motion(self, arm: RobotArm, table: ArmTable) -> JointTrajectory | JointAngles:
        if not isinstance(table.joints, LineTable):
            return joint_motion_of(arm, table, self._recorded)
        # Joint angles along a line take longer to find than a frame.
        key = ("line", table.model, table.meshes, table.joints.model_dump_json())
        return self._kept.of(key, lambda: joint_motion_of(arm, table))

    def _arm_model(self, table: ArmTable) -> RobotArm:
        if table.model == "ur10":
            return RobotArm.named("ur10") if table.meshes else RobotArm.ur10()
        if table.model in arm_names():
            return RobotArm.named(table.model)
        path = self._directory / table.model
        with located("model: "):
            if not path.suffix and not path.exists():
                hint = check.near_names(table.model, arm_names())
                raise ValueError(f"expected a URDF file or an arm by name, got {table.model!r}; {hint}")
        if table.meshes:
            raise ValueError("meshes: expected false for a URDF file, which names its own meshes, got true")
        with located("model: "):
            return RobotArm.from_urdf(path)


def _carrier(table: AnyTable) -> str | None:
    return table.attached_to if isinstance(table, PlacedTable) else None


def _check_names(tables: dict[str, AnyTable]) -> None:
    """Refuse a name that two parts have: it would be ambiguous in attachments and truth."""
    seen: dict[str | None, str] = {}
    for where, table in tables.items():
        if table.name is not None and (other := seen.setdefault(table.name, where)) != where:
            raise ValueError(f"{where}: name: expected a name of its own, got that of {other}")


def materials_of(tables: list[NamedMaterialTable]) -> dict[str, Material]:
    """Materials of the file and of the library by name."""
    own: dict[str, Material] = {}
    for i, table in enumerate(tables):
        with located(f"{place('material', i, table.name)}: "):
            if table.name in own or table.name in materials:
                other = "another" if table.name in own else "one of the library"
                raise ValueError(f"name: expected a name of its own, got that of {other}")
            own[table.name] = material_of(table)
    return own | dict(materials)


def _named(name: str, known: Mapping[str, Material]) -> Material:
    if name not in known:
        raise ValueError(f"no material {name!r}; {check.near_names(name, known)}")
    return known[name]


def material_of(table: MaterialTable) -> Material:
    """The material of a table: a dielectric, or a reflection coefficient and an albedo."""
    surface: dict[str, Any] = table.model_dump(include={"roughness", "thickness", "scattering"})
    if table.permittivity is None:
        if given := table.model_fields_set & set(surface):
            raise ValueError(f"{min(given)}: expected permittivity with it, got none")
        return Material(table.reflection or 0.0, table.albedo)
    if table.reflection is not None:
        raise ValueError("reflection: expected either reflection or permittivity, got both")
    if table.albedo != 0.0:
        raise ValueError(
            "albedo: expected none with permittivity (roughness or scattering say what is scattered), "
            f"got {table.albedo:g}"
        )
    if isinstance(table.permittivity, str):
        with located("permittivity: "):
            return _named(table.permittivity, materials).with_surface(**surface)
    real, loss = table.permittivity
    return Material.dielectric(complex(real, -loss), **surface)
