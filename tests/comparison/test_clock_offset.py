"""Offsets between clocks are recovered from a walker, with their deviation; signals without an offset raise an
error."""

from __future__ import annotations

import tracemalloc
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

import radarcore as rc
from radarcore.processing import ClockOffset, clock_offset

Array = NDArray[np.float64]
RADAR = np.array([0.0, 0.0, 0.8])


@cache
def walker(seed: int) -> CubicSpline:
    """Distance [m] of the trunk of a person who walks in circles for 25 s, from -2 s on."""
    rng = np.random.default_rng(seed)
    corners = np.tile([[1.5, -1.0], [4.0, -1.0], [4.0, 1.0], [1.5, 1.0]], (4, 1))
    path = corners + rng.uniform(-0.3, 0.3, corners.shape)
    person = rc.models.Human(path=path, speed=rng.uniform(1.1, 1.5), turn_radius=0.3, start_time=-2.0)
    motion = next(body.motion for body in person.bodies() if body.name.endswith("trunk"))
    times = np.arange(-2.0, 23.0, 0.004)
    return CubicSpline(times, np.linalg.norm(motion.poses_at(times)[..., 3] - RADAR, axis=1))


def radar_track(seed: int, distance: CubicSpline, noise: float = 0.01) -> tuple[Array, Array]:
    """Track at 40 Hz of 20 s, 7 cm too near, with noise [m] and half a second that is missing."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, 20.0, 0.025)
    values = distance(times) - 0.07 + noise * rng.normal(size=len(times))
    values[300:320] = np.nan
    return times, values


def capture(seed: int, distance: CubicSpline, rate: float, offset: float) -> tuple[Array, Array]:
    """Motion capture of 22 s on a clock that is late, with noise of 0.3 mm and two occlusions."""
    rng = np.random.default_rng(seed)
    times = np.arange(-1.0, 21.0, 1.0 / rate)
    values = distance(times) + 3e-4 * rng.normal(size=len(times))
    values[(times > 4.2) & (times < 5.1)] = np.nan
    is_there = (times < 11.0) | (times > 11.4)  # frames that are not there at all
    return times[is_there] - offset, values[is_there]


@pytest.mark.parametrize(("rate", "offset"), [(100.0, -1.2345), (240.0, 1.9)])
def test_known_offsets_of_a_walker_are_recovered_within_2_ms(rate: float, offset: float) -> None:
    seed = int(rate)
    distance = walker(seed)
    found = clock_offset(*radar_track(seed, distance), *capture(seed, distance, rate, offset), max_offset=2.0)
    assert abs(found.offset - offset) < 2e-3
    assert found.deviation < 1e-3
    assert found.correlation > 0.98


def test_deviation_is_that_of_the_errors() -> None:
    distance = walker(1)
    found = [
        clock_offset(*radar_track(seed, distance, 0.02), *capture(seed, distance, 120.0, 0.5), max_offset=1.0)
        for seed in range(10)
    ]
    errors = np.array([one.offset for one in found]) - 0.5
    ratio = np.sqrt(np.mean(np.square(errors))) / np.mean([one.deviation for one in found])
    # The root mean square of 10 errors is known to 22 %.
    assert 0.5 < ratio < 1.6


def test_without_noise_the_offset_is_exact() -> None:
    distance = walker(2)
    times = np.arange(0.0, 20.0, 0.025)
    faster = np.arange(-1.0, 21.0, 0.01)
    found = clock_offset(times, distance(times), faster - 0.333, distance(faster), max_offset=1.0)
    assert abs(found.offset - 0.333) < 5e-6
    back = clock_offset(faster - 0.333, distance(faster), times, distance(times), max_offset=1.0)
    assert abs(back.offset + found.offset) < 1e-6


def test_scale_and_constant_difference_do_not_matter() -> None:
    distance = walker(3)
    times, values = radar_track(3, distance)
    other = capture(3, distance, 120.0, 0.25)
    plain = clock_offset(times, values, *other, max_offset=1.0)
    scaled = clock_offset(times, 1000.0 + 0.8 * values, *other, max_offset=1.0)
    assert scaled.offset == pytest.approx(plain.offset, abs=1e-9)
    assert scaled.correlation == pytest.approx(plain.correlation, abs=1e-9)


def test_clocks_that_count_from_other_days_need_a_guess() -> None:
    distance = walker(4)
    times, values = radar_track(4, distance)
    found = clock_offset(1.7e9 + times, values, *capture(4, distance, 120.0, 0.6), max_offset=1.0, around=1.7e9 + 1.0)
    assert isinstance(found, ClockOffset)
    assert abs(found.offset - 1.7e9 - 0.6) < 2e-3


def test_offsets_that_leave_no_overlap_are_no_rivals() -> None:
    distance = walker(6)
    track, other = radar_track(6, distance), capture(6, distance, 120.0, 0.4)
    widest = clock_offset(*track, *other, max_offset=100.0)
    assert widest == clock_offset(*track, *other, max_offset=1.0)


TIMES = np.arange(0.0, 20.0, 0.025)
WALK = walker(5)(TIMES)
STEADY = 3.0 + 0.2 * np.sin(2.0 * np.pi * TIMES)


RANDOM = np.cumsum(np.random.default_rng(0).normal(size=800))
SLOW = 100.0 * TIMES**2 - np.where(TIMES < 10.0, WALK, 0.0)
PIECES = np.where(np.arange(800) % 20 < 3, WALK, np.nan)
MIXED = {"times_b": np.append(TIMES, 1.7e9), "values_b": np.append(WALK, 2.0)}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"values_b": np.full(800, 2.0)}, "values_b: expected values whose slope varies, got a constant slope"),
        ({"values_a": 1.0 + 0.5 * TIMES}, "values_a: expected values whose slope varies, got a constant slope"),
        (
            {"values_a": STEADY, "values_b": STEADY},
            r"values_a: .* got two, .* give a smaller max_offset",
        ),
        ({"values_b": -WALK}, r"values_b: expected the motion of values_a, got a correlation of -?0\.\d+ at most"),
        ({"values_b": RANDOM}, "values_b: expected the motion of values_a"),
        ({"values_b": SLOW, "max_offset": 0.5}, "values_b: expected the motion of values_a"),
        ({"times_b": TIMES + 100.0}, r"max_offset: expected records that overlap within 1\.5 s, got none"),
        ({"times_b": TIMES + 1.55, "max_offset": 1.52}, r"max_offset: expected the best offset within 1\.52 s"),
        ({"times_b": TIMES + 1e9, "max_offset": 1e7}, "max_offset: expected records that overlap within 1e\\+07 s"),
        ({"values_a": np.full(800, np.nan)}, "values_a: expected at least 4 that are not NaN, got 0"),
        ({"values_a": PIECES}, r"times_a: expected stretches longer than 0\.4 s without gaps"),
        ({"values_a": np.full(800, np.inf)}, "values_a: expected finite numbers or NaN, got inf"),
        ({"values_a": WALK[1:]}, r"values_a: expected shape \(800,\), got \(799,\)"),
        ({"times_b": TIMES[::-1]}, r"times_b: expected increasing times \[s\]"),
        (MIXED, r"times_b: expected times of one record, .* nothing between 19\.975 and 1\.7e\+09 s"),
        ({"max_offset": 0.0}, "max_offset: expected a positive number"),
        ({"smoothing": 0.001}, r"smoothing: expected at least 0\.0125 s, half a step, got 0\.001 s"),
    ],
)
def test_records_that_do_not_tell_the_offset_are_refused(given: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"times_a": TIMES, "values_a": WALK, "times_b": TIMES, "values_b": WALK}
    with pytest.raises(ValueError, match=message):
        clock_offset(**arguments | {"max_offset": 1.5} | given)


def test_memory_does_not_grow_with_the_rate_of_one_record() -> None:
    """A slow radar against motion at 20 kHz: 2 x 10^5 numbers, and half a gigabyte if every window is there at once."""
    distance = walker(3)
    slow, fast = np.arange(0.0, 20.0, 0.2), np.arange(-1.0, 21.0, 5e-5)
    tracemalloc.start()
    found = clock_offset(slow, distance(slow), fast - 0.3, distance(fast), max_offset=1.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 120e6
    assert abs(found.offset - 0.3) < 0.01
