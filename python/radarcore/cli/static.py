"""Static echoes, removed by commands: by default of recordings of sensors, whose leakage is louder than all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.cli.source import AnyReader
from radarcore.processing.clutter.static import has_offsets, without_offset
from radarcore.processing.inputs import with_samples
from radarcore.recording.frame import Frame, is_of_adc
from radarcore.recording.recording import Recording


def removes_static(frames: AnyReader | Recording, chosen: bool | None) -> bool:
    """True when static echoes are to be removed: as chosen; else of frames that an ADC measured, more than a chirp.

    They have no truth; simulated ones have, and in these what stands still was put there.
    """
    if chosen is not None:
        return chosen
    first = next(_frames(frames), None)
    if first is None or first.truth is not None or not is_of_adc(first):
        return False
    return len(frames) * first.radar.num_chirps > 1


def moving(frames: AnyReader | Recording) -> Iterator[Frame]:
    """The frames without what stands still throughout: their mean over all chirps of the recording, taken off.

    Of an ADC's samples the offset of every chirp goes too, which differs a little from the next one's.
    """
    mean = _mean(frames)
    for frame in _frames(frames):
        yield _without(frame, mean)


def moving_frame(recording: Recording, index: int) -> Frame:
    """One of the frames that `moving` gives."""
    return _without(recording[index], _mean(recording))


def _without(frame: Frame, mean: NDArray[Any] | float) -> Frame:
    """A frame without the mean of all and offsets."""
    moving = frame.cube - mean
    if has_offsets(frame):
        moving = without_offset(moving)
    return with_samples(frame, moving.astype(frame.cube.dtype), frame.radar)


def _mean(frames: AnyReader | Recording) -> NDArray[Any] | float:
    """Mean of all chirps, (channel, 1, sample)."""
    mean: NDArray[Any] | float = 0.0
    for frame in _frames(frames):
        mean = mean + frame.cube.mean(axis=1, keepdims=True, dtype=np.result_type(frame.cube, np.float64)) / len(frames)
    return mean


def _frames(frames: AnyReader | Recording) -> Iterator[Frame]:
    return frames.frames() if isinstance(frames, Recording) else iter(frames)
