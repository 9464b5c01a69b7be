"""Surfaces in depth images: normals from depth, and range rates of pixels that show one surface in two images."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.geometry.camera import Camera

Values = NDArray[np.float64]

# Neighbouring pixels belong to one surface when 1/depth changes from one to the other by no more than this times what
# it changes by between the next pixels on the flatter side, or as it does on one side, up to this fraction of itself.
_STEEPER = 3.0
_STEP = 2e-3
# A difference is one-sided where the two-sided one bends this many times more: at creases.
_BEND = 4.0

# Steps that sensors write integers of [m]; how close to multiples of them how many different values have to be (by
# chance a fiftieth of them is).
_DECIMAL_STEPS = (1e-2, 1e-3, 1e-4)
_DECIMAL_SLACK, _LEAST_DISTINCT = 0.01, 5


def decimal_step(depth: Values) -> float:
    """Step of an image in whole millimetres or the like [m]; zero where there is none."""
    distinct = np.unique(depth[np.isfinite(depth)])
    if len(distinct) < _LEAST_DISTINCT:
        return 0.0
    for step in _DECIMAL_STEPS:
        count = distinct / step
        if (np.abs(count - np.round(count)) < _DECIMAL_SLACK).mean() >= 1.0 - _DECIMAL_SLACK:
            return step
    return 0.0


def relative_noise(given: NDArray[Any], depth: Values, step: float) -> Values:
    """Uncertainty of every depth relative to itself: the rounding of its type, or the step of the image [m]."""
    rounding = 4.0 * np.finfo(given.dtype).eps if given.dtype.kind == "f" else 0.0
    known = np.where(np.isfinite(depth), depth, 1.0)
    return np.maximum(max(rounding, 1e-12), step / known)


def normals(distance: Values, camera: Camera, noise: Values) -> Values:
    """Unit normals towards the sensor, (rows, columns, 3), zero where no neighbour belongs to the same surface.

    `distance` along the ray, (rows, columns) [m], infinite where nothing returns; `noise`: its relative uncertainty.
    With q = 1/(planar depth) a plane n.x = d has q = (n_x + n_y u + n_z v)/d, affine in the image, so differences of q
    give its normal exactly for any pixel spacing.
    """
    rows, columns = distance.shape
    u, v = camera.plane(rows, columns)
    q = _inverse(distance) * camera.slant(rows, columns)
    q_u = -camera.fx * _gradient(q, noise)
    q_v = -camera.fy * _gradient(q.T, noise.T).T
    towards = -np.stack([q - u * q_u - v[:, None] * q_v, q_u, q_v], axis=-1)
    length = np.linalg.norm(towards, axis=-1, keepdims=True)
    is_known = length > 0.0  # not so for NaN
    unit: Values = np.divide(towards, length, out=np.zeros_like(towards), where=is_known)
    return unit


def range_rate(distance: Values, previous: Values, noise: Values) -> Values:
    """Change of distance between two images [m], NaN where a pixel shows another object than before.

    Stetco et al., ICRA 2020, eq. (13), without its silhouettes: where an object has come between or gone away the
    difference is the gap between two objects. Such pixels form strips along edges: joined to one neighbour in the new
    image and to the other in the old one, with a jump of the difference at both. It misses pixels near the contact of
    an object with its ground, where gaps are about as large as motions.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    is_known = np.isfinite(distance) & np.isfinite(previous)
    change = np.where(is_known, 1.0, np.nan)
    change[is_known] *= distance[is_known] - previous[is_known]

    # Near the contact of an object with the surface behind it the gap falls to zero, and a strip merges with the rest:
    # it is cut into octaves of the change.
    with np.errstate(divide="ignore"):
        octave = np.maximum(np.floor(np.log2(np.abs(change) / (_STEP * np.where(is_known, distance, 1.0)))), 0.0)

    # Edges between neighbours: joined in both images, or in one only and with a jump of the difference.
    number = np.arange(distance.size).reshape(distance.shape)
    pairs, joined, torn = [], [], []
    for turned in (False, True):
        new, old, spread, difference, part = (
            a.T if turned else a for a in (_inverse(distance), _inverse(previous), noise, change, octave)
        )
        ids = number.T if turned else number
        in_new, in_old = _is_continuous(new, spread), _is_continuous(old, spread)
        known = np.isfinite(difference[:, 1:]) & np.isfinite(difference[:, :-1])
        pairs.append(np.stack([ids[:, :-1][known], ids[:, 1:][known]]))
        jump = np.abs(np.diff(difference, axis=1)) * np.fmin(new[:, 1:], new[:, :-1])
        joined.append((in_new & in_old & (np.diff(part, axis=1) == 0.0))[known])
        torn.append(((in_new ^ in_old) & (jump > _STEP + 4.0 * spread[:, 1:]))[known])
    (p, q), is_joined, is_torn = np.concatenate(pairs, axis=1), np.concatenate(joined), np.concatenate(torn)
    if not is_torn.any():
        return change

    # Regions of pixels that show one surface in both images.
    graph = coo_array((np.ones(is_joined.sum(), np.int8), (p[is_joined], q[is_joined])), shape=(distance.size,) * 2)
    num_regions, region = connected_components(graph, directed=False)

    # A strip is torn from most of its surroundings, and its difference is the larger one.
    across = region[p] != region[q]
    size = np.abs(change).ravel()
    larger = np.where(size[p] > size[q], p, q)
    ends = np.concatenate([p[across], q[across]])
    border = np.bincount(region[ends], minlength=num_regions)
    is_outer = across & is_torn
    false = np.bincount(region[larger[is_outer]], minlength=num_regions)
    is_strip = (false > 0) & (2 * false >= border)
    change[is_strip[region].reshape(change.shape)] = np.nan
    return change


def _inverse(distance: Values) -> Values:
    """1/distance, NaN where nothing returns."""
    return np.where(np.isfinite(distance), 1.0 / distance, np.nan)


def _is_continuous(q: Values, noise: Values) -> NDArray[np.bool_]:
    """True where a pixel and its right neighbour belong to one surface, (rows, columns - 1)."""
    step = np.diff(q, axis=1)
    beside = np.full((len(q), q.shape[1] + 1), np.nan)
    beside[:, 1:-1] = step
    before, behind = beside[:, :-2], beside[:, 2:]
    flatter = np.nan_to_num(np.fmin(np.abs(before), np.abs(behind)))
    tolerated = np.maximum(_STEP, 4.0 * noise[:, 1:]) * np.fmax(q[:, 1:], q[:, :-1])
    goes_on = np.fmin(np.abs(step - before), np.abs(step - behind)) <= tolerated
    return np.asarray((np.abs(step) <= _STEEPER * flatter + tolerated) | goes_on)  # not so for NaN


def _gradient(q: Values, noise: Values) -> Values:
    """Change of q per column, from the neighbours on the same surface; NaN where there is none."""
    step = np.where(_is_continuous(q, noise), np.diff(q, axis=1), np.nan)
    edge = np.full((len(q), 1), np.nan)
    ahead, behind = np.hstack([step, edge]), np.hstack([edge, step])
    bend = np.abs(ahead - behind)

    # Away from a crease the straight side is right (essentially non-oscillatory differences).
    bend_ahead = np.nan_to_num(np.hstack([bend[:, 1:], edge]), nan=np.inf)
    bend_behind = np.nan_to_num(np.hstack([edge, bend[:, :-1]]), nan=np.inf)
    straighter = np.where(bend_ahead < bend_behind, ahead, behind)
    is_crease = bend > _BEND * np.minimum(bend_ahead, bend_behind) + 8.0 * noise * q
    both = np.where(is_crease, straighter, 0.5 * (ahead + behind))
    one = np.where(np.isnan(ahead), behind, ahead)
    return np.where(np.isnan(bend), one, both)
