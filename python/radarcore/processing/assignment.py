"""Which detection belongs to which track: gates, and the most likely assignment within them."""

from __future__ import annotations

from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.kalman import Array, inverse_of_measured

_FEW = 64
"""Pairs of tracks and detections that are all worked out: leaving most of them out takes longer."""


@cache
def gate_limits(probability: float) -> Array:
    """Squared Mahalanobis distances within which a detection of m values lies with a probability, m = 0 to 4."""
    from scipy.special import chdtri  # here: importing radarcore imports numpy and nothing heavier

    return np.concatenate([[0.0], chdtri(np.arange(1, 5), 1.0 - probability)])


class Pairs(NamedTuple):
    """Tracks and the detections that belong to them."""

    tracks: NDArray[np.int64]
    """Indices (pair,)."""
    detections: NDArray[np.int64]
    """Indices (pair,)."""
    inverse: Array
    """Inverses of the covariances of the innovations (pair, m, m), see `inverse_of_measured`."""


def assign(innovation: Array, spread: Array, noise: Array, probability: float) -> Pairs:
    """Pairs of tracks and detections: global nearest neighbours.

    No pair is outside of its gate. Among all assignments of the others that of the largest likelihood is taken: a pair
    costs ``v' S^-1 v + log(det(S))``, a track that is left out 1 more than the worst pair within the gates. The
    determinant keeps a poorly known track from taking what belongs to a well known one (Blackman and Popoli, Design
    and Analysis of Modern Tracking Systems, 1999, section 6.4).

    Parameters
    ----------
    innovation : (track, detection, m) float64
        Measured less expected values; NaN for what was not measured.
    spread : (track, m, m) float64
        Covariance of the expected values.
    noise : (detection, m, m) float64
        Covariance of the measured values.
    probability : float
        That a detection of the target is within the gate.

    Returns
    -------
    pairs : Pairs
    """
    limits = gate_limits(probability)

    num_tracks, num_detections, num_values = innovation.shape
    if num_tracks * num_detections <= _FEW:
        rows, columns = _all_pairs(num_tracks, num_detections)
    else:
        # The squared distance is at least that of each value alone: most pairs go at once.
        variance = spread.diagonal(axis1=1, axis2=2)[:, None] + noise.diagonal(axis1=1, axis2=2)
        rows, columns = np.nonzero(~(innovation * innovation > limits[num_values] * variance).any(axis=-1))
    between = innovation[rows, columns]
    squares, inverse = inverse_of_measured(between, spread[rows] + noise[columns])
    missing = np.isnan(between)
    is_inside = squares <= limits[num_values]
    if missing.any():
        num_measured = num_values - missing.sum(axis=-1)
        is_inside = (squares <= limits[num_measured]) & (num_measured > 0)
    inside = is_inside.nonzero()[0]
    rows, columns, inverse = rows[inside], columns[inside], inverse[inside]
    if all(len(set(indices.tolist())) == len(indices) for indices in (rows, columns)):  # no two want the same
        return Pairs(rows, columns, inverse)

    from scipy.optimize import linear_sum_assignment  # here: as above

    cost = squares[inside] - np.log(np.linalg.det(inverse))
    costs = np.zeros(innovation.shape[:2])  # a pair outside of the gate costs as much as none
    costs[rows, columns] = cost - cost.max() - 1.0
    pair = np.full(costs.shape, -1)
    pair[rows, columns] = np.arange(len(rows))
    pair = pair[linear_sum_assignment(costs)]
    taken = pair[pair >= 0]
    return Pairs(rows[taken], columns[taken], inverse[taken])


@lru_cache(maxsize=256)
def _all_pairs(num_tracks: int, num_detections: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of the tracks and of the detections of all pairs."""
    rows, columns = np.indices((num_tracks, num_detections)).reshape(2, -1)
    return rows, columns
