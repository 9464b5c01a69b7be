"""Three estimators of range and velocity of one echo, with predicted standard deviations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.detection.peaks import limits, strongest_peak
from radarcore.processing.estimation import bounds
from radarcore.processing.estimation.bounds import CramerRaoBound
from radarcore.processing.estimation.phase_fit import PhaseFit, fit_phase, noise_power, search_beat
from radarcore.processing.inputs import (
    Samples,
    checked_samples,
    cube_and_radar,
    cube_and_waveform,
    require_transmitters_apart,
    require_uniform_chirps,
)
from radarcore.processing.spectra.windows import Window
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform, require_range
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.units import SPEED_OF_LIGHT, decibels

Array = NDArray[np.float64]

_ANY_SNR_DB = -1000.0
"""SNR limit without effect: the strongest echo is always measured [dB]."""


def doppler_velocity(
    cube: Samples,
    waveform: Waveform | Radar | None = None,
    *,
    min_range: float = 0.0,
    max_range: float | None = None,
    min_velocity: float | None = None,
    max_velocity: float | None = None,
    window: Window = None,
    doppler_window: Window = None,
    noise: float | None = None,
) -> VelocityEstimate:
    """Range and velocity from the phase over all chirps: the peak of the range-Doppler transform, refined.

    The most accurate estimator. Least squares refines the strongest local maximum of the transform within the limits,
    with eq. (1)'s phase at constant velocity and one amplitude per channel. This maximum-likelihood estimate reaches
    `doppler_bound`. Velocities are assumed to be within ``waveform.max_velocity``.

    Parameters
    ----------
    cube : ([frame,] channel, chirp, sample) float32, float64, complex64 or complex128, or Frame or Recording
        Beat signal, real or I/Q, finite.
    waveform : Waveform or Radar, optional
        Of a cube; a frame or recording has its own. A ramp, and at least two chirps at equal intervals.
    min_range, max_range, min_velocity, max_velocity : float, optional
        Limits of the search [m], [m/s].
    window, doppler_window : str, tuple or None
        Windows over fast and slow time, as `scipy.signal.get_window` names them (periodic). Default: none, the most
        accurate for a single echo in noise. A Hann window increases the deviations 1.53 times but suppresses sidelobes
        of other echoes.
    noise : float, optional
        Power of the noise per sample, I and Q together. Default: measured as the median of the residual's range-Doppler
        map, which ignores other echoes in a few cells.

    Returns
    -------
    estimate : VelocityEstimate
        Numbers for one frame, arrays (frame,) for several.

    Raises
    ------
    ValueError, TypeError
        For samples that are not finite or do not fit the waveform, a CW radar, one chirp, chirps at unequal intervals,
        transmitters in Doppler-division multiplex, and limits in the wrong order.

    See Also
    --------
    processing.doppler_bound : Least standard deviation.
    strongest_peak : Faster, accurate to some hundredths of a bin.
    processing.chirp_rate_velocity : Without Doppler ambiguity.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32)).frame()
    >>> estimate = rc.doppler_velocity(frame, min_range=0.5)
    >>> print(f"{estimate.range:.2f} m, {estimate.velocity:+.2f} m/s")
    2.00 m, -0.50 m/s
    """
    require_transmitters_apart(cube, waveform)
    given = _checked_input(cube, waveform)
    wf = given.waveform
    require_uniform_chirps(wf)
    weights = bounds.sample_weights(wf, window, doppler_window)
    level = _checked_noise(noise)
    slow, fast = bounds.times_from_middle(wf)
    gradients = bounds.range_and_velocity_gradients(wf)
    time = slow + given.offsets[:, None, None] + fast  # (channel or 1, chirp, sample)
    ramp = wf.sample_times

    def phase(parameters: Array) -> Array:
        delay = 2.0 / SPEED_OF_LIGHT * (parameters[0] + parameters[1] * time)
        turned: Array = 2.0 * np.pi * delay * (wf.start_frequency + wf.slope * ramp - 0.5 * wf.slope * delay)
        return turned

    def measure(frame: NDArray[Any]) -> _Row:
        peak = strongest_peak(
            frame,
            wf,
            min_range=min_range,
            max_range=max_range,
            min_velocity=min_velocity,
            max_velocity=max_velocity,
            window=window,
            doppler_window=doppler_window,
            min_snr_db=_ANY_SNR_DB,
        )
        if peak is None or np.isnan(peak.velocity):
            return _NOTHING
        fit = fit_phase(frame, phase, gradients, np.array([peak.range, peak.velocity]), weights, per_chirp=False)
        return fit.parameters[0], fit.parameters[1], _snr(frame, wf, fit, level, weights)

    bound = partial(bounds.doppler_bound, wf, window=window, doppler_window=doppler_window)
    return _estimate(given, [measure(frame) for frame in given.samples], bound)


def up_down_velocity(
    up: Samples,
    down: Samples,
    up_waveform: Waveform | Radar | None = None,
    down_waveform: Waveform | Radar | None = None,
    *,
    down_delay: float | None = None,
    min_range: float = 0.0,
    max_range: float | None = None,
    max_velocity: float = 10.0,
    window: Window = None,
    noise: float | None = None,
) -> VelocityEstimate:
    """Range and velocity from the beat frequencies of up- and down-chirps: one pair is enough.

    For opposite slopes, the range shifts the beat frequencies in opposite directions and the Doppler shift in the same
    direction: ``f_up = 2/c (slope R + f v)`` and ``f_down = 2/c (-slope R + f v)``. Motion between both frames is taken
    into account. There is no Doppler ambiguity. The sub-sequences of a frame may form the pair:
    ``up_down_velocity(*frame.sequences())``, see `Waveform.alternating`. Several targets can be paired wrongly; limit
    the range then.

    Parameters
    ----------
    up, down : ([frame,] channel, chirp, sample), or Frame or Recording
        Beat signals of two waveforms with slopes of opposite sign, of one or several chirps. Amplitudes are free per
        chirp, and the frequency may change from chirp to chirp.
    up_waveform, down_waveform : Waveform or Radar, optional
        Of cubes; frames and recordings have their own.
    down_delay : float, optional
        Time from the start of `up` to the start of `down` [s]. Default: the difference of the frames' times; for cubes
        ``up_waveform.frame_interval``, or 0 if the first chirps have different offsets (sub-sequences).
    min_range, max_range : float, optional
        Limits of the search [m]. They apply to the apparent range of each chirp, which is ``velocity * f /
        abs(slope)`` too far for an up-chirp and too near for a down-chirp.
    max_velocity : float
        Fastest target [m/s], which limits the change of the frequency from chirp to chirp.
    window, noise
        As in `doppler_velocity`.

    Returns
    -------
    estimate : VelocityEstimate
        Range at the mean of both frames' middles.

    Raises
    ------
    ValueError, TypeError
        For slopes of equal sign, and as `doppler_velocity`.

    See Also
    --------
    up_down_bound : Least standard deviation.
    Waveform.alternating : Frames of both slopes.
    doppler_velocity : From many chirps of one slope.

    Examples
    --------
    >>> up = rc.Waveform(start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=128, num_chirps=1)
    >>> down = up.replace(start_frequency=63e9, slope=-50e12)
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[1.0, 0.0, 0.0])])
    >>> frames = [rc.Simulator(scene, rc.Radar(each)).frame(time) for each, time in ((up, 0.0), (down, 0.01))]
    >>> estimate = rc.processing.up_down_velocity(*frames)
    >>> print(f"{estimate.range:.2f} m, {estimate.velocity:+.2f} m/s")
    2.01 m, +1.00 m/s
    """
    both = _checked_input(up, up_waveform, "up"), _checked_input(down, down_waveform, "down")
    kinds = ["one frame" if given.is_one else f"{len(given.samples)} frames in an array" for given in both]
    if kinds[0] != kinds[1]:
        raise ValueError(f"down: expected {kinds[0]} as up, got {kinds[1]}")
    waveforms = both[0].waveform, both[1].waveform
    delay = down_delay if down_delay is not None else _delay_between(up, down)
    equations = bounds.up_down_equations(*waveforms, delay)
    ranges = limits("range", "m", min_range, max_range)
    fastest = check.non_negative("max_velocity", max_velocity, "m/s")
    level = _checked_noise(noise)
    searches = [_beat_fit(given, ranges, fastest, window) for given in both]
    slopes = np.array([waveform.slope for waveform in waveforms])

    def measure(*frames: NDArray[Any]) -> _Row:
        fits = [fit for search, frame in zip(searches, frames, strict=True) if (fit := search(frame)) is not None]
        if len(fits) < 2:
            return _NOTHING
        # The delay within slope * delay**2 / 2 shifts the carrier by the beat frequency: a millionth of it.
        distance = velocity = 0.0
        for _ in range(3):
            by_velocity = equations[:, 1] - slopes * 4.0 * distance / SPEED_OF_LIGHT**2
            matrix = np.stack([equations[:, 0], by_velocity], axis=1)
            distance, velocity = np.linalg.solve(matrix, [fit.parameters[0] for fit in fits])
        ratios = [
            _snr(frame, wf, fit, level, bounds.sample_weights(wf, window, None))
            for frame, wf, fit in zip(frames, waveforms, fits, strict=True)
        ]
        return distance, velocity, float(np.mean(ratios))

    bound = partial(bounds.up_down_bound, *waveforms, down_delay=delay, window=window)
    return _estimate(
        both[0], [measure(*frames) for frames in zip(*(given.samples for given in both), strict=True)], bound
    )


def chirp_rate_velocity(
    cube: Samples,
    waveform: Waveform | Radar | None = None,
    *,
    min_range: float = 0.0,
    max_range: float | None = None,
    max_velocity: float = 10.0,
    window: Window = None,
    noise: float | None = None,
) -> VelocityEstimate:
    """Velocity from the change of the beat frequency within the chirps, ``4 slope velocity / c`` [Hz/s].

    Uses the third term of the beat phase, ``2 slope velocity / c t^2`` turns. One chirp is enough, and there is no
    ambiguity. Chirps must be long and wide: the deviation falls as ``1 / (bandwidth * duration)``. The search dechirps
    with the rates of velocities up to `max_velocity`. Least squares then fits the rate with an amplitude and phase per
    channel and chirp. The frequency may change from chirp to chirp; this change is not used.

    Parameters
    ----------
    cube, waveform, min_range, max_range, window, noise
        As in `doppler_velocity`; at least three samples per chirp, chirps at any times.
    max_velocity : float
        Fastest target [m/s].

    Returns
    -------
    estimate : VelocityEstimate
        The range is corrected by this velocity and contains its error, ``f / slope`` metres per m/s.

    Raises
    ------
    ValueError, TypeError
        As `doppler_velocity`.

    See Also
    --------
    chirp_rate_bound : Least standard deviation.
    doppler_velocity : The most accurate estimator, with many chirps.
    up_down_velocity : From one chirp of each slope.

    Examples
    --------
    >>> waveform = rc.Waveform(start_frequency=60e9, slope=2e12, sample_rate=1e6, num_samples=1024, num_chirps=1)
    >>> scene = rc.Scene([rc.PointTarget([8.0, 0.0, 0.0], velocity=[-2.0, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.Radar(waveform)).frame()
    >>> print(f"{rc.processing.chirp_rate_velocity(frame).velocity:+.1f} m/s from one chirp")
    -2.0 m/s from one chirp
    """
    given = _checked_input(cube, waveform)
    wf = given.waveform
    if wf.num_samples < 3:
        raise ValueError(f"waveform: expected at least 3 samples per chirp, got {wf.num_samples}")
    ranges = limits("range", "m", min_range, max_range)
    fastest = check.non_negative("max_velocity", max_velocity, "m/s")
    level = _checked_noise(noise)
    search = _beat_fit(given, ranges, fastest, window)
    weights = bounds.sample_weights(wf, window, None)

    def measure(frame: NDArray[Any]) -> _Row:
        fit = search(frame)
        if fit is None:
            return _NOTHING
        velocity = SPEED_OF_LIGHT / (4.0 * wf.slope) * fit.parameters[-1]
        # The delay within slope * delay**2 / 2 lowers the carrier by the beat frequency.
        shift = 2.0 * velocity / SPEED_OF_LIGHT * (bounds.beat_carrier(wf) - fit.parameters[0])
        distance = 0.5 * SPEED_OF_LIGHT / wf.slope * (fit.parameters[0] - shift)
        return distance, velocity, _snr(frame, wf, fit, level, weights)

    bound = partial(bounds.chirp_rate_bound, wf, window=window)
    return _estimate(given, [measure(frame) for frame in given.samples], bound)


def _beat_fit(
    given: _Input, ranges: tuple[float, float], fastest: float, window: Window
) -> Callable[[NDArray[Any]], PhaseFit | None]:
    """Fit of the mean beat frequency of a frame and of its observable changes.

    The parameters are the frequency, its change between chirps if there are several, and, as the last one, its change
    within chirps of more than two samples.
    """
    wf = given.waveform
    observable = [0, *([1] if wf.num_chirps > 1 else []), *([2] if wf.num_samples > 2 else [])]
    gradients = bounds.beat_gradients(wf)[observable]
    weights = bounds.sample_weights(wf, window, None)
    slow, fast = bounds.beat_times(wf)
    shifted = slow + given.offsets[:, None, None]  # (channel or 1, chirp, 1)

    def phase(parameters: Array) -> Array:
        every = np.zeros(3)
        every[observable] = parameters
        frequency, change, rate = every
        turned: Array = 2.0 * np.pi * ((frequency + change * shifted) * fast + 0.5 * rate * fast**2)
        return turned

    def search(frame: NDArray[Any]) -> PhaseFit | None:
        start = search_beat(frame, wf, ranges, fastest, window)
        if start is None:
            return None
        return fit_phase(frame, phase, gradients, np.array(start)[observable], weights, per_chirp=True)

    return search


@dataclass(frozen=True, eq=False)
class VelocityEstimate:
    """Range and velocity of the strongest echo; NaN without an echo.

    Attributes
    ----------
    range : float or (frame,) float64
        Range at the middle of the frame [m].
    velocity : float or (frame,) float64
        Range rate, receding positive [m/s].
    range_std, velocity_std : float or (frame,) float64
        Predicted standard deviations [m], [m/s]: the Cramér-Rao bound at the measured `snr_db`, including the loss of
        the windows. They hold for one echo in white noise above the SNR threshold, below which noise peaks exceed the
        echo.
    snr_db : float or (frame,) float64
        Signal-to-noise ratio of the echo per sample [dB]; -inf for an echo below the noise.

    See Also
    --------
    doppler_velocity : From the phase over the chirps.
    up_down_velocity : From chirps of both slopes.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32)).frame()
    >>> estimate = rc.doppler_velocity(frame)
    >>> round(estimate.velocity, 2), estimate.velocity_std < 1e-3
    (-0.5, True)
    """

    range: Array | float
    velocity: Array | float
    range_std: Array | float
    velocity_std: Array | float
    snr_db: Array | float


_Row = tuple[float, float, float]
"""Range [m], velocity [m/s] and SNR (a ratio of powers per sample) of a frame."""

_NOTHING: _Row = (np.nan, np.nan, np.nan)


class _Input(NamedTuple):
    """Samples (frame, channel, chirp, sample) of a waveform, checked."""

    samples: NDArray[Any]
    waveform: Waveform
    offsets: Array
    """Time from the mean chirp of all channels to the mean chirp of each, (channel,) [s]."""
    is_one: bool
    """True for a single frame."""


def _checked_input(cube: Samples, waveform: Waveform | Radar | None, name: str = "cube") -> _Input:
    """Checked samples of one or several frames, with their waveform; messages call the argument `name`."""
    samples, wf = cube_and_waveform(cube, waveform)
    offsets = np.zeros(1)
    if not isinstance(waveform, Waveform):
        of_channels = cube_and_radar(cube, waveform)[1].channel_offsets
        if of_channels.any():
            offsets = of_channels - of_channels.mean()
    require_range(wf)
    checked = checked_samples(
        samples, "([frame,] channel, chirp, sample)", num_chirps=wf.num_chirps, num_samples=wf.num_samples
    )
    if checked.ndim not in (3, 4):
        raise ValueError(f"{name}: expected shape ([frame,] channel, chirp, sample), got {checked.shape}")
    if checked.shape[-3] == 0:
        raise ValueError(f"{name}: expected at least one channel, got none")
    is_one = checked.ndim == 3
    return _Input(check.finite(name, checked)[None] if is_one else check.finite(name, checked), wf, offsets, is_one)


def _delay_between(up: Samples, down: Samples) -> float | None:
    """Difference of the times of two frames [s]; None for cubes."""
    times = [np.atleast_1d(frames.time) for frames in (up, down) if isinstance(frames, Frame | Recording)]
    if len(times) < 2 or len(times[0]) == 0:
        return None
    between = times[1] - times[0]
    if np.ptp(between) > 1e-9:
        raise ValueError(
            f"down: expected frames at a constant delay after up, got {between.min():g} to {between.max():g} s"
        )
    return float(between[0])


def _checked_noise(noise: float | None) -> float | None:
    """Power of the noise per sample; None: measured."""
    return None if noise is None else check.non_negative("noise", noise)


def _snr(frame: NDArray[Any], waveform: Waveform, fit: PhaseFit, level: float | None, weights: Array) -> float:
    """Signal-to-noise ratio of the echo per sample."""
    noise = noise_power(frame - fit.echo, waveform) if level is None else level
    if noise == 0.0:
        return np.inf
    # The power of a real tone is half of its squared amplitude, which contains twice the noise.
    is_iq = np.iscomplexobj(frame)
    per_amplitude = float((weights**2).sum() / weights.sum() ** 2) * fit.num_free / len(frame)
    power = fit.power * (1.0 if is_iq else 0.5) - noise * per_amplitude * (1.0 if is_iq else 2.0)
    return max(0.0, power / noise)


def _estimate(given: _Input, rows: list[_Row], bound: Callable[..., CramerRaoBound]) -> VelocityEstimate:
    """Estimates with the deviations of the bound at their SNR: numbers for one frame, arrays for several."""
    distance, velocity, ratio = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    snr_db = decibels(ratio)
    least = bound(snr_db, is_real=not np.iscomplexobj(given.samples), num_channels=given.samples.shape[1])
    columns = distance, velocity, least.range, least.velocity, snr_db
    return VelocityEstimate(*(column.item() if given.is_one else column for column in columns))
