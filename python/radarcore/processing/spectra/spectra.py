"""Range and Doppler transforms of the beat signal, and separation of transmitters in Doppler-division multiplex."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.inputs import (
    Samples,
    checked_samples,
    cube_and_waveform,
    require_uniform_chirps,
    transform_length,
)
from radarcore.processing.spectra.windows import Window, window_weights
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform, require_range


def range_profile(
    cube: Samples, waveform: Waveform | Radar | None = None, *, window: Window = "hann", num_bins: int | None = None
) -> NDArray[Any]:
    """Transform fast time to range.

    Not normalised: a tone of amplitude a in the middle of a bin gives a times the sum of the window (half of it
    from real samples). Ranges increase from 0, also for a down-chirp. The beat signal's phase over slow time is kept:
    a receding target has a positive Doppler frequency for either sign of the slope. NaN passes through, as in NumPy's
    transforms.

    Parameters
    ----------
    cube : (..., sample) float32, float64, complex64 or complex128, or Frame or Recording
        Beat signal, real or I/Q.
    waveform : Waveform or Radar, optional
        Of a cube; a frame or recording has its own.
    window : str, tuple or None
        Window over fast time, as `scipy.signal.get_window` names it (periodic).
    num_bins : int, optional
        Length n of the transform, zero-padded; default: `num_samples`.

    Returns
    -------
    profile : (..., range) complex64 or complex128
        ``n // 2 + 1`` bins from real samples, n from I/Q, in the precision of `cube`; bin k lies at
        ``waveform.range_axis(n)[k]`` [m].

    Raises
    ------
    ValueError, TypeError
        For shapes that do not fit the waveform, and for a CW radar; for integers (raw ADC counts) and other dtypes.

    See Also
    --------
    range_doppler : Ranges and velocities.
    range_time : Ranges over a recording.
    plot.range_profile : Plots it.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32)).frame()
    >>> power = (abs(rc.range_profile(frame)) ** 2).mean(axis=(0, 1))  # channels and chirps
    >>> print(f"{frame.radar.waveform.range_axis()[power.argmax()]:.2f} m")
    2.04 m
    """
    cube, waveform = cube_and_waveform(cube, waveform)
    require_range(waveform)
    return fast_spectrum(cube, waveform, window=window, num_bins=num_bins)


def fast_spectrum(cube: ArrayLike, waveform: Waveform, *, window: Window, num_bins: int | None) -> NDArray[Any]:
    """`range_profile`, also for a CW radar, whose bins are frequencies."""
    samples = checked_samples(cube, "(..., sample)", num_samples=waveform.num_samples)
    n = transform_length("num_bins", num_bins, "num_samples", waveform.num_samples)
    windowed = samples * window_weights("window", window, waveform.num_samples).astype(samples.real.dtype)
    return _fast_transform(windowed, n, waveform)


def range_doppler(
    cube: Samples,
    waveform: Waveform | Radar | None = None,
    *,
    window: Window = "hann",
    doppler_window: Window = "hann",
    num_range_bins: int | None = None,
    num_velocity_bins: int | None = None,
) -> NDArray[Any]:
    """Transform fast time to range and slow time to velocity.

    Not normalised. Zero velocity is in the middle, receding is positive. NaN passes through, as in NumPy's
    transforms. Beat frequency and Doppler frequency add. A moving target therefore appears ``velocity * f / slope``
    (f the centre frequency) behind its range at the middle of the frame; `strongest_peak` corrects this.

    Parameters
    ----------
    cube : (..., chirp, sample) float32, float64, complex64 or complex128, or Frame or Recording
        Beat signal, real or I/Q.
    waveform : Waveform or Radar, optional
        Of a cube; a frame or recording has its own. Chirps at equal intervals.
    window, doppler_window : str, tuple or None
        Windows over fast and slow time, as `scipy.signal.get_window` names them (periodic). Default: Hann, as in all
        maps, because the sidelobes of a strong echo would hide weak ones; estimators and bounds of a single echo
        (`doppler_velocity`) default to none, which is the most accurate.
    num_range_bins, num_velocity_bins : int, optional
        Lengths n of the transforms, zero-padded; default: `num_samples`, `num_chirps`.

    Returns
    -------
    spectrum : (..., doppler, range) complex64 or complex128
        At ``waveform.velocity_axis(num_velocity_bins)`` [m/s] and the first of
        ``waveform.range_axis(num_range_bins)`` [m]: ``n // 2 + 1`` from real samples, n from I/Q.

    Raises
    ------
    ValueError, TypeError
        For shapes that do not fit the waveform, for chirps at unequal intervals, and for a CW radar; for integers
        (raw ADC counts) and other dtypes.

    See Also
    --------
    range_profile : Ranges alone.
    strongest_peak : The largest, between the bins.
    detect : Targets above the noise.
    plot.range_doppler_map : Plots it.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32)).frame()
    >>> power = (abs(rc.range_doppler(frame)) ** 2).sum(axis=0)  # of all channels
    >>> row, column = np.unravel_index(power.argmax(), power.shape)
    >>> waveform = frame.radar.waveform
    >>> print(f"{waveform.range_axis()[column]:.2f} m, {waveform.velocity_axis()[row]:+.2f} m/s")
    2.04 m, -0.52 m/s
    """
    cube, waveform = cube_and_waveform(cube, waveform)
    require_range(waveform)
    samples = checked_samples(
        cube, "(..., chirp, sample)", num_chirps=waveform.num_chirps, num_samples=waveform.num_samples
    )
    require_uniform_chirps(waveform)
    n = transform_length("num_velocity_bins", num_velocity_bins, "num_chirps", waveform.num_chirps)
    num_bins = transform_length("num_range_bins", num_range_bins, "num_samples", waveform.num_samples)
    fast = window_weights("window", window, waveform.num_samples)
    slow = window_weights("doppler_window", doppler_window, waveform.num_chirps)
    return transformed(samples * both_windows(fast, slow, n, samples.real.dtype), waveform, num_bins, n)


def both_windows(
    fast: NDArray[np.float64], slow: NDArray[np.float64], num_velocity_bins: int, dtype: np.dtype[Any]
) -> NDArray[Any]:
    """Product of the windows over fast and slow time for `transformed`, (chirp, sample)."""
    if num_velocity_bins % 2 == 0:
        # Alternating signs shift zero velocity into the middle.
        slow = slow.copy()
        slow[1::2] *= -1.0
    return (slow[:, None] * fast).astype(dtype)


def transformed(
    windowed: NDArray[Any], waveform: Waveform, num_range_bins: int, num_velocity_bins: int
) -> NDArray[Any]:
    """Transform of samples times `both_windows` along both axes, in their precision."""
    from scipy.fft import fft  # here: importing radarcore imports numpy and nothing heavier

    profiles = _fast_transform(windowed, num_range_bins, waveform)
    cells: NDArray[Any] = fft(profiles, num_velocity_bins, axis=-2, overwrite_x=True)
    return cells if num_velocity_bins % 2 == 0 else np.fft.fftshift(cells, axes=-2)


def _fast_transform(windowed: NDArray[Any], num_bins: int, waveform: Waveform) -> NDArray[Any]:
    """Transform of windowed samples along the last axis, in their precision."""
    from scipy.fft import fft, ifft, rfft  # as above; several rows at a time, twice as fast as numpy's

    down = waveform.slope < 0.0
    if np.iscomplexobj(windowed):
        # The beat frequency has the sign of the slope: bin k of a down-chirp is the transform at -k.
        transform: NDArray[Any] = ifft(windowed, num_bins, norm="forward") if down else fft(windowed, num_bins)
        return transform
    # A real signal's transform at -k is the conjugate of its transform at k.
    half: NDArray[Any] = rfft(windowed, num_bins)
    return half.conj() if down else half


def powers(values: NDArray[Any]) -> NDArray[np.float64]:
    """Squared magnitudes in double precision."""
    return np.asarray(np.square(values.real, dtype=np.float64) + np.square(values.imag, dtype=np.float64))


_WHOLE = 1e-6
"""Largest deviation of a shift from a whole number of bins [bins]."""


@dataclass(frozen=True, eq=False)
class Demultiplexed:
    """Range-Doppler maps of every pair of antennas.

    Attributes
    ----------
    spectrum : (..., tx * num_rx + rx, doppler, range) complex64 or complex128
    velocity : (doppler,) float64
        Velocities of the rows [m/s], receding positive, zero in the middle.

    See Also
    --------
    demultiplex : Makes one.

    Examples
    --------
    >>> radar = rc.Radar(
    ...     rc.bgt60tr13c(num_chirps=16).waveform, tx=[[0, 0, 0], [0, 5e-3, 0]], schedule=rc.Schedule.ddm()
    ... )
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), radar).frame()
    >>> separated = rc.demultiplex(rc.range_doppler(frame), radar)
    >>> separated.spectrum.shape, separated.velocity.shape
    ((2, 8, 128), (8,))
    """

    spectrum: NDArray[Any]
    velocity: NDArray[np.float64]


def demultiplex(spectrum: ArrayLike, radar: Radar) -> Demultiplexed:
    """Separate the transmitters of a DDM radar: each contributes the rows around its zero velocity as channels.

    The echoes of transmitter i lie the fraction ``turns[i]`` of all rows below the true velocity, see `Schedule.ddm`.
    Velocities are unambiguous up to half of the smallest distance between two transmitters, ``max_velocity / num_tx``
    of the waveform for evenly spaced ones. Faster targets appear at wrong transmitters. The channels have the order
    and the `Radar.virtual_array` of the same radar without a schedule.

    Parameters
    ----------
    spectrum : (..., rx, doppler, range) complex64 or complex128
        From `range_doppler`. Transmitters must have distances of whole rows: ``num_velocity_bins`` is a multiple of
        their number.
    radar : Radar
        With `Schedule.ddm`.

    Returns
    -------
    demultiplexed : Demultiplexed
        Transmitters leak into each other if the Doppler window is wider than their distance.

    Raises
    ------
    ValueError, TypeError
        For a radar without such a schedule, other shapes, and rows that do not fit.

    See Also
    --------
    Schedule.ddm : Simultaneous transmitters, each with a Doppler code.
    range_doppler : Makes the spectrum.
    range_angle : Angles of a radar with separate transmitters.

    Examples
    --------
    >>> radar = rc.Radar(
    ...     rc.bgt60tr13c(num_chirps=16).waveform, tx=[[0, 0, 0], [0, 5e-3, 0]], schedule=rc.Schedule.ddm()
    ... )
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), radar).frame()
    >>> spectrum = rc.range_doppler(frame)
    >>> spectrum.shape, rc.demultiplex(spectrum, radar).spectrum.shape
    ((1, 16, 128), (2, 8, 128))
    """
    check.instance("radar", radar, Radar)
    schedule, num_tx, num_rx = radar.schedule, len(radar.tx), len(radar.rx)
    if schedule is None or schedule.kind != "ddm":
        got = "none" if schedule is None else repr(schedule.kind)
        raise ValueError(f"radar: expected a schedule of kind 'ddm', got {got}")
    maps = np.asarray(spectrum)
    if maps.dtype.kind != "c":
        raise TypeError(f"spectrum: expected complex numbers of range_doppler, got {maps.dtype}")
    if maps.ndim < 3 or maps.shape[-3] != num_rx:
        raise ValueError(f"spectrum: expected shape (..., rx, doppler, range) with rx = {num_rx}, got {maps.shape}")

    # Rows from the true velocity down to each transmitter's echoes, and the smallest distance of two transmitters.
    num_rows = maps.shape[-2]
    turns = schedule.tx_turns(num_tx) % 1.0
    shifts = np.rint(turns * num_rows).astype(int)
    if np.abs(turns * num_rows - shifts).max() > _WHOLE:
        raise ValueError(
            f"spectrum: expected a whole number of doppler bins between transmitters, got {num_rows} bins for turns of "
            f"{turns.tolist()} (num_velocity_bins of range_doppler)"
        )
    ordered = np.sort(shifts)
    width = int(np.diff(ordered, append=ordered[0] + num_rows).min())

    # Whole rows around each transmitter's zero velocity, which is at width // 2 as in velocity axes.
    rows = num_rows // 2 - width // 2 + np.arange(width)
    taken = (rows - shifts[:, None]) % num_rows  # (tx, doppler)
    channels = np.moveaxis(maps[..., taken, :], -3, -4)  # (..., tx, rx, doppler, range)
    shape = (*maps.shape[:-3], num_tx * num_rx, width, maps.shape[-1])
    return Demultiplexed(channels.reshape(shape), radar.waveform.velocity_axis(num_rows)[rows])
