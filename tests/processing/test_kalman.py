"""Kalman filters against closed forms, and measurements of a radar against differences and samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from radarcore.processing.tracking.kalman import (
    begin,
    cartesian,
    expect,
    normalized_squares,
    observe,
    polar,
    predict,
    update,
    white_acceleration,
)

ROUNDING = 1e-12
"""Of a few hundred operations in float64, relative."""


def states(number: int, dimensions: int, seed: int = 0) -> NDArray[np.float64]:
    """Places 1 to 6 m ahead, and motions."""
    rng = np.random.default_rng(seed)
    place = np.array([4.0, 0.0, 0.0])[:dimensions] + rng.uniform(-1.5, 1.5, (number, dimensions))
    return np.concatenate([place, rng.uniform(-3.0, 3.0, (number, dimensions))], axis=1)


def covariances(number: int, length: int, size: float = 1.0, seed: int = 1) -> NDArray[np.float64]:
    root = np.sqrt(size) * np.random.default_rng(seed).standard_normal((number, length, length))
    return root @ root.mT + 0.1 * size * np.eye(length)


def steady_gain(transition: Any, noise: Any, jacobian: Any, measurement: float) -> NDArray[np.float64]:
    """Gain (2,) of a filter of range alone that has run long: K = P H' / R after an update."""
    state, covariance = np.zeros((1, 2)), np.eye(2)[None]
    for _ in range(300):
        state, covariance = predict(state, covariance, transition, noise)
        state, covariance = update(state, covariance, np.zeros((1, 1)), jacobian, np.full((1, 1, 1), measurement))
    return np.asarray((covariance @ jacobian.mT)[0, :, 0] / measurement)


@pytest.mark.parametrize("index", [0.1, 5.0])
def test_steady_gain_is_that_of_the_alpha_beta_filter_of_kalata(index: float) -> None:
    """P. R. Kalata, The tracking index (IEEE Trans. AES 20, 1984): acceleration constant within each interval.

    With the index L = sigma_a T^2 / sigma_r, alpha = -(L^2 + 8 L - (L + 4) sqrt(L^2 + 8 L)) / 8 and
    beta = (L^2 + 4 L - L sqrt(L^2 + 8 L)) / 4.
    """
    interval, deviation = 0.025, 0.03
    acceleration = index * deviation / interval**2
    transition, _ = white_acceleration(interval, 1.0, 1)
    step = np.array([interval**2 / 2.0, interval])
    noise = acceleration**2 * np.outer(step, step)
    gain = steady_gain(transition, noise, np.array([[[1.0, 0.0]]]), deviation**2)
    root = np.sqrt(index**2 + 8.0 * index)
    alpha = -(index**2 + 8.0 * index - (index + 4.0) * root) / 8.0
    beta = (index**2 + 4.0 * index - index * root) / 4.0
    np.testing.assert_allclose(gain * [1.0, interval], [alpha, beta], rtol=1e-9)  # residual after 300 steps


@pytest.mark.parametrize("index", [0.1, 5.0])
def test_steady_gain_with_white_acceleration_fulfils_its_equations(index: float) -> None:
    """From the steady Riccati equation on paper, with the index L^2 = q T^3 / sigma_r^2: L^2 = beta^2 / (1 - alpha) and
    alpha^2 = 2 beta - alpha beta - beta^2 / 6 (Kalata's has 1/4 in the place of 1/6)."""
    interval, deviation = 0.025, 0.03
    density = index**2 * deviation**2 / interval**3
    alpha, beta = steady_gain(*white_acceleration(interval, density, 1), np.array([[[1.0, 0.0]]]), deviation**2) * [
        1.0,
        interval,
    ]
    assert beta**2 / (1.0 - alpha) == pytest.approx(index**2, rel=1e-9)
    assert alpha**2 == pytest.approx(2.0 * beta - alpha * beta - beta**2 / 6.0, rel=1e-9)


def test_two_predictions_are_one_over_both_intervals() -> None:
    state, covariance = states(3, 2), covariances(3, 4)
    once = predict(state, covariance, *white_acceleration(0.07, 2.0, 2))
    twice = predict(*predict(state, covariance, *white_acceleration(0.02, 2.0, 2)), *white_acceleration(0.05, 2.0, 2))
    for a, b in zip(once, twice, strict=True):
        np.testing.assert_allclose(a, b, rtol=ROUNDING)


def test_update_is_that_of_the_information_filter() -> None:
    """P^-1 + H' R^-1 H, and x + P H' R^-1 v: another route to the same numbers."""
    state, covariance = states(5, 3), covariances(5, 6)
    _, jacobian = observe(state)
    noise = covariances(5, 4, seed=3)
    innovation = np.random.default_rng(4).standard_normal((5, 4))
    found, spread = update(state, covariance, innovation, jacobian, noise)
    expected = np.linalg.inv(np.linalg.inv(covariance) + jacobian.mT @ np.linalg.inv(noise) @ jacobian)
    np.testing.assert_allclose(spread, expected, rtol=1e-9, atol=1e-9)  # condition numbers of some thousands
    shift = expected @ jacobian.mT @ np.linalg.inv(noise) @ innovation[..., None]
    np.testing.assert_allclose(found, state + shift[..., 0], rtol=1e-9, atol=1e-9)


def test_missing_values_drop_out_of_the_update() -> None:
    state, covariance, noise = states(2, 3), covariances(2, 6), covariances(2, 4, seed=3)
    _, jacobian = observe(state)
    innovation = np.random.default_rng(4).standard_normal((2, 4))
    kept = [0, 2]
    expected = update(state, covariance, innovation[:, kept], jacobian[:, kept], noise[:, kept][:, :, kept])
    innovation[:, [1, 3]] = np.nan
    noise[:, [1, 3]] = noise[:, :, [1, 3]] = np.nan
    for found, value in zip(update(state, covariance, innovation, jacobian, noise), expected, strict=True):
        np.testing.assert_allclose(found, value, rtol=1e-10, atol=1e-10)  # condition numbers of some hundreds
    unchanged = update(state, covariance, np.full((2, 4), np.nan), jacobian, noise)
    np.testing.assert_array_equal(unchanged[0], state)
    np.testing.assert_allclose(unchanged[1], covariance, rtol=ROUNDING)


def test_normalized_squares_are_those_of_the_inverse() -> None:
    covariance = covariances(6, 3)
    innovation = np.random.default_rng(5).standard_normal((6, 3))
    squares, logs = normalized_squares(innovation, covariance)
    np.testing.assert_allclose(
        squares, [v @ np.linalg.inv(s) @ v for v, s in zip(innovation, covariance, strict=True)], rtol=1e-9
    )
    np.testing.assert_allclose(logs, np.log(np.linalg.det(covariance)), rtol=1e-9, atol=1e-9)
    innovation[:, 1] = np.nan
    alone = normalized_squares(innovation[:, ::2], covariance[:, ::2, ::2])
    np.testing.assert_allclose(normalized_squares(innovation, covariance), alone, rtol=1e-12)


def test_covariance_stays_symmetric_and_positive_definite_for_2000_updates() -> None:
    """Three hard cases at once: no range rate; a wild target; one that hardly moves. All begin known to a kilometre and
    are measured to 10 um."""
    transition, noise = white_acceleration(0.025, 1.0, 1)
    scale = np.array([1.0, 1e6, 1e-12])[:, None, None]
    jacobian = np.broadcast_to(np.eye(2), (3, 2, 2))
    state, covariance = np.zeros((3, 2)), np.broadcast_to(1e6 * np.eye(2), (3, 2, 2))
    measured = np.diag([1e-10, 1e-2])[None] * np.ones((3, 1, 1))
    innovation = np.array([[0.1, np.nan], [0.1, -0.1], [0.1, 0.1]])
    for _ in range(2_000):
        covariance = transition @ covariance @ transition.T + scale * noise
        _, covariance = update(state, covariance, innovation, jacobian, measured)
    np.testing.assert_array_equal(covariance, covariance.mT)
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_jacobian_is_the_derivative_of_what_is_measured(dimensions: int) -> None:
    state = states(20, dimensions)
    _, jacobian = observe(state)
    step = 1e-6
    for column in range(2 * dimensions):
        change = np.zeros(2 * dimensions)
        change[column] = step
        slope = (observe(state + change)[0] - observe(state - change)[0]) / (2.0 * step)
        np.testing.assert_allclose(jacobian[:, :, column], slope, atol=1e-8)  # rounding: 1e-16 x 6 m / step


@pytest.mark.parametrize("dimensions", [2, 3])
def test_second_order_of_range_and_velocity_is_that_of_samples(dimensions: int) -> None:
    """Mean and covariance over 100,000 states, where place and motion across are known to a tenth of the range."""
    state = states(1, dimensions, seed=7)
    covariance = covariances(1, 2 * dimensions, 0.02)
    expected = expect(state, covariance)
    drawn = np.random.default_rng(8).multivariate_normal(state[0], covariance[0], size=100_000)
    samples = observe(drawn)[0][:, :2]
    total = expected.spread[0, :2, :2]
    errors = np.sqrt(np.diag(total) / len(samples))
    # Within 5 standard errors and the fourth order, (1/10)^4 of the range and of the speed.
    assert (np.abs(samples.mean(axis=0) - expected.value[0, :2]) <= 5.0 * errors + 1e-3).all()
    sizes = np.sqrt(np.outer(np.diag(total), np.diag(total)))
    assert (np.abs(np.cov(samples.T) - total) <= 0.02 * sizes).all()
    assert expected.jacobian.shape == (1, dimensions + 1, 2 * dimensions)


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_begun_states_measure_what_they_began_with(dimensions: int) -> None:
    measured = np.array([[3.0, -0.7, 0.4, -0.2]])[:, : dimensions + 1]
    noise = covariances(1, dimensions + 1, 1e-4)
    state, covariance = begin(measured, noise, 2.0)
    value, jacobian = observe(state)
    np.testing.assert_allclose(value, measured, rtol=ROUNDING)
    np.testing.assert_allclose(jacobian @ covariance @ jacobian.mT, noise, rtol=1e-9, atol=1e-14)


def test_velocity_across_the_line_of_sight_begins_as_unknown() -> None:
    state, covariance = begin(np.array([[3.0, 0.5, 0.0]]), np.diag([1e-4, 1e-4, 1e-9])[None], 2.0)
    np.testing.assert_allclose(state, [[3.0, 0.0, 0.5, 0.0]], atol=ROUNDING)
    assert covariance[0, 3, 3] == pytest.approx(4.0, rel=1e-6)
    assert covariance[0, 2, 2] == pytest.approx(1e-4)
    _, wide = begin(np.array([[3.0, np.nan, 0.0]]), np.diag([1e-4, 1e-4, 1e-9])[None], 2.0)
    assert wide[0, 2, 2] == pytest.approx(4.0, rel=1e-6)


def test_polar_and_cartesian_values_are_nan_where_nothing_is_told() -> None:
    line, plane = states(2, 1), states(2, 2)
    assert np.isnan(polar(line, covariances(2, 2))[0][:, 2:]).all()
    assert np.isnan(cartesian(line)[0]).all()
    values, spread = polar(plane, covariances(2, 4))
    assert np.isnan(values[:, 3]).all()
    assert (cartesian(plane)[0][:, 2] == 0.0).all()
    assert np.isnan(spread[:, 3]).all()
    assert np.isfinite(spread[:, :3, :3]).all()
