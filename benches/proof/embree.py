"""Distances to the facets of a scene by Embree, from embreex, of the extras of the benches."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from proof.dense import Camera
from proof.measure import Reals

INSTALL_HINT = "embreex is not installed, its rows are left out: pip install -r requirements/bench.txt"

BATCH = 1 << 20
"""Rays that are cast together."""


def is_available() -> bool:
    """True if embreex is installed."""
    try:
        import embreex  # noqa: F401
    except ImportError:
        return False
    return True


@lru_cache(maxsize=1)
def embree_scene(scene: rc.Scene, origin: tuple[float, ...]) -> tuple[Any, NDArray[np.int32]]:
    """Scene at rest, relative to a point, as Embree has it, and the body of every triangle.

    Coordinates are in single precision: a fifth of a micrometre at 3 m, a thousandth of a radian.
    """
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    vertices, triangles, bodies, first = [], [], [], 0
    for number, body in enumerate(scene.bodies):
        vertices.append(body.motion.apply(body.mesh.vertices) - origin)
        triangles.append(body.mesh.triangles.astype(np.int64) + first)
        bodies.append(np.full(len(body.mesh.triangles), number, dtype=np.int32))
        first += len(body.mesh.vertices)
    embree = EmbreeScene(robust=True)
    TriangleMesh(embree, np.concatenate(vertices).astype(np.float32), np.concatenate(triangles).astype(np.int32))
    return embree, np.concatenate([*bodies, np.array([-1], dtype=np.int32)])


def embree_facets(scene: rc.Scene, _: rc.Radar, camera: Camera) -> tuple[Reals, NDArray[np.int32]]:
    """Distances by Embree to the facets as they are."""
    embree, bodies = embree_scene(scene, tuple(camera.pose.position))
    (rows, columns), (half_width, half_height) = camera.shape, camera.half
    u = half_width * (1.0 - (2.0 * np.arange(columns) + 1.0) / columns)
    v = half_height * (1.0 - (2.0 * np.arange(rows) + 1.0) / rows)
    y, z = np.meshgrid(u, v)
    directions = np.stack([np.ones_like(y), y, z], axis=-1).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = (directions @ camera.pose.rotation.T).astype(np.float32)
    distance, triangle = np.empty(len(directions)), np.empty(len(directions), dtype=np.int64)
    for first in range(0, len(directions), BATCH):
        some = slice(first, first + BATCH)
        hits = embree.run(np.zeros_like(directions[some]), directions[some], query="INTERSECT", output=1)
        distance[some], triangle[some] = hits["tfar"], hits["primID"]
    return distance.reshape(camera.shape), bodies[triangle].reshape(camera.shape)
