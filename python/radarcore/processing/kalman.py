"""Kalman filter of many targets at once: the white-acceleration model, prediction, update and smoothing.

One row per target throughout: states (target, n), covariances (target, n, n). The formulas are from Bar-Shalom, Li and
Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), chapters 5, 6 and 8.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check

Array = NDArray[np.float64]


def white_acceleration(interval: float, density: float, num_dimensions: int) -> tuple[Array, Array]:
    """Matrices F and Q of `predict`: constant velocity, disturbed by white acceleration (their section 6.2.2).

    Two intervals in a row give the same as one of their sum, so frames may come at uneven times.

    Parameters
    ----------
    interval : float
        Time to predict over [s].
    density : float
        Power spectral density of the acceleration along each axis [m^2/s^3]: the velocity changes by
        ``sqrt(density * t)`` in a time t, one standard deviation.
    num_dimensions : int
        Axes d of the space; a state is d positions, then d velocities.

    Returns
    -------
    transition, noise : (2 d, 2 d) float64
    """
    t, d, axes = interval, num_dimensions, unit(num_dimensions)
    transition, noise = np.eye(2 * d), np.empty((2 * d, 2 * d))
    transition[:d, d:] = t * axes
    noise[:d, :d] = density * t**3 / 3.0 * axes
    noise[:d, d:] = noise[d:, :d] = density * t**2 / 2.0 * axes
    noise[d:, d:] = density * t * axes
    return transition, noise


@cache
def unit(length: int) -> Array:
    """Unit matrix, read-only."""
    return check.frozen(np.eye(length))


def predict(state: Array, covariance: Array, transition: Array, noise: Array) -> tuple[Array, Array]:
    """States and covariances after a step: ``F x`` and ``F P F' + Q``."""
    return state @ transition.T, transition @ covariance @ transition.T + noise


def update(state: Array, covariance: Array, innovation: Array, jacobian: Array, noise: Array) -> tuple[Array, Array]:
    """States and covariances after a measurement.

    The covariance is updated in Joseph's form, ``(I - K H) P (I - K H)' + K R K'``. Rounding leaves this form symmetric
    and positive definite, and ``(I - K H) P`` not.

    Parameters
    ----------
    state, covariance : (target, n), (target, n, n) float64
        Before the measurement.
    innovation : (target, m) float64
        Measured less predicted value; NaN for a missing value, which has no effect.
    jacobian : (target, m, n) float64
        Derivative H of the measured values by the state.
    noise : (target, m, m) float64
        Covariance R of the measurement.
    """
    missing = np.isnan(innovation)
    if missing.any():
        innovation, noise = np.where(missing, 0.0, innovation), isolated(noise, missing)
        jacobian = np.where(missing[..., None], 0.0, jacobian)
    crossed = jacobian @ covariance
    inverse: Any = np.linalg.inv(crossed @ jacobian.mT + noise)
    gain = crossed.mT @ inverse
    kept = unit(state.shape[-1]) - gain @ jacobian
    updated = kept @ covariance @ kept.mT + gain @ noise @ gain.mT
    return state + (gain @ innovation[..., None])[..., 0], 0.5 * (updated + updated.mT)


def isolated(covariance: Array, which: NDArray[np.bool_]) -> Array:
    """Covariances (..., m, m) in which some coordinates (..., m) are independent of the others, with variance 1."""
    crossed = which[..., :, None] | which[..., None, :]
    return np.where(crossed, unit(covariance.shape[-1]), covariance)


def normalized_squares(innovation: Array, covariance: Array) -> tuple[Array, Array]:
    """Squared Mahalanobis distances of innovations, and the log determinants of their covariances.

    Parameters
    ----------
    innovation : (..., m) float64
        NaN for missing values.
    covariance : (..., m, m) float64
        Of the innovations, positive definite.

    Returns
    -------
    distance, log_determinant : (...,) float64
        ``v' S^-1 v`` and ``log(det(S))`` over the measured values: minus twice the log likelihood is their sum and
        ``log(2 pi)`` for each value.
    """
    missing = np.isnan(innovation)
    if missing.any():
        innovation, covariance = np.where(missing, 0.0, innovation), isolated(covariance, missing)
    inverse: Any = np.linalg.inv(covariance)
    squares = np.vecdot(innovation, (inverse @ innovation[..., None])[..., 0])
    return squares, -np.log(np.linalg.det(inverse))


def smoothed(time: Array, state: Array, covariance: Array, density: float) -> tuple[Array, Array]:
    """States and covariances of a target given all of its measurements, the later ones too.

    The fixed-interval smoother of Rauch, Tung and Striebel (their section 8.6), backwards through the results of a
    filter of the white-acceleration model.

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
        transition, noise = white_acceleration(float(time[k + 1] - time[k]), density, d)
        expected, spread = predict(state[k], covariance[k], transition, noise)
        gain: Any = np.linalg.solve(spread, transition @ covariance[k]).T
        state[k] += gain @ (state[k + 1] - expected)
        changed = covariance[k] + gain @ (covariance[k + 1] - spread) @ gain.T
        covariance[k] = 0.5 * (changed + changed.T)
    return state, covariance
