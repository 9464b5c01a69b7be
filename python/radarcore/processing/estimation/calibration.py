"""Calibration of the channels and ranges of a radar with a reflector at a known position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.detection.detect import detect
from radarcore.processing.detection.map import MAIN_LOBE
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.inputs import recording_of, require_one_waveform
from radarcore.processing.spectra.windows import centred_window
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import require_range
from radarcore.recording.frame import COUNTS, Frame, is_of_adc, unit_of
from radarcore.recording.recording import Recording
from radarcore.units import SPEED_OF_LIGHT

_SECOND_DB = 10.0
"""The choice is uncertain if a second echo near the reflector is less than this below the strongest [dB]."""

_MOST_CLIPPED = 1e-3
"""Largest share of samples at the limits of the ADC; above it the spectrum is distorted."""

_LARGEST_COUNT = 2**15 - 1
"""Largest sample of an ADC of 16 bits."""

_Reals = NDArray[np.float64]
_Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Calibration:
    """Errors of the channels and of ranges, measured with a reflector.

    Attributes
    ----------
    channel_weights : (channel,) complex128
        Inverse errors of the channels, for ``Radar(channel_weights=...)``. The phase of the first is zero, and the
        power of the reflector, added over the channels, stays the same.
    range_offset : float
        Measured range minus true range [m]. Subtract it from ranges.
    range_deviation : float
        Standard deviation of `range_offset` from the SNR [m].
    snr_db : (channel,) float64
        Power of the reflector over the noise in a cell of a frame [dB].
    phase_deviation : (channel,) float64
        Standard deviation of the phase of each weight from the SNR [rad].
    residual_phase : (channel,) float64
        Root mean square of the residual phase over the frames [rad]; NaN with one frame. A value far above
        ``phase_deviation * sqrt(frames)`` indicates motion or drift.

    See Also
    --------
    calibrate : Makes one.

    Examples
    --------
    >>> radar = rc.bgt60tr13c(num_chirps=16)
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), radar).frame()
    >>> found = rc.calibrate(frame, at=[2.0, 0.0, 0.0])
    >>> np.abs(found.channel_weights).round(1).tolist(), bool(abs(found.range_offset) < 0.01)
    ([1.0, 1.0, 1.0], True)
    """

    channel_weights: NDArray[np.complex128]
    range_offset: float
    range_deviation: float
    snr_db: NDArray[np.float64]
    phase_deviation: NDArray[np.float64]
    residual_phase: NDArray[np.float64]


def calibrate(frames: Frame | Recording, *, at: ArrayLike, max_offset: float = 0.3) -> Calibration:
    """Measure channel and range errors with a reflector at a known position.

    A suitable reflector is a trihedral corner of 3 to 10 cm, 1 to 5 m away and at least three range bins from other
    objects. Radar and reflector must be at rest. The echo in channel k is ``error_k * ideal_k``. `ideal_k` is the echo
    of a point at `at`, with the distances to every antenna, so the reflector may be in the near field. The weights are
    the inverse errors. They correct all channel errors, including receiver phases, and replace earlier
    ``Radar.channel_weights``.

    Several frames are averaged coherently, after removal of the phase common to all channels of a frame.

    Parameters
    ----------
    frames : Frame or Recording
        Raw samples, real or I/Q. The radar needs a ramp and separable transmitters.
    at : (3,) array_like
        Position of the reflector (the apex of a corner) in the sensor frame [m]: x forward, y left, z up.
    max_offset : float
        Largest difference between measured and true range [m].

    Returns
    -------
    calibration : Calibration

    Raises
    ------
    ValueError, TypeError
        If there is no echo near `at` or a second one of similar power, if the echo moves or the ADC saturates; for
        frames of several waveforms, CW radars and Doppler-division multiplex.

    See Also
    --------
    Radar : Takes the weights.
    detect : Measures directions with them.

    Examples
    --------
    >>> from dataclasses import replace
    >>> radar = rc.bgt60tr13c(num_chirps=16)
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.3, 0.0])]), radar).frame()
    >>> errors = np.array([1.0, 0.9, 1.1])[:, None, None]
    >>> measured = rc.Frame(frame.cube * errors.astype(np.float32), 0.0, radar)
    >>> found = rc.calibrate(measured, at=[2.0, 0.3, 0.0])
    >>> calibrated = replace(radar, channel_weights=found.channel_weights)
    >>> (1.0 / np.abs(calibrated.channel_weights)).round(1).tolist()
    [1.0, 0.9, 1.1]
    """
    # Check all arguments before any work.
    recording = recording_of("frames", frames)
    radar = recording.radar
    require_one_waveform(radar)
    require_range(radar.waveform)
    place = check.array("at", at, (3,))
    largest_offset = check.positive("max_offset", max_offset, "m")
    ideal, distance = _ideal_echo(radar, place)
    nearest = MAIN_LOBE * radar.waveform.range_resolution
    if not nearest < distance < radar.max_unambiguous_range:
        raise ValueError(
            f"at: expected a position {nearest:.3g} to {radar.max_unambiguous_range:.3g} m from the antennas, got "
            f"{distance:.3g} m"
        )
    if len(recording) == 0:
        raise ValueError("frames: expected at least one frame, got none")

    # The reflector in every frame, and its channels' amplitudes relative to the ideal echo.
    limits = max(distance - largest_offset, nearest), distance + largest_offset
    rows, ranges, levels, variances = [], [], [], []
    for frame in recording.frames():
        _require_range_of_adc(frame)
        found = detect(frame, min_range=limits[0], max_range=limits[1])
        index = _reflector(found, limits, radar)
        rows.append(_channels(frame, float(found.range[index]), float(np.nan_to_num(found.velocity[index]))) / ideal)
        ranges.append(found.range[index])
        levels.append(found.snr_db[index])
        variances.append(found.covariance[index, 0, 0])

    # Errors common to all frames, up to a factor per frame: the dominant singular vector.
    echoes = np.array(rows)
    errors = np.linalg.svd(echoes, full_matrices=False)[2][0]
    errors *= np.exp(-1j * np.angle(errors[0]))
    square = np.square(np.abs(errors))
    weights: _Complexes = np.sqrt(square.mean()) / errors

    # Accuracy from the SNR, and from the scatter between frames.
    number = len(echoes)
    snr = np.mean(10.0 ** (0.1 * np.array(levels))) * square / square.mean()
    equal = echoes * weights
    left = np.angle(equal * equal.mean(axis=1, keepdims=True).conj())
    return Calibration(
        channel_weights=weights,
        range_offset=float(np.mean(ranges)) - distance,
        range_deviation=float(np.sqrt(np.mean(variances) / number)),
        snr_db=10.0 * np.log10(snr),
        phase_deviation=np.sqrt(0.5 / (snr * number)),
        residual_phase=np.sqrt(np.square(left).sum(axis=0) / (number - 1)) if number > 1 else np.full(len(snr), np.nan),
    )


def _ideal_echo(radar: Radar, place: _Reals) -> tuple[_Complexes, float]:
    """Channels of the echo of a point relative to their mean amplitude, (channel,), and its range [m]."""
    to_tx, to_rx = (np.linalg.norm(place - antennas, axis=1) for antennas in (radar.tx, radar.rx))
    if radar.num_channels == len(radar.rx):  # one transmitter, or all at once
        to_tx = to_tx.mean(keepdims=True)
    paths = (to_tx[:, None] + to_rx).ravel()
    spreading = 1.0 / np.outer(to_tx, to_rx).ravel()
    wave: _Complexes = spreading / spreading.mean() * np.exp(2j * np.pi / radar.waveform.wavelength * paths)
    return wave, 0.5 * float(paths.mean())


def _require_range_of_adc(frame: Frame) -> None:
    """Raise ValueError if samples of a frame are at the limits of the ADC."""
    if not is_of_adc(frame):
        return
    largest = _LARGEST_COUNT if unit_of(frame) == COUNTS else 1.0
    parts = frame.cube.view(frame.cube.real.dtype)
    clipped = float(np.mean(np.abs(parts) >= largest))
    if clipped > _MOST_CLIPPED:
        raise ValueError(
            f"frames: expected samples within the range of the ADC, got {100.0 * clipped:.2g} % at its limits in the "
            f"frame at {frame.time:g} s; use less gain or a smaller reflector"
        )


def _reflector(found: Detections, limits: tuple[float, float], radar: Radar) -> int:
    """Index of the echo of the reflector among detections within limits."""
    where = f"from {limits[0]:.3g} to {limits[1]:.3g} m"
    if len(found) == 0:
        raise ValueError(f"at: expected an echo {where}, got none in the frame at {found.time - radar.middle:g} s")
    order = np.argsort(-found.snr_db)
    best = int(order[0])
    if len(found) > 1 and found.snr_db[order[1]] > found.snr_db[best] - _SECOND_DB:
        two = " and ".join(f"{found.range[k]:.3f} m ({found.snr_db[k]:.0f} dB)" for k in order[:2])
        raise ValueError(f"at: expected one strong echo {where}, got {two}; remove one or set max_offset")
    if abs(found.velocity[best]) > radar.waveform.velocity_resolution:  # False for NaN
        raise ValueError(f"frames: expected radar and reflector at rest, got {found.velocity[best]:+.3g} m/s")
    return best


def _channels(frame: Frame, distance: float, velocity: float) -> _Complexes:
    """Windowed amplitudes of a tone in the channels, compensated for the motion until each chirp."""
    radar = frame.radar
    wf = radar.waveform
    doppler = 2.0 * velocity / wf.wavelength
    beat = 2.0 * distance * wf.slope / SPEED_OF_LIGHT + doppler
    fast = centred_window("window", "hann", wf.num_samples) * np.exp(-2j * np.pi * beat * wf.sample_times)
    slow = centred_window("doppler_window", "hann", wf.num_chirps) * np.exp(
        -2j * np.pi * doppler * (wf.chirp_times + radar.channel_offsets[:, None])
    )
    amplitudes: _Complexes = np.einsum("kc,kcn,n->k", slow, frame.cube.astype(np.complex128), fast, optimize=True)
    return amplitudes
