"""Power over a whole recording, by velocity (spectrogram, micro-Doppler) and by range."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.clutter.static import has_offsets, without_offset
from radarcore.processing.inputs import range_limits, recording_of, require_one_waveform, require_uniform_chirps
from radarcore.processing.spectra.noise import known_noise
from radarcore.processing.spectra.spectra import fast_spectrum, powers
from radarcore.processing.spectra.windows import Window, window_centre, window_weights
from radarcore.radar.waveform import require_range
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording

USUAL_LENGTH = 64
"""Frames of a single chirp per column."""

_SAME_INTERVAL = 0.25
"""Largest delay of a single-chirp frame without a gap, relative to the interval. A lost frame delays the next one by
an interval, a host's timestamps by a tenth."""

_SEAMLESS = 1e-3
"""Frames have no gap if the next chirp is late by less than this many chirp intervals. The phase of the fastest
unambiguous target then errs by at most `pi` times this [rad]."""


@dataclass(frozen=True, eq=False)
class Spectrogram:
    """Power of velocities over time.

    Attributes
    ----------
    time : (column,) float64
        Middle of every column's window [s]: a target with constant acceleration has the measured velocity then.
    velocity : (velocity,) float64
        Range rate [m/s], increasing, receding positive; NaN for a window of a single chirp.
    power : (column, velocity) float64
        ``abs(range_doppler(...))**2`` added over the ranges of the gate and over channels.
    noise : float or None
        Mean of `power` for the receiver's noise alone; None if unknown.

    See Also
    --------
    spectrogram : Makes one.

    Examples
    --------
    >>> history = rc.spectrogram(recording)
    >>> history.power.shape, history.velocity[history.power[0].argmax()].round(2).item()
    ((12, 32), -0.52)
    """

    time: NDArray[np.float64]
    velocity: NDArray[np.float64]
    power: NDArray[np.float64]
    noise: float | None = None


@dataclass(frozen=True, eq=False)
class RangeTime:
    """Power of ranges over time.

    Attributes
    ----------
    time : (frame,) float64
        Middle of every frame [s].
    range : (range,) float64
        Range of every bin [m].
    power : (frame, range) float64
        ``abs(range_profile(...))**2``, mean over chirps and added over channels.
    noise : float or None
        Mean of `power` for the receiver's noise alone; None if unknown.

    See Also
    --------
    range_time : Makes one.

    Examples
    --------
    >>> history = rc.range_time(recording)
    >>> history.power.shape, history.range[history.power[[0, -1]].argmax(axis=1)].round(2).tolist()
    ((12, 65), [2.04, 1.89])
    """

    time: NDArray[np.float64]
    range: NDArray[np.float64]
    power: NDArray[np.float64]
    noise: float | None = None


def spectrogram(
    recording: Recording | Frame,
    *,
    channel: int | None = None,
    window_length: int | None = None,
    overlap: float = 0.5,
    min_range: float | None = None,
    max_range: float | None = None,
    subtract_mean: bool = False,
    window: Window = "hann",
    doppler_window: Window = "hann",
    num_velocity_bins: int | None = None,
) -> Spectrogram:
    """Velocities over time: short-time Doppler transforms along the chirps of a recording.

    The window never spans a gap. Frames are bursts of chirps, usually with pauses between them. Then each frame gives
    one column, or several with a shorter window. Frames are contiguous where the first chirp of one comes a chirp
    interval after the last of the frame before (by `Recording.time`, to a thousandth of the interval). The window then
    continues across the border and may be longer than a frame. Frames of a single chirp count as chirps at the frame
    interval: a window spans several of them, up to a missing frame.

    Parameters
    ----------
    recording : Recording or Frame
        Frames with chirps at equal intervals; a frame counts as a recording of one.
    channel : int, optional
        One channel, negative numbers count from the end; default: sum of the powers of all.
    window_length : int, optional
        Chirps per column; default: the chirps of a frame, or 64 frames of a single chirp (fewer if the longest run
        without a gap is shorter). Shorter: finer in time, coarser in velocity; velocities of a single chirp are NaN.
    overlap : float
        Part of the window shared with the next one, from 0 to below 1.
    min_range, max_range : float, optional
        Range gate [m]: the bins of the range profile whose centres lie within; none for a CW radar. Default: all.
    subtract_mean : bool
        Subtract from every range bin and channel its mean over the recording, for a radar at rest (`remove_static` is
        for a moving radar). Objects at rest throughout vanish; slow ones, and objects that rest for a while, stay. The
        offset of every chirp, which varies slightly, is removed from ADC samples too.
    window, doppler_window : str, tuple or None
        Windows over fast and slow time, as `scipy.signal.get_window` names them (periodic).
    num_velocity_bins : int, optional
        Length of the Doppler transform, zero-padded; default: `window_length`.

    Returns
    -------
    spectrogram : Spectrogram

    Raises
    ------
    ValueError, TypeError
        For numbers out of range, a gate without a bin, a window longer than the longest run of chirps without a gap,
        chirps at unequal intervals, and frames of several waveforms.

    See Also
    --------
    range_time : Ranges over time.
    range_doppler : Velocities of a frame, with their phases.
    plot.spectrogram : Plots it.

    Examples
    --------
    >>> history = rc.spectrogram(recording, window_length=16, overlap=0.0)
    >>> print(f"{len(history.time)} columns, {history.velocity[history.power[0].argmax()]:+.2f} m/s")
    24 columns, -0.52 m/s
    """
    # Check all arguments before any work.
    recording = recording_of("recording", recording)
    require_one_waveform(recording.radar)
    wf = recording.radar.waveform
    require_uniform_chirps(wf)
    interval, late = wf.chirp_interval, _SEAMLESS
    if wf.num_chirps == 1 and len(recording) > 1:
        interval, late = float(np.median(np.diff(recording.time))), _SAME_INTERVAL
    is_seamless = _is_seamless(recording, interval, late)
    longest = wf.num_chirps * _longest_run(is_seamless) if len(recording) > 0 else wf.num_chirps
    usual = wf.num_chirps if wf.num_chirps > 1 else min(USUAL_LENGTH, longest)
    length = usual if window_length is None else check.count("window_length", window_length)
    shared = check.non_negative("overlap", overlap)
    if shared >= 1.0:
        raise ValueError(f"overlap: expected a part of the window, 0 to below 1, got {overlap!r}")
    step = max(1, round(length * (1.0 - shared)))
    num_bins = length if num_velocity_bins is None else check.count("num_velocity_bins", num_velocity_bins)
    if num_bins < length:
        raise ValueError(f"num_velocity_bins: expected at least {length} (window_length), got {num_bins}")
    weights = window_weights("doppler_window", doppler_window, length)
    fast_weights = window_weights("window", window, wf.num_samples)
    gate = _gate(recording, min_range, max_range)
    if len(recording) > 0 and length > longest:
        raise ValueError(
            f"window_length: expected at most {longest}, the most chirps without a gap in this recording, got {length}"
        )

    # Slide the window along each run of chirps. A frame's chirps are appended to the remainder of the run before.
    to_middle = window_centre(weights) * interval + (
        wf.chirp_times[0] + wf.adc_delay + window_centre(fast_weights) / wf.sample_rate
    )
    channels = _channels(recording, channel)
    to_middle += float(recording.radar.channel_offsets[channels].mean())
    times, powers = [np.empty(0)], [np.empty((0, num_bins))]
    left: NDArray[Any] | None = None
    for index, profile in enumerate(_profiles(recording, channels, gate, window, subtract_mean)):
        run = profile if left is None or not is_seamless[index] else np.concatenate([left, profile], axis=1)
        num_columns = max(0, (run.shape[1] - length) // step + 1)
        starts = step * np.arange(num_columns)
        after_frame = (starts - (run.shape[1] - wf.num_chirps)) * interval
        times.append(recording.time[index] + after_frame + to_middle)
        powers.extend(_doppler_power(run[:, k : k + length], weights, num_bins) for k in starts)
        left = run[:, num_columns * step :]
    noise = known_noise(recording, fast_weights, weights)
    num_ranges = len(range(*gate.indices(_num_ranges(recording))))
    noise = noise and noise * num_ranges * len(recording.radar.channel_offsets[channels])
    velocity = np.full(num_bins, np.nan)
    if np.count_nonzero(weights) > 1:
        velocity = wf.velocity_axis(num_bins) * (wf.chirp_interval / interval)
    return Spectrogram(np.concatenate(times), velocity, np.concatenate(powers), noise)


def range_time(
    recording: Recording | Frame,
    *,
    channel: int | None = None,
    subtract_mean: bool = False,
    window: Window = "hann",
    num_bins: int | None = None,
) -> RangeTime:
    """Range profiles over time: one column per frame.

    Parameters
    ----------
    recording : Recording or Frame
        A frame counts as a recording of one.
    channel : int, optional
        One channel, negative numbers count from the end; default: sum of the powers of all.
    subtract_mean : bool
        Subtract from every range bin and channel its mean over the recording, as in `spectrogram`.
    window : str, tuple or None
        Window over fast time, as `scipy.signal.get_window` names it (periodic).
    num_bins : int, optional
        Length of the range transform, zero-padded; default: `num_samples`.

    Returns
    -------
    range_time : RangeTime

    Raises
    ------
    ValueError, TypeError
        For numbers out of range, a CW radar, and frames of several waveforms.

    See Also
    --------
    spectrogram : Velocities over time.
    range_profile : Ranges of a frame, with their phases.
    plot.range_time : Plots it.

    Examples
    --------
    >>> history = rc.range_time(recording)
    >>> print(f"{history.range[history.power[0].argmax()]:.2f} m at {history.time[0]:.3f} s")
    2.04 m at 0.005 s
    """
    recording = recording_of("recording", recording)
    require_one_waveform(recording.radar)
    wf = recording.radar.waveform
    require_range(wf)
    n = wf.num_samples if num_bins is None else check.count("num_bins", num_bins)
    num_ranges = _num_ranges(recording, n)
    power = np.empty((len(recording), num_ranges))
    channels = _channels(recording, channel)
    for i, profile in enumerate(_profiles(recording, channels, slice(None), window, subtract_mean, num_bins=n)):
        power[i] = powers(profile).mean(axis=1).sum(axis=0)
    noise = known_noise(recording, window_weights("window", window, wf.num_samples))
    noise = noise and noise * len(recording.radar.channel_offsets[channels])
    return RangeTime(recording.time + recording.radar.middle, wf.range_axis(n)[:num_ranges], power, noise)


def _channels(recording: Recording, channel: int | None) -> slice:
    """Channels whose powers are added."""
    if channel is None:
        return slice(None)
    index = check.index("channel", channel, recording.radar.num_channels)
    return slice(index, index + 1)


def _num_ranges(recording: Recording, length: int | None = None) -> int:
    """Bins of a range transform of a length; default length: the number of samples."""
    n = recording.radar.waveform.num_samples if length is None else length
    return n if np.iscomplexobj(recording.cube) else n // 2 + 1


def _profiles(
    recording: Recording,
    channels: slice,
    gate: slice,
    window: Window,
    subtract_mean: bool,
    num_bins: int | None = None,
) -> Iterator[NDArray[Any]]:
    """Range profiles (channel, chirp, range), frame by frame: a cube on disk is not loaded as a whole."""
    wf = recording.radar.waveform
    takes_offset = subtract_mean and len(recording) > 0 and has_offsets(recording[0])

    def profile(frame: NDArray[Any]) -> NDArray[Any]:
        samples = without_offset(frame[channels]) if takes_offset else frame[channels]
        return fast_spectrum(samples, wf, window=window, num_bins=num_bins)[..., gate]

    mean: NDArray[Any] | float = 0.0
    if subtract_mean:
        for frame in recording.cube:
            mean = mean + profile(frame).mean(axis=1, keepdims=True, dtype=np.complex128) / len(recording)
    for frame in recording.cube:
        kept = profile(frame)
        yield (kept - mean).astype(kept.dtype)


def _doppler_power(run: NDArray[Any], weights: NDArray[np.float64], num_bins: int) -> NDArray[np.float64]:
    """Power (1, velocity) of one window of profiles (channel, chirp, range)."""
    spectrum = np.fft.fft(run * weights.astype(run.real.dtype)[:, None], num_bins, axis=1)
    power: NDArray[np.float64] = np.fft.fftshift(powers(spectrum).sum(axis=(0, 2)))
    return power[None]


def _gate(recording: Recording, min_range: float | None, max_range: float | None) -> slice:
    """Bins of the range profile between two ranges."""
    nearest, farthest = range_limits(min_range, max_range)
    wf = recording.radar.waveform
    if wf.is_cw:
        if min_range is not None or max_range is not None:
            require_range(wf)
        return slice(None)
    ranges = wf.range_axis()[: None if np.iscomplexobj(recording.cube) else wf.num_samples // 2 + 1]
    if nearest > ranges[-1]:
        raise ValueError(f"min_range: expected at most {ranges[-1]:g} m, the last range bin, got {nearest:g}")
    first, last = np.searchsorted(ranges, nearest), np.searchsorted(ranges, farthest, side="right")
    if first == last:
        raise ValueError(
            f"max_range: expected a gate that holds the centre of a range bin (one each {wf.range_resolution:g} m), "
            f"got {nearest:g} to {farthest:g} m"
        )
    return slice(int(first), int(last))


def _is_seamless(recording: Recording, interval: float, late: float) -> NDArray[np.bool_]:
    """True for every frame that begins when the previous one ends, (frame,); False for the first.

    Chirps follow every `interval` [s]; a frame may be `late`, or early, by this part of an interval.
    """
    gaps = np.diff(recording.time, prepend=np.nan) - recording.radar.waveform.num_chirps * interval
    return np.abs(gaps) <= late * interval


def _longest_run(is_seamless: NDArray[np.bool_]) -> int:
    """Frames of the longest run without a gap."""
    firsts = np.flatnonzero(~is_seamless)
    return int(np.diff(firsts, append=len(is_seamless)).max())
