"""Channels of transmitters that sent at once: Doppler-division multiplexing taken apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.radar.radar import Radar

_WHOLE = 1e-6
"""Part of a bin by which a shift may miss a whole number of bins."""


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
    >>> apart = rc.demultiplex(rc.range_doppler(frame), radar)
    >>> apart.spectrum.shape, apart.velocity.shape
    ((2, 8, 128), (8,))
    """

    spectrum: NDArray[Any]
    velocity: NDArray[np.float64]


def demultiplex(spectrum: ArrayLike, radar: Radar) -> Demultiplexed:
    """Take the transmitters of a DDM radar apart: the rows around zero velocity of each, as channels of their own.

    The rows of transmitter i lie ``turns[i]`` of all rows below the true velocity, see `Schedule.ddm`. Only velocities
    up to half of the smallest distance between two transmitters are unambiguous, ``max_velocity / num_tx`` of the
    waveform for evenly spaced ones: faster targets appear at wrong transmitters. The channels are those of the same
    radar without a schedule, whose `Radar.virtual_array` they have.

    Parameters
    ----------
    spectrum : (..., rx, doppler, range) complex64 or complex128
        Of `range_doppler`; transmitters must be a whole number of rows apart: ``num_velocity_bins`` a multiple of
        their number.
    radar : Radar
        With `Schedule.ddm`.

    Returns
    -------
    demultiplexed : Demultiplexed
        A Doppler window that is wider than the distance of two transmitters leaks from one into the other.

    Raises
    ------
    ValueError, TypeError
        For a radar without such a schedule, other shapes, and rows that do not fit.

    See Also
    --------
    Schedule.ddm : Transmitters that send at once, each with a Doppler code.
    range_doppler : Spectrum that it takes.
    range_angle : Angles of a radar whose transmitters are apart.

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

    # Rows by which the echoes of every transmitter lie below the true velocity, and the least distance of two.
    num_rows = maps.shape[-2]
    turns = schedule.tx_turns(num_tx) % 1.0
    shifts = np.rint(turns * num_rows).astype(int)
    if np.abs(turns * num_rows - shifts).max() > _WHOLE:
        raise ValueError(
            f"spectrum: expected transmitters a whole number of doppler bins apart, got {num_rows} bins for turns of "
            f"{turns.tolist()} (num_velocity_bins of range_doppler)"
        )
    ordered = np.sort(shifts)
    width = int(np.diff(ordered, append=ordered[0] + num_rows).min())

    # Around zero velocity of each: whole rows, zero at width // 2 as in velocity axes.
    rows = num_rows // 2 - width // 2 + np.arange(width)
    taken = (rows - shifts[:, None]) % num_rows  # (tx, doppler)
    channels = np.moveaxis(maps[..., taken, :], -3, -4)  # (..., tx, rx, doppler, range)
    shape = (*maps.shape[:-3], num_tx * num_rx, width, maps.shape[-1])
    return Demultiplexed(channels.reshape(shape), radar.waveform.velocity_axis(num_rows)[rows])
