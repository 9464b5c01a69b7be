"""States of targets, and the values that a radar measures of them: range and range rate, with angles or without.

Targets without angles move in one dimension: state (range, velocity). Those with an azimuth move in the plane, those
with an elevation too in space: state (position, velocity), in the coordinates of a sensor at rest. In d dimensions the
first d + 1 of range, velocity, azimuth and elevation are measured.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from radarcore.processing.kalman import Array, isolated, unit

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
    across = (unit(d) - towards[:, :, None] * towards[:, None, :]) / distance
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
    covariance[:, d:, d:] += speed_deviation**2 * (unit(d) - towards[:, :, None] * towards[:, None, :])
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
    """Places of targets and their rates, (target, 3) each; NaN without angles, 0 along z without an elevation."""
    number, d = len(state), state.shape[1] // 2
    position, motion = np.full((2, number, 3), np.nan if d == 1 else 0.0)
    if d > 1:
        position[:, :d], motion[:, :d] = state[:, :d], state[:, d:]
    return position, motion


def directions(azimuth: Array, elevation: Array) -> Array:
    """Unit vectors (..., 3) towards angles [rad]: x ahead, y to the left, z up."""
    across = np.cos(elevation)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)], axis=-1)


def points_at(values: Array) -> Array:
    """Points [m] at ranges, velocities, azimuths and perhaps elevations (target, 3 or 4): in the plane, or in space.

    An unknown elevation counts as 0.
    """
    across = values[:, 0]
    if values.shape[1] > 3:
        elevation = np.where(np.isnan(values[:, 3]), 0.0, values[:, 3])
        up, across = across * np.sin(elevation), across * np.cos(elevation)
        return np.array([across * np.cos(values[:, 2]), across * np.sin(values[:, 2]), up]).T
    return np.array([across * np.cos(values[:, 2]), across * np.sin(values[:, 2])]).T
