"""One time base for recordings and truth: offsets of clocks, middles of frames, frames that are missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore.recording.recording import Recording

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RecordingOffset:
    """Offset of a recording's clock.

    Parameters
    ----------
    seconds : float
        Added to the times of the recording it gives those of the common base [s].
    deviation : float
        Standard deviation [s]; 0 of one that was given.
    is_estimated : bool
    """

    seconds: float
    deviation: float = 0.0
    is_estimated: bool = False


@dataclass(frozen=True)
class Dropped:
    """Frames that are missing before one that is there.

    Parameters
    ----------
    frame : int
        Index of the frame after the gap.
    time : float
        Its start, by the common base [s].
    count : int
        Number of missing frames.
    is_counted : bool
        Whether the recording counts them itself; the gap of the times tells otherwise.
    """

    frame: int
    time: float
    count: int
    is_counted: bool


def middles(recording: Recording, offset: float = 0.0) -> _Floats:
    """Middle of every frame, by the common base [s]: ranges, velocities and truth hold there."""
    return np.asarray(recording.time) + recording.radar.middle + offset


def usual_interval(recording: Recording) -> float:
    """Ordinary interval of frames [s]."""
    if len(recording) < 2:
        return recording.radar.waveform.frame_interval
    return float(np.median(np.diff(recording.time)))


def dropped_frames(recording: Recording, offset: float = 0.0) -> tuple[Dropped, ...]:
    """Frames that a recording lacks: as it counts them itself, and as gaps of its times tell."""
    interval = usual_interval(recording)
    by_gap = np.zeros(len(recording), dtype=np.int64)
    by_gap[1:] = np.rint(np.diff(recording.time) / interval).astype(np.int64) - 1
    counted = np.zeros(len(recording), dtype=np.int64) if recording.lost is None else np.asarray(recording.lost)
    numbers = np.maximum(by_gap, counted)
    return tuple(
        Dropped(int(k), float(recording.time[k]) + offset, int(numbers[k]), bool(counted[k] >= by_gap[k]))
        for k in np.flatnonzero(numbers > 0)
    )
