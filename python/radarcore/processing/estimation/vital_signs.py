"""Breathing and heart rate of a resting person, from the phase of the chest over frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.detection.map import MAIN_LOBE
from radarcore.processing.detection.peaks import limits
from radarcore.processing.inputs import require_one_waveform, require_transmitters_apart
from radarcore.processing.spectra.spectra import fast_spectrum
from radarcore.radar.waveform import require_range
from radarcore.recording.recording import Recording

_BREATHING_HZ = (0.1, 0.7)
"""Breathing rates of adults at rest, 6 to 42 per minute."""

_HEART_HZ = (0.75, 2.5)
"""Heart rates, 45 to 150 per minute."""

_SHORTEST, _LOWEST_RATE = 5.0, 6.0
"""Shortest recording [s] and lowest frame rate [Hz]."""

_LARGEST_BREATH = 13e-3
"""Movement of the chest in a breath [m]; at rest, 4 to 12 mm (De Groote et al. 1997)."""

_NUM_BREATHS = 2.0
"""Breaths that a recording needs."""

_PADDING = 4
"""Cells per range bin."""

_WEAKEST, _OVER_MEDIAN = 1e-2, 4.0
"""Least power of movement in a used cell, relative to the strongest and to the median cell."""

_LARGEST_RADIUS = 10.0
"""Largest radius over the root mean square of the movement; a larger radius fits a straight line, possibly noise."""

_LARGEST_STEP, _SHARE_OF_STEPS = 0.9 * np.pi, 0.01
"""Largest phase step between frames with a certain sign [rad]; largest share of frames with larger steps."""

_FARTHEST = 0.15
"""Largest difference of a person's ranges at the start and at the end [m]."""

_NUM_HARMONICS = 4
"""Harmonics in the waveform of a breath."""

_LEAST_PERIODIC = 0.4
"""Least share of periodic breathing in the power of the movement; noise and random movements reach 0.3."""

_LEAST_PEAK = 4.0
"""Least amplitude of a line over the median of its band; noise exceeds it in 0.1 % of recordings of a minute."""

_DOMINANCE = 1.5
"""Least amplitude of the heart's line over any other line in its band."""

_OVER_SKIRTS = 2.0
"""Least amplitude of the heart's line over the skirts of the harmonics of breathing."""

_AGREEMENT = 0.05
"""Largest difference between heart rates of channels, 3 per minute [Hz]."""

_HANN_LOSS = 1.53
"""Standard deviation of a frequency with a Hann window over the bound without a window."""

_Reals = NDArray[np.float64]
_Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class VitalSigns:
    """Breathing and heartbeat of a person.

    Attributes
    ----------
    breathing_rate, breathing_deviation : float
        Mean rate and its standard deviation [Hz]; NaN with a `breathing_reason`.
    amplitude : float
        Movement of the chest per breath, peak to peak, median over all breaths [m].
    heart_rate, heart_deviation : float
        Mean rate and its standard deviation [Hz]; NaN with a `heart_reason`.
    range : float
        Range of the chest [m].
    time, displacement : (frame,) float64
        Middle of every frame [s] and displacement of the chest from its initial place [m], receding positive.
    breathing_reason, heart_reason : str
        Reasons for NaN, empty if there is a rate.

    See Also
    --------
    processing.vital_signs : Makes one.

    Examples
    --------
    >>> waveform = rc.bgt60tr13c(num_chirps=1).waveform
    >>> time = 0.05 * np.arange(400)
    >>> chest = 1.0 + 2e-3 * np.sin(2.0 * np.pi * 0.25 * time)
    >>> cube = np.stack([rc.beat_signal([2.0 * x / 299792458.0], [1.0], waveform) for x in chest])
    >>> signs = rc.processing.vital_signs(rc.Recording(cube, time, rc.Radar(waveform)))
    >>> print(f"{1e3 * np.ptp(signs.displacement):.1f} mm at {signs.range:.1f} m")
    4.0 mm at 1.0 m
    """

    breathing_rate: float
    breathing_deviation: float
    amplitude: float
    heart_rate: float
    heart_deviation: float
    range: float
    time: NDArray[np.float64]
    displacement: NDArray[np.float64]
    breathing_reason: str = ""
    heart_reason: str = ""


class _Line(NamedTuple):
    """Spectral line of the heart."""

    frequency: float
    amplitude: float
    runner_up: float
    """Largest amplitude of other lines, including a line at half the frequency."""
    median: float
    """Median amplitude of the band."""
    is_distinct: bool = True
    """False within the skirts of the harmonics of breathing."""


def vital_signs(recording: Recording, *, min_range: float | None = None, max_range: float | None = None) -> VitalSigns:
    """Breathing rate, amplitude of the chest and heart rate of a resting person, by a radar at rest.

    The chest is the range cell whose samples over the frames fit an arc of a circle best, among all cells with at least
    a hundredth of the strongest movement. The centre of the circle is the static echo in that cell. It is fitted for
    each channel by Taubin's method (Taubin, IEEE Transactions on Pattern Analysis and Machine Intelligence 13, 1991; by
    eigenvalues as in Chernov, Circular and Linear Regression, 2010). The phase around the centre is ``4 pi /
    wavelength`` times the displacement. Its steps from frame to frame are combined over the channels by power (Kasai et
    al., IEEE Transactions on Sonics and Ultrasonics 32, 1985), which ignores a channel with a fading echo.

    The breathing rate is the least-squares fit of a periodic movement with four harmonics. The heart rate is the
    strongest line from 45 to 150 per minute after removal of the harmonics of breathing. The line must be twice as high
    as the skirts of these harmonics (due to irregular breathing), 4 times the median of the band, and 1.5 times any
    other line. Each channel alone must confirm it within 3 per minute, in its range cell with the most movement.

    Parameters
    ----------
    recording : Recording
        One person who sits or lies in front of the radar, with at least 6 frames per second and 2 breaths.
    min_range, max_range : float, optional
        Limits of the range [m]. Default: all but two range bins next to the radar.

    Returns
    -------
    signs : VitalSigns
        Uncertain rates are NaN, with a reason.

    Raises
    ------
    ValueError, TypeError
        For a recording of less than 5 s, fewer than 6 frames per second, gaps between frames, several waveforms, a CW
        radar, Doppler-division multiplex and limits without a range bin.

    See Also
    --------
    range_time : Power of all ranges over time.
    spectrogram : Velocities over time.

    Examples
    --------
    >>> waveform = rc.bgt60tr13c(num_chirps=1).waveform
    >>> time = 0.05 * np.arange(400)
    >>> chest = 1.0 + 2e-3 * np.sin(2.0 * np.pi * 0.25 * time)
    >>> cube = np.stack([rc.beat_signal([2.0 * x / 299792458.0], [1.0], waveform) for x in chest])
    >>> signs = rc.processing.vital_signs(rc.Recording(cube, time, rc.Radar(waveform)))
    >>> print(f"{60.0 * signs.breathing_rate:.1f} breaths per minute of {1e3 * signs.amplitude:.1f} mm")
    15.0 breaths per minute of 4.0 mm
    """
    # Check all arguments before any work.
    check.instance("recording", recording, Recording)
    require_one_waveform(recording.radar)
    require_transmitters_apart(recording, None)
    waveform = recording.radar.waveform
    require_range(waveform)
    time = recording.time + recording.radar.middle
    interval = _checked_interval(recording.time)
    duration = len(time) * interval
    ranges = waveform.range_axis(_PADDING * waveform.num_samples)
    low, high = limits("range", "m", min_range, max_range)
    low = max(low, 0.0 if min_range is not None else MAIN_LOBE * waveform.range_resolution)
    num_cells = len(ranges) // 2 if recording.radar.is_real else len(ranges)
    inside = np.flatnonzero((ranges[:num_cells] >= low) & (ranges[:num_cells] <= high))
    if len(inside) == 0:
        raise ValueError(f"min_range, max_range: expected range bins within the limits, got {low:g} to {high:g} m")

    # The chest and its movement.
    samples = np.stack([frame.cube.mean(axis=1) for frame in recording.frames()])  # little motion within a frame
    profiles = fast_spectrum(samples, waveform, window="hann", num_bins=len(ranges))[..., inside]
    arcs, cell = _chest(profiles)
    products = arcs[1:] * arcs[:-1].conj()
    steps = np.angle(products.sum(axis=1))
    scale = waveform.wavelength / (4.0 * np.pi)
    displacement = scale * np.concatenate([[0.0], np.cumsum(steps)])
    nothing = VitalSigns(np.nan, np.nan, np.nan, np.nan, np.nan, float(ranges[inside[cell]]), time, displacement)

    # Breathing.
    breathing, deviation, share = _breathing(displacement, time)
    moved = _moved(profiles, ranges[inside])
    reason = ""
    if moved > _FARTHEST:
        reason = f"the person moved by {moved:.2f} m"
    elif np.mean(np.abs(steps) > _LARGEST_STEP) > _SHARE_OF_STEPS:
        reason = "the phase jumps from frame to frame: nobody is there, or the frames are too few"
    elif share < _LEAST_PERIODIC:
        reason = f"periodic breathing explains only {100.0 * share:.0f} % of the movement"
    elif breathing < _BREATHING_HZ[0]:
        reason = f"{60.0 * breathing:.1f} per minute are too slow for breathing: the person sways"
    elif duration * breathing < _NUM_BREATHS:
        reason = f"the recording of {duration:.1f} s has only {duration * breathing:.1f} breaths"
    else:
        size = _peak_to_peak(displacement, time, breathing)
        if size > _LARGEST_BREATH:
            reason = f"movements of {1e3 * size:.0f} mm are no breaths: the person sways"
    if reason:
        return replace(nothing, breathing_reason=reason, heart_reason="the breathing rate is not known")
    known = replace(nothing, breathing_rate=breathing, breathing_deviation=deviation, amplitude=size)

    # Heart.
    line = _heart(displacement, time, breathing)
    alone = [_heart(scale * phases, time, breathing) for phases in _phases_of_channels(profiles)]
    rates = [one.frequency if one.is_distinct or not line.is_distinct else np.nan for one in alone]
    reasons = []
    if not all(abs(rate - line.frequency) <= _AGREEMENT for rate in rates):
        listed = ", ".join("none" if np.isnan(rate) else f"{60.0 * rate:.0f}" for rate in rates)
        reasons.append(f"channels disagree: {listed} per minute")
    if not line.is_distinct:
        reasons.append("no line stands out from the harmonics of breathing")
    elif line.amplitude < _LEAST_PEAK * line.median:
        reasons.append(f"the SNR is too low: the line is {line.amplitude / line.median:.1f} times the noise")
    elif line.amplitude < _DOMINANCE * line.runner_up:
        reasons.append("another line is almost as strong")
    if reasons:
        return replace(known, heart_reason="; ".join(reasons))
    noise = line.median / float(np.sqrt(np.log(2.0)))  # root mean square of amplitudes with that median
    heart_deviation = _HANN_LOSS * noise / (np.pi * line.amplitude * duration)
    return replace(known, heart_rate=line.frequency, heart_deviation=heart_deviation)


def _checked_interval(times: _Reals) -> float:
    """Interval of frames [s]."""
    if len(times) < 2 or times[-1] - times[0] < _SHORTEST:
        span = times[-1] - times[0] if len(times) else 0.0
        raise ValueError(f"recording: expected at least {_SHORTEST:g} s, got {span:.2f} s")
    intervals = np.diff(times)
    interval = float(np.median(intervals))
    if 1.0 / interval < _LOWEST_RATE:
        raise ValueError(f"recording: expected at least {_LOWEST_RATE:g} frames per second, got {1.0 / interval:.3g}")
    if (longest := float(intervals.max())) > 2.5 * interval:
        raise ValueError(f"recording: expected frames every {interval:.3g} s, got a gap of {longest:.3g} s")
    return interval


def _chest(profiles: _Complexes) -> tuple[_Complexes, int]:
    """Samples of the chest relative to the centre of their circle, (frame, channel), and the chest's cell."""
    power = profiles.var(axis=0).sum(axis=0)
    cells = np.flatnonzero(power >= min(max(_WEAKEST * power.max(), _OVER_MEDIAN * np.median(power)), power.max()))
    samples = profiles[:, :, cells].astype(np.complex128)
    about_centre = samples - _centres(samples)
    radius = np.abs(about_centre)
    scatter = radius.std(axis=0) / np.maximum(radius.mean(axis=0), 1e-300)
    is_line = radius.mean(axis=0) > _LARGEST_RADIUS * samples.std(axis=0)
    scatter = np.where(is_line, 1.0, scatter).mean(axis=0)
    best = int(scatter.argmin())
    return about_centre[:, :, best], int(cells[best])


def _centres(samples: _Complexes) -> _Complexes:
    """Centres of circles through samples (frame, ...), Taubin's fit."""
    mean = samples.mean(axis=0)
    about = samples - mean
    square = np.square(np.abs(about))
    level = np.maximum(square.mean(axis=0), 1e-300)
    size = np.sqrt(level)
    rows = np.stack([0.5 * (square - level) / size, about.real, about.imag], axis=-1) / size[..., None]
    moments = np.einsum("t...i,t...j->...ij", rows, rows)
    _, vectors = np.linalg.eigh(moments)
    least = vectors[..., 0]
    curvature = np.where(np.abs(least[..., 0]) > 1e-9, least[..., 0], 1e-9)
    centres: _Complexes = mean - (least[..., 1] + 1j * least[..., 2]) * size / curvature
    return centres


def _phases_of_channels(profiles: _Complexes) -> list[_Reals]:
    """Phase of each channel alone over the frames [rad], in the channel's cell with the strongest movement."""
    strongest = profiles.var(axis=0).argmax(axis=1)
    phases = []
    for channel, cell in enumerate(strongest):
        samples = profiles[:, channel, cell].astype(np.complex128)
        phases.append(np.unwrap(np.angle(samples - _centres(samples))))
    return phases


def _moved(profiles: _Complexes, ranges: _Reals) -> float:
    """Difference between the ranges of movement in the first and the last third of the frames [m]."""
    third = max(len(profiles) // 3, 2)
    places = []
    for part in (profiles[:third], profiles[-third:]):
        power = part.var(axis=0).sum(axis=0)
        power = np.where(power > 0.1 * power.max(), power, 0.0)
        places.append(float(power @ ranges / power.sum()) if power.any() else 0.0)
    return abs(places[1] - places[0])


def _breathing(displacement: _Reals, time: _Reals) -> tuple[float, float, float]:
    """Rate and deviation of the best-fitting periodic movement [Hz], and its share of the power without drift."""
    detrended = _without_drift(displacement, time)
    power = float(detrended @ detrended)
    if power == 0.0:
        return np.nan, np.nan, 0.0
    duration = time[-1] - time[0]
    frequencies = np.arange(*_BREATHING_HZ, 0.05 / duration)
    coarse = frequencies[_spectrum(detrended, time, frequencies).argmax()]

    def left(frequency: float) -> _Reals:
        waves = _waves(frequency, time)
        return displacement - waves @ np.linalg.lstsq(waves, displacement, rcond=None)[0]

    fine = coarse + np.linspace(-0.5, 0.5, 101) / duration
    errors = [float(residual @ residual) for residual in map(left, fine)]
    best = _vertex(fine, -np.array(errors))

    # Cramer-Rao bound of a tone in noise with the residual's density around the breathing rate.
    residual = left(best)
    beside = np.linspace(0.5, 1.5, 101) * best
    noise = np.mean(np.square(_spectrum(residual, time, beside)))
    amplitude = float(np.hypot(*np.linalg.lstsq(_waves(best, time), displacement, rcond=None)[0][:2]))
    deviation = float(np.sqrt(noise) / (np.pi * amplitude * duration))
    return best, deviation, 1.0 - min(errors) / power


def _waves(frequency: float, time: _Reals, num_orders: int = _NUM_HARMONICS) -> _Reals:
    """Cosines and sines of a frequency and its harmonics, and a parabola's powers, (time, 2 harmonics + 3)."""
    phases = 2.0 * np.pi * frequency * np.outer(time - time[0], np.arange(1, num_orders + 1))
    waves = np.stack([np.cos(phases), np.sin(phases)], axis=-1).reshape(len(time), -1)
    return np.column_stack([waves, np.vander(_scaled(time), 3)])


def _without_drift(displacement: _Reals, time: _Reals) -> _Reals:
    """Displacement minus its best-fitting parabola."""
    powers = np.vander(_scaled(time), 3)
    return np.asarray(displacement - powers @ np.linalg.lstsq(powers, displacement, rcond=None)[0])


def _scaled(time: _Reals) -> _Reals:
    """Times from -1 to 1."""
    return np.asarray(2.0 * (time - time[0]) / (time[-1] - time[0]) - 1.0)


def _spectrum(values: _Reals, time: _Reals, frequencies: _Reals) -> _Reals:
    """Amplitudes of tones [unit of values], with a Hann window."""
    phase = np.pi * (time - time[0]) / (time[-1] - time[0])
    weights = np.square(np.sin(phase))
    waves = np.exp(-2j * np.pi * np.outer(frequencies, time - time[0]))
    return np.asarray(2.0 * np.abs(waves @ (weights * values)) / weights.sum())


def _peak_to_peak(displacement: _Reals, time: _Reals, breathing: float) -> float:
    """Median over the breaths of the movement peak to peak, low-passed above the harmonics of breathing."""
    waves = _waves(breathing, time)
    drift = waves[:, -3:] @ np.linalg.lstsq(waves, displacement, rcond=None)[0][-3:]
    detrended = displacement - drift
    interval = (time[-1] - time[0]) / (len(time) - 1)
    spectrum = np.fft.rfft(detrended)
    spectrum[np.fft.rfftfreq(len(time), interval) > (_NUM_HARMONICS + 0.5) * breathing] = 0.0
    smooth = np.fft.irfft(spectrum, len(time))
    length = min(round(1.0 / (breathing * interval)), len(time))
    return float(np.median(np.ptp(np.lib.stride_tricks.sliding_window_view(smooth, length), axis=1)))


def _heart(displacement: _Reals, time: _Reals, breathing: float) -> _Line:
    """Strongest line in the heart's band that is no harmonic of breathing; without one, the strongest line."""
    duration = time[-1] - time[0]
    width = 2.0 / duration
    num_orders = int(np.ceil(_HEART_HZ[1] / breathing))
    orders = np.arange(1, num_orders + 1)[:, None]

    # Amplitudes of the harmonics of breathing, and the spectrum without them.
    waves = _waves(breathing, time, num_orders)
    fitted = np.linalg.lstsq(waves, displacement, rcond=None)[0]
    harmonics = np.hypot(fitted[0:-3:2], fitted[1:-3:2])
    frequencies = np.arange(0.5 * breathing, _HEART_HZ[1] + width, 0.2 / duration)
    amplitudes = _spectrum(displacement - waves @ fitted, time, frequencies)
    in_band = (frequencies >= _HEART_HZ[0]) & (frequencies <= _HEART_HZ[1])
    median = float(np.median(amplitudes[in_band]))
    inner = amplitudes[1:-1]
    peaks = 1 + np.flatnonzero((inner > amplitudes[:-2]) & (inner >= amplitudes[2:]) & in_band[1:-1])

    # Irregular breathing causes skirts around the harmonics; their relative height grows with the order.
    cells = np.abs(frequencies[peaks] - orders * breathing) * duration
    beside = np.abs(frequencies - breathing) <= width
    irregularity = np.minimum(orders * amplitudes[beside].max() / harmonics[0], 1.0)
    near = np.abs(frequencies - orders * breathing) <= width
    levels = np.maximum(harmonics, np.where(near, amplitudes, 0.0).max(axis=1))[:, None]
    skirts = (irregularity * levels / np.maximum(0.5 * cells, 1.0)).sum(axis=0)  # of a phase that walks at random
    kept = peaks[amplitudes[peaks] > _OVER_SKIRTS * skirts]
    if len(kept) == 0:
        strongest = frequencies[peaks[amplitudes[peaks].argmax()]] if len(peaks) else np.nan
        return _Line(float(strongest), 0.0, 0.0, median, is_distinct=False)
    best = kept[amplitudes[kept].argmax()]
    frequency = _with_harmonics(displacement, time, waves, float(frequencies[best]))

    # Other lines. The line may also be the second harmonic of a line hidden by a harmonic of breathing.
    distance = np.minimum(np.abs(frequencies[kept] - frequency), np.abs(frequencies[kept] - 2.0 * frequency))
    half = np.abs(frequencies - 0.5 * frequency) <= 0.5 * width
    hidden = np.abs(0.5 * frequency - orders[:, 0] * breathing) < 0.25 / duration
    rivals = np.concatenate([amplitudes[kept[distance > width]], amplitudes[half & in_band], harmonics[hidden]])
    return _Line(frequency, float(amplitudes[best]), float(rivals.max(initial=0.0)), median)


def _with_harmonics(displacement: _Reals, time: _Reals, waves: _Reals, coarse: float) -> float:
    """Frequency of the tone that fits best jointly with the harmonics of breathing, which removes their bias [Hz]."""
    basis = np.linalg.qr(waves)[0]
    left = displacement - basis @ (basis.T @ displacement)
    fine = coarse + np.linspace(-0.6, 0.6, 61) / (time[-1] - time[0])
    powers = []
    for frequency in fine:
        phase = 2.0 * np.pi * frequency * (time - time[0])
        tone = np.column_stack([np.cos(phase), np.sin(phase)])
        tone -= basis @ (basis.T @ tone)
        powers.append(left @ tone @ np.linalg.lstsq(tone, left, rcond=1e-6)[0])
    return _vertex(fine, np.array(powers))


def _vertex(places: _Reals, values: _Reals) -> float:
    """Position of the maximum of evenly spaced values, by a parabola."""
    best = int(np.clip(values.argmax(), 1, len(values) - 2))
    before, highest, after = values[best - 1 : best + 2]
    curvature = 2.0 * highest - before - after
    offset = 0.5 * (after - before) / curvature if curvature > 0.0 else 0.0
    return float(places[best] + np.clip(offset, -1.0, 1.0) * (places[1] - places[0]))
