"""Which detection belongs to which track: gates, and the most likely assignment within them."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.kalman import Array, normalized_squares

Indices = NDArray[np.int64]


@cache
def gate_limits(probability: float) -> Array:
    """Squared Mahalanobis distances within which a detection of m values lies with a probability, m = 0 to 4."""
    from scipy.special import chdtri  # here: importing radarcore imports numpy and nothing heavier

    return np.concatenate([[0.0], chdtri(np.arange(1, 5), 1.0 - probability)])


def assign(innovation: Array, spread: Array, noise: Array, probability: float) -> tuple[Indices, Indices]:
    """Tracks and the detections that belong to them, by their indices: global nearest neighbours.

    No pair is outside of its gate. Among the other assignments the one of the largest likelihood is taken: a pair costs
    ``v' S^-1 v + log(det(S))``, a track without a detection 1 more than the worst pair within the gates. The
    determinant keeps a poorly known track from taking the detection of a well known one (Blackman and Popoli, Design
    and Analysis of Modern Tracking Systems, 1999, section 6.4).

    Parameters
    ----------
    innovation : (track, detection, m) float64
        Measured less expected values; NaN for missing values.
    spread : (track, m, m) float64
        Covariance of the expected values.
    noise : (detection, m, m) float64
        Covariance of the measured values.
    probability : float
        That a detection of the target is within the gate.
    """
    limits, num_values = gate_limits(probability), innovation.shape[2]

    # The squared distance is at least that of each value alone, which excludes most pairs.
    variance = spread.diagonal(axis1=1, axis2=2)[:, None] + noise.diagonal(axis1=1, axis2=2)
    rows, columns = np.nonzero(~(innovation * innovation > limits[num_values] * variance).any(axis=-1))
    between = innovation[rows, columns]
    squares, log_determinants = normalized_squares(between, spread[rows] + noise[columns])
    num_measured = num_values - np.isnan(between).sum(axis=-1)
    is_inside = (squares <= limits[num_measured]) & (num_measured > 0)
    rows, columns, costs = rows[is_inside], columns[is_inside], (squares + log_determinants)[is_inside]
    if all(len(set(indices.tolist())) == len(indices) for indices in (rows, columns)):  # no detection is disputed
        return rows, columns

    from scipy.optimize import linear_sum_assignment  # here: as above

    matrix = np.zeros(innovation.shape[:2])  # a pair outside of the gate costs as much as no pair
    matrix[rows, columns] = costs - costs.max() - 1.0
    rows, columns = linear_sum_assignment(matrix)
    is_inside = matrix[rows, columns] < 0.0
    return rows[is_inside], columns[is_inside]
