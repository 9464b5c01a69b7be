"""Steps of a tracker in plain arrays, as the core is to do them: prediction, expected measurements, gates, updates.

One row per target throughout: states (target, n), covariances (target, n, n). The formulas are those of Bar-Shalom, Li
and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), chapters 5 and 6.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.clustering import wrapped
from radarcore.processing.state_space import SHORTEST_RANGE

Array = NDArray[np.float64]

_UNITS = [np.eye(d) for d in range(4)]
"""Unit matrices of d dimensions."""


@lru_cache(maxsize=64)
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
        The matrices F and Q of ``predict``, read-only: kept for equal intervals.
    """
    moved, noise = _powers_of_time(num_dimensions)
    t = interval
    weights = np.array([density * t**3 / 3.0, density * t**2 / 2.0, density * t])
    transition = _unit(2 * num_dimensions) + t * moved
    return check.frozen(transition), check.frozen((weights @ noise).reshape(moved.shape))


@cache
def _unit(length: int) -> Array:
    """Unit matrix, read-only."""
    return check.frozen(np.eye(length))


@cache
def _powers_of_time(num_dimensions: int) -> tuple[Array, Array]:
    """Transition per time (2 d, 2 d), and the noise of its cube, square and itself (3, 4 d^2)."""
    d = num_dimensions
    moved, noise = np.zeros((2 * d, 2 * d)), np.zeros((3, 2 * d, 2 * d))
    here, rate = np.arange(d), d + np.arange(d)
    moved[here, rate] = 1.0
    noise[0, here, here] = noise[1, here, rate] = noise[1, rate, here] = noise[2, rate, rate] = 1.0
    return moved, noise.reshape(3, -1)


def predict(state: Array, covariance: Array, transition: Array, noise: Array) -> tuple[Array, Array]:
    """States and covariances after a step: ``F x`` and ``F P F' + Q``."""
    return state @ transition.T, transition @ covariance @ transition.T + noise


def update(
    state: Array,
    covariance: Array,
    innovation: Array,
    jacobian: Array,
    noise: Array,
    inverse: Array | None = None,
) -> tuple[Array, Array]:
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
    inverse : (target, m, m) float64, optional
        Of the covariance ``H P H' + R`` of the innovation, as `inverse_of_measured` gives it.
    """
    innovation, jacobian, noise = without_missing(innovation, jacobian, noise)
    crossed = jacobian @ covariance
    inverted: Any = np.linalg.inv(crossed @ jacobian.mT + noise) if inverse is None else inverse
    gain = crossed.mT @ inverted
    kept = _unit(state.shape[-1]) - gain @ jacobian
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
    return np.where(crossed, _unit(covariance.shape[-1]), covariance)


def inverse_of_measured(innovation: Array, covariance: Array) -> tuple[Array, Array]:
    """Squared Mahalanobis distances as `normalized_squares`, and the inverses of the covariances (..., m, m).

    Values that were not measured are independent of the others there, with variance 1.
    """
    missing = np.isnan(innovation)
    if missing.any():
        innovation, covariance = np.where(missing, 0.0, innovation), alone(covariance, missing)
    inverse: Any = np.linalg.inv(covariance)
    return np.vecdot(innovation, (inverse @ innovation[..., None])[..., 0]), inverse


class Expected(NamedTuple):
    """Expected measurements of targets."""

    value: Array
    """(target, d + 1): range [m], velocity [m/s], azimuth, elevation [rad]; their mean, to second order."""
    jacobian: Array
    """(target, d + 1, 2 d): derivative of the values by the state."""
    covariance: Array
    """(target, d + 1, d + 1): of the values, to first order."""
    curvature: Array
    """(target, d + 1, d + 1): what second order adds to that covariance."""


def observe(state: Array) -> tuple[Array, Array]:
    """Range, velocity, azimuth and elevation of targets, and their derivatives by the state.

    Parameters
    ----------
    state : (target, 2 d) float64

    Returns
    -------
    value : (target, d + 1) float64
        Range [m], velocity [m/s], azimuth, elevation [rad]: the first d + 1 of them.
    jacobian : (target, d + 1, 2 d) float64
    """
    number, d = state.shape[0], state.shape[1] // 2
    if d == 1:
        return state, np.broadcast_to(np.eye(2), (number, 2, 2))
    position, motion = state[:, :d], state[:, d:]
    distance = np.maximum(np.sqrt(np.vecdot(position, position)), SHORTEST_RANGE)
    towards = position / distance[:, None]
    rate = np.vecdot(towards, motion)
    value, jacobian = np.empty((number, d + 1)), np.zeros((number, d + 1, 2 * d))
    value[:, 0], value[:, 1] = distance, rate
    jacobian[:, 0, :d] = jacobian[:, 1, d:] = towards
    jacobian[:, 1, :d] = (motion - rate[:, None] * towards) / distance[:, None]

    # Angles: azimuth in the plane, elevation above it.
    x, y = position[:, 0], position[:, 1]
    across = np.maximum(np.hypot(x, y), SHORTEST_RANGE)
    value[:, 2] = np.arctan2(y, x)
    square = across * across
    jacobian[:, 2, 0], jacobian[:, 2, 1] = -y / square, x / square
    if d == 3:
        z = position[:, 2]
        value[:, 3] = np.arctan2(z, across)
        jacobian[:, 3, 2] = slope = across / (distance * distance)
        jacobian[:, 3, :2] = position[:, :2] * (-z * slope / square)[:, None]
    return value, jacobian


def expect(state: Array, covariance: Array) -> Expected:
    """Expected measurements of targets whose states are known to some covariance.

    Range and velocity are taken to second order, as in the second-order extended Kalman filter (Bar-Shalom, Li and
    Kirubarajan 2001, section 10.3): where angles or the velocity across are poorly known, the range rate varies
    with the product of both errors, which first order does not see. Angles are taken to first order.

    Parameters
    ----------
    state, covariance : (target, 2 d), (target, 2 d, 2 d) float64
    """
    value, jacobian = observe(state)
    number, d = len(state), state.shape[1] // 2
    first_order = jacobian @ covariance @ jacobian.mT
    curvature = np.zeros(first_order.shape)
    if d == 1:
        return Expected(value, jacobian, first_order, curvature)

    # Second derivatives of range and range rate: of the direction, as both are its products with place and motion.
    distance, rate = value[:, 0, None, None], value[:, 1, None, None]
    towards, turning = jacobian[:, 0, :d], jacobian[:, 1, :d]
    bend = (_UNITS[d] - towards[:, :, None] * towards[:, None, :]) / distance
    crossed = towards[:, :, None] * turning[:, None, :]
    second = np.zeros((number, 2, 2 * d, 2 * d))
    second[:, 0, :d, :d] = second[:, 1, :d, d:] = second[:, 1, d:, :d] = bend
    second[:, 1, :d, :d] = -(crossed + crossed.mT + rate * bend) / distance

    # Half the traces of their products with the covariance, and of the products of two of those.
    spread = second @ covariance[:, None]
    flat = (number, 2, 4 * d * d)
    value[:, :2] += 0.5 * np.vecdot(second.reshape(flat), covariance.reshape(number, 1, 4 * d * d))
    curvature[:, :2, :2] = 0.5 * (spread.reshape(flat) @ spread.mT.reshape(flat).mT)
    return Expected(value, jacobian, first_order, curvature)


def begin(measured: Array, noise: Array, speed_deviation: float) -> tuple[Array, Array]:
    """States and covariances of targets from their first measurements.

    Parameters
    ----------
    measured : (target, d + 1) float64
        Range [m], velocity [m/s], azimuth, elevation [rad]; a velocity may be NaN.
    noise : (target, d + 1, d + 1) float64
        Their covariance.
    speed_deviation : float
        Standard deviation of the velocity along each axis where nothing was measured [m/s].
    """
    number, d = measured.shape[0], measured.shape[1] - 1
    unknown = np.isnan(measured[:, 1])
    if unknown.any():
        which = np.zeros(measured.shape, dtype=bool)
        which[:, 1] = unknown
        measured = np.where(which, 0.0, measured)
        noise = np.where(which[:, :, None] & which[:, None, :], speed_deviation**2, alone(noise, which))
    if d == 1:
        return measured, noise

    # Unit vectors towards the target, to the left and up, (target, axis, vector).
    distance, rate = measured[:, 0, None], measured[:, 1, None]
    ca, sa = np.cos(measured[:, 2]), np.sin(measured[:, 2])
    elevation = measured[:, 3] if d == 3 else np.zeros(number)
    ce, se = np.cos(elevation), np.sin(elevation)
    vectors = np.array([[ce * ca, ce * sa, se], [-ce * sa, ce * ca, 0.0 * se], [-se * ca, -se * sa, ce]])
    vectors = vectors[:d, :d].transpose(2, 1, 0)
    towards, turns = vectors[:, :, 0], vectors[:, :, 1:]
    state = np.concatenate([distance * towards, rate * towards], axis=1)

    # Derivative of the state by what was measured; of the velocity across the line of sight nothing is known.
    slope = np.zeros((number, 2 * d, d + 1))
    slope[:, :d, 0] = slope[:, d:, 1] = towards
    slope[:, :d, 2:], slope[:, d:, 2:] = distance[:, None] * turns, rate[:, None] * turns
    covariance = slope @ noise @ slope.mT
    covariance[:, d:, d:] += speed_deviation**2 * (_UNITS[d] - towards[:, :, None] * towards[:, None, :])
    return state, covariance


def gated_pairs(
    state: Array, covariance: Array, measured: Array, noise: Array, periods: Array, limits: Array, velocity_known: float
) -> tuple[Array, Array, Array]:
    """Tracks and detections within their gates, by track, and minus twice the log likelihood of each pair."""
    expected = expect(state, covariance)
    spread = expected.covariance + expected.curvature
    innovation = wrapped(measured - expected.value[:, None], periods[: measured.shape[1]])
    innovation[~(spread[:, 1, 1] <= velocity_known), :, 1] = np.nan
    rows, columns = np.indices(innovation.shape[:2]).reshape(2, -1)
    between = innovation[rows, columns]
    squares, inverse = inverse_of_measured(between, spread[rows] + noise[columns])
    number = between.shape[1] - np.isnan(between).sum(axis=-1)
    inside = (squares <= limits[number]) & (number > 0)
    return rows[inside], columns[inside], squares[inside] - np.log(np.linalg.det(inverse[inside]))
