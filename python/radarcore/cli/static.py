"""What stands still, taken off by commands: by default of recordings of sensors, whose leakage is louder than all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.cli.source import AnyReader
from radarcore.processing.inputs import with_samples
from radarcore.recording.frame import FULL_SCALE, PARTS_OF_FULL_SCALE, Frame, unit_of
from radarcore.recording.recording import Recording


def removes_static(frames: AnyReader | Recording, chosen: bool | None) -> bool:
    """Whether what stands still is to be taken off: as chosen; else of frames that an ADC measured, more than a chirp.

    They have no truth; simulated ones have, and in these what stands still was put there.
    """
    if chosen is not None:
        return chosen
    first = next(_frames(frames), None)
    if first is None or first.truth is not None or unit_of(first) not in (FULL_SCALE, PARTS_OF_FULL_SCALE):
        return False
    return len(frames) * first.radar.num_chirps > 1


def moving(frames: AnyReader | Recording) -> Iterator[Frame]:
    """The frames without what stands still throughout: their mean over all chirps of the recording, taken off."""
    mean = _mean(frames)
    for frame in _frames(frames):
        yield with_samples(frame, (frame.cube - mean).astype(frame.cube.dtype), frame.radar)


def moving_frame(recording: Recording, index: int) -> Frame:
    """One of the frames that `moving` gives."""
    frame = recording[index]
    return with_samples(frame, (frame.cube - _mean(recording)).astype(frame.cube.dtype), frame.radar)


def _mean(frames: AnyReader | Recording) -> NDArray[Any] | float:
    """Mean of all chirps, (channel, 1, sample)."""
    mean: NDArray[Any] | float = 0.0
    for frame in _frames(frames):
        mean = mean + frame.cube.mean(axis=1, keepdims=True, dtype=np.result_type(frame.cube, np.float64)) / len(frames)
    return mean


def _frames(frames: AnyReader | Recording) -> Iterator[Frame]:
    return frames.frames() if isinstance(frames, Recording) else iter(frames)
