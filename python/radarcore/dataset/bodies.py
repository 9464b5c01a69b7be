"""Bodies at one time in the sensor frame: the label of each, poses, boxes, and joints of people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.models.people.figure import SEGMENTS
from radarcore.motion.group import Motions
from radarcore.motion.protocol import Motion
from radarcore.recording.frame import Frame
from radarcore.scene.scene import Parts, Scene

Floats = NDArray[np.float64]
Members = tuple[NDArray[np.intp], ...]
"""Per label the numbers in the scene of the bodies that it stands for; none where it is absent."""


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
"""The segment whose origin, its upper joint, is the joint; the trunk has that of the pelvis."""

JOINTS = tuple(_OF_SEGMENTS)
"""Names of the joints in the order of the axis `joint`.

The pelvis is midway between the hips (with a man's meshes: at his waist), the neck between the shoulders, the head at
the height of the chin; the others are the joints of the limbs.
"""


def checked_names(body_names: Sequence[str]) -> tuple[str, ...]:
    """Names of the axis `body`, all different."""
    if isinstance(body_names, str):
        raise TypeError(f"body_names: expected one name per body, got the text {body_names!r}")
    names = tuple(map(str, body_names))
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"body_names: expected names that differ, got {twice!r} twice")
    return names


def members_of(names: tuple[str, ...], scene_names: tuple[str, ...]) -> Members:
    """Bodies that each name stands for: the one of that name, or all ``NAME/part`` of a person, an arm, a mesh file."""
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


def owners_of(members: Members, num_bodies: int) -> NDArray[np.intp]:
    """Label of every body of the scene, (body,): of several that it has, the one that stands for the fewest."""
    owners = np.zeros(num_bodies, dtype=np.intp)
    for label in sorted(range(len(members)), key=lambda label: -len(members[label])):
        owners[members[label]] = label
    return owners


def middle_of(frame: Frame) -> float:
    """Time for which truth and labels hold [s]: the middle of the frame, of several sub-sequences of the first."""
    return frame.time + frame.radar.middle


@dataclass(frozen=True, eq=False)
class Placed:
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


class Places:
    """Poses of the bodies of a scene in the sensor frame, at any time."""

    def __init__(self, scene: Scene, sensor_motion: Motion) -> None:
        self._parts = scene.parts
        self._motions = Motions([*(body.motion for body in scene.parts.meshed), sensor_motion])

    def at(self, time: float) -> Placed:
        """At a time [s]."""
        poses = self._motions.poses_at(np.array([time]))[0]
        to_sensor, origin = poses[-1, :, :3].T, poses[-1, :, 3]
        meshes = poses[:-1].copy()
        meshes[..., 3] -= origin
        points = self._parts.positions + time * self._parts.velocities - origin
        return Placed(time, to_sensor @ meshes, points @ to_sensor.T)


def boxes_of(parts: Parts, placed: Placed) -> Floats:
    """Lowest and highest corner of every body of the scene in the sensor frame, (body, 2, 3) [m].

    Of the vertices where they are at that time, those of bodies that deform too: exact for flat facets. A point
    target's box is the point.
    """
    boxes = np.empty((len(parts.meshed) + len(parts.point_numbers), 2, 3))
    for mesh, (number, pose) in enumerate(zip(parts.mesh_numbers, placed.meshes, strict=True)):
        # One row per axis: the extremes of rows are found several times faster than those of columns.
        axes = pose[:, :3] @ parts.vertices_at(mesh, placed.time).T
        boxes[number] = axes.min(axis=1, initial=np.inf), axes.max(axis=1, initial=-np.inf)
        boxes[number] += pose[:, 3]
    boxes[parts.point_numbers] = placed.points[:, None]
    return boxes


def united(boxes: Floats, members: Members) -> Floats:
    """Box around the bodies of every label, (label, 2, 3) [m]; NaN where there are none."""
    around = np.full((len(members), 2, 3), np.nan)
    for label, numbers in enumerate(members):
        if len(numbers) > 0:
            around[label] = boxes[numbers, 0].min(axis=0), boxes[numbers, 1].max(axis=0)
    return around


class People:
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

    def joints(self, placed: Placed) -> Floats:
        """Positions of the joints in the sensor frame, (label, joint, 3) [m]; NaN of labels that are no people."""
        positions = np.full((self._num_labels, len(JOINTS), 3), np.nan)
        for label, meshes in self._meshes.items():
            positions[label] = placed.meshes[meshes, :, 3]
        return positions
