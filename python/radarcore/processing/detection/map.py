"""Range-velocity map of `detect`: settings, layout of the cells and thresholds."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.detection.cfar import (
    averaging_factor,
    checked_rate,
    per_axis,
    require_training,
    training_counts,
)
from radarcore.processing.detection.tone import REACH, Axes, axes_of
from radarcore.processing.inputs import range_limits
from radarcore.processing.spectra.noise import rounding_per_energy
from radarcore.processing.spectra.spectra import both_windows
from radarcore.processing.spectra.windows import (
    Window,
    centred_window,
    hashable,
    independent_share,
    window_centre,
    window_weights,
)
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform, require_range
from radarcore.records import sealed
from radarcore.units import SPEED_OF_LIGHT

LEAST_GAIN = 0.05
"""Least noise gain of a velocity row after removal of static echoes; rows below are not tested."""

MAIN_LOBE = 2
"""Cells from the middle of an echo to the first zero of the Hann window's main lobe: the extent of leakage, and the
guard cells."""


_TRAINING_2D, _TRAINING_1D = 8, 16
"""Training cells on each side: several hundred in a map, so that the threshold hardly fluctuates; nearby ones in a
profile."""

_HIGHEST_RATE = 0.01
"""Largest false-alarm rate: about one in ten cells of noise is a local maximum."""


@sealed
@dataclass(kw_only=True, unsafe_hash=True)
class DetectionSettings:
    """Settings of `detect`, checked; `guard` and `training` may be given as one number."""

    false_alarm_rate: float
    guard: tuple[int, int]
    training: tuple[int, int] | None
    subtract_mean: bool
    window: Window
    doppler_window: Window
    min_range: float | None
    max_range: float | None
    dynamic_range_db: float

    def __post_init__(self) -> None:
        self.guard = cells_per_side("guard", self.guard)
        self.training = None if self.training is None else cells_per_side("training", self.training)
        self.false_alarm_rate = checked_rate(self.false_alarm_rate)
        if self.false_alarm_rate > _HIGHEST_RATE:
            raise ValueError(
                f"false_alarm_rate: expected at most {_HIGHEST_RATE:g} per cell, got {self.false_alarm_rate:g}"
            )
        if self.training is not None and not any(self.training):
            raise ValueError(f"training: expected at least one cell on a side, got {self.training!r}")
        self.subtract_mean = check.flag("subtract_mean", self.subtract_mean)
        self.window = hashable("window", self.window)
        self.doppler_window = hashable("doppler_window", self.doppler_window)
        range_limits(self.min_range, self.max_range)
        self.dynamic_range_db = check.positive("dynamic_range_db", self.dynamic_range_db, "dB")


_settings_of = lru_cache(maxsize=16, typed=True)(DetectionSettings)


def settings_of(**values: Any) -> DetectionSettings:
    """Settings of `detect`, checked once for all frames."""
    with suppress(TypeError):  # lists and arrays have no hash
        return _settings_of(**values)
    return DetectionSettings(**values)


def cells_per_side(name: str, value: int | Sequence[int]) -> tuple[int, int]:
    """Numbers of cells along velocity and range."""
    row, column = per_axis(name, value, 2, 0)
    return row, column


@dataclass(frozen=True, eq=False)
class Layout:
    """Layout of the cells of a map, (look, row, column)."""

    slow: NDArray[np.float64]
    """Window over slow time; a single 1 for a map with one row."""
    fast: NDArray[np.float64]
    has_velocity: bool
    has_range: bool
    is_iq: bool
    is_down: bool
    num_looks: int
    num_columns: int
    row_gain: NDArray[np.float64]
    """Noise gain of every row due to removal of static echoes, (row,)."""
    beat_step: float
    """Beat frequency from one column to the next, with the sign of the slope [Hz]."""
    doppler_step: float
    """Doppler frequency from one row to the next [Hz]."""
    smear: float
    """Cells crossed by a target during a frame, per row of its velocity."""
    coordinates: Coordinates

    @cached_property
    def weights(self) -> dict[np.dtype[Any], NDArray[Any]]:
        """Product of the windows, as `transformed` needs it, (chirp, sample), in both precisions."""
        kinds = map(np.dtype, (np.float32, np.float64))
        return {kind: both_windows(self.fast, self.slow, len(self.slow), kind) for kind in kinds}

    @cached_property
    def rounding(self) -> float:
        """Least noise of a cell, all looks together, over the sum of the squared samples."""
        return self.num_looks * rounding_per_energy(self.fast, self.slow)

    @cached_property
    def gain(self) -> float:
        """Power of an echo of amplitude 1 in the middle of a cell."""
        return float(self.slow.sum() * self.fast.sum()) ** 2

    @cached_property
    def envelopes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Envelopes for `sidelobes` along rows and columns."""
        return envelope(self.slow), envelope(self.fast if self.has_range else np.ones(1))

    @cached_property
    def mean_gain(self) -> NDArray[np.float64]:
        """Gain of the subtracted mean of the chirps in every row, (row,): it contains a part of all echoes."""
        if not (self.row_gain < 1.0).any():
            return np.zeros(self.num_rows)
        spectrum = np.abs(np.fft.fftshift(np.fft.fft(self.slow))) / self.slow.sum()
        return np.asarray(np.where(spectrum > 1e-9, spectrum, 0.0) / np.sqrt(np.maximum(self.row_gain, LEAST_GAIN)))

    @cached_property
    def mean_envelope(self) -> NDArray[np.float64]:
        """Envelope of echoes in the mean of the chirps, by their distance from zero velocity."""
        return envelope(np.ones(self.num_rows))

    @cached_property
    def axes(self) -> Axes:
        """Shape of a tone in the cells around its peak."""
        most = 2 * REACH + 1
        num_cells = min(most, self.num_rows), min(most, self.num_columns)
        return axes_of((self.slow, self.fast), num_cells, is_conjugate=self.is_down)

    @cached_property
    def covariances(self) -> NDArray[np.float64]:
        """Covariance of range and velocity by the variances of row and column, (2, 4); NaN for unobservable ones."""
        slopes: NDArray[np.float64] = self.coordinates.slopes()[:, ::-1] * [self.doppler_step, self.beat_step]
        slopes[[not self.has_range, not self.has_velocity]] = np.nan
        return np.asarray(np.einsum("ik,jk->kij", slopes, slopes).reshape(2, 4))

    @cached_property
    def num_rows(self) -> int:
        """Rows of the map."""
        return len(self.row_gain)

    def searched(self, lowest: float | None) -> tuple[int, int]:
        """First and last column (exclusive) of the search."""
        if not self.has_range or self.num_columns <= 2 * MAIN_LOBE:
            return 0, self.num_columns
        metres_per_column = self.beat_step * self.coordinates.slopes()[0, 0]
        first = MAIN_LOBE if lowest is None else min(MAIN_LOBE, int(lowest / metres_per_column))
        return first, self.num_columns - (first if self.is_iq else 1)

    def wrapped_row(self, row: Any) -> Any:
        """Row relative to zero velocity, wrapped: half a row below the lowest velocity is the highest."""
        half = 0.5 * self.num_rows
        return (row - self.num_rows // 2 + half) % self.num_rows - half

    def wrapped_column(self, column: Any) -> Any:
        """Column relative to range zero; range is cyclic with I/Q."""
        return column % len(self.fast) if self.is_iq and self.has_range else column


def layout_of(radar: Radar, window: Window, doppler_window: Window, subtract_mean: bool, is_iq: bool) -> Layout:
    """Layout of a radar's map."""
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
        beat_step=np.sign(wf.slope) * wf.sample_rate / wf.num_samples,
        doppler_step=1.0 / (wf.num_chirps * wf.chirp_interval),
        smear=wf.velocity_resolution * wf.duration / wf.range_resolution if has_velocity and has_range else 0.0,
        coordinates=Coordinates(wf, *centres, has_velocity),
    )


@dataclass(frozen=True)
class Coordinates:
    """Range and velocity at the middle of a frame, from frequencies at the centre of its windows.

    The phase of a uniformly moving target is quadratic in fast and slow time and the windows are symmetric. The
    frequencies at the peak are therefore the frequencies at the centre of the windows.

    Parameters
    ----------
    waveform : Waveform
    fast_centre, slow_centre : float
        Centres of the windows [samples, chirps].
    has_velocity : bool
        False for a single chirp, or chirps at unequal intervals, which give no Doppler frequency.
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
        """Range [m] and velocity [m/s], NaN for unobservable ones; `beat` has the sign of the slope [Hz]."""
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

        Neglects the effect of range on the frequency of the Doppler shift: of the order 1e-3 if the bandwidth is a
        tenth of the frequency.
        """
        wf = self.waveform
        by_beat = np.nan if wf.is_cw else 0.5 * SPEED_OF_LIGHT / wf.slope
        if not self.has_velocity:
            return np.array([[by_beat, 0.0], [0.0, np.nan]])
        by_doppler = 0.5 * SPEED_OF_LIGHT / (wf.start_frequency + wf.slope * self._middle_fast)
        return np.array([[by_beat, self._lead * by_doppler - by_beat], [0.0, by_doppler]])


@dataclass(frozen=True, eq=False)
class Search:
    """Tested cells of a map and their thresholds; training cells are in the columns `first` to `last`."""

    layout: Layout
    first: int
    last: int
    """Exclusive."""
    guards: tuple[int, int]
    trainings: tuple[int, int]
    scale: NDArray[np.float64]
    """Threshold over the sum of the training cells, 0 for untested cells, (row, column from `first` on)."""
    factor: NDArray[np.float64]
    """Threshold over the background, inf without training cells, (row, column from `first` on)."""


@lru_cache(maxsize=16)
def prepared(radar: Radar, is_iq: bool, settings: DetectionSettings) -> Search:
    """Search of a radar's frames, prepared once for all frames."""
    if settings.min_range is not None or settings.max_range is not None:
        require_range(radar.waveform)
    if settings.subtract_mean and radar.waveform.num_chirps < 2:
        raise ValueError("subtract_mean: expected at least two chirps for a mean, got one")
    layout = layout_of(radar, settings.window, settings.doppler_window, settings.subtract_mean, is_iq)
    first, last = layout.searched(settings.min_range)
    guards, trainings = settings.guard, settings.training
    if trainings is None:
        trainings = 2 * (_TRAINING_2D if layout.has_velocity and layout.has_range else _TRAINING_1D,)
    counts = training_counts((layout.num_rows, last - first), guards, trainings)
    require_training(counts, guards)

    # The effective number of training cells is smaller, see `independent_share`.
    share = independent_share(layout.slow) * (independent_share(layout.fast) if layout.has_range else 1.0)
    independent = np.maximum(share * counts, np.minimum(counts, 1))
    factor = averaging_factor(independent, settings.false_alarm_rate, layout.num_looks)
    is_tested = np.isfinite(factor) & (layout.row_gain > LEAST_GAIN)[:, None]
    scale = np.where(is_tested, factor, 0.0) / np.maximum(counts, 1)
    return Search(layout, first, last, guards, trainings, scale, factor)


_PER_CELL = 16
"""Points of the window's spectrum per cell."""


def envelope(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest amplitude of a window's transform at or beyond a distance from the peak, 16 points per cell.

    The reference is the smallest peak height that a parabola through the log power of three cells can give.
    """
    spectrum = np.abs(np.fft.rfft(weights, _PER_CELL * len(weights))) / weights.sum()
    lobes = np.maximum.accumulate(spectrum[::-1])[::-1]
    if len(weights) < 3:
        return np.ascontiguousarray(lobes)
    cells = np.abs(np.arange(_PER_CELL // 2 + 1) + _PER_CELL * np.array([[-1], [0], [1]]))
    left, middle, right = np.log(np.maximum(spectrum[cells], 1e-12))
    found = middle - 0.125 * (right - left) ** 2 / (left - 2.0 * middle + right)
    return np.ascontiguousarray(lobes / np.exp(found).min())


def sidelobes(envelope: NDArray[np.float64], distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Amplitude of an `envelope` at distances [cells], relative to the peak; constant after its last point."""
    return envelope.take((distance * _PER_CELL).astype(np.intp), mode="clip")
