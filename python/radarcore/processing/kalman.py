"""Kalman filters beyond their steps, which are in the core: distances of innovations, and smoothing.

The formulas are those of Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation
(2001).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core

Array = NDArray[np.float64]


def normalized_squares(innovation: Array, covariance: Array) -> tuple[Array, Array]:
    """Squared Mahalanobis distances of innovations, and the log determinants of their covariances.

    Parameters
    ----------
    innovation : (..., m) float64
        NaN for what was not measured.
    covariance : (..., m, m) float64
        Of the innovations, positive definite.

    Returns
    -------
    distance, log_determinant : (...,) float64
        ``v' S^-1 v`` and ``log(det(S))`` over what was measured: minus twice the log likelihood is their sum and
        ``log(2 pi)`` for each value.
    """
    missing = np.isnan(innovation)
    if missing.any():
        crossed = missing[..., :, None] | missing[..., None, :]
        innovation = np.where(missing, 0.0, innovation)
        covariance = np.where(crossed, np.eye(covariance.shape[-1]), covariance)  # independent of the others
    inverse: Any = np.linalg.inv(covariance)
    squares = np.vecdot(innovation, (inverse @ innovation[..., None])[..., 0])
    return squares, -np.log(np.linalg.det(inverse))


def smoothed(time: Array, state: Array, covariance: Array, density: float) -> tuple[Array, Array]:
    """States and covariances of a target by all of its measurements, the later ones too.

    The fixed-interval smoother of Rauch, Tung and Striebel (their section 8.6), backwards through what a filter of the
    white-acceleration model has found.

    Parameters
    ----------
    time : (row,) float64
        Increasing [s].
    state, covariance : (row, 2 d), (row, 2 d, 2 d) float64
        After the measurement of each time.
    density : float
        Power spectral density of the acceleration along each axis [m^2/s^3].
    """
    state, covariance = state.copy(), covariance.copy()
    d = state.shape[1] // 2
    for k in reversed(range(len(time) - 1)):
        step, known = time[k + 1] - time[k], covariance[k].copy()
        expected, spread = _core.predicted(state[k : k + 1], covariance[k : k + 1], time=step, density=density)
        crossed = known.copy()  # with the transition F, the covariance P F' of this state and the next
        crossed[:, :d] += step * known[:, d:]
        gain: Any = np.linalg.solve(spread[0], crossed.T).T
        state[k] += gain @ (state[k + 1] - expected[0])
        changed = known + gain @ (covariance[k + 1] - spread[0]) @ gain.T
        covariance[k] = 0.5 * (changed + changed.T)
    return state, covariance
