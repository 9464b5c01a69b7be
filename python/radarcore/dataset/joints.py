"""Joints of people in the sensor frame."""

from __future__ import annotations

import numpy as np

from radarcore.dataset.bodies import Floats, Placed
from radarcore.models.people.figure import SEGMENTS
from radarcore.scene.scene import Scene

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
