"""Kalman filter of many targets at once: prediction and update in plain arrays, and the white-acceleration model.

One row per target throughout: states (target, n), covariances (target, n, n). The formulas are those of Bar-Shalom, Li
and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), chapters 5 and 6.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def white_acceleration(interval: float, density: float, num_dimensions: int) -> tuple[Array, Array]:
    """Motion at a constant velocity that white acceleration disturbs (their section 6.2.2).

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
        The matrices F and Q of ``predict``.
    """
    unit, moved, noise = _powers_of_time(num_dimensions)
    weights = density * interval * np.array([interval**2 / 3.0, interval / 2.0, 1.0])
    return unit + interval * moved, np.asarray((weights @ noise.reshape(3, -1)).reshape(unit.shape))


@cache
def _powers_of_time(num_dimensions: int) -> tuple[Array, Array, Array]:
    """Unit matrix, what the transition has per time, and what the noise has of its cube, square and itself."""
    d = num_dimensions
    unit, moved, noise = np.eye(2 * d), np.zeros((2 * d, 2 * d)), np.zeros((3, 2 * d, 2 * d))
    here, rate = np.arange(d), d + np.arange(d)
    moved[here, rate] = 1.0
    noise[0, here, here] = noise[1, here, rate] = noise[1, rate, here] = noise[2, rate, rate] = 1.0
    return unit, moved, noise


def predict(state: Array, covariance: Array, transition: Array, noise: Array) -> tuple[Array, Array]:
    """States and covariances after a step: ``F x`` and ``F P F' + Q``."""
    return state @ transition.T, transition @ covariance @ transition.T + noise


def update(state: Array, covariance: Array, innovation: Array, jacobian: Array, noise: Array) -> tuple[Array, Array]:
    """States and covariances after a measurement.

    The covariance is updated in Joseph's form, ``(I - K H) P (I - K H)' + K R K'``, which rounding leaves symmetric
    and positive definite where ``(I - K H) P`` in time does not.

    Parameters
    ----------
    state, covariance : (target, n), (target, n, n) float64
        Before the measurement.
    innovation : (target, m) float64
        Measured less predicted value; NaN for what was not measured, which then has no effect at all.
    jacobian : (target, m, n) float64
        Derivative H of the measured values by the state.
    noise : (target, m, m) float64
        Covariance R of the measurement.
    """
    innovation, jacobian, noise = without_missing(innovation, jacobian, noise)
    crossed = jacobian @ covariance
    gain = np.linalg.solve(crossed @ jacobian.mT + noise, crossed).mT
    kept = np.eye(state.shape[-1]) - gain @ jacobian
    updated = kept @ covariance @ kept.mT + gain @ noise @ gain.mT
    return state + (gain @ innovation[..., None])[..., 0], 0.5 * (updated + updated.mT)


def without_missing(innovation: Array, jacobian: Array, noise: Array) -> tuple[Array, Array, Array]:
    """A measurement whose missing values (innovation NaN) depend on nothing: innovation 0, no slope, unit noise."""
    missing = np.isnan(innovation)
    if not missing.any():
        return innovation, jacobian, noise
    return (
        np.where(missing, 0.0, innovation),
        np.where(missing[..., None], 0.0, jacobian),
        alone(noise, missing),
    )


def alone(covariance: Array, which: NDArray[np.bool_]) -> Array:
    """Covariances (..., m, m) in which some coordinates (..., m) are independent of the others, with variance 1."""
    crossed = which[..., :, None] | which[..., None, :]
    return np.where(crossed, np.eye(covariance.shape[-1]), covariance)


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
        innovation, covariance = np.where(missing, 0.0, innovation), alone(covariance, missing)
    squares = (innovation * np.linalg.solve(covariance, innovation[..., None])[..., 0]).sum(axis=-1)
    return squares, np.log(np.linalg.det(covariance))
