"""What processing takes: a cube with its radar or waveform, a frame or a recording; lengths of transforms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording

Samples = ArrayLike | Frame | Recording
"""A cube, which comes with its radar or waveform, or a frame or recording, which has one."""


def cube_and_waveform(cube: Samples, waveform: Waveform | Radar | None) -> tuple[ArrayLike, Waveform]:
    """Samples and the waveform that they have."""
    if not isinstance(cube, Frame | Recording) and isinstance(waveform, Waveform):
        return cube, waveform
    samples, radar = cube_and_radar(cube, waveform, name="waveform", kinds="Waveform or Radar")
    return samples, radar.waveform


def cube_and_radar(
    cube: Samples, radar: object, *, name: str = "radar", kinds: str = "Radar"
) -> tuple[ArrayLike, Radar]:
    """Samples and the radar that they have; `name`, `kinds`: of the argument, for messages."""
    if isinstance(cube, Frame | Recording):
        if radar is not None:
            raise TypeError(f"{name}: expected none with a {type(cube).__name__}, which has its radar, got {radar!r}")
        require_one_waveform(cube.radar)
        return cube.cube, cube.radar
    if not isinstance(radar, Radar):
        got = "none" if radar is None else type(radar).__name__
        raise TypeError(f"{name}: expected {kinds} with a cube that is no Frame or Recording, got {got}")
    require_one_waveform(radar)
    return cube, radar


def require_one_waveform(radar: Radar) -> None:
    """Refuse frames of several sub-sequences with a ValueError."""
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
    """Length of a transform: zero-padding, never cutting."""
    if value is None:
        return minimum
    if (length := check.count(name, value)) < minimum:
        raise ValueError(f"{name}: expected at least {minimum} ({minimum_name}), got {length}")
    return length


def require_uniform_chirps(waveform: Waveform) -> None:
    """Refuse chirps at unequal intervals with a ValueError."""
    if not waveform.has_uniform_chirps:
        gaps = np.diff(waveform.chirp_times)
        raise ValueError(
            "waveform: expected chirps at equal intervals, because the Doppler transform takes them as evenly "
            f"spaced, got chirp_times with intervals of {gaps.min():g} to {gaps.max():g} s"
        )
