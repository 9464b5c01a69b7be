"""Layout of a map of ranges and velocities: windows, cells, and what follows from them for every frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.cells import Coordinates
from radarcore.processing.noise import rounding_per_energy
from radarcore.processing.spectra import both_windows
from radarcore.processing.tone_fit import REACH, Axes, axes_of
from radarcore.processing.windows import Window, centred_window, window_centre, window_weights
from radarcore.radar.radar import Radar

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


def layout_of(radar: Radar, window: Window, doppler_window: Window, remove_static: bool, is_iq: bool) -> Layout:
    """Layout of a radar's map, kept for the next frame unless windows may have no hash."""
    named = all(each is None or isinstance(each, str) for each in (window, doppler_window))
    return (_kept_layout if named else _new_layout)(radar, window, doppler_window, remove_static, is_iq)


@lru_cache(maxsize=16)
def _kept_layout(radar: Radar, *settings: Any) -> Layout:
    return _new_layout(radar, *settings)


def _new_layout(radar: Radar, window: Window, doppler_window: Window, remove_static: bool, is_iq: bool) -> Layout:
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
        if remove_static:
            row_gain -= np.abs(np.fft.fftshift(np.fft.fft(slow))) ** 2 / (len(slow) * np.sum(slow**2))
    else:
        slow = np.ones(1)
        num_looks *= wf.num_chirps - int(remove_static)
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
