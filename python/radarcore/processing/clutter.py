"""Removal of what stands still: over the chirps of a frame, and over frames."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.inputs import checked_samples

_BINOMIAL = {2: (-1.0, 1.0), 3: (1.0, -2.0, 1.0)}
"""Weights of the cancellers by the number of their pulses, oldest first."""


def remove_mean(cube: ArrayLike, *, axis: int = -2) -> NDArray[Any]:
    """Take off the mean along an axis: of the chirps of a frame by default, which is what stands still within it.

    A target loses what it has at zero velocity: with the mean of M chirps, one that moves less than a velocity bin
    fades with it. Noise at zero velocity goes too; `detect` takes that into account.

    Parameters
    ----------
    cube : (..., chirp, sample) float32, float64, complex64 or complex128
        Beat signal.
    axis : int
        -2: chirps, whose mean is the static echoes; -1: samples, whose mean is the offset of an ADC; -4: frames of a
        recording, whose mean is what stands still throughout.

    Returns
    -------
    moving : array of the shape and dtype of `cube`
    """
    samples = checked_samples(cube, "(...)")
    where = check.index("axis", axis, samples.ndim)
    if samples.shape[where] == 0:
        return samples.copy()
    wide = np.result_type(samples.dtype, np.float64)  # the sum of a long recording
    mean = samples.mean(axis=where, keepdims=True, dtype=wide)
    return np.asarray(samples - mean.astype(samples.dtype))


def cancel_pulses(cube: ArrayLike, *, num_pulses: int = 2) -> NDArray[Any]:
    """Canceller over chirps: differences of neighbours (two pulses), or differences of these (three).

    The classic moving-target indication: a target of Doppler frequency f keeps ``abs(2 sin(pi f T))`` of its
    amplitude, with T from chirp to chirp, to the power of one less than the number of pulses. What stands still is
    gone, and so is what moves at a multiple of ``wavelength / (2 T)``.

    Parameters
    ----------
    cube : (..., chirp, sample) float32, float64, complex64 or complex128
        Beat signal.
    num_pulses : 2 or 3

    Returns
    -------
    moving : (..., chirp, sample), with ``num_pulses - 1`` chirps fewer, in the dtype of `cube`
        A waveform with as many chirps less describes it: ``waveform.replace(num_chirps=...)``.
    """
    samples = checked_samples(cube, "(..., chirp, sample)")
    if check.count("num_pulses", num_pulses) not in _BINOMIAL:
        raise ValueError(f"num_pulses: expected 2 or 3, got {num_pulses}")
    if samples.ndim < 2 or samples.shape[-2] < num_pulses:
        raise ValueError(f"cube: expected at least {num_pulses} chirps (num_pulses), got shape {samples.shape}")
    num_left = samples.shape[-2] - num_pulses + 1
    moving = np.zeros((*samples.shape[:-2], num_left, samples.shape[-1]), dtype=samples.dtype)
    for first, weight in enumerate(_BINOMIAL[num_pulses]):
        moving += samples.real.dtype.type(weight) * samples[..., first : first + num_left, :]
    return moving


def remove_running_mean(cube: ArrayLike, time: ArrayLike, *, time_constant: float) -> NDArray[Any]:
    """Take off the running mean of the frames so far: what has stood still for longer than `time_constant`.

    The mean of all frames at first, of those of the last `time_constant` later (an exponential decay, by the frames'
    times). The first frame becomes what moves within it.

    Parameters
    ----------
    cube : (frame, ..., chirp, sample) float32, float64, complex64 or complex128
        Beat signal.
    time : (frame,) array_like
        Of every frame [s], increasing.
    time_constant : float
        [s].

    Returns
    -------
    moving : array of the shape and dtype of `cube`
    """
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


def updated_mean(
    mean: NDArray[Any], frame: NDArray[Any], num_before: int, interval: float, time_constant: float
) -> NDArray[Any]:
    """Running mean of chirps (..., 1, sample) with one frame more.

    Parameters
    ----------
    mean : (..., 1, sample)
        Mean of the frames before; not looked at for the first.
    frame : (..., chirp, sample)
        Next frame.
    num_before : int
        Frames in the mean.
    interval : float
        Time since the last of them [s].
    time_constant : float
        [s].
    """
    newest = frame.mean(axis=-2, keepdims=True)
    if num_before == 0:
        return np.asarray(newest)
    share = max(1.0 / (num_before + 1), -np.expm1(-interval / time_constant))
    return np.asarray(mean + frame.real.dtype.type(share) * (newest - mean))
