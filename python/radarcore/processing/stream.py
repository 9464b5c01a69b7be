"""Running state of a stream of frames: levels over the noise, history, detections, losses."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.peaks import parabolic_peak
from radarcore.processing.spectra import range_doppler, range_profile
from radarcore.processing.windows import window_weights
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame

LOWEST_DB = -10.0
"""Lowest level of the map [dB]."""

_MOST_RANGES, _MOST_VELOCITIES = 256, 64
"""Largest numbers of cells after padding: a finer picture is not seen and costs time in every frame."""

_MOST_COLUMNS = 400
"""Columns of the history: about as many as its axes have pixels."""

_SIDELOBES_DB = 25.0
"""Sidelobes of the Hann window are 31.5 dB below its main lobe; a mean that is taken off brings them some dB nearer."""

_FIRST_BINS = 2.0
"""Range bins without detections: the width of what leaks from transmitter to receiver (Hann)."""

_ROUNDING = 1e-12
"""Smallest noise, relative to the power of the frame as one echo; float32 rounds to less."""

_STATIC_TIME = 3.0
"""Time constant of the mean of static echoes [s]: walking leaves no trace, standing fades in seconds."""

_RATE_INTERVALS = 40
"""Intervals between frames over which the rate is measured."""


class Detection(NamedTuple):
    """Local maximum above the noise."""

    range: float
    """Range at the middle of the frame [m]."""
    velocity: float
    """Range rate, receding positive [m/s]; NaN where a frame tells nothing of it."""
    level_db: float
    """Power over the noise [dB]."""


class Stream:
    """Running levels, history and detections of the frames of one radar.

    Parameters
    ----------
    radar : Radar
    remove_static : bool
        Take off the mean of the samples over the last seconds.
    max_range : float, optional
        End of the ranges [m]; default: the largest unambiguous range.
    history : float
        Length of the history [s].
    threshold_db : float
        Smallest level of a detection [dB].
    max_detections : int
        Keep at most as many.

    Attributes
    ----------
    ranges : (range,) float64
        [m].
    velocities : (velocity,) float64 or None
        [m/s, receding positive]; None if the waveform has one or two chirps, or unevenly spaced ones.
    level : (velocity, range) float32
        Power of all channels over the median of all cells [dB], not below `LOWEST_DB`; one row without velocities.
        NaN after a frame with samples that are no finite numbers.
    history : (column, range) float32
        Level of the strongest velocity [dB], newest last; NaN where no frame was.
    detections : list of Detection
        By increasing range.
    num_frames, num_lost : int
        Frames taken, and lost between them.
    time : float
        Time of the newest frame [s].
    rate : float
        Frames per second of their own time, over the last ones; NaN before the second.
    """

    def __init__(
        self,
        radar: Radar,
        *,
        remove_static: bool = True,
        max_range: float | None = None,
        history: float = 10.0,
        threshold_db: float = 15.0,
        max_detections: int = 5,
    ) -> None:
        if not isinstance(radar, Radar):
            raise TypeError(f"radar: expected Radar, got {type(radar).__name__}")
        self.radar = radar
        self.remove_static = remove_static
        self.seconds = check.positive("history", history, "s")
        self._threshold_db = check.number("threshold_db", threshold_db, "dB")
        self._max_detections = check.count("max_detections", max_detections, 0)

        # Cells of the map.
        wf = radar.waveform
        last = radar.max_range
        if max_range is not None:
            last = min(check.positive("max_range", max_range, "m"), last)
        ranges = wf.range_axis(_num_cells(wf.num_samples, _MOST_RANGES))
        self._num_ranges, self._range_step = len(ranges), float(ranges[1])
        self.ranges = ranges[: int(np.searchsorted(ranges, last * (1.0 + 1e-9), side="right"))]
        has_velocity = wf.num_chirps > 2 and wf.has_uniform_chirps  # the window leaves one of two
        self.velocities = wf.velocity_axis(_num_cells(wf.num_chirps, _MOST_VELOCITIES)) if has_velocity else None
        self.level = np.full((1 if self.velocities is None else len(self.velocities), len(self.ranges)), np.nan, "f4")
        self.detections: list[Detection] = []

        # Columns of the history are not finer than frames come.
        num_columns = max(1, round(min(_MOST_COLUMNS, self.seconds / wf.frame_interval)))
        self.history = np.full((num_columns, len(self.ranges)), np.nan, "f4")
        self._column_time = self.seconds / num_columns
        self._origin, self._column = np.nan, 0

        self.num_frames = self.num_lost = 0
        self._times: deque[float] = deque(maxlen=_RATE_INTERVALS + 1)
        self._static: NDArray[Any] | None = None
        self._num_static = 0

    @property
    def time(self) -> float:
        """Time of the newest frame [s]; NaN before the first."""
        return self._times[-1] if self._times else np.nan

    @property
    def rate(self) -> float:
        """Frames per second of their own time, over the last ones; NaN before the second."""
        return (len(self._times) - 1) / (self._times[-1] - self._times[0]) if len(self._times) > 1 else np.nan

    def forget(self) -> None:
        """Empty the history."""
        self.history[:] = np.nan

    def take(self, frame: Frame) -> None:
        """Take the next frame.

        Raises
        ------
        ValueError, TypeError
            For a frame of another radar, and for anything but a frame.
        """
        if not isinstance(frame, Frame):
            raise TypeError(f"frame: expected Frame, got {type(frame).__name__}")
        if frame.radar is not self.radar and frame.radar != self.radar:
            raise ValueError("frame: expected one of the radar of the view, got one of another")
        if self._times and frame.time <= self.time:  # a source that starts again
            self.forget()
            self._times.clear()
        self._times.append(frame.time)
        self.num_frames += 1
        self.num_lost += int(frame.stats.get("lost_before", 0))

        self.level = np.full_like(self.level, np.nan)
        self.detections = []
        if np.isfinite(frame.cube).all():
            level = self._levels(frame.cube)
            self.detections = self._detections(level, is_real=not np.iscomplexobj(frame.cube))
            self.level[:, : level.shape[1]] = level[:, : len(self.ranges)]
        self._remember(self.level.max(axis=0))

    def _levels(self, cube: NDArray[Any]) -> NDArray[np.float32]:
        """Power over the noise of all cells, (velocity, range) [dB]."""
        wf = self.radar.waveform
        samples = self._moving(cube)
        if self.velocities is None:
            spectrum = range_profile(samples, wf, num_bins=self._num_ranges)
        else:
            spectrum = range_doppler(
                samples, wf, num_range_bins=self._num_ranges, num_velocity_bins=len(self.velocities)
            )
        power = (np.square(spectrum.real) + np.square(spectrum.imag)).sum(axis=0)
        if self.velocities is None:
            power = power.mean(axis=0, keepdims=True)

        # Power of a frame that is a single echo: the windows add its samples coherently.
        energy = float(np.vdot(cube, cube).real)
        gain = _window_gain(wf.num_samples) * (1.0 if self.velocities is None else _window_gain(wf.num_chirps))
        noise = max(float(np.median(power)), _ROUNDING * gain * energy, float(np.finfo(np.float32).tiny))
        lowest = 10.0 ** (LOWEST_DB / 10.0)
        return np.asarray(10.0 * np.log10(np.maximum(power / noise, lowest)), dtype=np.float32)

    def _moving(self, cube: NDArray[Any]) -> NDArray[Any]:
        """The samples without their mean: that of all frames at first, later that of the last seconds."""
        mean = cube.mean(axis=1, keepdims=True)
        if self._static is None or len(self._times) < 2:
            self._static, self._num_static = mean, 0
        self._num_static += 1
        if self._num_static > 1:
            forgetting = 1.0 - math.exp((self._times[-2] - self._times[-1]) / _STATIC_TIME)
            self._static = self._static + max(1.0 / self._num_static, forgetting) * (mean - self._static)
        return cube - self._static if self.remove_static else cube

    def _detections(self, level: NDArray[np.float32], *, is_real: bool) -> list[Detection]:
        """Local maxima between their neighbours, to a fraction of a cell.

        Velocity is cyclic, range too with I/Q; the spectrum of real samples is even about both its ends.
        """
        wf = self.radar.waveform
        beside = np.pad(level, ((0, 0), (1, 1)), mode="reflect" if is_real else "wrap")
        below, above = np.roll(level, 1, axis=0), np.roll(level, -1, axis=0)
        nearer, farther = beside[:, :-2], beside[:, 2:]
        ranges = self._range_step * np.arange(level.shape[1])
        is_peak = (level > nearer) & (level >= farther)
        if self.velocities is not None:
            is_peak &= (level > below) & (level >= above)
        is_peak &= level >= max(self._threshold_db, float(level.max()) - _SIDELOBES_DB)
        is_peak &= (ranges >= _FIRST_BINS * wf.range_resolution) & (ranges <= self.ranges[-1])

        found = []
        peaks = np.argwhere(is_peak)
        strongest = np.argsort(-level[is_peak], kind="stable")[: self._max_detections]
        for row, column in peaks[strongest]:
            at = row, column
            distance = self._range_step * (column + parabolic_peak(nearer[at], level[at], farther[at])[0])
            velocity = np.nan
            if self.velocities is not None:
                step = self.velocities[1] - self.velocities[0]
                velocity = self.velocities[row] + step * parabolic_peak(below[at], level[at], above[at])[0]
                distance -= velocity * wf.center_frequency / wf.slope  # beat and Doppler frequency add
            found.append(Detection(float(distance), float(velocity), float(level[at])))
        return sorted(found)

    def _remember(self, profile: NDArray[np.float32]) -> None:
        """Put a frame into the column of its time, and into those since the last frame unless that was a pause."""
        if len(self._times) < 2:
            self._origin, self._column = self.time, 0
            self.history[-1] = profile
            return
        column = round((self.time - self._origin) / self._column_time)
        steps, self._column = column - self._column, column
        if steps == 0:
            self.history[-1] = np.fmax(self.history[-1], profile)
            return
        intervals = np.diff(self._times)
        usual = float(np.median(intervals))
        filled = steps if intervals[-1] <= 1.5 * usual else max(1, round(usual / self._column_time))
        kept = max(0, len(self.history) - steps)
        self.history[:kept] = self.history[len(self.history) - kept :].copy()
        self.history[kept:] = np.nan
        self.history[-min(filled, steps, len(self.history)) :] = profile


def _num_cells(length: int, most: int) -> int:
    """Length of a padded transform: smooth to look at, quick to compute."""
    from scipy.fft import next_fast_len  # here: importing radarcore imports numpy and nothing heavier

    return int(next_fast_len(max(length, min(4 * length, most)), real=True))


def _window_gain(length: int) -> float:
    """Power of a tone in the middle of its bin over the sum of its squares."""
    weights = window_weights("window", "hann", length)
    return float(weights.sum() ** 2 / length)
