"""Strongest peak of a frame with sub-bin accuracy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.inputs import checked_samples, require_uniform_chirps
from radarcore.processing.spectra import spectrum as spectrum_of
from radarcore.processing.windows import Window, window_centre, window_weights
from radarcore.radar.waveform import Waveform
from radarcore.units import SPEED_OF_LIGHT

_PADDING = 4
"""Cells per bin of the grid on which peaks are sought; the parabola then errs by less than 1e-3 bins (Hann)."""


@dataclass(frozen=True)
class Peak:
    """Strongest echo of a frame; range and velocity are NaN without a peak, or if they cannot be determined.

    Parameters
    ----------
    range : float
        Range at the middle of the frame, ``waveform.duration / 2`` [m]; NaN for a CW radar.
    velocity : float
        Range rate, receding positive [m/s]; NaN for a single chirp.
    power : float
        ``abs(range_doppler(...))**2`` at the peak, added over channels; 0 where there is no peak.
    range_index, velocity_index : int
        Nearest cell of ``range_doppler(cube, waveform)``; -1 where there is no peak.
    """

    range: float
    velocity: float
    power: float
    range_index: int
    velocity_index: int


def strongest_peak(
    cube: ArrayLike,
    waveform: Waveform,
    *,
    min_range: float = 0.0,
    max_range: float | None = None,
    min_velocity: float | None = None,
    max_velocity: float | None = None,
    window: Window = "hann",
    doppler_window: Window = "hann",
) -> Peak:
    """Range and velocity of the strongest echo of a frame, to a fraction of a bin.

    The powers of the channels are added. A peak is a local maximum within the limits, so the flank of a stronger
    echo outside them is none. A parabola through the log power of a four times finer grid gives the sub-bin
    estimate, good to 0.02 bins in both axes for one target (Hann windows, no noise, velocity constant). Velocity
    is taken as unambiguous: within ``waveform.max_velocity``.

    From real samples, echoes closer than about three range bins to 0 or to ``waveform.max_range`` interfere with
    their mirror image and are less accurate.

    Parameters
    ----------
    cube : (channel, chirp, sample) float32, float64, complex64 or complex128
        Beat signal of one frame, finite.
    waveform : Waveform
        Waveform of the frame, with chirps at equal intervals.
    min_range, max_range : float, optional
        Limits of the range at the middle of the frame [m]; default: all that the waveform tells apart.
    min_velocity, max_velocity : float, optional
        Limits of the velocity, receding positive [m/s]; default: none. A single chirp has no velocity to limit.
    window, doppler_window : str, tuple or None
        Windows over fast and slow time, as `scipy.signal.get_window` names them (periodic).

    Returns
    -------
    peak : Peak
        Strongest peak; the range is corrected for the Doppler shift of the beat frequency (except for a single chirp).
        NaN, with power 0, where nothing is within the limits.

    Raises
    ------
    ValueError, TypeError
        As `range_doppler`, but for a CW radar, unless with limits of range; for NaN or infinite samples; for limits in
        the wrong order.
    """
    # Check all arguments before any work.
    samples = checked_samples(
        cube,
        "(channel, chirp, sample)",
        num_dimensions=3,
        num_chirps=waveform.num_chirps,
        num_samples=waveform.num_samples,
    )
    require_uniform_chirps(waveform)
    if not np.isfinite(samples).all():
        bad = np.argwhere(~np.isfinite(samples))
        raise ValueError(
            f"cube: expected finite samples, got {len(bad)} that are not, the first at {tuple(map(int, bad[0]))}"
        )
    range_limits = limits("range", "m", min_range, max_range)
    if waveform.is_cw and range_limits != (0.0, np.inf):
        waveform.require_range()
    velocity_limits = limits("velocity", "m/s", min_velocity, max_velocity)

    # Power on a fine grid, added over channels: (doppler, range). One weighted chirp (or sample) tells nothing
    # of velocity (or range): that axis then has one cell.
    fast_weights = window_weights("window", window, waveform.num_samples)
    slow_weights = window_weights("doppler_window", doppler_window, waveform.num_chirps)
    has_range = np.count_nonzero(fast_weights) > 1 and not waveform.is_cw
    has_velocity = np.count_nonzero(slow_weights) > 1
    num_range = waveform.num_samples * (_PADDING if has_range else 1)
    num_velocity = waveform.num_chirps * (_PADDING if has_velocity else 1)
    power: NDArray[np.float64] | float = 0.0
    for channel in samples:
        spectrum = spectrum_of(
            channel,
            waveform,
            window=window,
            doppler_window=doppler_window,
            num_range_bins=num_range,
            num_velocity_bins=num_velocity,
        )
        power = power + np.square(spectrum.real, dtype=np.float64) + np.square(spectrum.imag, dtype=np.float64)
    missing = Peak(np.nan, np.nan, 0.0, -1, -1)
    if isinstance(power, float):  # no channels
        return missing
    power = power[: None if has_velocity else 1, : None if has_range else 1]

    # The local maxima among their four neighbours. Velocity is cyclic, range too with I/Q; the spectrum of real
    # samples is even about both its ends.
    around = np.pad(power, ((1, 1), (0, 0)), mode="wrap")
    around = np.pad(around, ((0, 0), (1, 1)), mode="wrap" if np.iscomplexobj(samples) else "reflect")
    neighbours = (around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:])
    is_peak = (power > 0.0) & np.logical_and.reduce([power >= neighbour for neighbour in neighbours])

    # Range and velocity of a cell; the phase of a uniformly moving target is quadratic in fast and slow time and
    # the windows are symmetric, so the frequencies at the peak are those at the centre of the windows.
    middle_fast = waveform.adc_delay + window_centre(fast_weights) / waveform.sample_rate
    middle_time = waveform.chirp_times[0] + window_centre(slow_weights) * waveform.chirp_interval + middle_fast

    def measure(row: Any, column: Any) -> tuple[Any, Any]:
        beat = np.sign(waveform.slope) * column * (waveform.sample_rate / num_range)
        if not has_velocity:
            without = np.full(np.shape(row + column), np.nan)
            return without if waveform.is_cw else 0.5 * SPEED_OF_LIGHT * beat / waveform.slope + 0.0 * row, without
        doppler = (row - num_velocity // 2) / (num_velocity * waveform.chirp_interval)
        if waveform.is_cw:
            velocity = 0.5 * SPEED_OF_LIGHT * doppler / waveform.start_frequency + 0.0 * column
            return np.full(np.shape(velocity), np.nan), velocity
        # d/dt and d/dT of eq. (1)'s phase: doppler = rate (f0 + slope (t - tau)), beat = slope tau + doppler.
        shift = beat - doppler
        velocity = 0.5 * SPEED_OF_LIGHT * doppler / (waveform.start_frequency + waveform.slope * middle_fast - shift)
        at_centre = 0.5 * SPEED_OF_LIGHT * shift / waveform.slope
        return at_centre + velocity * (0.5 * waveform.duration - middle_time), velocity

    # The strongest within the limits.
    rows, columns = np.ogrid[: power.shape[0], : power.shape[1]]
    ranges, velocities = measure(rows, columns)
    if not waveform.is_cw:
        is_peak &= (ranges >= range_limits[0]) & (ranges <= range_limits[1])
    if has_velocity:
        is_peak &= (velocities >= velocity_limits[0]) & (velocities <= velocity_limits[1])
    if not is_peak.any():
        return missing
    row, column = map(int, np.unravel_index(np.argmax(np.where(is_peak, power, -1.0)), power.shape))

    # Refine by a parabola through the log power along each axis.
    level = np.log(np.maximum(around[row : row + 3, column : column + 3], 1e-30 * power[row, column]))
    row_offset, row_gain = parabolic_peak(*level[:, 1])
    column_offset, column_gain = parabolic_peak(*level[1, :])
    at_row = (row + row_offset) % num_velocity  # half a cell below the lowest velocity is the highest
    at_column = column + column_offset
    peak_range, velocity = measure(at_row, at_column)
    num_samples, num_chirps = waveform.num_samples, waveform.num_chirps
    range_index = round(at_column * num_samples / num_range)
    velocity_index = round((at_row - num_velocity // 2) * num_chirps / num_velocity) + num_chirps // 2
    return Peak(
        range=float(peak_range) if has_range else np.nan,
        velocity=float(velocity),
        power=float(power[row, column] * np.exp(row_gain + column_gain)),
        range_index=range_index % num_samples if np.iscomplexobj(samples) else min(range_index, num_samples // 2),
        velocity_index=velocity_index % num_chirps,
    )


def limits(name: str, unit: str, low: float | None, high: float | None) -> tuple[float, float]:
    """Both limits of a search, in order; None: no limit."""
    lowest = -np.inf if low is None else check.number(f"min_{name}", low, unit)
    highest = np.inf if high is None else check.number(f"max_{name}", high, unit)
    if lowest > highest:
        raise ValueError(f"max_{name}: expected at least min_{name} = {lowest:g} {unit}, got {highest:g}")
    return lowest, highest


def parabolic_peak(left: float, middle: float, right: float) -> tuple[float, float]:
    """Vertex of the parabola through a local maximum and its neighbours.

    Returns the offset from the middle, in steps, at most half of one, and the height above `middle`; zeros where the
    three values have no maximum.
    """
    curvature = left - 2.0 * middle + right
    if curvature >= 0.0:
        return 0.0, 0.0
    offset = float(np.clip(0.5 * (left - right) / curvature, -0.5, 0.5))
    return offset, -0.25 * (left - right) * offset
