"""Whose parts the bodies of a scene are, and where they are in the sensor frame at one time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.motion.group import Motions
from radarcore.motion.protocol import Motion
from radarcore.recording.frame import Frame
from radarcore.scene.scene import Scene

Floats = NDArray[np.float64]
Members = tuple[NDArray[np.intp], ...]
"""Per label the numbers in the scene of the bodies that it stands for; none where it is absent."""


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
