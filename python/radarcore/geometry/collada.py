"""COLLADA files (.dae), read by pycollada: all triangles of the scene in metres, with z up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Axes of a file (columns: its x, y and z) in those with z up, by COLLADA 1.4.1, table of <up_axis>: right, up and
# towards the viewer are -y, x, z (X_UP), x, y, z (Y_UP) and x, z, -y (Z_UP).
TO_Z_UP = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "Z_UP": np.eye(3),
}


def load_collada(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (n, 3) [m] and triangles (m, 3) of all geometry that the scene of a file shows.

    Transforms of the nodes, the unit and the up axis of the file are applied; one without the latter has y up.
    Polygons become fans of triangles; lines, materials and skins are left out. Parts that are mirrored by their
    transforms keep their normals outwards.

    Raises
    ------
    ImportError
        Without pycollada; what else it raises is about the content of the file.
    """
    try:
        from collada import Collada, common, polylist, triangleset
    except ImportError as error:
        raise ImportError(f"{path}: reading .dae files needs pycollada: pip install radarcore[mesh]") from error
    # Textures that are missing, cameras of other programs and the like are no matter.
    document = Collada(str(path), ignore=[common.DaeUnsupportedError, common.DaeBrokenRefError])
    about = document.assetInfo
    to_metres = (1.0 if about.unitmeter is None else float(about.unitmeter)) * TO_Z_UP[about.upaxis]
    vertices, triangles, num_vertices = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for geometry in [] if document.scene is None else document.scene.objects("geometry"):
        placed = np.asarray(geometry.matrix, dtype=np.float64)
        linear = to_metres @ placed[:3, :3]
        is_mirrored = np.linalg.det(linear) < 0.0
        for part in geometry.original.primitives:
            if isinstance(part, polylist.Polylist):
                part = part.triangleset()  # the same surface
            if not isinstance(part, triangleset.TriangleSet) or part.vertex is None or len(part) == 0:
                continue
            vertices.append(np.asarray(part.vertex, dtype=np.float64) @ linear.T + to_metres @ placed[:3, 3])
            rows = np.asarray(part.vertex_index, dtype=np.int64) + num_vertices
            triangles.append(rows[:, ::-1] if is_mirrored else rows)
            num_vertices += len(vertices[-1])
    return np.concatenate(vertices), np.concatenate(triangles)
