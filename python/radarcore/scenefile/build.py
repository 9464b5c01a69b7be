"""From the tables of a scene file to radar, bodies and motions."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from radarcore.geometry import shapes
from radarcore.geometry.files import load_mesh, load_meshes
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.pose import Pose
from radarcore.models.people.human import Human
from radarcore.models.robots.arm import RADAR_AT_TOOL0, RobotArm
from radarcore.models.robots.joint import JointAngles
from radarcore.models.robots.joint_trajectory import JointTrajectory
from radarcore.models.robots.line import cartesian_line
from radarcore.motion.attached import Attached
from radarcore.motion.linear import Linear
from radarcore.motion.protocol import Motion
from radarcore.motion.trajectory import Trajectory
from radarcore.radar.pattern import GaussianPattern, IsotropicPattern, Pattern, TabulatedPattern
from radarcore.radar.presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.scene.body import Body, PointTarget
from radarcore.scene.library import materials, near_names
from radarcore.scene.material import Material
from radarcore.scene.scene import Scene
from radarcore.scenefile import Simulation
from radarcore.scenefile.clearance import check_antennas
from radarcore.scenefile.read import place, unknown
from radarcore.scenefile.tables import (
    ArmTable,
    BodyTable,
    HumanTable,
    JointTrajectoryTable,
    LinearTable,
    LineTable,
    MaterialTable,
    MeshTable,
    NamedMaterialTable,
    PatternTable,
    PlacedTable,
    PointTable,
    PoseTable,
    RadarTable,
    SceneTable,
    SensorTable,
)
from radarcore.simulate.simulator import frame_times

_Read = TypeVar("_Read")
AnyTable = BodyTable | PointTable | HumanTable | ArmTable
Carriers = dict[str, Motion]
"""Motions by name, for what is attached to them."""


def simulation(table: SceneTable, file: Path) -> Simulation:
    """What the tables of a file describe."""
    with _located(f"{file}: "):
        with _located("radar: "):
            radar = _radar(table.radar, file.parent)
        parts, carriers = _Parts(file.parent, _materials(table.material)).build(table)
        with _located("sensor: "):
            motion = _sensor_motion(table.sensor, carriers)
        found = Simulation(Scene(parts), radar, motion, table.run)
        with _located("run: "):
            found.simulator()
            frame_times(table.run.start, table.run.stop, table.run.rate)
        with _located("sensor: "):
            check_antennas(found)
    return found


@contextmanager
def _located(prefix: str) -> Iterator[None]:
    """Put a place in the file in front of the messages of errors."""
    try:
        yield
    except OSError as error:
        text = str(error) if error.filename is None else f"{error.strerror}: {error.filename}"
        raise type(error)(prefix + text) from error
    except (ValueError, TypeError, KeyError, ImportError) as error:
        text = str(error.args[0]) if isinstance(error, KeyError) else str(error)
        kind = ImportError if isinstance(error, ImportError) else ValueError
        raise kind(prefix + " ".join(text.split())) from error


class _Parts:
    """Builds bodies, points, people and arms, each after what carries it."""

    def __init__(self, directory: Path, known: Mapping[str, Material]) -> None:
        self._directory = directory
        self._materials = known
        self._carriers: Carriers = {}

    def build(self, table: SceneTable) -> tuple[list[Body | PointTarget], Carriers]:
        """All parts in the order of the tables, and what can carry the sensor."""
        kinds: dict[str, list[Any]] = {
            "body": table.body,
            "point": table.point,
            "human": table.human,
            "arm": table.arm,
        }
        waiting: dict[str, AnyTable] = {
            place(kind, i, entry.name): entry for kind, entries in kinds.items() for i, entry in enumerate(entries)
        }
        order = list(waiting)
        _check_names(waiting)
        built: dict[str, list[Body] | list[PointTarget]] = {}
        while waiting:
            # What is attached waits until its carrier is there.
            ready = [where for where, entry in waiting.items() if self._has_carrier(entry)]
            if not ready:
                where, entry = next(iter(waiting.items()))
                with _located(f"{where}: "):
                    raise ValueError(self._no_carrier(entry, waiting))
            for where in ready:
                with _located(f"{where}: "):
                    built[where] = self._part(waiting.pop(where))
        return [part for where in order for part in built[where]], self._carriers

    def _has_carrier(self, entry: AnyTable) -> bool:
        return not isinstance(entry, PlacedTable) or entry.attached_to is None or entry.attached_to in self._carriers

    def _no_carrier(self, entry: AnyTable, waiting: dict[str, AnyTable]) -> str:
        assert isinstance(entry, PlacedTable)  # the others have no carrier
        assert entry.attached_to is not None  # or it would not wait
        waiting_names = {other.name for other in waiting.values()}
        if entry.attached_to.partition("/")[0] in waiting_names:
            return f"attached_to: expected what is not attached to this in turn, got {entry.attached_to!r}"
        return f"attached_to: unknown {unknown(entry.attached_to, self._carriers)}"

    def _part(self, entry: AnyTable) -> list[Body] | list[PointTarget]:
        if isinstance(entry, PointTable):
            return [PointTarget(entry.position, entry.rcs, entry.velocity, name=entry.name)]
        if isinstance(entry, BodyTable):
            return self._bodies(entry)
        return self._human(entry) if isinstance(entry, HumanTable) else self._arm(entry)

    def _bodies(self, table: BodyTable) -> list[Body]:
        """One body, or one for each material of an OBJ file that is to have several."""
        motion = _motion(table, self._carriers)
        if table.name is not None:
            self._carriers[table.name] = motion
        rest = self._material(table.material)
        if table.materials is None:
            return [Body(self._mesh(table.shape), material=rest, motion=motion, name=table.name)]
        with _located("materials: "):
            own = {name: self._material(value) for name, value in table.materials.items()}
            meshes = self._meshes(table.shape)
            for name in own:
                if name not in meshes:
                    raise ValueError(f"no material {name!r} in the file; {near_names(name, meshes)}")
        prefix = "" if table.name is None else f"{table.name}/"
        return [
            Body(mesh, material=own.get(name, rest), motion=motion, name=f"{prefix}{name or 'rest'}")
            for name, mesh in meshes.items()
        ]

    def _material(self, value: str | MaterialTable) -> Material:
        if isinstance(value, MaterialTable):
            with _located("material."):
                return _material(value)
        with _located("material: "):
            return _named(value, self._materials)

    def _mesh(self, table: Any) -> Mesh:
        if isinstance(table, MeshTable):
            return self._read(table, load_mesh, lambda mesh: len(mesh.triangles))
        make: Callable[..., Mesh] = getattr(shapes, table.kind)
        return make(**table.model_dump(exclude={"kind"}, exclude_none=True))

    def _meshes(self, table: Any) -> dict[str, Mesh]:
        """The parts of an OBJ file by their materials."""
        if not isinstance(table, MeshTable):
            raise ValueError(f"expected a shape of kind 'mesh' with an OBJ file, got {table.kind!r}")
        return self._read(table, partial(load_meshes, split_by="material"), len)

    def _read(self, table: MeshTable, load: Callable[..., _Read], size: Callable[[_Read], int]) -> _Read:
        sizes = table.model_dump(exclude={"kind"}, exclude_none=True)
        path = self._directory / sizes.pop("path")
        with _located("path: "):
            if not path.is_file():
                raise FileNotFoundError(f"expected a mesh file, got none at {path}")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what they say is an error here
                read = load(path, **sizes)
            if size(read) == 0:
                raise ValueError(f"expected a mesh with faces, got none in {path}")
        return read

    def _human(self, table: HumanTable) -> list[Body]:
        human = Human(**table.model_dump(exclude={"name", "material", "meshes"}))
        make = human.mesh_bodies if table.meshes else human.bodies
        bodies = make(material=self._material(table.material), name=table.name)
        self._carriers |= {body.name: body.motion for body in bodies if body.name is not None}
        return bodies

    def _arm(self, table: ArmTable) -> list[Body]:
        arm = self._arm_model(table)
        with _located("joints."):
            joints = _joint_motion(arm, table)
        moving = arm.moving(joints, base=_motion(table, self._carriers))
        self._carriers |= {f"{table.name}/{link}": moving.link_motion(link) for link in arm.links}
        return moving.bodies(material=self._material(table.material), name=table.name)

    def _arm_model(self, table: ArmTable) -> RobotArm:
        if table.model == "ur10":
            return RobotArm.ur10_meshes() if table.meshes else RobotArm.ur10()
        if table.meshes:
            raise ValueError("meshes: expected false for a URDF file, which names its own meshes, got true")
        with _located("model: "):
            return RobotArm.from_urdf(self._directory / table.model)


def _check_names(tables: dict[str, AnyTable]) -> None:
    """Refuse a name that two parts have: attachments and truth could not tell them apart."""
    seen: dict[str, str] = {}
    for where, table in tables.items():
        if table.name is not None and table.name in seen:
            raise ValueError(f"{where}: name: expected a name of its own, got that of {seen[table.name]}")
        if table.name is not None:
            seen[table.name] = where


def _pose(table: PoseTable) -> Pose:
    given = [name for name in ("rpy_deg", "quaternion", "look_at") if getattr(table, name) is not None]
    if len(given) > 1:
        raise ValueError(f"{given[1]}: expected one of rpy_deg, quaternion and look_at, got also {given[0]}")
    if table.look_at is not None:
        if table.look_at[:2] == table.position[:2]:
            raise ValueError("look_at: expected a point not straight above or below (use rpy_deg for that)")
        return Pose.look_at(table.position, table.look_at)
    if table.quaternion is not None:
        return Pose.from_quaternion(table.position, table.quaternion)
    return Pose.from_rpy(table.position, np.deg2rad(table.rpy_deg or (0.0, 0.0, 0.0)))


def _motion(table: PlacedTable, carriers: Carriers) -> Motion:
    """The motion in the world."""
    own: Motion
    if table.motion is None or isinstance(table.motion, LinearTable):
        with _located("pose."):
            own = _pose(table.pose)
        if table.motion is not None:
            own = Linear(own, table.motion.velocity, table.motion.angular_velocity)
    else:
        if "pose" in table.model_fields_set:
            raise ValueError("pose: expected none together with a trajectory, which has its own poses")
        poses = []
        for k, pose in enumerate(table.motion.poses):
            with _located(f"motion.poses[{k}]."):
                poses.append(_pose(pose))
        with _located("motion."):
            own = Trajectory(table.motion.times, poses)
    return own if table.attached_to is None else Attached(carriers[table.attached_to], own)


def _sensor_motion(table: SensorTable, carriers: Carriers) -> Motion:
    if table.attached_to is not None and table.attached_to not in carriers:
        raise ValueError(f"attached_to: unknown {unknown(table.attached_to, carriers)}")
    if table.along_z is None:
        return _motion(table, carriers)
    if table.attached_to is None:
        raise ValueError(
            "along_z: expected attached_to as well: the link of an arm, or the body, that carries the sensor"
        )
    if other := {"pose", "motion"} & table.model_fields_set:
        raise ValueError(f"along_z: expected it alone, got {' and '.join(sorted(other))} as well")
    return Attached(carriers[table.attached_to], Pose([0.0, 0.0, table.along_z]) @ RADAR_AT_TOOL0)


def _materials(tables: list[NamedMaterialTable]) -> dict[str, Material]:
    """Materials of the file and of the library by name."""
    own: dict[str, Material] = {}
    for i, table in enumerate(tables):
        with _located(f"{place('material', i, table.name)}: "):
            if table.name in own or table.name in materials:
                other = "another" if table.name in own else "one of the library"
                raise ValueError(f"name: expected a name of its own, got that of {other}")
            own[table.name] = _material(table)
    return own | dict(materials)


def _named(name: str, known: Mapping[str, Material]) -> Material:
    if name not in known:
        raise ValueError(f"no material {name!r}; {near_names(name, known)}")
    return known[name]


def _material(table: MaterialTable) -> Material:
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
        with _located("permittivity: "):
            found = _named(table.permittivity, materials)
        return found.with_surface(**surface)
    real, loss = table.permittivity
    return Material.dielectric(complex(real, -loss), **surface)


def _joint_motion(arm: RobotArm, table: ArmTable) -> JointTrajectory | JointAngles:
    joints = table.joints
    if isinstance(joints, LineTable):
        options = joints.model_dump(exclude={"kind", "start_deg"})
        return cartesian_line(arm, _joint_angles(arm, "start_deg", joints.start_deg), **options)
    if not isinstance(joints, JointTrajectoryTable):
        return _joint_angles(arm, "angles_deg", joints.angles_deg)
    if len(joints.angles_deg) != len(joints.times):
        raise ValueError(f"angles_deg: expected {len(joints.times)} lists, one per time, got {len(joints.angles_deg)}")
    rows = [_joint_angles(arm, f"angles_deg[{k}]", row) for k, row in enumerate(joints.angles_deg)]
    return JointTrajectory(joints.times, np.array(rows).reshape(len(rows), -1), arm=arm)


def _joint_angles(arm: RobotArm, name: str, values: list[float]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Joint angles [rad]; m for joints that slide."""
    if len(values) != len(arm.joint_names):
        raise ValueError(
            f"{name}: expected {len(arm.joint_names)} values ({', '.join(arm.joint_names)}), got {len(values)}"
        )
    units = [1.0 if joint.kind == "prismatic" else np.deg2rad(1.0) for joint in arm.moving_joints]
    return np.array(values) * units


_WAVEFORM_KEYS = (
    "start_frequency",
    "stop_frequency",
    "slope",
    "sample_rate",
    "num_samples",
    "num_chirps",
    "chirp_interval",
    "chirp_times",
    "frame_interval",
    "adc_delay",
)
# Frequencies outside cannot be meant: gigahertz in place of hertz, for example [Hz].
_LOWEST_FREQUENCY, _HIGHEST_FREQUENCY = 1e8, 3e12


def _radar(table: RadarTable, directory: Path) -> Radar:
    given = {name: value for name in type(table).model_fields if (value := getattr(table, name)) is not None}
    waveform = {name: given[name] for name in _WAVEFORM_KEYS if name in given}
    for name in ("start_frequency", "stop_frequency"):
        if not _LOWEST_FREQUENCY <= waveform.get(name, _LOWEST_FREQUENCY) <= _HIGHEST_FREQUENCY:
            raise ValueError(f"{name}: expected 1e8 to 3e12 [Hz] (60 GHz is 60e9), got {waveform[name]:g}")
    others: dict[str, Any] = {
        name: given[name] for name in ("tx", "rx", "tx_power_dbm", "polarization") if name in given
    }
    if table.pattern is not None:
        with _located("pattern."):
            others["pattern"] = _pattern(table.pattern, directory)
    for name in ("tx_patterns", "rx_patterns"):
        if name in given:
            others[name] = []
            for k, entry in enumerate(given[name]):
                with _located(f"{name}[{k}]."):
                    others[name].append(_pattern(entry, directory))
    if table.receiver is not None:
        with _located("receiver."):
            others["receiver"] = Receiver(**table.receiver.model_dump())
    if table.preset is not None:
        preset = bgt60tr13c(**waveform)
        kept = {
            name: getattr(preset, name) for name in ("tx", "rx", "tx_power_dbm", "pattern", "receiver", "polarization")
        }
        return Radar(preset.waveform, **(kept | others))
    return Radar(_waveform(waveform), **others)


def _waveform(values: dict[str, Any]) -> Waveform:
    for name in ("start_frequency", "sample_rate", "num_samples"):
        if name not in values:
            raise ValueError(f"{name}: expected a value, or a preset, got none")
    if ("slope" in values) == ("stop_frequency" in values):
        got = "both" if "slope" in values else "none"
        raise ValueError(f"slope: expected either slope or stop_frequency, got {got}")
    return Waveform(**values) if "slope" in values else Waveform.from_sweep(**values)


def _pattern(table: PatternTable, directory: Path) -> Pattern:
    given = table.model_fields_set
    if "path" in given:
        if other := given - {"path"}:
            raise ValueError(f"path: expected it alone, got {' and '.join(sorted(other))} as well")
        with _located("path: "):
            return TabulatedPattern.load(directory / str(table.path))
    azimuth, elevation = table.azimuth_deg, table.elevation_deg
    widths = table.beamwidth_azimuth_deg, table.beamwidth_elevation_deg
    if azimuth is not None or elevation is not None or isinstance(table.gain_db, list):
        if azimuth is None or elevation is None or not isinstance(table.gain_db, list):
            missing = "azimuth_deg" if azimuth is None else "elevation_deg" if elevation is None else "gain_db"
            got = "none" if getattr(table, missing) is None else getattr(table, missing)
            raise ValueError(f"{missing}: expected a list, as all three keys of a table are, got {got}")
        if widths != (None, None):
            raise ValueError("azimuth_deg: expected either a table or beam widths, got both")
        return TabulatedPattern.from_degrees(azimuth, elevation, table.gain_db)
    gain_db = 0.0 if table.gain_db is None else table.gain_db
    if widths == (None, None):
        return IsotropicPattern(gain_db)
    if widths[0] is None or widths[1] is None:
        missing = "beamwidth_azimuth_deg" if widths[0] is None else "beamwidth_elevation_deg"
        raise ValueError(f"{missing}: expected both beam widths or none [degrees], got one")
    return GaussianPattern(gain_db, widths[0], widths[1])
