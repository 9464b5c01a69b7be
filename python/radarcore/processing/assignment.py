"""Which detection belongs to which track: gates, and the most likely assignment within them."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.kalman import Array, normalized_squares


@cache
def gate_limits(probability: float) -> Array:
    """Squared Mahalanobis distances within which a detection of m values lies with a probability, m = 0 to 4."""
    from scipy.special import chdtri  # here: importing radarcore imports numpy and nothing heavier

    return np.concatenate([[0.0], chdtri(np.arange(1, 5), 1.0 - probability)])


def assign(
    innovation: Array, spread: Array, noise: Array, probability: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
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
    tracks, detections : (pair,) int
        Indices.
    """
    limits = gate_limits(probability)

    # The squared distance is at least that of each value alone: most pairs go at once.
    variance = spread.diagonal(axis1=1, axis2=2)[:, None] + noise.diagonal(axis1=1, axis2=2)
    is_far = (innovation * innovation > limits[innovation.shape[-1]] * variance).any(axis=-1)
    rows, columns = np.nonzero(~is_far)
    if len(rows) == 0:
        return rows, columns
    between = innovation[rows, columns]
    squares, log_determinant = normalized_squares(between, spread[rows] + noise[columns])
    num_measured = (~np.isnan(between)).sum(axis=-1)
    inside = (squares <= limits[num_measured]) & (num_measured > 0)
    rows, columns, cost = rows[inside], columns[inside], (squares + log_determinant)[inside]
    if all(len(set(indices.tolist())) == len(indices) for indices in (rows, columns)):  # no two want the same
        return rows, columns

    from scipy.optimize import linear_sum_assignment  # here: as above

    costs = np.zeros(innovation.shape[:2])  # a pair outside of the gate costs as much as none
    costs[rows, columns] = cost - cost.max() - 1.0
    is_inside = np.zeros(costs.shape, dtype=bool)
    is_inside[rows, columns] = True
    rows, columns = linear_sum_assignment(costs)
    taken = is_inside[rows, columns]
    return rows[taken], columns[taken]
