"""Inputs of processing: a cube with its radar or waveform, a frame or a recording; lengths of transforms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import FULL_SCALE, PARTS_OF_FULL_SCALE, Frame, frame_of, unit_of
from radarcore.recording.recording import Recording

Kind = TypeVar("Kind", Frame, Recording)
Samples = ArrayLike | Frame | Recording
"""A cube, given with its radar or waveform, or a frame or recording, which has its own."""


def cube_and_waveform(cube: Samples, waveform: Waveform | Radar | None) -> tuple[ArrayLike, Waveform]:
    """Samples and their waveform."""
    if not isinstance(cube, Frame | Recording) and isinstance(waveform, Waveform):
        return cube, waveform
    samples, radar = cube_and_radar(cube, waveform, name="waveform", kinds="Waveform or Radar")
    return samples, radar.waveform


def cube_and_radar(
    cube: Samples, radar: object, *, name: str = "radar", kinds: str = "Radar"
) -> tuple[ArrayLike, Radar]:
    """Samples and their radar; messages call the argument `name` and its types `kinds`."""
    if isinstance(cube, Frame | Recording):
        if radar is not None:
            raise TypeError(f"{name}: expected none with a {type(cube).__name__}, which has its radar, got {radar!r}")
        require_one_waveform(cube.radar)
        return cube.cube, cube.radar
    if not isinstance(radar, Radar):
        got = "none" if radar is None else type(radar).__name__
        raise TypeError(f"{name}: expected {kinds} with a cube given as an array, got {got}")
    require_one_waveform(radar)
    return cube, radar


def recording_of(name: str, frames: object) -> Recording:
    """The recording itself, or a frame as a recording of one; messages call the argument `name`."""
    if isinstance(frames, Recording):
        return frames
    if not isinstance(frames, Frame):
        raise TypeError(f"{name}: expected Recording or Frame, got {type(frames).__name__}")
    unit = unit_of(frames)
    source = {} if unit is None else {"cube_unit": unit}
    return Recording(frames.cube[None], np.array([frames.time]), frames.radar, source=source)


def require_one_frame(name: str, cube: object) -> None:
    """Raise TypeError for a recording."""
    if isinstance(cube, Recording):
        raise TypeError(
            f"{name}: expected a Frame or the cube of one, got a Recording; take its frames one by one: "
            "`recording.frames()`"
        )


def require_transmitters_apart(cube: Samples, radar: Waveform | Radar | None) -> None:
    """Raise ValueError if the radar, or the frame's radar, uses Doppler-division multiplex."""
    of = cube.radar if isinstance(cube, Frame | Recording) else radar
    if isinstance(of, Radar) and has_doppler_division(of):
        raise ValueError(
            "radar: expected separate transmitters, got a schedule of kind 'ddm', in which every echo appears at one "
            "velocity per transmitter; `demultiplex` separates them in maps of `range_doppler`, and `detect` does if "
            "the turns leave a band empty, as Schedule.ddm(np.arange(num_tx) / (num_tx + 1))"
        )


def has_doppler_division(radar: Radar) -> bool:
    """True for several transmitters in Doppler-division multiplex."""
    return radar.schedule is not None and radar.schedule.kind == "ddm" and len(radar.tx) > 1


@overload
def with_samples(frame: Frame, cube: NDArray[Any], radar: Radar, delay: float = ...) -> Frame: ...
@overload
def with_samples(frame: Recording, cube: NDArray[Any], radar: Radar, delay: float = ...) -> Recording: ...
def with_samples(frame: Frame | Recording, cube: NDArray[Any], radar: Radar, delay: float = 0.0) -> Frame | Recording:
    """The frame or recording with filtered samples in the same unit, without codes, delayed by `delay` [s]."""
    unit = unit_of(frame) if isinstance(frame, Frame) else frame.source.get("cube_unit")
    told = {} if unit is None else {"cube_unit": PARTS_OF_FULL_SCALE if unit == FULL_SCALE else unit}
    if isinstance(frame, Frame):
        return frame_of(cube, frame.time + delay, radar, frame.truth, frame.stats | told)
    return replace(frame, cube=cube, radar=radar, time=frame.time + delay, source=frame.source | told)


def require_one_waveform(radar: Radar) -> None:
    """Raise ValueError for a radar with several sub-sequences per frame."""
    if radar.more_waveforms:
        raise ValueError(
            f"radar: expected one waveform, got {len(radar.waveforms)}; `.sequences()` of a frame, recording or radar "
            "has one for each"
        )


def checked_samples(cube: ArrayLike, axes: str, num_dimensions: int | None = None, **lengths: int) -> NDArray[Any]:
    """The cube as an array of a floating dtype whose last axes have the given lengths."""
    samples = np.asarray(cube)
    native = samples.dtype.newbyteorder("=")
    if native not in (np.float32, np.float64, np.complex64, np.complex128):
        advice = " (raw ADC counts: scale them first, e.g. counts.astype('float32') / 4095)"
        raise TypeError(
            "cube: expected float32, float64, complex64 or complex128, "
            f"got {samples.dtype}{advice if samples.dtype.kind in 'iu' else ''}"
        )
    wrong_dimensions = samples.ndim != num_dimensions if num_dimensions else samples.ndim < len(lengths)
    if wrong_dimensions or samples.shape[samples.ndim - len(lengths) :] != tuple(lengths.values()):
        expected = ", ".join(f"{name} = {length}" for name, length in lengths.items())
        raise ValueError(f"cube: expected shape {axes} with {expected}, got {samples.shape}")
    return samples.astype(native, copy=False)


def transform_length(name: str, value: int | None, minimum_name: str, minimum: int) -> int:
    """Length of a transform; at least the minimum, because transforms pad and never truncate."""
    if value is None:
        return minimum
    if (length := check.count(name, value)) < minimum:
        raise ValueError(f"{name}: expected at least {minimum} ({minimum_name}), got {length}")
    return length


def range_limits(min_range: float | None, max_range: float | None) -> tuple[float, float]:
    """Lower and upper limit of the range [m]; 0 and infinity for None."""
    nearest = 0.0 if min_range is None else check.non_negative("min_range", min_range, "m")
    farthest = np.inf if max_range is None else check.positive("max_range", max_range, "m")
    if farthest < nearest:
        raise ValueError(f"max_range: expected at least min_range = {nearest:g} m, got {farthest:g}")
    return nearest, farthest


def require_uniform_chirps(waveform: Waveform) -> None:
    """Raise ValueError for chirps at unequal intervals."""
    if not waveform.has_uniform_chirps:
        gaps = np.diff(waveform.chirp_times)
        raise ValueError(
            "waveform: expected chirps at equal intervals, because the Doppler transform takes them as evenly "
            f"spaced, got chirp_times with intervals of {gaps.min():g} to {gaps.max():g} s"
        )
