"""False-alarm rates of CFAR: factors known on paper, rates on simulated noise, masks against plain loops."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.processing.detection.cfar import averaging_factor, ordered_factor


def test_factor_of_the_mean_is_the_published_one() -> None:
    # N (Pfa^(-1/N) - 1) for N = 20, Pfa = 1e-2.
    assert averaging_factor(20, 1e-2) == pytest.approx(5.1785, abs=5e-5)
    assert averaging_factor(0, 1e-2) == np.inf
    # With ever more cells the mean is known, and the factor belongs to the exponential distribution.
    assert averaging_factor(1e9, 1e-6) == pytest.approx(-np.log(1e-6), rel=1e-7)


def test_factor_of_the_ordered_cell_is_the_published_one() -> None:
    assert ordered_factor(32, 18, 1e-6) == pytest.approx(26.127, abs=5e-4)
    factor = ordered_factor(20, 15, 1e-4)
    product_formula = np.prod([(20 - i) / (20 - i + factor) for i in range(15)])
    assert product_formula == pytest.approx(1e-4, rel=1e-10)


def test_factors_for_several_looks_are_continuous_in_them_and_known_for_one_training_cell() -> None:
    almost = 1.0 + 1e-9  # takes the general way
    assert averaging_factor(20, 1e-6, almost) == pytest.approx(averaging_factor(20, 1e-6), rel=1e-6)
    assert ordered_factor(20, 15, 1e-6, almost) == pytest.approx(ordered_factor(20, 15, 1e-6), rel=1e-6)
    # Two looks, one training cell: P(x > f y) of two gamma variables of shape 2 is (1 + 3 f) / (1 + f)^3.
    for factor in (averaging_factor(1, 1e-3, 2.0), ordered_factor(1, 1, 1e-3, 2.0)):
        assert (1.0 + 3.0 * factor) / (1.0 + factor) ** 3 == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize("num_looks", [1, 3])
@pytest.mark.parametrize("method", ["ca", "os"])
@pytest.mark.parametrize("axes", [1, 2], ids=["1-D", "2-D"])
def test_false_alarms_are_as_rare_as_set_in_the_middle_and_at_the_edges(axes: int, method: str, num_looks: int) -> None:
    # Maps narrower than two windows: most cells have a cut window. Bounds: 5 standard deviations of the counts, doubled
    # for overlapping windows; below 10 % of the rate.
    rate, shape = 1e-2, (600, 24, 20)
    power = np.random.default_rng(axes + 2 * num_looks).gamma(num_looks, size=shape).astype(np.float32)
    guard, training = (1, 6) if axes == 1 else ((1, 2), (3, 3))
    mask = rc.cfar(
        power,
        guard=guard,
        training=training,
        false_alarm_rate=rate,
        method=method,
        num_looks=num_looks,
        axes=-1 if axes == 1 else None,
    )
    corner = mask[:, :, :3] if axes == 1 else mask[:, :5, :4]
    for cells in (mask, corner):
        deviation = 2.0 / np.sqrt(rate * cells.size)
        assert abs(cells.mean() / rate - 1.0) <= 5.0 * deviation


@pytest.mark.parametrize("method", ["ca", "os"])
@pytest.mark.parametrize("shape", [(9, 11), (2, 3), (1, 12), (4, 1)])
def test_mask_is_that_of_a_loop_over_cells(method: str, shape: tuple[int, int]) -> None:
    power = np.random.default_rng(5).exponential(size=shape) ** 2
    guard, training, rate = (1, 0), (2, 4), 0.1
    expected = np.zeros(shape, dtype=bool)
    full = 7 * 9 - 3 * 1
    for i, j in product(*map(range, shape)):
        near = [
            power[k, m]
            for k, m in product(*map(range, shape))
            if abs(k - i) <= 3 and abs(m - j) <= 4 and (abs(k - i) > 1 or abs(m - j) > 0)
        ]
        if not near:
            continue
        if method == "ca":
            expected[i, j] = power[i, j] > averaging_factor(len(near), rate) * np.mean(near)
        else:
            rank = max(1, round(40 / full * len(near)))
            expected[i, j] = power[i, j] > ordered_factor(len(near), rank, rate) * np.sort(near)[rank - 1]
    mask = rc.cfar(
        power,
        guard=guard,
        training=training,
        false_alarm_rate=rate,
        method=method,
        rank=40 if method == "os" else None,
    )
    np.testing.assert_array_equal(mask, expected)


def test_axes_may_be_any_and_others_are_separate_maps() -> None:
    power = np.random.default_rng(6).exponential(size=(3, 12, 2, 10))
    settings: dict[str, Any] = {"guard": (1, 0), "training": (2, 3), "false_alarm_rate": 0.05}
    mask = rc.cfar(power, axes=(1, -1), **settings)
    for i, j in product(range(3), range(2)):
        np.testing.assert_array_equal(mask[i, :, j], rc.cfar(power[i, :, j], **settings))
    swapped = rc.cfar(power, axes=(3, 1), guard=(0, 1), training=(3, 2), false_alarm_rate=0.05)
    np.testing.assert_array_equal(swapped, mask)


def test_a_weak_echo_is_found_beside_strong_ones_by_the_ordered_statistic_alone() -> None:
    power = np.ones(60)
    power[[30, 36]] = 100.0, 1e6
    settings: dict[str, Any] = {"guard": 2, "training": 8, "false_alarm_rate": 1e-3}
    assert rc.cfar(power, method="ca", **settings).nonzero()[0].tolist() == [36]
    assert rc.cfar(power, method="os", **settings).nonzero()[0].tolist() == [30, 36]


def test_an_echo_leaves_no_rounding_error_in_the_sums_around_it() -> None:
    # 150 dB above the noise in float32, of 24 bits: sums by differences would lose the noise altogether.
    power = np.ones((30, 30), np.float32)
    power[15, 15] = 1e15
    mask = rc.cfar(power, guard=1, training=2, false_alarm_rate=0.3)
    assert mask.sum() == 1 + (np.abs(mask) & (power == 1.0)).sum()
    far = np.ones((30, 30), dtype=bool)
    far[11:20, 11:20] = False
    assert mask[15, 15]
    assert not mask[far].any()  # the factor of 0.3 is above 1


SETTINGS: dict[str, Any] = {"guard": 1, "training": 2, "false_alarm_rate": 1e-3}


def test_silence_and_empty_maps_have_no_detections() -> None:
    empty: NDArray[np.float64]
    for empty in (np.zeros((5, 6)), np.zeros((0, 6)), np.zeros((3, 0, 6)), np.ones((1, 1))):
        for method in ("ca", "os"):
            mask = rc.cfar(empty, method=method, **SETTINGS)
            assert (mask.shape, mask.dtype, mask.any()) == (empty.shape, np.dtype(bool), np.False_)
