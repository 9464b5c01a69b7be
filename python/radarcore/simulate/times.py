"""Starts of the frames of a run."""

from __future__ import annotations

import numpy as np

from radarcore import check

_MAX_FRAMES = 10_000_000
"""Largest number of frames of a recording: a day at 100 Hz."""


def frame_times(start: float, stop: float, rate: float) -> list[float]:
    """Starts of the frames before `stop` [s]."""
    first, last = check.number("start", start, "s"), check.number("stop", stop, "s")
    per_second = check.positive("rate", rate, "Hz")
    if last <= first:
        raise ValueError(f"stop: expected a time after start {first:g} s, got {last:g} s")
    # A stop that is a whole number of frames away, but for rounding, is not the start of one more.
    num_frames = max(1.0, float(np.ceil((last - first) * per_second - 1e-6)))
    if num_frames > _MAX_FRAMES:
        raise ValueError(f"rate, stop: expected at most {_MAX_FRAMES} frames, got {num_frames:.3g}")
    return [first + i / per_second for i in range(int(num_frames))]
