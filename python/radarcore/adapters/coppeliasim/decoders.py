"""Answers of CoppeliaSim, decoded: grey images, matrices and meshes; depth images by `radarcore.adapters.images`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.pose import Pose


def from_grey_buffer(data: bytes, resolution: Sequence[int]) -> NDArray[np.uint8]:
    """Grey image of ``sim.getVisionSensorImg(handle, 1)``, (rows, columns) uint8; row 0 on top.

    `data` has the bottom row first, a byte per pixel; `resolution` is (columns, rows).

    See Also
    --------
    adapters.images.from_coppeliasim : Depth images.

    Examples
    --------
    >>> rc.adapters.coppeliasim.from_grey_buffer(bytes([0, 0, 255, 255]), (2, 2)).tolist()
    [[255, 255], [0, 0]]
    """
    sides = check.array("resolution", resolution, (2,))
    columns, rows = (check.count("resolution", int(side)) for side in sides)
    grey = np.frombuffer(data, np.uint8)
    if grey.size != rows * columns:
        raise ValueError(
            f"data: expected {rows * columns} bytes for {columns} x {rows} grey pixels, got {grey.size}; "
            "options=1 asks for grey"
        )
    return grey.reshape(rows, columns)[::-1].copy()


def from_matrix(matrix: ArrayLike) -> Pose:
    """Pose of an object by ``sim.getObjectMatrix(handle, sim.handle_world)``: 12 numbers, three rows of four.

    See Also
    --------
    Pose.from_matrix : Of a matrix in rows.

    Examples
    --------
    >>> rc.adapters.coppeliasim.from_matrix([1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 1.2]).position.tolist()
    [0.5, 0.0, 1.2]
    """
    return Pose.from_matrix(check.array("matrix", matrix, (12,)).reshape(3, 4))


def from_shape_viz(items: Sequence[Mapping[str, Any]]) -> Mesh:
    """Mesh of a shape in its own coordinates, of what ``sim.getShapeViz(handle, index)`` returns for index 0, 1, ...

    A compound shape has several items; they become one mesh.

    See Also
    --------
    Mesh : What comes back.
    adapters.coppeliasim.CoppeliaSim.bodies : Asks for all shapes.

    Examples
    --------
    >>> item = {"vertices": [0, 0, 0, 1, 0, 0, 0, 1, 0], "indices": [0, 1, 2]}
    >>> rc.adapters.coppeliasim.from_shape_viz([item]).triangles.tolist()
    [[0, 1, 2]]
    """
    vertices, triangles, num_vertices = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for number, item in enumerate(items):
        for name in ("vertices", "indices"):
            if name not in item:
                raise ValueError(
                    f"items: expected {name!r} in item {number}, got {', '.join(map(repr, item)) or 'none'}"
                )
        vertices.append(np.asarray(item["vertices"], dtype=np.float64).reshape(-1, 3))
        triangles.append(np.asarray(item["indices"], dtype=np.int64).reshape(-1, 3) + num_vertices)
        num_vertices += len(vertices[-1])
    return Mesh(np.concatenate(vertices), np.concatenate(triangles))
