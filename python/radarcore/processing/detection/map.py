"""Layout of a map of ranges and velocities: windows, cells, and what follows from them for every frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.processing.detection.cfar import (
    DEFAULT_RANK,
    averaging_factor,
    ordered_factor,
    require_training,
    scaled_ranks,
    tabulated,
    training_counts,
    training_sums,
)
from radarcore.processing.detection.correlated_noise import cell_rate, independent_part, independent_part_below
from radarcore.processing.detection.tone import REACH, Axes, axes_of
from radarcore.processing.spectra.noise import rounding_per_energy
from radarcore.processing.spectra.spectra import both_windows
from radarcore.processing.spectra.windows import Window, centred_window, window_centre, window_weights
from radarcore.products import product
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.units import SPEED_OF_LIGHT

LEAST_GAIN = 0.05
"""Part of the noise that must be left in a velocity row without static echoes for its cells to be tested."""

MAIN_LOBE = 2
"""Cells from the middle of an echo to the first zero of the Hann window's main lobe: where leakage from the transmitter
is, and what a cell must be guarded from."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Layout of the cells of a map, (look, row, column)."""

    slow: NDArray[np.float64]
    """Window over what the rows are the transform of; a single 1 where there is one row."""
    fast: NDArray[np.float64]
    has_velocity: bool
    has_range: bool
    is_iq: bool
    is_down: bool
    num_looks: int
    num_columns: int
    row_gain: NDArray[np.float64]
    """Noise of every row, relative to that without removal of static echoes, (row,)."""
    beat_step: float
    """Beat frequency from one column to the next [Hz], without its sign."""
    doppler_step: float
    """Doppler frequency from one row to the next [Hz]."""
    smear: float
    """Cells that a target crosses in a frame per row of its velocity."""
    coordinates: Coordinates

    @cached_property
    def is_tested(self) -> NDArray[np.bool_]:
        """True for rows with noise enough that their cells are tested, (row,)."""
        return self.row_gain > LEAST_GAIN

    @cached_property
    def gain(self) -> float:
        """Amplitude of a tone of amplitude 1 in the middle of a cell."""
        return float(self.slow.sum() * (self.fast.sum()))

    def both_windows(self, dtype: np.dtype[Any]) -> NDArray[Any]:
        """As `transformed` takes them, in the precision of the samples."""
        if dtype not in self._both_windows:
            self._both_windows[dtype] = both_windows(self.fast, self.slow, len(self.slow), dtype)
        return self._both_windows[dtype]

    @cached_property
    def _both_windows(self) -> dict[np.dtype[Any], NDArray[Any]]:
        return {}

    @cached_property
    def rounding(self) -> float:
        """Noise by rounding of the samples over the sum of their squares."""
        return rounding_per_energy(self.fast, self.slow)

    @cached_property
    def windows(self) -> tuple[bytes, bytes]:
        """Windows over what the rows and the columns are the transforms of, float64."""
        return self.slow.tobytes(), (self.fast if self.has_range else np.ones(1)).tobytes()

    @cached_property
    def axes(self) -> Axes:
        """Shape of a tone in the cells about its peak."""
        most = 2 * REACH + 1
        num_cells = min(most, self.num_rows), min(most, self.num_columns)
        windows = self.windows[0], self.fast.tobytes()
        return axes_of(windows, num_cells, is_conjugate=self.is_down)

    @cached_property
    def signed_beat_step(self) -> float:
        """Beat frequency from one column to the next, with the sign of the slope [Hz]."""
        return float(np.sign(self.coordinates.waveform.slope)) * self.beat_step

    @cached_property
    def per_variance(self) -> NDArray[np.float64]:
        """Covariance of range and velocity by the variances of row and column [cells^2], (2, 4)."""
        slopes = np.asarray(self.coordinates.slopes() * (self.signed_beat_step, self.doppler_step))
        slopes[[not self.has_range, not self.has_velocity]] = np.nan
        return np.array([np.outer(slope, slope).ravel() for slope in slopes.T[::-1]])

    @cached_property
    def metres_per_column(self) -> float:
        """Range from one column to the next [m]."""
        return abs(float(self.beat_step * self.coordinates.slopes()[0, 0]))

    @cached_property
    def num_rows(self) -> int:
        """Rows of the map."""
        return len(self.row_gain)

    def searched(self, lowest: float) -> tuple[int, int]:
        """First and last column (exclusive) to be searched."""
        if not self.has_range or self.num_columns <= 2 * MAIN_LOBE:
            return 0, self.num_columns
        first = MAIN_LOBE if lowest == -np.inf else min(MAIN_LOBE, int(max(0.0, lowest) / self.metres_per_column))
        return first, self.num_columns - (first if self.is_iq else 1)

    def wrapped_row(self, row: Any) -> Any:
        """Rows from zero velocity on: half a row below the lowest velocity is the highest."""
        half = 0.5 * self.num_rows
        return (row - self.num_rows // 2 + half) % self.num_rows - half

    def wrapped_column(self, column: Any) -> Any:
        """Columns from range zero on; range is cyclic with I/Q."""
        return column % len(self.fast) if self.is_iq and self.has_range else column


def layout_of(radar: Radar, window: Window, doppler_window: Window, subtract_mean: bool, is_iq: bool) -> Layout:
    """Layout of a radar's map, kept for the next frame unless windows may have no hash."""
    named = all(each is None or isinstance(each, str) for each in (window, doppler_window))
    return (_kept_layout if named else _new_layout)(radar, window, doppler_window, subtract_mean, is_iq)


@lru_cache(maxsize=16)
def _kept_layout(radar: Radar, *settings: Any) -> Layout:
    return _new_layout(radar, *settings)


def _new_layout(radar: Radar, window: Window, doppler_window: Window, subtract_mean: bool, is_iq: bool) -> Layout:
    wf = radar.waveform
    fast = window_weights("window", window, wf.num_samples)
    slow = centred_window("doppler_window", doppler_window, wf.num_chirps)
    centres = window_centre(fast), window_centre(slow)
    has_velocity = wf.has_uniform_chirps and bool(np.count_nonzero(slow) > 1)
    has_range = not wf.is_cw and bool(np.count_nonzero(fast) > 1)
    num_looks = radar.num_channels
    row_gain = np.ones(1)
    if has_velocity:
        row_gain = np.ones(len(slow))
        if subtract_mean:
            row_gain -= np.abs(np.fft.fftshift(np.fft.fft(slow))) ** 2 / (len(slow) * np.sum(slow**2))
    else:
        slow = np.ones(1)
        num_looks *= wf.num_chirps - int(subtract_mean)
    return Layout(
        slow=slow,
        fast=fast,
        has_velocity=has_velocity,
        has_range=has_range,
        is_iq=is_iq,
        is_down=wf.slope < 0.0,
        num_looks=num_looks,
        num_columns=1 if not has_range else wf.num_samples if is_iq else wf.num_samples // 2 + 1,
        row_gain=row_gain,
        beat_step=wf.sample_rate / wf.num_samples,
        doppler_step=1.0 / (wf.num_chirps * wf.chirp_interval),
        smear=wf.velocity_resolution * wf.duration / wf.range_resolution if has_velocity and has_range else 0.0,
        coordinates=Coordinates(wf, *centres, has_velocity),
    )


@dataclass(frozen=True)
class Coordinates:
    """Range and velocity at the middle of a frame, from frequencies at the centre of its windows.

    The phase of a uniformly moving target is quadratic in fast and slow time and windows are symmetric, so the
    frequencies at the peak are those at the centre of the windows.

    Parameters
    ----------
    waveform : Waveform
    fast_centre, slow_centre : float
        Centres of the windows [samples, chirps].
    has_velocity : bool
        False for a single chirp, or chirps at unequal intervals: there is no Doppler frequency.
    """

    waveform: Waveform
    fast_centre: float
    slow_centre: float
    has_velocity: bool

    @cached_property
    def _middle_fast(self) -> float:
        """Time of the centre within its chirp [s]."""
        return self.waveform.adc_delay + self.fast_centre / self.waveform.sample_rate

    @cached_property
    def _lead(self) -> float:
        """Time from the centre of the windows to the middle of the frame [s]."""
        wf = self.waveform
        centre = wf.chirp_times[0] + self.slow_centre * wf.chirp_interval + self._middle_fast
        return float(wf.middle - centre)

    def at(self, beat: Any, doppler: Any) -> tuple[Any, Any]:
        """Range [m] and velocity [m/s], NaN for what is not told; `beat` has the sign of the slope [Hz]."""
        wf = self.waveform
        if not self.has_velocity:
            without = np.full(np.shape(doppler + beat), np.nan)
            return without if wf.is_cw else 0.5 * SPEED_OF_LIGHT * beat / wf.slope + 0.0 * doppler, without
        if wf.is_cw:
            velocity = 0.5 * SPEED_OF_LIGHT * doppler / wf.start_frequency + 0.0 * beat
            return np.full(np.shape(velocity), np.nan), velocity
        # d/dt and d/dT of eq. (1)'s phase: doppler = rate (f0 + slope (t - tau)), beat = slope tau + doppler.
        shift = beat - doppler
        velocity = 0.5 * SPEED_OF_LIGHT * doppler / (wf.start_frequency + wf.slope * self._middle_fast - shift)
        return 0.5 * SPEED_OF_LIGHT * shift / wf.slope + velocity * self._lead, velocity

    def slopes(self) -> Any:
        """Derivatives of range and velocity by beat and Doppler frequency, (2, 2).

        Without the little that the range changes the frequency of the Doppler shift: parts of 1e-3 where the band is
        a tenth of the frequency.
        """
        wf = self.waveform
        by_beat = np.nan if wf.is_cw else 0.5 * SPEED_OF_LIGHT / wf.slope
        if not self.has_velocity:
            return np.array([[by_beat, 0.0], [0.0, np.nan]])
        by_doppler = 0.5 * SPEED_OF_LIGHT / (wf.start_frequency + wf.slope * self._middle_fast)
        return np.array([[by_beat, self._lead * by_doppler - by_beat], [0.0, by_doppler]])


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


_PER_CELL = 16
"""Points of the window's spectrum per cell."""


def envelope(window: bytes, distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest amplitude at this distance [cells] or farther, relative to that at the peak.

    Farther than half of the transform there is no other cell: that distance has the last value. The window is float64,
    as bytes, by which its envelope is kept for the next frame.
    """
    return _envelope(window).take((distance * _PER_CELL).astype(np.intp), mode="clip")


def envelope_at(window: bytes, distance: float) -> float:
    """`envelope` at a single distance, without arrays."""
    table = _listed(window)
    return table[min(int(distance * _PER_CELL), len(table) - 1)]


@lru_cache(maxsize=64)
def _listed(window: bytes) -> list[float]:
    return [float(amplitude) for amplitude in _envelope(window)]


@lru_cache(maxsize=64)
def _envelope(window: bytes) -> NDArray[np.float64]:
    weights = np.frombuffer(window)
    spectrum = np.abs(np.fft.rfft(weights, _PER_CELL * len(weights))) / weights.sum()
    return np.maximum.accumulate(spectrum[::-1])[::-1]
