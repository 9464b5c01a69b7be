"""Triangles that a file lists in both windings, so that a viewer shows both sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.edges import position_hashes


def first_listings(vertices: NDArray[np.float64], triangles: NDArray[np.uint32]) -> NDArray[np.bool_] | None:
    """Triangles to keep, (triangle,), so that no surface is listed in both windings; None if no two triangles coincide.

    The kept winding fits its neighbours and faces outwards on a closed surface. Both windings stay on a surface that
    meets others at an edge, where two bodies may share a face, and of a triangle without neighbours.
    """
    # Triangles coincide if the sums of their corners' hashes are equal; a place is a set of such triangles.
    hashes = position_hashes(vertices)
    keys = hashes[triangles].sum(axis=1, dtype=np.uint64)
    in_order = np.sort(keys)
    if not (in_order[1:] == in_order[:-1]).any():
        return None
    from scipy.sparse import coo_array  # takes longer to load than the rest
    from scipy.sparse.csgraph import connected_components

    def components(first: NDArray[np.int64], second: NDArray[np.int64], num_nodes: int) -> NDArray[np.int64]:
        graph = coo_array((np.ones(len(first), np.int8), (first, second)), (num_nodes, num_nodes))
        labels: NDArray[np.int64] = connected_components(graph, directed=False)[1].astype(np.int64)
        return labels

    _, places = np.unique(keys, return_inverse=True)
    corners = np.unique(hashes, return_inverse=True)[1][triangles].astype(np.int64)
    is_degenerate = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    windings = np.sign(np.diff(corners, axis=1, append=corners[:, :1])).sum(axis=1)  # of the places: 1 or -1
    is_doubled = np.bincount(places, windings > 0).astype(bool) & np.bincount(places, windings < 0).astype(bool)

    # Number of places that meet at each edge.
    after, owners = np.roll(corners, -1, axis=1), np.repeat(np.arange(len(triangles)), 3)
    ends = np.minimum(corners, after) * len(vertices) + np.maximum(corners, after)
    edges = np.unique(ends, return_inverse=True)[1].ravel()
    num_places = int(places.max()) + 1
    pairs = np.stack(np.divmod(np.unique(edges * num_places + places[owners]), num_places), axis=-1)
    num_meeting = np.bincount(pairs[:, 0])
    lowest = pairs[np.cumsum(num_meeting) - num_meeting, 1]

    # Connected surfaces of places with both windings, bounded by edges where more than two meet.
    inner = (num_meeting[pairs[:, 0]] == 2) & is_doubled[pairs[:, 1]]
    surfaces = components(pairs[inner, 1], num_places + pairs[inner, 0], num_places + len(num_meeting))[:num_places]
    is_isolated = np.bincount(surfaces, is_doubled) > 1
    is_isolated[surfaces[pairs[num_meeting[pairs[:, 0]] > 2, 1]]] = False
    is_merged: NDArray[np.bool_] = (is_doubled & is_isolated[surfaces])[places] & ~is_degenerate

    # Triangles belong to one side if they run through their common edge in opposite directions.
    is_forward = (corners < after).ravel() ^ (places[owners] != lowest[edges])
    crossed = num_meeting[edges] == 2
    nodes = len(triangles) + 2 * edges + is_forward
    sides = components(owners[crossed], nodes[crossed], len(triangles) + 2 * len(num_meeting))[: len(triangles)]
    with np.errstate(all="ignore"):  # infinite coordinates are refused later
        a, b, c = (vertices[triangles[:, i]] - vertices.mean(axis=0) for i in range(3))
        volumes = np.bincount(sides, (a * np.cross(b, c)).sum(axis=1))[sides]

    # Keep the triangle of the larger side of every place, or the first.
    order = np.lexsort((np.arange(len(triangles)), -volumes, places))
    kept = ~is_merged
    kept[order[np.diff(places[order], prepend=-1) > 0]] = True
    return kept
