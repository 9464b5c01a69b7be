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
from radarcore.dataset.bodies import (
    JOINTS,
    Floats,
    Members,
    People,
    Places,
    boxes_of,
    checked_names,
    members_of,
    middle_of,
    owners_of,
    united,
)
from radarcore.geometry.pose import Pose
from radarcore.motion.protocol import as_motion
from radarcore.radar.radar import Radar
from radarcore.recording.frame import TRUTH_FIELDS, Frame
from radarcore.simulate.simulator import Simulator

_MOST_NAMES = 2**15 - 1
"""Largest number of names that an int16 counts."""

_AXES = "axes of the sensor: x forward, y left, z up"


@dataclass(frozen=True)
class Labels:
    """Which labels the frames of a dataset have.

    All hold for the middle of a frame, as its truth does.

    Parameters
    ----------
    truth : bool
        ``true_range``, ``true_velocity``, ``true_azimuth``, ``true_elevation``, (body,): those of `Truth`, of a person
        or an arm that has one name those of its nearest visible part. NaN of what is not there or not visible.
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
    Truth : What is true of bodies.

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
    settings, names = _checked(settings), checked_names(body_names)
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
    dataset.Labels : What each of them is.
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
    key = (checked_names(body_names), _checked(settings))
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
        self._members: Members = members_of(names, scene.names)
        self._owners = owners_of(self._members, len(scene.names))
        # The truth alone needs none of these.
        self._needs_places = settings.boxes or settings.visibility or settings.joints
        self._needs_echoes = settings.visibility or settings.cells
        if self._needs_places:
            self._places = Places(scene, Pose() if motion is None else as_motion("radar_motion", motion))
        if settings.joints:
            self._people = People(scene, names)
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
        time = middle_of(frame)
        if self._needs_places:
            placed = self._places.at(time)
        if settings.boxes or settings.visibility:
            boxes = boxes_of(parts, placed)
        if settings.boxes:
            low, high = united(boxes, self._members).swapaxes(0, 1)
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
            got = "none" if truth is None else ", ".join(truth.names) or "that of no body"
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
