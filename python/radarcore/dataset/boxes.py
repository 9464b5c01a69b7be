"""Boxes around bodies: axis-aligned in the sensor frame, of the vertices of their meshes."""

from __future__ import annotations

import numpy as np

from radarcore.dataset.bodies import Floats, Members, Placed
from radarcore.scene.scene import Parts


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
