"""Labels of frames: truth, boxes, visibility, joints of people, strongest bodies of the map's cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.dataset import echoes
from radarcore.dataset.echoes import Floats, Members
from radarcore.geometry.pose import Pose
from radarcore.models.people.figure import SEGMENTS
from radarcore.motion.group import Motions
from radarcore.motion.protocol import Motion, as_motion
from radarcore.radar.radar import Radar
from radarcore.recording.frame import TRUTH_FIELDS, Frame
from radarcore.scene.scene import Parts, Scene
from radarcore.simulate.simulator import Simulator

_MOST_NAMES = 2**15 - 1
"""Largest number of names that an int16 counts."""

_AXES = "axes of the sensor: x forward, y left, z up"

_OF_SEGMENTS = {
    "pelvis": "pelvis",
    "neck": "neck",
    "head": "head",
    "left_hip": "left_thigh",
    "right_hip": "right_thigh",
    "left_knee": "left_shank",
    "right_knee": "right_shank",
    "left_ankle": "left_foot",
    "right_ankle": "right_foot",
    "left_shoulder": "left_upper_arm",
    "right_shoulder": "right_upper_arm",
    "left_elbow": "left_forearm",
    "right_elbow": "right_forearm",
    "left_wrist": "left_hand",
    "right_wrist": "right_hand",
}
"""The segment whose origin, its upper joint, is the joint; trunk and pelvis share one."""

JOINTS = tuple(_OF_SEGMENTS)
"""Names of the joints in the order of the axis `joint`.

The pelvis is midway between the hips (with a man's meshes: at his waist), the neck between the shoulders, the head at
the height of the chin; the others are the joints of the limbs.
"""


@dataclass(frozen=True)
class Labels:
    """Which labels the frames of a dataset have.

    All hold for the middle of a frame, as its truth does.

    Parameters
    ----------
    truth : bool
        ``true_range``, ``true_velocity``, ``true_azimuth``, ``true_elevation``, (body,): as in `Truth`; for a person or
        an arm with one name of its nearest visible part. NaN of what is not there or not visible.
    boxes : bool
        ``box_center`` and ``box_size``, (body, xyz) [m]: the box around the vertices of its mesh, also while it
        deforms, along the axes of the sensor. NaN of what is not there.
    visibility : bool
        ``visibility``, (body,), 0 to 1: the share of the energy of its echo, were it alone in the scene, that reaches
        the radar. 1 if nothing is in front of it, 0 if it is hidden or its echo too weak for a path; NaN of what is not
        there.
    joints : bool
        ``joint_position``, (body, joint, xyz) [m]: the `JOINTS` of people in the sensor frame, visible or not. NaN of
        all others.
    cells : bool
        ``strongest_body``, (doppler, range) int16: index of the body whose echo is strongest in a cell of
        `range_doppler` with its default windows, -1 for none.

    See Also
    --------
    dataset.labels_of : The labels of a frame.
    dataset.dims_of : Their shapes.
    Truth : True positions and velocities of bodies.

    Examples
    --------
    >>> rc.dataset.Labels(boxes=True)
    Labels(truth=True, boxes=True, visibility=False, joints=False, cells=False)
    """

    truth: bool = True
    boxes: bool = False
    visibility: bool = False
    joints: bool = False
    cells: bool = False

    def __post_init__(self) -> None:
        for each in fields(self):
            if not isinstance(value := getattr(self, each.name), bool):
                raise TypeError(f"{each.name}: expected True or False, got {value!r}")


class LabelLayout(NamedTuple):
    """Axes, shape, dtype and attributes of a label.

    Attributes
    ----------
    dims : tuple of str
        Names of the axes.
    shape : tuple of int
    dtype : numpy.dtype
    attrs : dict
        ``units``, ``long_name`` and what else is to be known of the numbers: anything JSON can hold.

    See Also
    --------
    dataset.dims_of : Of every label.

    Examples
    --------
    >>> rc.dataset.dims_of(rc.bgt60tr13c(), ["ball"])["true_velocity"].attrs["units"]
    'm/s'
    """

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    attrs: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Labelled:
    """A label of one frame.

    Attributes
    ----------
    dims : tuple of str
        Names of the axes.
    values : array
    attrs : dict
        As `LabelLayout` has them.

    See Also
    --------
    dataset.labels_of : Makes them.

    Examples
    --------
    >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], name="ball")]), rc.bgt60tr13c(num_chirps=16))
    >>> label = rc.dataset.labels_of(simulator, simulator.frame(), ["ball"])["true_range"]
    >>> label.dims, label.values.round(2).tolist(), label.attrs["units"]
    (('body',), [2.0], 'm')
    """

    dims: tuple[str, ...]
    values: NDArray[Any]
    attrs: dict[str, Any] = field(default_factory=dict)


def dims_of(radar: Radar, body_names: Sequence[str], settings: Labels | None = None) -> dict[str, LabelLayout]:
    """Axes, shapes, dtypes and attributes of the labels of a radar's frames, before there is any.

    Parameters
    ----------
    radar : Radar
    body_names : sequence of str
        Names of the axis `body`, see `labels_of`.
    settings : Labels, optional
        Default: the truth alone.

    Raises
    ------
    ValueError
        For labels of cells of a radar whose frames have no range-velocity map: of several waveforms, chirps at unequal
        intervals, no sweep, or transmitters that send at once.

    See Also
    --------
    dataset.labels_of : The labels.

    Examples
    --------
    >>> layouts = rc.dataset.dims_of(rc.bgt60tr13c(), ["ball", "wall"], rc.dataset.Labels(cells=True))
    >>> layouts["strongest_body"].dims, layouts["strongest_body"].shape
    (('doppler', 'range'), (64, 65))
    """
    settings, names = _checked(settings), _checked_names(body_names)
    lengths = {"body": len(names), "xyz": 3, "joint": len(JOINTS)}
    layouts: dict[str, LabelLayout] = {}

    def add(name: str, dims: tuple[str, ...], units: str, long_name: str, **more: Any) -> None:
        attrs = {"units": units, "long_name": long_name, **more}
        layouts[name] = LabelLayout(dims, tuple(lengths[axis] for axis in dims), np.dtype(np.float64), attrs)

    if settings.truth:
        point = {"description": "nearest visible point, from the centre of the array; NaN: not visible"}
        add("true_range", ("body",), "m", "true range", **point)
        add("true_velocity", ("body",), "m/s", "true velocity", **point, positive="receding positive")
        add("true_azimuth", ("body",), "rad", "true azimuth", **point, positive="positive to the left")
        add("true_elevation", ("body",), "rad", "true elevation", **point, positive="positive up")
    if settings.boxes:
        add("box_center", ("body", "xyz"), "m", "middle of the box around the mesh", description=_AXES)
        add("box_size", ("body", "xyz"), "m", "edges of the box around the mesh", description=_AXES)
    if settings.visibility:
        add("visibility", ("body",), "1", "share of the energy of the echo alone that is received")
    if settings.joints:
        joints = {"description": _AXES, "joints": list(JOINTS)}
        add("joint_position", ("body", "joint", "xyz"), "m", "position of the joint", **joints)
    if settings.cells:
        echoes.require_map(radar)
        if len(names) > _MOST_NAMES:
            raise ValueError(f"body_names: expected at most {_MOST_NAMES} for labels of cells, got {len(names)}")
        text = (
            f"index into body; -1 below the mean power of the noise, {echoes.DEPTH_DB:g} dB below the strongest cell, "
            f"and where two bodies are within {echoes.TIE_DB:g} dB"
        )
        attrs = {"units": "1", "long_name": "body with the strongest echo", "description": text}
        shape, dtype = echoes.map_shape(radar), np.dtype(np.int16)
        layouts["strongest_body"] = LabelLayout(("doppler", "range"), shape, dtype, attrs)
    return layouts


def labels_of(
    simulator: Simulator, frame: Frame, body_names: Sequence[str], settings: Labels | None = None
) -> dict[str, Labelled]:
    """Labels of a frame that a simulator has made.

    Parameters
    ----------
    simulator : Simulator
        Which made the frame.
    frame : Frame
    body_names : sequence of str
        Names of the axis `body`. A name stands for the body of that name, or for all that are called ``NAME/part``: a
        person, an arm, a mesh file of several materials. Names of what is not in the scene are fine.
    settings : Labels, optional
        Default: the truth alone.

    Returns
    -------
    labels : dict of str to Labelled

    Raises
    ------
    ValueError
        For a body of the scene without a name, and as `dims_of`.

    See Also
    --------
    dataset.Labels : Meaning of each label.
    dataset.dims_of : Their shapes.
    Simulator.frame : Makes a frame.

    Examples
    --------
    >>> scene = rc.Scene([rc.Body(rc.shapes.box(0.2), motion=rc.Pose([2.0, 0.0, 0.0]), name="box")])
    >>> simulator = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16))
    >>> settings = rc.dataset.Labels(boxes=True, visibility=True)
    >>> labels = rc.dataset.labels_of(simulator, simulator.frame(), ["box", "cat"], settings)
    >>> labels["true_range"].values.round(2).tolist(), labels["visibility"].values.tolist()
    ([1.9, nan], [1.0, nan])
    >>> labels["box_size"].values[0].round(3).tolist()
    [0.2, 0.2, 0.2]
    """
    check.instance("simulator", simulator, Simulator)
    key = (_checked_names(body_names), _checked(settings))
    labellers = _LABELLERS.setdefault(simulator, {})
    if key not in labellers:
        labellers[key] = _Labeller(simulator, *key)
    return labellers[key].of(frame)


class _Labeller:
    """Makes the labels of a simulator's frames; keeps what is the same for all of them."""

    def __init__(self, simulator: Simulator, names: tuple[str, ...], settings: Labels) -> None:
        scene, motion = simulator.scene, simulator.radar_motion
        self._settings, self._scene = settings, scene
        self._layouts = dims_of(simulator.radar, names, settings)
        self._members: Members = _members_of(names, scene.names)
        self._owners = _owners_of(self._members, len(scene.names))
        # The truth alone needs none of these.
        self._needs_places = settings.boxes or settings.visibility or settings.joints
        self._needs_echoes = settings.visibility or settings.cells
        if self._needs_places:
            self._places = _Places(scene, Pose() if motion is None else as_motion("radar_motion", motion))
        if settings.joints:
            self._people = _People(scene, names)
        if self._needs_echoes:
            self._caster = echoes.Caster(simulator)
        if settings.visibility:
            self._is_rough = echoes.are_rough(scene, simulator.radar.waveform.center_frequency)

    def of(self, frame: Frame) -> dict[str, Labelled]:
        """Labels of a frame, as `labels_of` has them."""
        settings, parts = self._settings, self._scene.parts
        values: dict[str, NDArray[Any]] = {}
        if settings.truth:
            values |= self._truth(frame)
        time = frame.time + frame.radar.middle
        if self._needs_places:
            placed = self._places.at(time)
        if settings.boxes or settings.visibility:
            boxes = _boxes_of(parts, placed)
        if settings.boxes:
            low, high = _united(boxes, self._members).swapaxes(0, 1)
            values |= {"box_center": 0.5 * (low + high), "box_size": high - low}
        if self._needs_echoes:
            echo = self._caster.echo(time)
        if settings.visibility:
            seen_from = boxes - frame.radar.array_center
            values["visibility"] = echoes.visibilities(
                self._caster, echo, time, self._members, self._scene, self._is_rough, seen_from
            )
        if settings.cells:
            values["strongest_body"] = echoes.strongest_bodies(echo, self._owners, frame.radar)
        if settings.joints:
            values["joint_position"] = self._people.joints(placed)
        return {name: Labelled(layout.dims, values[name], layout.attrs) for name, layout in self._layouts.items()}

    def _truth(self, frame: Frame) -> dict[str, Floats]:
        """Truth of the nearest visible body of every label."""
        truth = frame.truth
        if truth is None or truth.names != self._scene.names:
            got = "none" if truth is None else ", ".join(truth.names) or "no body"
            raise ValueError(f"frame: expected the truth of the simulator's bodies, got {got}")
        rows = np.array([getattr(truth, name) for name in TRUTH_FIELDS])
        labels = np.full((len(TRUTH_FIELDS), len(self._members)), np.nan)
        for label, numbers in enumerate(self._members):
            if len(seen := numbers[~np.isnan(truth.range[numbers])]) > 0:
                labels[:, label] = rows[:, seen[truth.range[seen].argmin()]]
        return {f"true_{name}": row for name, row in zip(TRUTH_FIELDS, labels, strict=True)}


_LABELLERS: WeakKeyDictionary[Simulator, dict[tuple[tuple[str, ...], Labels], _Labeller]] = WeakKeyDictionary()
"""Of the simulators in use."""


def _checked(settings: object) -> Labels:
    if settings is None:
        return Labels()
    return check.instance("settings", settings, Labels)


def _checked_names(body_names: Sequence[str]) -> tuple[str, ...]:
    """Names of the axis `body`, all different."""
    if isinstance(body_names, str):
        raise TypeError(f"body_names: expected one name per body, got the text {body_names!r}")
    names = tuple(map(str, body_names))
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"body_names: expected names that differ, got {twice!r} twice")
    return names


def _members_of(names: tuple[str, ...], scene_names: tuple[str, ...]) -> Members:
    """Bodies of each name: the body with that name, or all ``NAME/part`` of a person, an arm, a mesh file."""
    members = tuple(
        np.array([i for i, other in enumerate(scene_names) if other == name or other.startswith(f"{name}/")], np.intp)
        for name in names
    )
    known = set(np.concatenate([np.zeros(0, np.intp), *members]).tolist())
    for i, other in enumerate(scene_names):
        if i not in known:
            raise ValueError(
                f"body_names: expected a name for every body of the scene, got none for {other!r}; "
                f"{check.near_names(other, names)}"
            )
    return members


def _owners_of(members: Members, num_bodies: int) -> NDArray[np.intp]:
    """Label of every body of the scene, (body,): of several, the label with the fewest bodies."""
    owners = np.zeros(num_bodies, dtype=np.intp)
    for label in sorted(range(len(members)), key=lambda label: -len(members[label])):
        owners[members[label]] = label
    return owners


@dataclass(frozen=True, eq=False)
class _Placed:
    """Bodies and points at a time, seen from the sensor.

    Attributes
    ----------
    time : float
        [s].
    meshes : (mesh, 3, 4) float64
        ``[rotation | position]`` of the bodies with meshes: body to sensor frame.
    points : (point, 3) float64
        Point targets in the sensor frame [m].
    """

    time: float
    meshes: Floats
    points: Floats


class _Places:
    """Poses of the bodies of a scene in the sensor frame, at any time."""

    def __init__(self, scene: Scene, sensor_motion: Motion) -> None:
        self._parts = scene.parts
        self._motions = Motions([*(body.motion for body in scene.parts.meshed), sensor_motion])

    def at(self, time: float) -> _Placed:
        """At a time [s]."""
        poses = self._motions.poses_at(np.array([time]))[0]
        to_sensor, origin = poses[-1, :, :3].T, poses[-1, :, 3]
        meshes = poses[:-1].copy()
        meshes[..., 3] -= origin
        points = self._parts.positions + time * self._parts.velocities - origin
        return _Placed(time, to_sensor @ meshes, points @ to_sensor.T)


def _boxes_of(parts: Parts, placed: _Placed) -> Floats:
    """Lowest and highest corner of every body of the scene in the sensor frame, (body, 2, 3) [m].

    Of the vertices at that time, also of deforming bodies: exact for flat facets. A point
    target's box is the point.
    """
    boxes = np.empty((len(parts.meshed) + len(parts.point_numbers), 2, 3))
    for mesh, (number, pose) in enumerate(zip(parts.mesh_numbers, placed.meshes, strict=True)):
        # One row per axis: the extremes of rows are several times faster than of columns.
        axes = pose[:, :3] @ parts.vertices_at(mesh, placed.time).T
        boxes[number] = axes.min(axis=1, initial=np.inf), axes.max(axis=1, initial=-np.inf)
        boxes[number] += pose[:, 3]
    boxes[parts.point_numbers] = placed.points[:, None]
    return boxes


def _united(boxes: Floats, members: Members) -> Floats:
    """Box around the bodies of every label, (label, 2, 3) [m]; NaN where there are none."""
    around = np.full((len(members), 2, 3), np.nan)
    for label, numbers in enumerate(members):
        if len(numbers) > 0:
            around[label] = boxes[numbers, 0].min(axis=0), boxes[numbers, 1].max(axis=0)
    return around


class _People:
    """The people of a scene: bodies of `models.Human`, by the names of all their segments."""

    def __init__(self, scene: Scene, names: tuple[str, ...]) -> None:
        """Of a scene, in the rows of the labels `names`: the person's, or its pelvis' where segments have rows."""
        # Joints are origins of bodies with meshes, which poses count by themselves.
        meshes = {scene.names[number]: mesh for mesh, number in enumerate(scene.parts.mesh_numbers)}
        self._num_labels = len(names)
        self._meshes: dict[int, list[int]] = {}
        for label, name in enumerate(names):
            person = name.removesuffix("/pelvis")
            if all(f"{person}/{segment}" in meshes for segment in SEGMENTS):
                self._meshes[label] = [meshes[f"{person}/{segment}"] for segment in _OF_SEGMENTS.values()]

    def joints(self, placed: _Placed) -> Floats:
        """Positions of the joints in the sensor frame, (label, joint, 3) [m]; NaN of labels that are no people."""
        positions = np.full((self._num_labels, len(JOINTS), 3), np.nan)
        for label, meshes in self._meshes.items():
            positions[label] = placed.meshes[meshes, :, 3]
        return positions
