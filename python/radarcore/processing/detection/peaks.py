"""Strongest peak of a frame over the noise, with sub-bin accuracy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, check, notice
from radarcore.processing.detection.cfar import ordered_factor
from radarcore.processing.detection.map import Coordinates, envelope, sidelobes
from radarcore.processing.inputs import (
    Samples,
    checked_samples,
    cube_and_waveform,
    require_one_frame,
    require_transmitters_apart,
    require_uniform_chirps,
)
from radarcore.processing.spectra.noise import filtered_rows, median_of_unit_mean, noise_level, rounding_noise
from radarcore.processing.spectra.spectra import both_windows, powers, transformed
from radarcore.processing.spectra.windows import (
    Window,
    centred_window,
    independent_share,
    window_centre,
    window_weights,
)
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform, require_range
from radarcore.recording.frame import Frame, is_of_adc

_PADDING = 4
"""Cells per bin of the search grid; the parabola then errs by less than 1e-3 bins (Hann)."""

_FALSE_ALARMS = 1e-6
"""Share of noise frames with a peak, for the default of `min_snr_db`."""

_SHARES = (0.5, 1e-3, 0.0)
"""Parts of the highest power: cells above them are candidates, first of all the few above the largest part."""

_NEAREST = 3.0
"""Range bins next to the radar filled by leakage from its transmitter: less than a cycle per chirp, and two bins of the
window's main lobe."""

_SIDELOBES = 3.0
"""Sidelobe amplitude of leakage over the window's sidelobes: 2 for the sum of a tone and its mirror image, times 1.5
because leakage is not a pure tone."""


@dataclass(frozen=True)
class Peak:
    """Strongest echo of a frame; range and velocity are NaN where they cannot be determined.

    Parameters
    ----------
    range : float
        Range at the middle of the frame, `Radar.middle` [m]; NaN for a CW radar.
    velocity : float
        Range rate at the middle of the frame, receding positive [m/s]; NaN for a single chirp.
    power : float
        ``abs(range_doppler(...))**2`` at the peak, added over channels.
    range_index, velocity_index : int
        Nearest cell of ``range_doppler(cube, waveform)``.
    snr_db : float
        `power` over the noise [dB]. The noise is the mean that corresponds to the median of the map.

    See Also
    --------
    strongest_peak : Makes one.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32)).frame()
    >>> peak = rc.strongest_peak(frame)
    >>> round(peak.range, 1), round(peak.velocity, 1), peak.snr_db > 20.0
    (2.0, -0.5, True)
    """

    range: float
    velocity: float
    power: float
    range_index: int
    velocity_index: int
    snr_db: float


def strongest_peak(
    cube: Samples,
    waveform: Waveform | Radar | None = None,
    *,
    min_range: float | None = None,
    max_range: float | None = None,
    min_velocity: float | None = None,
    max_velocity: float | None = None,
    window: Window = "hann",
    doppler_window: Window = "hann",
    min_snr_db: float | None = None,
) -> Peak | None:
    """Range and velocity of the strongest echo of a frame, to a fraction of a bin.

    The powers of the channels are added. A peak is a local maximum within the limits; the flank of a stronger echo
    outside is ignored. A parabola through the log power of a four times finer grid gives the sub-bin estimate,
    accurate to 0.02 bins in both axes for one target (Hann windows, no noise, constant velocity). Velocity is assumed
    to be within ``waveform.max_velocity``.

    The noise is the median of the map, which a few echoes hardly change. Velocities emptied by a filter such as
    `remove_static` are excluded. If echoes fill more than half of the map, they count as noise; a weak echo may then
    need a smaller `min_snr_db`. `detect` finds several targets and compares each with its surroundings.

    **Leakage.** A sensor receives its own transmitter in the nearest range bins, far stronger than any echo. In a frame
    with ADC samples (codes, counts or parts of full scale) the search therefore starts beyond three range bins and
    excludes possible sidelobes of the leakage. Frames simulated without leakage and offsets are searched in full. If
    `min_range` is given, even 0, only the limits apply, as for any other frame. A bare cube may come from a sensor: a
    peak of real samples within three range bins raises a warning. Static targets count as echoes;
    `remove_running_mean` removes them.

    From real samples, echoes closer than about three range bins to 0 or to ``waveform.max_range`` interfere with
    their mirror image and are less accurate.

    Parameters
    ----------
    cube : (channel, chirp, sample) float32, float64, complex64 or complex128, or Frame
        Beat signal of one frame, finite.
    waveform : Waveform or Radar, optional
        Of a cube; a frame has its own. Chirps at equal intervals.
    min_range, max_range : float, optional
        Limits of the range at the middle of the frame [m]; default: all ranges, for ADC samples all beyond the leakage.
    min_velocity, max_velocity : float, optional
        Limits of the velocity, receding positive [m/s]; default: none. A single chirp has no velocity to limit.
    window, doppler_window : str, tuple or None
        Windows over fast and slow time, as `scipy.signal.get_window` names them (periodic).
    min_snr_db : float, optional
        Smallest `Peak.snr_db` [dB]. Default: one noise frame in a million exceeds it. For 64 chirps of 128 real samples
        it is 14.1 dB with one channel and 10.2 dB with three; small frames need more, as their median fluctuates more.

    Returns
    -------
    peak : Peak or None
        Strongest peak; the range is corrected for the Doppler shift of the beat frequency (except for a single chirp).
        None if no peak within the limits reaches `min_snr_db`.

    Raises
    ------
    ValueError, TypeError
        As `range_doppler`, except that a CW radar is accepted without limits of range. Also for several frames,
        transmitters in Doppler-division multiplex, NaN or infinite samples, and limits in the wrong order.

    Warns
    -----
    UserWarning
        For a peak of a cube of real samples within three range bins, unless `min_range` is given.

    See Also
    --------
    processing.Peak : The result.
    detect : All targets of a frame.
    doppler_velocity : The strongest echo, with the accuracy that noise allows.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32)).frame()
    >>> peak = rc.strongest_peak(frame, min_range=0.5)
    >>> print(f"{peak.range:.1f} m, {peak.velocity:+.1f} m/s")
    2.0 m, -0.5 m/s
    """
    # Check all arguments before any work.
    require_one_frame("cube", cube)
    require_transmitters_apart(cube, waveform)
    has_leakage = isinstance(cube, Frame) and _has_leakage(cube)
    may_leak = not isinstance(cube, Frame) and min_range is None and not np.iscomplexobj(cube)
    cube, waveform = cube_and_waveform(cube, waveform)
    samples = checked_samples(
        cube,
        "(channel, chirp, sample)",
        num_dimensions=3,
        num_chirps=waveform.num_chirps,
        num_samples=waveform.num_samples,
    )
    require_uniform_chirps(waveform)
    check.finite("cube", samples)
    leaks = min_range is None and has_leakage and not waveform.is_cw
    range_limits = limits("range", "m", 0.0 if min_range is None else min_range, max_range)
    if waveform.is_cw and range_limits != (0.0, np.inf):
        require_range(waveform)
    velocity_limits = limits("velocity", "m/s", min_velocity, max_velocity)
    least_snr_db = None if min_snr_db is None else check.number("min_snr_db", min_snr_db, "dB")

    # Power on a fine grid, added over channels: (doppler, range). With one weighted chirp (or sample), velocity (or
    # range) is unobservable: its axis then has one cell.
    fast_weights = window_weights("window", window, waveform.num_samples)
    slow_weights = centred_window("doppler_window", doppler_window, waveform.num_chirps)
    has_range = bool(np.count_nonzero(fast_weights) > 1) and not waveform.is_cw
    has_velocity = bool(np.count_nonzero(slow_weights) > 1)
    num_range = waveform.num_samples * (_PADDING if has_range else 1)
    num_velocity = waveform.num_chirps * (_PADDING if has_velocity else 1)
    weights = both_windows(fast_weights, slow_weights, num_velocity, samples.real.dtype)
    power = np.zeros((num_velocity, 1))
    for channel in samples:
        power = power + powers(transformed(channel * weights, waveform, num_range, num_velocity))
    power = np.ascontiguousarray(power[: None if has_velocity else 1, : None if has_range else 1])

    # Range and velocity of a cell.
    centres = window_centre(fast_weights), window_centre(slow_weights)
    coordinates = Coordinates(waveform, *centres, has_velocity)

    def measure(row: Any, column: Any) -> tuple[Any, Any]:
        beat = np.sign(waveform.slope) * column * (waveform.sample_rate / num_range)
        return coordinates.at(beat, (row - num_velocity // 2) / (num_velocity * waveform.chirp_interval))

    # The strongest peak within the limits, and its position between the cells.
    is_iq = np.iscomplexobj(samples)
    searched = power
    if leaks and has_range:
        searched = np.where(power > _leakage(power, fast_weights, is_cyclic=is_iq), power, 0.0)
    for share in _SHARES:  # the highest cells may be outside of the limits, or the flank of a peak there
        cells = np.stack(np.unravel_index(np.flatnonzero(searched > share * searched.max()), power.shape), axis=1)
        ranges, velocities = measure(*cells.T)
        is_inside = np.ones(len(cells), dtype=bool)
        if not waveform.is_cw:
            is_inside &= (ranges >= range_limits[0]) & (ranges <= range_limits[1])
        if has_velocity:
            is_inside &= (velocities >= velocity_limits[0]) & (velocities <= velocity_limits[1])
        cells = cells[is_inside]
        cells = cells[_core.local_maxima(power, cells, is_cyclic=is_iq)]
        if len(cells) > 0:
            break
    else:
        return None
    strongest = cells[power[*cells.T].argmax()]
    offset, heights = _core.between_cells(power, strongest[None], is_cyclic=is_iq)
    height, (at_row, at_column) = float(heights[0]), strongest + offset[0]
    at_row %= num_velocity  # half a cell below the lowest velocity is the highest
    peak_range, velocity = measure(at_row, at_column)
    num_samples, num_chirps = waveform.num_samples, waveform.num_chirps
    range_index = round(at_column * num_samples / num_range)
    velocity_index = round((at_row - num_velocity // 2) * num_chirps / num_velocity) + num_chirps // 2

    # Over the noise.
    noise = noise_level(power[~filtered_rows(power)], num_looks=len(samples))
    noise = max(noise, len(samples) * rounding_noise(samples, fast_weights, slow_weights))
    snr_db = float(10.0 * np.log10(height / noise))
    if least_snr_db is None:
        independent = 1.0
        if has_velocity:
            independent *= len(slow_weights) * independent_share(slow_weights)
        if has_range:
            num_bins = len(fast_weights) if is_iq else 0.5 * len(fast_weights)
            independent *= num_bins * independent_share(fast_weights)
        least_snr_db = _least_snr_db(independent, power.size, len(samples))
    if snr_db < least_snr_db:
        return None
    if may_leak and has_range and at_column <= _NEAREST * _PADDING:
        notice.warn(
            f"cube: expected the strongest peak beyond {_NEAREST:g} range bins, because nearer bins contain a sensor's "
            f"leakage, got it at {peak_range:.3g} m; give the sensor's Frame, or min_range"
        )
    return Peak(
        range=float(peak_range) if has_range else np.nan,
        velocity=float(velocity),
        power=height,
        range_index=range_index % num_samples if is_iq else min(range_index, num_samples // 2),
        velocity_index=velocity_index % num_chirps,
        snr_db=snr_db,
    )


def _has_leakage(frame: Frame) -> bool:
    """True for ADC samples, unless the receiver is fully known (simulated) and adds no leakage and no offsets.

    Offsets lie in the same bins as leakage.
    """
    if not is_of_adc(frame):
        return False
    receiver = frame.radar.receiver
    if receiver is None or receiver.full_scale is None:
        return True
    errors = receiver.adc_errors
    offsets = (receiver.dc_offset, None if errors is None else errors.chirp_offset_lsb)
    return receiver.leakage is not None or any(value is not None and np.any(value) for value in offsets)


def _leakage(power: NDArray[np.float64], fast_weights: NDArray[np.float64], *, is_cyclic: bool) -> NDArray[np.float64]:
    """Largest power explained by leakage, (doppler, range): any power in the nearest bins, and its sidelobes elsewhere.

    Each velocity has its own limit, because offsets and leakage may vary from chirp to chirp.
    """
    bins = np.arange(power.shape[1]) / _PADDING
    if is_cyclic:
        bins = np.minimum(bins, len(fast_weights) - bins)
    is_near = bins <= _NEAREST
    leaked = np.square(_SIDELOBES * sidelobes(envelope(fast_weights), bins))
    return np.where(is_near, np.inf, leaked * power[:, is_near].max(axis=1, keepdims=True))


def _least_snr_db(num_independent: float, num_cells: int, num_channels: int) -> float:
    """SNR exceeded by a cell of noise in one frame of a million.

    The median is the middle of the independent cells. The sum of the rates of all cells of the fine grid is an upper
    bound of the rate of frames.
    """
    number = max(num_independent, 1.0)
    factor = ordered_factor(number, 0.5 * (number + 1.0), _FALSE_ALARMS / num_cells, num_channels)
    return float(10.0 * np.log10(factor * median_of_unit_mean(num_channels)))


def limits(name: str, unit: str, low: float | None, high: float | None) -> tuple[float, float]:
    """Lower and upper limit of a search; None: no limit."""
    lowest = -np.inf if low is None else check.number(f"min_{name}", low, unit)
    highest = np.inf if high is None else check.number(f"max_{name}", high, unit)
    if lowest > highest:
        raise ValueError(f"max_{name}: expected at least min_{name} = {lowest:g} {unit}, got {highest:g}")
    return lowest, highest
