"""Running state of a stream of frames: levels over the noise, history, detections, losses."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.clutter.static import has_offsets, updated_mean, without_offset
from radarcore.processing.detection.detect import detect
from radarcore.processing.spectra.noise import noise_level, rounding_noise
from radarcore.processing.spectra.spectra import range_doppler, range_profile
from radarcore.processing.spectra.windows import window_weights
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame

LOWEST_DB = -10.0
"""Lowest level of the map [dB]."""

_MOST_RANGES, _MOST_VELOCITIES = 256, 64
"""Largest numbers of cells after padding: a finer picture is not seen and costs time in every frame."""

_MOST_COLUMNS = 400
"""Columns of the history: about one per pixel of its axes."""

_DYNAMIC_RANGE_DB = 25.0
"""Weaker detections than this below the strongest are hidden: residual static echoes, limbs."""

_FALSE_ALARM_RATE = 1e-7
"""Detections per cell of noise: of some thousand cells, one in an hour at 40 frames per second would need 1e-9; the
threshold in dB is mostly higher."""

STATIC_TIME = 3.0
"""Time constant of the mean of static echoes [s]: walking leaves no trace, standing fades in seconds."""

_RATE_INTERVALS = 40
"""Intervals between frames over which the rate is measured."""


class Detection(NamedTuple):
    """One of the `Detections` of a frame, for the eye."""

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
    subtract_mean : bool
        Take off the mean of the samples over the last seconds, and of an ADC's the offset of every chirp.
    max_range : float, optional
        End of the ranges [m]; default: the largest unambiguous range.
    history : float
        Length of the history [s].
    threshold_db : float
        Smallest level of a detection [dB].
    max_detections : int
        Largest number to store.

    Attributes
    ----------
    ranges : (range,) float64
        [m].
    velocities : (velocity,) float64 or None
        [m/s, receding positive]; None if the waveform has one or two chirps, or unevenly spaced ones.
    level : (velocity, range) float32
        Power of all channels over the noise (`noise_level` of the map) [dB], not below `LOWEST_DB`; one row without
        velocities.
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
        subtract_mean: bool = True,
        max_range: float | None = None,
        history: float = 10.0,
        threshold_db: float = 15.0,
        max_detections: int = 5,
    ) -> None:
        check.instance("radar", radar, Radar)
        self.radar = radar
        self.subtract_mean = subtract_mean
        self.seconds: float = check.positive("history", history, "s")
        self._threshold_db = check.number("threshold_db", threshold_db, "dB")
        self._max_detections = check.count("max_detections", max_detections, 0)

        # Cells of the map.
        wf = radar.waveform
        last = radar.max_unambiguous_range
        if max_range is not None:
            last = min(check.positive("max_range", max_range, "m"), last)
        ranges = wf.range_axis(_num_cells(wf.num_samples, _MOST_RANGES))
        self._num_ranges, self._range_step = len(ranges), float(ranges[1])
        self.ranges: NDArray[np.float64] = ranges[: int(np.searchsorted(ranges, last * (1.0 + 1e-9), side="right"))]
        has_velocity = wf.num_chirps > 2 and wf.has_uniform_chirps  # the window leaves one of two
        self.velocities: NDArray[np.float64] | None = (
            wf.velocity_axis(_num_cells(wf.num_chirps, _MOST_VELOCITIES)) if has_velocity else None
        )
        self.level: NDArray[np.float32] = np.full(
            (1 if self.velocities is None else len(self.velocities), len(self.ranges)), np.nan, "f4"
        )
        self.detections: list[Detection] = []

        # Columns of the history are not finer than frames come.
        num_columns = max(1, round(min(_MOST_COLUMNS, self.seconds / wf.frame_interval)))
        self.history: NDArray[np.float32] = np.full((num_columns, len(self.ranges)), np.nan, "f4")
        self._column_time = self.seconds / num_columns
        self._origin, self._column = np.nan, 0

        self.num_frames: int = 0
        self.num_lost: int = 0
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
        check.instance("frame", frame, Frame)
        if frame.radar is not self.radar and frame.radar != self.radar:
            raise ValueError("frame: expected one of the radar of the view, got one of another")
        if self._times and frame.time <= self.time:  # a source that starts again
            self.forget()
            self._times.clear()
        self._times.append(frame.time)
        self.num_frames += 1
        self.num_lost += frame.lost_before or 0

        self.level = np.full_like(self.level, np.nan)
        self.detections = []
        if np.isfinite(frame.cube).all():
            moving = self._moving(frame)
            self.level[:] = self._levels(frame.cube, moving)
            self.detections = self._detections(moving)
        self._remember(self.level.max(axis=0))

    def _levels(self, cube: NDArray[Any], moving: NDArray[Any]) -> NDArray[np.float32]:
        """Power over the noise of the cells shown, (velocity, range) [dB]."""
        wf = self.radar.waveform
        num_looks = len(moving)
        if self.velocities is None:
            spectrum = range_profile(moving, wf, num_bins=self._num_ranges)
        else:
            spectrum = range_doppler(
                moving, wf, num_range_bins=self._num_ranges, num_velocity_bins=len(self.velocities)
            )
        power = (np.square(spectrum.real) + np.square(spectrum.imag)).sum(axis=0)
        if self.velocities is None:
            power = power.sum(axis=0, keepdims=True)
            num_looks *= wf.num_chirps
        fast = window_weights("window", "hann", wf.num_samples)
        slow = np.ones(1) if self.velocities is None else window_weights("window", "hann", wf.num_chirps)
        noise = max(noise_level(power, num_looks=num_looks), num_looks * rounding_noise(cube, fast, slow))
        lowest = 10.0 ** (LOWEST_DB / 10.0)
        level = np.maximum(power[:, : len(self.ranges)] / noise, lowest)
        return np.asarray(10.0 * np.log10(level), dtype=np.float32)

    def _moving(self, frame: Frame) -> NDArray[Any]:
        """The samples without their mean (of all frames at first, later of the last seconds) and offsets."""
        cube = frame.cube
        if self._static is None or len(self._times) < 2:
            self._static, self._num_static = np.zeros(1, cube.dtype), 0
        interval = self._times[-1] - self._times[-2] if self._num_static else 0.0
        self._static = updated_mean(self._static, cube, self._num_static, interval, STATIC_TIME)
        self._num_static += 1
        if not self.subtract_mean:
            return cube
        moving = cube - self._static
        return without_offset(moving) if has_offsets(frame) else moving

    def _detections(self, moving: NDArray[Any]) -> list[Detection]:
        """The strongest detections above the threshold, by increasing range."""
        found = detect(moving, self.radar, false_alarm_rate=_FALSE_ALARM_RATE, dynamic_range_db=_DYNAMIC_RANGE_DB)
        found = found[(found.snr_db >= self._threshold_db) & (found.range <= self.ranges[-1])]
        strongest = np.sort(np.argsort(-found.snr_db, kind="stable")[: self._max_detections])
        rows = np.stack([found.range, found.velocity, found.snr_db], axis=1)[strongest]
        return [Detection(*row) for row in rows.tolist()]

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
