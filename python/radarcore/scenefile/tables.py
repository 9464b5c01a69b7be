"""Tables of a scene file: keys with type, unit, default and meaning.

Numbers are checked by the classes and functions that take them.
"""

from __future__ import annotations

import re
from dataclasses import fields
from functools import reduce
from inspect import Parameter, getdoc, signature
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_type_hints

from pydantic import AllowInfNan, BaseModel, ConfigDict, Field, create_model
from pydantic.fields import FieldInfo

from radarcore.geometry import shapes
from radarcore.models.robots.named import arm_names
from radarcore.radar.receiver import AdcErrors, Leakage, Receiver
from radarcore.simulate.settings import NOT_RECORDED, SAMPLINGS, Settings, frame_times
from radarcore.simulate.simulator import Simulator

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Extrapolation = Literal["hold", "continue", "error"]

_STRICT = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

RECORDS = (Receiver, Leakage, AdcErrors)
"""Records of settings that are tables as they are: their fields are the keys."""

for _record in RECORDS:
    _record.__pydantic_config__ = _STRICT  # type: ignore[union-attr]  # how pydantic knows that they are strict


def _key(default: Any = ..., unit: str = "", text: str = "") -> Any:
    """A key with its unit and meaning, for messages and the schema."""
    return Field(default, description=f"{text} [{unit}]" if unit else text)


class Table(BaseModel):
    """A table: no unknown keys, no text where a number is meant."""

    model_config: ClassVar[ConfigDict] = _STRICT


def keys_of(table: Any) -> dict[str, FieldInfo]:
    """Keys of a table or a record, with their types, defaults and meanings."""
    keys: dict[str, FieldInfo] = parameters_of(table) if table in RECORDS else table.model_fields
    return keys


def parameters_of(documented: Any, **other_types: Any) -> dict[str, FieldInfo]:
    """Parameters of a function or a class as keys, some of them with other types."""
    types, texts = get_type_hints(documented) | other_types, parameter_texts(documented)
    keys = {}
    for name, parameter in signature(documented).parameters.items():
        default = ... if parameter.default is Parameter.empty else parameter.default
        keys[name] = FieldInfo(annotation=types[name], default=default, description=texts.get(name))
    return keys


def parameter_texts(documented: Any) -> dict[str, str]:
    """First sentence about every parameter in a docstring, its default if given, and its unit at the end."""
    section = (getdoc(documented) or "").partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    texts: dict[str, str] = {}
    for names, text in re.findall(r"^(\w[\w, ]*) : .*\n((?:    .*\n?)+)", section, re.MULTILINE):
        text = " ".join(text.split())
        sentence = re.split(r"[.:;] |\.$", text)[0]
        unit = re.search(r" \[[^\]]+\]", sentence)
        sentence = sentence[0].lower() + sentence[1:].replace(unit[0] if unit else "", "")
        if default := re.search(r"Default: (.+?)\.(?: |$)", text):
            sentence += f"; default: {default[1]}"
        texts |= dict.fromkeys(names.split(", "), sentence + (unit[0] if unit else ""))
    return texts


def _table_of(name: str, meaning: str | None, keys: dict[str, FieldInfo], base: type[Table] = Table) -> Any:
    """Table of some keys."""
    fields: dict[str, Any] = {key: (info.annotation, info) for key, info in keys.items()}
    return create_model(name, __base__=base, __doc__=meaning, **fields)


class PoseTable(Table):
    """A place; at most one of `rpy_deg`, `wxyz`, `xyzw` and `look_at`."""

    position: Vector = _key((0.0, 0.0, 0.0), "m", "origin")
    rpy_deg: Vector | None = _key(None, "degrees", "roll, pitch, yaw about the fixed axes x, y, z")
    wxyz: Quaternion | None = _key(None, "", "rotation as a quaternion in this order, as in MuJoCo")
    xyzw: Quaternion | None = _key(None, "", "rotation as a quaternion in this order, as in ROS and OptiTrack")
    look_at: Vector | None = _key(None, "m", "point that the x axis points to, with z up")


class LinearTable(Table):
    """Constant velocity; the pose holds at time 0."""

    kind: Literal["linear"]
    velocity: Vector = _key((0.0, 0.0, 0.0), "m/s", "velocity")
    angular_velocity: Vector = _key((0.0, 0.0, 0.0), "rad/s", "angular velocity about the fixed axes x, y, z")


class TrajectoryTable(Table):
    """A smooth motion through poses."""

    kind: Literal["trajectory"]
    times: list[float] = _key(..., "s", "increasing times")
    poses: list[PoseTable] = _key(..., "", "one pose per time")
    extrapolate: Extrapolation | None = _key(
        None, "", "beyond its times; default: on at the velocity there, with a warning"
    )


class BagMotionTable(Table):
    """Poses of a ROS bag: ``radarcore simulate --bag``."""

    kind: Literal["bag"]
    topic: str = _key("/tf", "", "of transforms, poses (PoseStamped) or rigid bodies of motion capture")
    frame: str | None = _key(None, "", "of transforms the frame, of rigid bodies the name; default: none, as for poses")
    within: str | None = _key(None, "", "of transforms the frame that is the world; default: the root of the frame")
    world: PoseTable = _key(PoseTable(), "", "pose of the topic's frame in the world; default: the same")
    max_gap: float | None = _key(None, "s", "longer intervals have no frames; default: splines through, with a warning")
    offset: PoseTable = _key(PoseTable(), "", "pose of the body in the frame that moves; default: the same")
    extrapolate: Extrapolation | None = _key(
        None, "", "beyond its times; default: on at the velocity there, with a warning"
    )


AnyMotion = Annotated[LinearTable | TrajectoryTable | BagMotionTable, Field(discriminator="kind")]


class PlacedTable(Table):
    """Anything that can be placed, moved and attached."""

    pose: PoseTable = _key(PoseTable(), "", "pose; at time 0 with a linear motion; none with a trajectory or a bag")
    motion: AnyMotion | None = _key(None, "", "motion; default: at rest")
    attached_to: str | None = _key(None, "", "carrier: a body, arm/link or human/segment; pose and motion are in it")


class SensorTable(PlacedTable):
    """Pose and motion of the sensor; it looks along its x axis, y is left, z up."""

    along_z: float | None = _key(None, "m", "in place of a pose: along the z axis of the carrier, where it looks")


class MeshTable(Table):
    """A mesh file."""

    kind: Literal["mesh"]
    path: str = _key(..., "", "OBJ, or a format of trimesh; relative to the scene file")
    scale: float = _key(1.0, "m", "length of one unit of the mesh file")
    crease_angle_deg: float = _key(45.0, "degrees", "facets that meet at a smaller angle approximate a curved surface")
    shading: Literal["smooth", "flat"] = _key("smooth", "", "normals of the curved surface, or of facets")


class UsdTable(Table):
    """A USD stage (extra `usd`): a body per prim, called by its path."""

    kind: Literal["usd"]
    path: str = _key(..., "", "USD file; relative to the scene file")


def _shape_table(kind: str) -> Any:
    """Table of a shape: its keys are the parameters of the function."""
    make = getattr(shapes, kind)
    keys = {"kind": FieldInfo(annotation=Literal[kind]), **parameters_of(make, size=Vector)}  # type: ignore[arg-type]
    return _table_of(f"{kind.title()}Table", getdoc(make), keys)


SHAPES = tuple(_shape_table(kind) for kind in shapes.__all__)
if TYPE_CHECKING:
    ShapeTable = Any
else:
    ShapeTable = reduce(or_, (*SHAPES, MeshTable, UsdTable))
    """A shape of `radarcore.shapes`, a mesh file, or a USD stage."""


class MaterialTable(Table):
    """A material by numbers: `reflection` and `albedo`, or `permittivity` and what goes with it."""

    reflection: float | None = _key(None, "", "field reflection coefficient, -1 to 1; default: no specular part")
    albedo: float = _key(0.0, "", "diffuse albedo, 0 to 1")
    permittivity: str | tuple[float, float] | None = _key(None, "", "real part, loss (positive); or a material by name")
    roughness: float = _key(0.0, "m", "rms height of the surface of a dielectric")
    thickness: float | None = _key(None, "m", "of a slab of a dielectric; default: a half-space")
    scattering: float | None = _key(None, "", "in place of roughness: scattered part of the reflected field, 0 to 1")


AnyMaterial = str | MaterialTable
_MATERIAL = "name of a material of this file or of the library, or a table of numbers"


class NamedMaterialTable(MaterialTable):
    """A material that bodies refer to."""

    name: str = _key(..., "", "name that bodies refer to")


class BodyTable(PlacedTable):
    """A rigid body."""

    name: str | None = _key(None, "", "for pictures, truth and attachments")
    shape: Annotated[ShapeTable, Field(discriminator="kind")] = _key(..., "", "kind and sizes")
    material: AnyMaterial = _key("metal", "", _MATERIAL)
    materials: dict[str, AnyMaterial] | None = _key(
        None, "", "materials by names in an OBJ file or USD stage; others: material"
    )


class PointTable(Table):
    """An ideal point target."""

    name: str | None = _key(None, "", "for pictures and truth")
    position: Vector = _key(..., "m", "at time 0")
    velocity: Vector = _key((0.0, 0.0, 0.0), "m/s", "constant velocity")
    rcs: float = _key(1.0, "m^2", "radar cross-section")


class HumanTable(Table):
    """A person who walks, or stands at a speed of 0."""

    name: str = _key("human", "", "prefix of the names of the segments")
    height: float = _key(1.75, "m", "body height")
    speed: float = _key(1.4, "m/s", "mean walking speed; 0: stands at the first waypoint")
    path: list[tuple[float, float]] = _key(..., "m", "waypoints on the floor, x and y, at least two")
    turn_radius: float = _key(0.4, "m", "smallest radius of the turns")
    start_time: float = _key(0.0, "s", "time at the first waypoint")
    phase: float = _key(0.0, "", "phase of the gait cycle at that time; the right heel strikes at 0")
    mass: float | None = _key(None, "kg", "body mass; default: by the height")
    breathing: float = _key(0.25, "Hz", "breaths per second when standing; 0: a statue that does not sway either")
    material: AnyMaterial = _key("skin", "", _MATERIAL)
    meshes: bool = _key(False, "", "real human meshes (extra `robots`) in place of spheroids")


class RestTable(Table):
    """Joints at rest."""

    kind: Literal["rest"]
    angles_deg: list[float] = _key(..., "degrees", "one per moving joint; metres for joints that slide")


class JointTrajectoryTable(Table):
    """Joint angles over time, smooth, at rest at both ends."""

    kind: Literal["trajectory"]
    times: list[float] = _key(..., "s", "increasing times")
    angles_deg: list[list[float]] = _key(..., "degrees", "per time one per joint; metres for joints that slide")
    extrapolate: Extrapolation | None = _key(None, "", "beyond its times; default: at rest")


class JointStatesTable(Table):
    """Joint states of a ROS bag: ``radarcore simulate --bag``."""

    kind: Literal["bag"]
    topic: str = _key("/joint_states", "", "of joint states")
    prefix: str = _key("", "", "in front of the names that the arm's joints have")
    extrapolate: Extrapolation | None = _key(None, "", "beyond its times; default: at rest")


class LineTable(Table):
    """A straight motion of a link at constant speed, from rest to rest."""

    kind: Literal["line"]
    start_deg: list[float] = _key(..., "degrees", "joint angles at the start; metres for joints that slide")
    direction: Vector = _key(..., "", "of the motion in the axes of the arm's base, of any length")
    speed: float = _key(0.25, "m/s", "speed")
    duration: float = _key(..., "s", "from rest to rest")
    start_time: float = _key(0.0, "s", "time of the start")
    ramp_time: float = _key(0.25, "s", "of acceleration and of deceleration")
    link: str = _key("tool0", "", "link that moves along the line")


AnyJoints = Annotated[RestTable | JointTrajectoryTable | LineTable | JointStatesTable, Field(discriminator="kind")]


class ArmTable(PlacedTable):
    """A robot arm; `pose`, `motion` and `attached_to` belong to its base."""

    name: str = _key("arm", "", "prefix of the names of the links")
    model: str = _key("ur10", "", f"{', '.join(arm_names())} (extra `robots` but for ur10); or the path of a URDF file")
    joints: AnyJoints = _key(..., "", "angles or motion of the joints")
    material: AnyMaterial = _key("metal", "", _MATERIAL)
    meshes: bool = _key(False, "", "real UR10 meshes (extra `robots`) in place of cylinders; other arms have theirs")


class PatternTable(Table):
    """Antenna pattern: isotropic, Gaussian with both beam widths, or a table, here or in a file."""

    gain_db: float | list[list[float]] | None = _key(
        None, "dBi", "on boresight, default: 0; or of a table: a list per azimuth, a number per elevation"
    )
    beamwidth_azimuth_deg: float | None = _key(None, "degrees", "full width at half power")
    beamwidth_elevation_deg: float | None = _key(None, "degrees", "full width at half power")
    azimuth_deg: list[float] | None = _key(None, "degrees", "of a table, increasing, positive to the left")
    elevation_deg: list[float] | None = _key(None, "degrees", "of a table, increasing, positive up")
    path: str | None = _key(None, "", "table in a CSV file: columns azimuth_deg, elevation_deg, gain_db")


class TdmTable(Table):
    """Transmitters in turn."""

    kind: Literal["tdm"]
    interval: float | None = _key(None, "s", "from one turn to the next; default: the chirp interval over their number")
    order: list[int] | None = _key(None, "", "numbers of the transmitters in their order; default: 0, 1, 2, ...")


class DdmTable(Table):
    """Transmitters at once, separated by their Doppler frequency."""

    kind: Literal["ddm"]
    turns: list[float] | None = _key(None, "turns", "of every transmitter per chirp; default: number k of n has k/n")


class SteeredTable(Table):
    """Transmitters at once as one beam; `azimuth_deg` and `elevation_deg`, or `phases_deg`."""

    kind: Literal["steered"]
    azimuth_deg: float | list[float] | None = _key(None, "degrees", "one, or one per chirp, to the left; default: 0")
    elevation_deg: float | list[float] | None = _key(None, "degrees", "one, or one per chirp, up; default: 0")
    phases_deg: list[float] | list[list[float]] | None = _key(
        None, "degrees", "of every transmitter, or a list of them per chirp; default: from the angles"
    )


AnySchedule = Annotated[TdmTable | DdmTable | SteeredTable, Field(discriminator="kind")]


class SequenceTable(Table):
    """A further sub-sequence of every frame: its differences from the first, and its delay."""

    delay: float = _key(..., "s", "from the start of the frame to its first chirp")
    start_frequency: float | None = _key(None, "Hz", "at the start of the ramp; default: as the first")
    slope: float | None = _key(None, "Hz/s", "of the ramp; default: as the first")
    num_chirps: int | None = _key(None, "", "chirps; default: as the first")
    chirp_interval: float | None = _key(None, "s", "from chirp to chirp; default: as the first")


class RadarTable(Table):
    """The radar; given keys override a preset."""

    preset: Literal["bgt60tr13c", "bgt60tr24"] | None = _key(None, "", "a real sensor")
    start_frequency: float | None = _key(None, "Hz", "at the start of the ramp")
    stop_frequency: float | None = _key(None, "Hz", "at the end of the sampled sweep; in place of slope")
    slope: float | None = _key(None, "Hz/s", "of the ramp, negative for a down-chirp; in place of stop_frequency")
    sample_rate: float | None = _key(None, "Hz", "samples per second")
    num_samples: int | None = _key(None, "", "samples per chirp")
    num_chirps: int | None = _key(None, "", "chirps per frame; default: 1, or the preset's")
    chirp_interval: float | None = _key(None, "s", "from chirp to chirp; default: back to back, or the preset's")
    chirp_times: list[float] | None = _key(None, "s", "start of every chirp, increasing; in place of chirp_interval")
    frame_interval: float | None = _key(None, "s", "from frame to frame; default: back to back, or the preset's")
    adc_delay: float | None = _key(None, "s", "from ramp start to first sample; default: 0, or the preset's")
    max_range: float | None = _key(
        None, "m", "requirement, replaces slope and num_samples: largest range; default: none"
    )
    range_resolution: float | None = _key(
        None, "m", "requirement, replaces slope, num_samples: range bin; default: none"
    )
    max_velocity: float | None = _key(
        None, "m/s", "requirement, replaces chirp_interval: largest velocity; default: none"
    )
    velocity_resolution: float | None = _key(
        None, "m/s", "requirement, replaces num_chirps: velocity bin; default: none"
    )
    rate: float | None = _key(None, "Hz", "requirement, replaces frame_interval: frames per second; default: none")
    alternating: bool = _key(False, "", "chirps with odd numbers go the other way: two sub-sequences, up and down")
    sequences: list[SequenceTable] | None = _key(None, "", "further sub-sequences of every frame; default: none")
    schedule: AnySchedule | None = _key(None, "", "how transmitters send; default: ideally separated")
    tx: list[Vector] | None = _key(None, "m", "transmit antennas in the sensor frame; default: origin, or the preset's")
    rx: list[Vector] | None = _key(None, "m", "receive antennas in the sensor frame; default: origin, or the preset's")
    tx_power_dbm: float | None = _key(None, "dBm", "power of one transmitter; default: 30, or the preset's")
    pattern: PatternTable | None = _key(None, "", "of every antenna; default: isotropic, or the preset's")
    tx_patterns: list[PatternTable] | None = _key(None, "", "of every transmit antenna by itself; default: pattern")
    rx_patterns: list[PatternTable] | None = _key(None, "", "of every receive antenna by itself; default: pattern")
    receiver: Receiver | None = _key(None, "", "default: I/Q without noise, or the preset's")
    measured_receiver: bool = _key(False, "", "the receiver of the preset as it was measured, of a BGT60TR13C")
    if_gain_db: int | None = _key(None, "dB", "gain of the measured receiver's baseband; default: 23")
    polarization: Literal["vertical", "horizontal"] | Vector | None = _key(
        None, "", "of the antennas' field: the radar's z or y axis, or a unit vector in its frame; default: averaged"
    )
    channel_weights: list[tuple[float, float]] | None = _key(
        None, "", "[real, imaginary] part of the factor of every channel in processing; default: 1"
    )


class InterfererTable(PlacedTable):
    """Another radar, which transmits; it looks along its x axis."""

    name: str | None = _key(None, "", "for pictures and messages")
    radar: RadarTable = _key(..., "", "the other radar; its receivers do not matter")
    start: float = _key(0.0, "s", "time at which one of its frames starts")
    rate: float | None = _key(None, "Hz", "frames per second; default: one per frame_interval of its radar")
    drift_ppm: float = _key(0.0, "ppm", "how much faster its clock runs")
    start_phase: Literal["chirp", "frame"] = _key("chirp", "", "its oscillator has a random phase anew in every")


class TimesTable(Table):
    """Times and settings of the simulation."""

    start: float = _key(0.0, "s", "time of the first frame; of a bag by default its first pose")
    stop: float = _key(1.0, "s", "no frame starts at or after it; of a bag by default the end of its poses")
    rate: float = _key(None, "Hz", "frames per second; default: one per frame_interval of the radar, at most 40")

    @property
    def times(self) -> list[float]:
        """Starts of the frames [s]."""
        return frame_times(self.start, self.stop, self.rate)


def _run_table() -> Any:
    """Table of times and of settings of `Simulator`."""
    settings = parameters_of(
        Simulator, sampling=Literal[SAMPLINGS], ray_budget=int | Annotated[float, AllowInfNan(True)] | None
    )
    keys = {field.name: settings[field.name] for field in fields(Settings) if field.name not in NOT_RECORDED}
    return _table_of("RunTable", TimesTable.__doc__, keys, TimesTable)


if TYPE_CHECKING:

    class RunTable(TimesTable, Settings):
        """Times, and settings of `Simulator`."""

else:
    RunTable = _run_table()


class SceneTable(Table):
    """A radarcore scene file."""

    radar: RadarTable = _key(..., "", "the radar")
    sensor: SensorTable = _key(SensorTable(), "", "pose of the radar; default: at the origin, looking along x")
    run: RunTable = _key(RunTable(), "", "times and settings of the simulation")
    material: list[NamedMaterialTable] = _key([], "", "materials that bodies refer to")
    body: list[BodyTable] = _key([], "", "rigid bodies")
    point: list[PointTable] = _key([], "", "ideal point targets")
    human: list[HumanTable] = _key([], "", "people who walk or stand")
    arm: list[ArmTable] = _key([], "", "robot arms")
    interferer: list[InterfererTable] = _key([], "", "other radars")
