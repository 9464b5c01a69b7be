"""Test of the cells of a range-Doppler map against their surroundings, at the false-alarm rate of local maxima."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.processing.constant_false_alarm import (
    DEFAULT_RANK,
    require_training,
    scaled_ranks,
    tabulated,
    training_counts,
    training_sums,
)
from radarcore.processing.correlated_noise import cell_rate, independent_part, independent_part_below
from radarcore.processing.false_alarms import averaging_factor, ordered_factor
from radarcore.products import product

_Indices = NDArray[np.intp]

_MOST_BY_PRODUCTS = 128
"""Rows or columns up to which sums are products with matrices of ones and zeros: a few calls instead of dozens."""


@dataclass(frozen=True, eq=False)
class MapTest:
    """Factors of the thresholds of a map."""

    guards: tuple[int, int]
    trainings: tuple[int, int]
    counts: NDArray[np.intp]
    """Training cells, (row, column)."""
    factor: NDArray[np.float64]
    """Threshold over the background, inf without training cells, (row, column)."""
    per_sum: NDArray[np.float64]
    """Threshold over the sum of the training cells, 0 without any, (row, column)."""
    ranks: NDArray[np.float64] | None
    """Of the ordered statistic, (row, column); None for averages."""

    @cached_property
    def has_training(self) -> NDArray[np.bool_]:
        """True for cells that have training cells, (row, column)."""
        return np.isfinite(self.factor)

    def passed(
        self, power: NDArray[Any], are_candidates: Callable[[_Indices, _Indices], NDArray[np.bool_]]
    ) -> tuple[_Indices, _Indices, NDArray[np.float64]]:
        """Rows, columns and thresholds of the cells above it that are candidates, which are asked for by both."""
        if self.ranks is None:
            threshold = self._sums(power) * self._in(power.dtype)[0]
            is_above = power > threshold
            is_above &= self.has_training
            index = is_above.ravel().nonzero()[0]  # of two dimensions at once it takes longer than all before
            rows, columns = np.divmod(index, power.shape[1])
            kept = are_candidates(rows, columns)
            return rows[kept], columns[kept], threshold.ravel()[index[kept]]
        rows, columns = np.nonzero(self.has_training)
        kept = are_candidates(rows, columns)
        rows, columns = rows[kept], columns[kept]
        around = self._around(power, rows, columns)
        # Above the factor times the k-th smallest: k training cells are below the cell over the factor. No sorting.
        limit = (power[rows, columns] / self.factor[rows, columns]).astype(power.dtype)
        above = np.flatnonzero(np.count_nonzero(around < limit[:, None], axis=1) >= self.ranks[rows, columns])
        rows, columns, around = rows[above], columns[above], np.sort(around[above], axis=1)
        ordered = around[np.arange(len(rows)), self.ranks[rows, columns].astype(np.intp) - 1]
        return rows, columns, self.factor[rows, columns] * ordered

    def _sums(self, power: NDArray[Any]) -> NDArray[Any]:
        """Sums of the training cells, (row, column), see `training_sums`: of small maps by two products of matrices."""
        if max(power.shape) > _MOST_BY_PRODUCTS:
            return training_sums(power, self.guards, self.trainings)
        _, over_columns, over_rows = self._in(power.dtype)
        parts = product(power, over_columns).reshape(-1, power.shape[1])  # of every row two
        return product(over_rows, parts)

    def _in(self, dtype: np.dtype[Any]) -> tuple[NDArray[Any], ...]:
        """`per_sum` and `_bands` in the precision of a map."""
        if dtype not in self._by_dtype:
            self._by_dtype[dtype] = tuple(each.astype(dtype) for each in (self.per_sum, *self._bands))
        return self._by_dtype[dtype]

    @cached_property
    def _by_dtype(self) -> dict[np.dtype[Any], tuple[NDArray[Any], ...]]:
        return {}

    @cached_property
    def _bands(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Masks of the cells that are added: columns beside the guard cells, and of the whole window; then rows."""
        rows, columns = (np.abs(np.subtract.outer(*2 * [np.arange(length)])) for length in self.counts.shape)
        (row_guard, column_guard), (row_training, column_training) = self.guards, self.trainings
        across, along = columns <= column_guard + column_training, rows <= row_guard + row_training
        over_columns = np.concatenate([across & (columns > column_guard), across], axis=1)
        over_rows = np.stack([rows <= row_guard, along & (rows > row_guard)], axis=2).reshape(len(rows), -1)
        return over_columns, over_rows

    def medians(self, power: NDArray[Any], rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.float64]:
        """Medians of the training cells of some cells that have any."""
        cells = np.ascontiguousarray(np.array([rows, columns]).T)
        map_ = np.ascontiguousarray(power, np.float64)
        return _core.training_medians(map_, cells, guards=self.guards, trainings=self.trainings)

    def _around(self, power: NDArray[Any], rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[Any]:
        """Training cells of some cells, inf where the map has none, (cell, training cell)."""
        top, left = self.guards[0] + self.trainings[0], self.guards[1] + self.trainings[1]
        height, width = power.shape[0] + 2 * top, power.shape[1] + 2 * left
        padded = np.full((height, width), np.inf, dtype=power.dtype)
        padded[top : height - top, left : width - left] = power
        middle = (rows + top) * width + columns + left
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
    require_training(counts, guards)
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
    return MapTest(guards, trainings, counts, factor, per_sum, ranks)


@lru_cache(maxsize=16)
def _offsets(guards: tuple[int, int], trainings: tuple[int, int], width: int) -> NDArray[np.intp]:
    """Training cells relative to the one in the middle, in a map with rows of `width` cells laid end to end."""
    rows, columns = (np.arange(-g - t, g + t + 1) for g, t in zip(guards, trainings, strict=True))
    is_beside = (np.abs(rows)[:, None] > guards[0]) | (np.abs(columns) > guards[1])
    return (rows[:, None] * width + columns)[is_beside]
