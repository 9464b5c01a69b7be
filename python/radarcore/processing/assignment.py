"""Which detection belongs to which track: gates, and the most likely assignment within them."""

from __future__ import annotations

from functools import cache

import numpy as np

from radarcore import _core
from radarcore.processing.kalman import Array


@cache
def gate_limits(probability: float) -> list[float]:
    """Squared Mahalanobis distances within which a detection of m values lies with a probability, m = 0 to 4."""
    from scipy.special import chdtri  # here: importing radarcore imports numpy and nothing heavier

    return [0.0, *(float(chdtri(number, 1.0 - probability)) for number in range(1, 5))]


def assign(
    state: Array,
    covariance: Array,
    measured: Array,
    noise: Array,
    *,
    periods: list[float],
    velocity_known: float,
    probability: float,
) -> list[tuple[int, int]]:
    """Pairs of tracks and detections, by their indices: global nearest neighbours.

    No pair is outside of its gate. Among all assignments of the others that of the largest likelihood is taken: a pair
    costs ``v' S^-1 v + log(det(S))``, a track that is left out 1 more than the worst pair within the gates. The
    determinant keeps a poorly known track from taking what belongs to a well known one (Blackman and Popoli, Design
    and Analysis of Modern Tracking Systems, 1999, section 6.4).

    Parameters
    ----------
    state, covariance : (track, 2 d), (track, 2 d, 2 d) float64
    measured, noise : (detection, d + 1), (detection, d + 1, d + 1) float64
        Range, velocity, azimuth and elevation, the first d + 1 of them; NaN for what was not measured.
    periods : list of float
        Of these coordinates, all four.
    velocity_known : float
        Largest variance of an expected velocity with which the measured one counts [m^2/s^2].
    probability : float
        That a detection of the target is within the gate.
    """
    limits = gate_limits(probability)
    pairs, costs = _core.gated_pairs(
        state, covariance, measured, noise, periods=periods, limits=limits, velocity_known=velocity_known
    )
    if all(len(set(indices)) == len(pairs) for indices in zip(*pairs, strict=True)):  # no two want the same
        return pairs

    from scipy.optimize import linear_sum_assignment  # here: as above

    matrix = np.zeros((len(state), len(measured)))  # a pair outside of the gate costs as much as none
    matrix[tuple(np.transpose(pairs))] = costs - costs.max() - 1.0
    rows, columns = linear_sum_assignment(matrix)
    within = matrix[rows, columns] < 0.0
    return list(zip(rows[within].tolist(), columns[within].tolist(), strict=True))
