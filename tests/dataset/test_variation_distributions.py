"""Distributions of values: moments known in closed form, grids, and what is refused."""

from __future__ import annotations

from collections import Counter
from functools import cache
from math import exp, log
from typing import Any

import numpy as np
import pytest

from radarcore.dataset.distributions import distribution_of
from radarcore.dataset.variation import share_of

NUM_DRAWS = 5_000


@cache
def shares() -> np.ndarray[Any, np.dtype[Any]]:
    return np.array([share_of(5, index, "body.ball.pose.position[0]") for index in range(NUM_DRAWS)])


def draws(table: dict[str, Any]) -> np.ndarray[Any, np.dtype[Any]]:
    distribution = distribution_of(table)
    return np.array([distribution.at(share) for share in shares().tolist()])


def assert_moments(values: np.ndarray[Any, np.dtype[Any]], mean: float, variance: float, fourth: float) -> None:
    """Within 4 standard errors; for the variance from the fourth central moment."""
    assert abs(values.mean() - mean) < 4.0 * np.sqrt(variance / len(values))
    assert abs(values.var() - variance) < 4.0 * np.sqrt((fourth - variance**2) / len(values))


def test_shares_are_uniform_and_independent_of_one_another() -> None:
    stats = pytest.importorskip("scipy.stats")  # here, as it takes most of a second to import
    assert stats.kstest(shares(), "uniform").pvalue > 0.01
    bound = 4.0 / np.sqrt(NUM_DRAWS)
    assert abs(np.corrcoef(shares()[:-1], shares()[1:])[0, 1]) < bound  # of the next sample
    others = [share_of(5, index, "body.ball.pose.position[1]") for index in range(NUM_DRAWS)]
    assert abs(np.corrcoef(shares(), others)[0, 1]) < bound  # of the next key
    others = [share_of(6, index, "body.ball.pose.position[0]") for index in range(NUM_DRAWS)]
    assert abs(np.corrcoef(shares(), others)[0, 1]) < bound  # of the next seed


def test_uniform() -> None:
    values = draws({"uniform": [-1.0, 3.0]})
    assert values.min() >= -1.0
    assert values.max() < 3.0
    assert_moments(values, 1.0, 4.0**2 / 12.0, 4.0**4 / 80.0)


def test_normal() -> None:
    assert_moments(draws({"normal": [1.2, 0.1]}), 1.2, 0.01, 3.0 * 0.1**4)


@pytest.mark.parametrize(("low", "high"), [(-0.5, 1.0), (1.5, 4.0), (-4.0, -2.0), (None, 0.3), (5.0, None)])
def test_cut_normal_is_that_of_textbooks(low: float | None, high: float | None) -> None:
    stats = pytest.importorskip("scipy.stats")
    mean, deviation = 10.0, 2.0
    bounds = {name: mean + deviation * z for name, z in (("min", low), ("max", high)) if z is not None}
    exact = stats.truncnorm(-np.inf if low is None else low, np.inf if high is None else high, mean, deviation)
    values = draws({"normal": [mean, deviation], **bounds})
    assert values.min() >= bounds.get("min", -np.inf)
    assert values.max() <= bounds.get("max", np.inf)
    fourth = exact.expect(lambda x: (x - exact.mean()) ** 4)
    assert_moments(values, exact.mean(), exact.var(), fourth)
    assert stats.kstest(values, exact.cdf).pvalue > 0.001


def test_log_uniform() -> None:
    low, high = 1e-3, 1.0
    values = draws({"log_uniform": [low, high]})
    ratio = log(high / low)
    first, second, third, fourth = ((high**k - low**k) / (k * ratio) for k in (1, 2, 3, 4))
    central = fourth - 4.0 * first * third + 6.0 * first**2 * second - 3.0 * first**4
    assert_moments(values, first, second - first**2, central)
    assert np.median(values) == pytest.approx(exp(0.5 * (log(low) + log(high))), rel=0.08)


def test_integers_have_both_ends() -> None:
    values = draws({"integers": [1, 4]})
    assert set(values.tolist()) == {1, 2, 3, 4}
    assert values.dtype.kind == "i"
    assert_moments(values, 2.5, 1.25, 2.5625)  # (1.5^2 + 0.5^2) / 2, (1.5^4 + 0.5^4) / 2


def test_choice_follows_its_weights() -> None:
    counts = Counter(draws({"choice": ["metal", "wood", "glass"], "weights": [3, 1, 0]}).tolist())
    assert set(counts) == {"metal", "wood"}
    assert abs(counts["wood"] / NUM_DRAWS - 0.25) < 4.0 * np.sqrt(0.25 * 0.75 / NUM_DRAWS)
    assert len(set(draws({"choice": [1, 2.5, "three", True]}).tolist())) == 4


@pytest.mark.parametrize(
    ("table", "values"),
    [
        ({"uniform": [1.5, 1.7], "step": 0.05}, [1.5, 1.55, 1.6, 1.65, 1.7]),
        ({"uniform": [0.0, 1.0], "step": 0.4}, [0.0, 0.4, 0.8]),
        ({"normal": [1.75, 0.1], "min": 1.62, "max": 1.86, "step": 0.05}, [1.65, 1.7, 1.75, 1.8, 1.85]),
    ],
)
def test_step_is_a_grid(table: dict[str, Any], values: list[float]) -> None:
    found = Counter(draws(table).tolist())
    assert sorted(found) == values
    assert set(distribution_of(table).ends) <= set(values)
    if "uniform" in table:
        assert min(found.values()) > 0.9 * NUM_DRAWS / len(values)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0 - 2.0**-53])
@pytest.mark.parametrize(
    "table",
    [
        {"uniform": [0.1, 0.3]},
        {"uniform": [0.1, 0.3], "step": 0.1},
        {"normal": [0.0, 1.0], "min": 4.0, "max": 5.0},
        {"log_uniform": [1e-9, 1e9]},
        {"integers": [-1, 1]},
        {"choice": [1, 2], "weights": [0.0, 0.1]},
    ],
)
def test_extreme_shares_stay_within_the_ends(table: dict[str, Any], share: float) -> None:
    distribution = distribution_of(table)
    assert min(distribution.ends) <= distribution.at(share) <= max(distribution.ends)


def test_extreme_shares_of_a_normal_distribution_are_finite() -> None:
    normal = distribution_of({"normal": [0.0, 1.0]})
    assert -9.0 < normal.at(0.0) < -8.0
    assert 8.0 < normal.at(1.0 - 2.0**-53) < 9.0
