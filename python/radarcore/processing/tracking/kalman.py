"""Kalman filter of many targets at once: the white-acceleration model, prediction, update and smoothing.

One row per target throughout: states (target, n), covariances (target, n, n). The formulas are from Bar-Shalom, Li and
Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), chapters 5, 6 and 8.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.direction import unit_vectors

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
    t, d, axes = interval, num_dimensions, np.eye(num_dimensions)
    transition, noise = np.eye(2 * d), np.empty((2 * d, 2 * d))
    transition[:d, d:] = t * axes
    noise[:d, :d] = density * t**3 / 3.0 * axes
    noise[:d, d:] = noise[d:, :d] = density * t**2 / 2.0 * axes
    noise[d:, d:] = density * t * axes
    return transition, noise


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
    kept = np.eye(state.shape[-1]) - gain @ jacobian
    updated = kept @ covariance @ kept.mT + gain @ noise @ gain.mT
    return state + (gain @ innovation[..., None])[..., 0], 0.5 * (updated + updated.mT)


def isolated(covariance: Array, which: NDArray[np.bool_]) -> Array:
    """Covariances (..., m, m) in which some coordinates (..., m) are independent of the others, with variance 1."""
    crossed = which[..., :, None] | which[..., None, :]
    return np.where(crossed, np.eye(covariance.shape[-1]), covariance)


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


SHORTEST_RANGE = 1e-3
"""Nearer than this [m] there is no direction."""


class Expected(NamedTuple):
    """Expected measurements of targets."""

    value: Array
    """(target, d + 1): range [m], velocity [m/s], azimuth, elevation [rad]; their mean, to second order."""
    jacobian: Array
    """(target, d + 1, 2 d): derivative of the values by the state."""
    covariance: Array
    """(target, d + 1, d + 1): of the values, to first order."""
    second_order: Array
    """(target, d + 1, d + 1): second-order terms of that covariance."""

    @property
    def spread(self) -> Array:
        """Covariance of the values to second order."""
        return self.covariance + self.second_order


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

    Range and velocity are expanded to second order, as in the second-order extended Kalman filter (Bar-Shalom, Li and
    Kirubarajan 2001, section 10.3): the range rate varies with the product of the errors of angles and of the velocity
    across. First order does not see that product, which is large where both are poorly known. Angles are expanded to
    first order.

    Parameters
    ----------
    state, covariance : (target, 2 d), (target, 2 d, 2 d) float64
    """
    value, jacobian = observe(state)
    number, d = len(state), state.shape[1] // 2
    first_order = jacobian @ covariance @ jacobian.mT
    second_order = np.zeros(first_order.shape)
    if d == 1:
        return Expected(value, jacobian, first_order, second_order)

    # Second derivatives of range and range rate, from the projection across the line of sight over the distance.
    distance, rate = value[:, 0, None, None], value[:, 1, None, None]
    towards, rate_slope = jacobian[:, 0, :d], jacobian[:, 1, :d]
    across = (np.eye(d) - towards[:, :, None] * towards[:, None, :]) / distance
    crossed = towards[:, :, None] * rate_slope[:, None, :]
    second = np.zeros((number, 2, 2 * d, 2 * d))
    second[:, 0, :d, :d] = second[:, 1, :d, d:] = second[:, 1, d:, :d] = across
    second[:, 1, :d, :d] = -(crossed + crossed.mT + rate * across) / distance

    # Half the traces of their products with the covariance, and of the products of two of those.
    spread = second @ covariance[:, None]
    flat = (number, 2, 4 * d * d)
    value[:, :2] += 0.5 * np.vecdot(second.reshape(flat), covariance.reshape(number, 1, 4 * d * d))
    second_order[:, :2, :2] = 0.5 * (spread.reshape(flat) @ spread.mT.reshape(flat).mT)
    return Expected(value, jacobian, first_order, second_order)


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
        noise = np.where(which[:, :, None] & which[:, None, :], speed_deviation**2, isolated(noise, which))
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

    # Derivative of the state by the measurement. The velocity across the line of sight is unknown.
    slope = np.zeros((number, 2 * d, d + 1))
    slope[:, :d, 0] = slope[:, d:, 1] = towards
    slope[:, :d, 2:], slope[:, d:, 2:] = distance[:, None] * turns, rate[:, None] * turns
    covariance = slope @ noise @ slope.mT
    covariance[:, d:, d:] += speed_deviation**2 * (np.eye(d) - towards[:, :, None] * towards[:, None, :])
    return state, covariance


def polar(state: Array, covariance: Array) -> tuple[Array, Array]:
    """Range, velocity, azimuth and elevation of targets (target, 4) with their covariance (target, 4, 4).

    To second order, see `expect`. NaN for unobservable angles.
    """
    expected = expect(state, covariance)
    number, num_values = expected.value.shape
    value, spread = np.full((number, 4), np.nan), np.full((number, 4, 4), np.nan)
    value[:, :num_values], spread[:, :num_values, :num_values] = expected.value, expected.spread
    return value, spread


def cartesian(state: Array) -> tuple[Array, Array]:
    """Places of targets and their rates, ([target,] 3) each; NaN without angles, 0 along z without an elevation."""
    d = state.shape[-1] // 2
    position, motion = np.full((2, *state.shape[:-1], 3), np.nan if d == 1 else 0.0)
    if d > 1:
        position[..., :d], motion[..., :d] = state[..., :d], state[..., d:]
    return position, motion


def over_ground(measured: Array, velocity: Array) -> Array:
    """Range rates (target,) without what the sensor's own velocity, (3,) along its axes, adds to them [m/s].

    NaN without an azimuth, unless the sensor is at rest.
    """
    return measured[:, 1] + directions_of(measured) @ velocity if velocity.any() else measured[:, 1].copy()


def directions_of(measured: Array) -> Array:
    """Unit vectors (target, 3) towards measured targets; unknown elevations, and azimuths of ranges alone, are 0."""
    azimuth = measured[:, 2] if measured.shape[1] > 2 else np.zeros(len(measured))
    elevation = np.where(np.isnan(measured[:, 3]), 0.0, measured[:, 3]) if measured.shape[1] > 3 else 0.0
    return unit_vectors(azimuth, elevation)


def to_world(state: Array, covariance: Array, pose: Array, velocity: Array) -> tuple[Array, Array]:
    """States and covariances in the world, of places and velocities relative to a sensor, along its axes.

    Parameters
    ----------
    state, covariance : (target, 2 d), (target, 2 d, 2 d) float64
        In the plane, d = 2, the sensor turns about its z axis only.
    pose : (3, 4) or (target, 3, 4) float64
        ``[rotation | position]`` of the sensor, to the world.
    velocity : (3,) or (target, 3) float64
        Of the sensor, in world axes [m/s].
    """
    turn, shift = _axes(pose, velocity, state.shape[1] // 2)
    return (turn @ state[..., None])[..., 0] + shift, turn @ covariance @ turn.mT


def to_sensor(state: Array, covariance: Array, pose: Array, velocity: Array) -> tuple[Array, Array]:
    """Inverse of `to_world`."""
    turn, shift = _axes(pose, velocity, state.shape[1] // 2)
    return (turn.mT @ (state - shift)[..., None])[..., 0], turn.mT @ covariance @ turn


def covariance_from_above(covariance: Array, pose: Array) -> Array:
    """Covariance (2, 2) of x and y in the world, of a state's (2 d, 2 d) in the axes of a sensor with a pose (3, 4)."""
    d = len(covariance) // 2
    seen: Array = pose[:2, :d] @ covariance[:d, :d] @ pose[:2, :d].T
    return seen


def _axes(pose: Array, velocity: Array, num_dimensions: int) -> tuple[Array, Array]:
    """Rotation of states (..., 2 d, 2 d) and what is added to them (..., 2 d)."""
    d = num_dimensions
    rotation = pose[..., :3]
    if d == 1:
        rotation = np.ones((*pose.shape[:-2], 1, 1))
    elif d == 2:
        heading = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
        columns = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        rotation = np.moveaxis(columns, (0, 1), (-2, -1))
    turn = np.zeros((*pose.shape[:-2], 2 * d, 2 * d))
    turn[..., :d, :d] = turn[..., d:, d:] = rotation
    return turn, np.concatenate([pose[..., :d, 3], velocity[..., :d]], axis=-1)


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
