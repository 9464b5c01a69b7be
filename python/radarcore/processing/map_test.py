"""Test of the cells of a range-Doppler map against their surroundings, at the false-alarm rate of local maxima."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.constant_false_alarm import (
    DEFAULT_RANK,
    scaled_ranks,
    tabulated,
    training_counts,
    training_sums,
)
from radarcore.processing.correlated_noise import cell_rate, independent_part, independent_part_below
from radarcore.processing.false_alarms import averaging_factor, ordered_factor


@dataclass(frozen=True, eq=False)
class MapTest:
    """Factors of the thresholds of a map."""

    guards: tuple[int, int]
    trainings: tuple[int, int]
    factor: NDArray[np.float64]
    """Threshold over the background, inf without training cells, (row, column)."""
    per_sum: NDArray[np.float64]
    """Threshold over the sum of the training cells, 0 without any, (row, column)."""
    ranks: NDArray[np.float64] | None
    """Of the ordered statistic, (row, column); None for averages."""

    def passed(
        self, power: NDArray[Any], is_candidate: NDArray[np.bool_]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64], NDArray[Any]]:
        """Rows, columns and thresholds of the candidates above it, and their training cells (inf for missing ones)."""
        if self.ranks is None:
            threshold = training_sums(power, self.guards, self.trainings) * self.per_sum.astype(power.dtype)
            rows, columns = np.nonzero(is_candidate & (power > threshold) & (self.per_sum > 0.0))
            return rows, columns, threshold[rows, columns], self._around(power, rows, columns)
        rows, columns = np.nonzero(is_candidate & np.isfinite(self.factor))
        around = self._around(power, rows, columns)
        # Above the factor times the k-th smallest: k training cells are below the cell over the factor. No sorting.
        limit = (power[rows, columns] / self.factor[rows, columns]).astype(power.dtype)
        above = np.flatnonzero(np.count_nonzero(around < limit[:, None], axis=1) >= self.ranks[rows, columns])
        rows, columns, around = rows[above], columns[above], np.sort(around[above], axis=1)
        ordered = around[np.arange(len(rows)), self.ranks[rows, columns].astype(np.intp) - 1]
        return rows, columns, self.factor[rows, columns] * ordered, around

    def _around(self, power: NDArray[Any], rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[Any]:
        """Training cells of some cells, inf where the map has none, (cell, training cell)."""
        reach = [g + t for g, t in zip(self.guards, self.trainings, strict=True)]
        padded = np.full([n + 2 * r for n, r in zip(power.shape, reach, strict=True)], np.inf, dtype=power.dtype)
        padded[reach[0] : reach[0] + power.shape[0], reach[1] : reach[1] + power.shape[1]] = power
        width = padded.shape[1]
        middle = (rows + reach[0]) * width + columns + reach[1]
        around: NDArray[Any] = padded.ravel()[middle[:, None] + _offsets(self.guards, self.trainings, width)]
        return around


@lru_cache(maxsize=16)
def map_test(
    shape: tuple[int, int],
    windows: tuple[bytes, bytes],
    guards: tuple[int, int],
    trainings: tuple[int, int],
    rate: float,
    method: str,
    num_looks: int,
) -> MapTest:
    """Test of the local maxima of a map.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns.
    windows : (bytes, bytes)
        Windows over slow and fast time, float64; as bytes, by which the test is kept for the next frame.
    guards, trainings : (int, int)
        Cells on each side, of rows and columns.
    rate : float
        False alarms per cell.
    method : "ca" or "os"
    num_looks : int
        Powers added in every cell.
    """
    slow, fast = map(np.frombuffer, windows)
    rate = cell_rate(slow, fast, rate, num_looks)
    counts = training_counts(shape, guards, trainings)
    share = independent_part(slow, fast, guards, trainings, rate, num_looks)
    ranks = None
    if method == "ca":
        factor = averaging_factor(np.maximum(share * counts, np.minimum(counts, 1)), rate, num_looks)
    else:
        ranks = scaled_ranks(counts, DEFAULT_RANK)
        share = independent_part_below(share, DEFAULT_RANK, num_looks)

        def ordered(count: float) -> float:
            """At the same quantile, of as many cells as are independent."""
            independent = max(1.0, share * count)
            rank = float(scaled_ranks(np.array([count]), DEFAULT_RANK)[0])
            return ordered_factor(independent, rank * (independent + 1.0) / (count + 1.0), rate, num_looks)

        factor = tabulated(counts, ordered)
    per_sum = np.where(np.isfinite(factor), factor, 0.0) / np.maximum(counts, 1)
    return MapTest(guards, trainings, factor, per_sum, ranks)


@lru_cache(maxsize=16)
def _offsets(guards: tuple[int, int], trainings: tuple[int, int], width: int) -> NDArray[np.intp]:
    """Training cells relative to the one in the middle, in a map with rows of `width` cells laid end to end."""
    rows, columns = (np.arange(-g - t, g + t + 1) for g, t in zip(guards, trainings, strict=True))
    is_beside = (np.abs(rows)[:, None] > guards[0]) | (np.abs(columns) > guards[1])
    return (rows[:, None] * width + columns)[is_beside]
