"""Removal of static echoes, over the chirps of a frame and over frames."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.inputs import (
    Kind,
    Samples,
    checked_samples,
    require_one_waveform,
    require_uniform_chirps,
    with_samples,
)
from radarcore.processing.spectra.windows import window_weights
from radarcore.recording.frame import Frame, check_alike, is_of_adc
from radarcore.recording.recording import Recording

_BINOMIAL = {2: (-1.0, 1.0), 3: (1.0, -2.0, 1.0)}
"""Weights of the cancellers by number of pulses, oldest first."""


@overload
def remove_mean(cube: Kind, *, axis: int = ...) -> Kind: ...
@overload
def remove_mean(cube: ArrayLike, *, axis: int = ...) -> NDArray[Any]: ...
def remove_mean(cube: Samples, *, axis: int = -2) -> NDArray[Any] | Frame | Recording:
    """Subtract the mean along an axis, by default the mean of a frame's chirps: the static echoes.

    Targets lose their component at zero velocity. Targets slower than a velocity bin fade. The noise at zero velocity
    is removed too; `detect` takes this into account.

    Parameters
    ----------
    cube : (..., chirp, sample) float32, float64, complex64 or complex128, or Frame or Recording
        Beat signal.
    axis : int
        -2: chirps of one waveform, whose mean is the static echoes; -1: samples, whose mean is the offset of an ADC;
        -4: frames of a recording, whose mean is the echoes of objects at rest throughout.

    Returns
    -------
    moving : array of the shape and dtype of `cube`, or Frame or Recording
        A frame or recording has no codes.

    Raises
    ------
    ValueError, TypeError
        For an axis out of range, chirps of several waveforms, integers and other dtypes.

    See Also
    --------
    cancel_pulses : Differences of chirps.
    remove_running_mean : Over many frames.
    remove_static : For a radar that moves.

    Examples
    --------
    >>> wall, ball = rc.PointTarget([1.0, 0.0, 0.0]), rc.PointTarget([2.0, 0.0, 0.0], 0.01, velocity=[-0.5, 0.0, 0.0])
    >>> frame = rc.Simulator(rc.Scene([wall, ball]), rc.bgt60tr13c(num_chirps=32)).frame()
    >>> [round(rc.strongest_peak(each).range, 1) for each in (frame, rc.remove_mean(frame))]
    [1.0, 2.0]
    """
    if isinstance(cube, Frame | Recording):
        if check.index("axis", axis, cube.cube.ndim) == cube.cube.ndim - 2:
            require_one_waveform(cube.radar)
        return with_samples(cube, remove_mean(cube.cube, axis=axis), cube.radar)
    samples = checked_samples(cube, "(...)")
    where = check.index("axis", axis, samples.ndim)
    if samples.shape[where] == 0:
        return samples.copy()
    wide = np.result_type(samples.dtype, np.float64)  # the sum of a long recording
    mean = samples.mean(axis=where, keepdims=True, dtype=wide)
    return np.asarray(samples - mean.astype(samples.dtype))


@overload
def cancel_pulses(cube: Kind, *, num_pulses: int = ...) -> Kind: ...
@overload
def cancel_pulses(cube: ArrayLike, *, num_pulses: int = ...) -> NDArray[Any]: ...
def cancel_pulses(cube: Samples, *, num_pulses: int = 2) -> NDArray[Any] | Frame | Recording:
    """Moving-target indication: differences of neighbouring chirps (two pulses) or second differences (three).

    The amplitude gain at the Doppler frequency f is ``abs(2 sin(pi f T)) ** (num_pulses - 1)``, with the chirp interval
    T. Static echoes vanish, and so do targets at multiples of ``wavelength / (2 T)`` (blind speeds).

    Parameters
    ----------
    cube : (..., chirp, sample) float32, float64, complex64 or complex128, or Frame or Recording
        Beat signal; a frame or recording of one waveform with chirps at equal intervals.
    num_pulses : 2 or 3

    Returns
    -------
    moving : (..., chirp, sample), with ``num_pulses - 1`` chirps fewer, in the dtype of `cube`
        A cube is described by ``waveform.replace(num_chirps=...)``. A frame or recording has this waveform and no
        codes. It begins later by half the duration of the pulses, so that its middle, and its truth, stay.

    Raises
    ------
    ValueError, TypeError
        For fewer chirps than pulses, several waveforms, integers and other dtypes.

    See Also
    --------
    remove_mean : Takes off the mean of the chirps.
    remove_static : For a radar that moves.

    Examples
    --------
    >>> wall, ball = rc.PointTarget([1.0, 0.0, 0.0]), rc.PointTarget([2.0, 0.0, 0.0], 0.01, velocity=[-0.5, 0.0, 0.0])
    >>> frame = rc.Simulator(rc.Scene([wall, ball]), rc.bgt60tr13c(num_chirps=32)).frame()
    >>> moving = rc.cancel_pulses(frame)
    >>> moving.radar.num_chirps, round(rc.strongest_peak(moving).range, 1)
    (31, 2.0)
    """
    if isinstance(cube, Frame | Recording):
        radar = cube.radar
        require_one_waveform(radar)
        require_uniform_chirps(radar.waveform)
        moving = cancel_pulses(cube.cube, num_pulses=num_pulses)
        left = moving.shape[-2]
        wf = radar.waveform.replace(
            num_chirps=left, chirp_times=radar.waveform.chirp_times[:left], frame_interval=radar.waveform.frame_interval
        )
        return with_samples(cube, moving, replace(radar, waveform=wf), 0.5 * (num_pulses - 1) * wf.chirp_interval)
    samples = checked_samples(cube, "(..., chirp, sample)")
    if check.count("num_pulses", num_pulses) not in _BINOMIAL:
        raise ValueError(f"num_pulses: expected 2 or 3, got {num_pulses}")
    if samples.ndim < 2 or samples.shape[-2] < num_pulses:
        raise ValueError(f"cube: expected at least {num_pulses} chirps (num_pulses), got shape {samples.shape}")
    num_left = samples.shape[-2] - num_pulses + 1
    difference = np.zeros((*samples.shape[:-2], num_left, samples.shape[-1]), dtype=samples.dtype)
    for first, weight in enumerate(_BINOMIAL[num_pulses]):
        difference += samples.real.dtype.type(weight) * samples[..., first : first + num_left, :]
    return difference


@overload
def remove_running_mean(cube: Recording, time: None = ..., *, time_constant: float) -> Recording: ...
@overload
def remove_running_mean(cube: Iterator[Frame], time: None = ..., *, time_constant: float) -> Iterator[Frame]: ...
@overload
def remove_running_mean(cube: ArrayLike, time: ArrayLike, *, time_constant: float) -> NDArray[Any]: ...
def remove_running_mean(
    cube: ArrayLike | Recording | Iterator[Frame], time: ArrayLike | None = None, *, time_constant: float
) -> NDArray[Any] | Recording | Iterator[Frame]:
    """Subtract the running mean of the frames so far: echoes of objects at rest for longer than `time_constant`.

    The mean covers all frames at first, later the last `time_constant` (exponential decay, by the frames' times). In
    the first frame only motion within the frame remains.

    Parameters
    ----------
    cube : (frame, ..., chirp, sample) float32, float64, complex64 or complex128, or Recording, or iterator of Frame
        Beat signal; a recording or frames of one waveform. Frames of an iterator, such as ``sensor.frames()``, are
        filtered as they arrive.
    time : (frame,) array_like, optional
        Times of a cube's frames [s], increasing; a recording and frames have their own.
    time_constant : float
        [s].

    Returns
    -------
    moving : array of the shape and dtype of `cube`, or Recording, or iterator of Frame
        A recording and frames have no codes.

    Raises
    ------
    ValueError, TypeError
        For a single frame, times that do not fit, several waveforms, integers and other dtypes.

    See Also
    --------
    remove_mean : Over the chirps of a frame.
    remove_static : For a radar that moves.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([1.0, 0.0, 0.0])])
    >>> still = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=4)).record(0.0, 0.1)
    >>> moving = rc.remove_running_mean(still, time_constant=1.0)
    >>> bool(np.abs(moving.cube[1:]).max() < 0.1 * np.abs(still.cube).max())
    True
    """
    if isinstance(cube, Recording | Iterator) and time is not None:
        raise TypeError("time: expected none with frames or a Recording, which have their own times")
    if isinstance(cube, Recording):
        require_one_waveform(cube.radar)
        moved = remove_running_mean(cube.cube, cube.time, time_constant=time_constant)
        return with_samples(cube, moved, cube.radar)
    if isinstance(cube, Iterator):
        return _moving_frames(cube, check.positive("time_constant", time_constant, "s"))
    if isinstance(cube, Frame):
        raise TypeError("cube: expected a Recording, frames or a cube of several frames, got one Frame")
    if time is None:
        raise TypeError("time: expected the times of the frames [s] with a cube given as an array, got none")
    samples = checked_samples(cube, "(frame, ..., chirp, sample)")
    if samples.ndim < 3:
        raise ValueError(f"cube: expected shape (frame, ..., chirp, sample), got {samples.shape}")
    times = check.array("time", time, (len(samples),))
    check.in_order("time", times)
    constant = check.positive("time_constant", time_constant, "s")
    moving = np.empty_like(samples)
    mean: NDArray[Any] = np.zeros(1, samples.dtype)
    for i, frame in enumerate(samples):
        mean = updated_mean(mean, frame, i, times[i] - times[max(0, i - 1)], constant)
        moving[i] = frame - mean
    return moving


def _moving_frames(frames: Iterator[Frame], time_constant: float) -> Iterator[Frame]:
    """Frames without their running mean, as an iterator."""
    mean: NDArray[Any] = np.zeros(1)
    before: Frame | None = None
    try:
        for number, frame in enumerate(frames):
            check.instance("cube", frame, Frame)
            check_alike("cube", frame, frame.radar if before is None else before.radar, None)
            require_one_waveform(frame.radar)
            interval = 0.0 if before is None else frame.time - before.time
            if before is not None and not interval > 0.0:
                raise ValueError(
                    f"cube: expected frames of increasing times, got {frame.time:g} s after {before.time:g} s"
                )
            mean = updated_mean(mean, frame.cube, number, interval, time_constant)
            yield with_samples(frame, frame.cube - mean, frame.radar)
            before = frame
    finally:
        if isinstance(frames, Generator):  # stops a sensor's measurement
            frames.close()


def has_offsets(frame: Frame) -> bool:
    """True for ADC samples, whose offset varies from chirp to chirp; False for CW: the offset is the signal."""
    return is_of_adc(frame) and not frame.radar.waveform.is_cw and frame.radar.waveform.num_samples > 1


def without_offset(cube: NDArray[Any]) -> NDArray[Any]:
    """Samples (..., sample) without the offset of every chirp: the residual at 0 m once static echoes are removed.

    The offset is the mean weighted by the window of the range transform, to which echoes contribute almost nothing.
    """
    weights = window_weights("window", "hann", cube.shape[-1])
    return np.asarray(
        cube - np.einsum("...s,s->...", cube, (weights / weights.sum()).astype(cube.real.dtype))[..., np.newaxis]
    )


def updated_mean(
    mean: NDArray[Any], frame: NDArray[Any], num_before: int, interval: float, time_constant: float
) -> NDArray[Any]:
    """Running mean of chirps (..., 1, sample), updated with the next frame.

    Parameters
    ----------
    mean : (..., 1, sample)
        Mean of the previous frames; ignored for the first.
    frame : (..., chirp, sample)
        Next frame.
    num_before : int
        Frames in the mean.
    interval : float
        Time since the last frame in the mean [s].
    time_constant : float
        [s].
    """
    newest = frame.mean(axis=-2, keepdims=True)
    if num_before == 0:
        return np.asarray(newest)
    share = max(1.0 / (num_before + 1), -np.expm1(-interval / time_constant))
    return np.asarray(mean + frame.real.dtype.type(share) * (newest - mean))
