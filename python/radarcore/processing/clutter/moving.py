"""Clutter removal for a moving radar: the filter subtracts echoes of static objects.

For a sensor with velocity v, a static object in the direction u has the range rate ``-v . u``: clutter lies on a known
curve of angle and velocity. Its phase in channel k at position p_k, at chirp time T and sample frequency f is
``-2 pi f/c (p_k + 2 v T) . u``. A moving sensor is thus an array along its path (displaced phase centres; Klemm,
Principles of Space-Time Adaptive Processing, 2002).

Clutter within the beam fills a band of velocities. After rotation by the band's centre velocity, its echoes vary
slowly over the chirps, so polynomials of low degree span them. The rotation uses the frequency of every sample and
therefore includes range migration. For a sensor at rest the polynomial is a constant: the filter subtracts the mean
over the chirps.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.motion.group import Motions, sensor_state
from radarcore.motion.protocol import STALE, AnyMotion, as_motion
from radarcore.processing.inputs import Kind, require_one_waveform, require_transmitters_apart, with_samples
from radarcore.products import orthonormal, product
from radarcore.radar.beam import is_in_beam
from radarcore.radar.pattern import Pattern
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.units import SPEED_OF_LIGHT

METHODS = ("doppler", "space-time")

_GRID = 36
"""Steps of the grid of directions across the field of view, along each axis."""

_WIDE_DEG = 110.0
"""Above this horizontal field of view the vertical angle also limits directions to the sides, as in `Simulator`."""

_BAND_OF_A_SUBSPACE = 4e-3
"""Relative bandwidth that shares one subspace of channels and polynomials: phases of pi then err by -40 dB."""

_TRANSITION = 3.0
"""Range bins at each end where real samples hardly show the sign of a frequency: slightly more than a Hann lobe."""

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def remove_static(
    frame: Kind,
    motion: AnyMotion | ArrayLike,
    *,
    method: str = "doppler",
    field_of_view_deg: tuple[float, float] | None = None,
    suppression_db: float = 50.0,
) -> Kind:
    """Subtract static echoes from frames of a moving sensor.

    At velocity 0 the filter subtracts the mean over the chirps from every channel and sample. Otherwise it removes a
    band of velocities, from the smallest to the largest in the field of view, and some bins around it. A stronger
    suppression removes more bins. Targets in the band are lost with ``method="doppler"``. Signals that move with the
    sensor, such as coupling between its antennas, have velocity 0 and stay unless 0 is in the band.

    The angular velocity has no effect: ranges stay constant when the sensor turns about the centre of its array.
    Antennas some millimetres from the centre move at only millimetres per second per rad/s.

    Parameters
    ----------
    frame : Frame or Recording
        At least two chirps, at any times.
    motion : Motion, or (3,) or (frame, 3) array_like
        Motion of the sensor, as in `Simulator`, or live, evaluated at the middle of each frame. Warns if a live update
        is more than 0.1 s older. Or the velocity of the array's centre over the ground at that time, along the
        sensor's axes [m/s]: one per recording or one per frame.
    method : "doppler" or "space-time"
        "doppler" removes the band in every channel. "space-time" removes only echoes from directions that have the
        cell's velocity, so slow targets in other directions stay. It needs an array that resolves them, calibrated in
        phase and position; three antennas with a wide beam leave little.
    field_of_view_deg : (horizontal, vertical), optional
        Directions of static objects, as in `Simulator` [degrees]; default: the antennas' beam, down to 20 dB below the
        largest two-way gain.
    suppression_db : float
        Least attenuation at the edge of the band for a far point at constant velocity [dB].

    Returns
    -------
    frame : Frame or Recording
        With filtered samples of the same dtype, without codes.

    Raises
    ------
    ValueError, TypeError
        For other shapes, several waveforms, transmitters in Doppler-division multiplex, real samples of a CW radar
        (the sign of velocity is unknown), and a band that fills all velocities of the chirps.

    See Also
    --------
    remove_mean : For a radar at rest.
    cancel_pulses : Differences of chirps.

    Examples
    --------
    >>> wall, ball = rc.PointTarget([2.0, 0.0, 0.0]), rc.PointTarget([3.0, 0.0, 0.0], 0.01, velocity=[1.5, 0.0, 0.0])
    >>> sensor = rc.Linear(rc.Pose(), velocity=[0.2, 0.0, 0.0])
    >>> frame = rc.Simulator(rc.Scene([wall, ball]), rc.bgt60tr13c(num_chirps=64), radar_motion=sensor).frame()
    >>> filtered = rc.remove_static(frame, sensor)
    >>> [round(rc.strongest_peak(each).range, 1) for each in (frame, filtered)]
    [2.0, 3.0]
    """
    check.instance("frame", frame, Frame, Recording)
    radar = frame.radar
    require_one_waveform(radar)
    require_transmitters_apart(frame, radar)
    is_one = isinstance(frame, Frame)
    given = _sensor_velocity(frame, motion)
    if (fastest := float(np.abs(given).max(initial=0.0))) > 1e-3 * SPEED_OF_LIGHT:
        raise ValueError(f"motion: expected at most {1e-3 * SPEED_OF_LIGHT:.0f} m/s, got {fastest:g}")
    is_joint = check.choice("method", method, METHODS) == "space-time"
    view = _field_of_view(field_of_view_deg)
    residual = 10.0 ** (-0.1 * check.positive("suppression_db", suppression_db, "dB"))
    if radar.waveform.is_cw and not np.iscomplexobj(frame.cube):
        raise ValueError("frame: expected I/Q samples of a CW radar (slope = 0 Hz/s), got real ones")

    cubes = frame.cube[None] if is_one else frame.cube
    filtered = np.empty_like(cubes)
    for samples, velocity, out in zip(cubes, np.broadcast_to(given, (len(cubes), 3)), filtered, strict=True):
        out[:] = _filtered(samples, radar, velocity, view, residual, is_joint)
    return with_samples(frame, filtered[0] if is_one else filtered, radar)


def _sensor_velocity(frame: Frame | Recording, motion: AnyMotion | ArrayLike) -> Array:
    """Velocity of the array's centre in the sensor's axes, (3,), or (frame, 3) of a recording [m/s]."""
    is_one = isinstance(frame, Frame)
    if not (callable(motion) or hasattr(motion, "rate_at")):  # arrays of JAX and pandas have `at`
        return check.array("motion", motion, (3,) if is_one or np.ndim(motion) == 1 else (len(frame.cube), 3))
    times = np.atleast_1d(frame.time) + frame.radar.middle
    motions = Motions([as_motion("motion", motion)])
    states = [sensor_state(motions, time, frame.radar.array_center) for time in times.tolist()]
    if (oldest := max((state.age for state in states), default=0.0)) > STALE:
        notice.warn(f"motion: expected a live update within {STALE:g} s of a frame, got one {oldest:.3g} s before it")
    velocities = np.array([state.pose[:, :3].T @ state.velocity for state in states])
    return velocities[0] if is_one else velocities.reshape(-1, 3)


def _filtered(
    samples: NDArray[Any],
    radar: Radar,
    velocity: Array,
    view: tuple[float, float] | None,
    residual: float,
    is_joint: bool,
) -> NDArray[Any]:
    """Samples (channel, chirp, sample) without clutter."""
    wf = radar.waveform
    directions = _directions(radar.tx_patterns, radar.rx_patterns, view)
    band = _band(wf, directions, velocity, residual)

    # Turn clutter to zero velocity and project it onto the polynomials.
    signal = _analytic(samples, wf)
    turned = np.ascontiguousarray(signal * band.turn.conj()).view(np.float64)  # the polynomials are real
    projected = product(band.polynomials.T, turned).view(np.complex128)  # (channel, degree, sample)
    if is_joint:
        projected = _from_clutter(projected, radar, velocity, directions, band, residual)
    clutter = band.turn * product(band.polynomials, projected.view(np.float64)).view(np.complex128)
    found = clutter if np.iscomplexobj(samples) else clutter.real
    filtered: NDArray[Any] = (samples - found).astype(samples.dtype)
    return filtered


class _Band(NamedTuple):
    """Velocity band of clutter, and the functions of slow time that span its echoes."""

    centre: float
    """Velocity in the middle of the band [m/s]."""
    turn: Complex
    """Echo of the centre velocity, (chirp, sample)."""
    polynomials: Array
    """Orthonormal over the chirps, (chirp, degree)."""
    time: Array
    """Times of the chirps from their middle [s], (chirp,)."""


def _band(waveform: Waveform, directions: Array, velocity: Array, residual: float) -> _Band:
    """Velocity band of static objects in these directions (direction, 3)."""
    speed = float(np.linalg.norm(velocity))
    rates = -(directions @ velocity)
    lowest, highest = float(rates.min()), float(rates.max())
    centre, half = 0.5 * (lowest + highest), 0.5 * (highest - lowest)
    time = waveform.chirp_times - 0.5 * (waveform.chirp_times[0] + waveform.chirp_times[-1])
    frequency = _frequencies(waveform)
    turn = np.exp(4j * np.pi * centre / SPEED_OF_LIGHT * np.outer(time, frequency))

    # Add polynomials until they span an echo at the edge of the band. A sensor at rest needs only the constant.
    extent = max(float(np.abs(time).max()), 1e-300)
    edge = 4.0 * np.pi * half / SPEED_OF_LIGHT * float(frequency.max())  # [rad/s]
    num_most = min(waveform.num_chirps - 1, int(1.5 * edge * extent) + 30 if speed > 0.0 else 1)
    polynomials = np.empty((num_most, waveform.num_chirps))
    next_power, wave = np.ones(waveform.num_chirps), np.exp(1j * edge * time)
    missed = float(waveform.num_chirps)
    for degree in range(num_most):
        polynomials[degree] = orthonormal(next_power, polynomials[:degree])
        missed -= abs(np.einsum("n,n->", polynomials[degree], wave)) ** 2
        if speed == 0.0 or missed <= max(residual, 1e-12) * waveform.num_chirps:  # rounding errors do not count
            return _Band(centre, turn, polynomials[: degree + 1].T, time)
        next_power = time / extent * polynomials[degree]
    raise ValueError(
        f"frame: expected more than {waveform.num_chirps} chirps, because clutter from {lowest:+.3g} to {highest:+.3g} "
        f"m/s fills all their velocities, got {waveform.num_chirps}"
    )


def _from_clutter(
    projected: Complex, radar: Radar, velocity: Array, directions: Array, band: _Band, residual: float
) -> Complex:
    """Part of (channel, degree, sample) that arrives from directions with the clutter's velocity."""
    num_channels, num_degrees, num_samples = projected.shape
    # Position of every channel at the middle of its chirps.
    positions = radar.virtual_array + 2.0 * radar.channel_offsets[:, None] * velocity
    along = positions @ directions.T  # (channel, direction)
    errors = 1.0 / radar.channel_corrections[:, None, None]
    rates = -(directions @ velocity) - band.centre
    frequency = _frequencies(radar.waveform)
    kept = np.empty_like(projected)
    step = max(1, int(num_samples * _BAND_OF_A_SUBSPACE * frequency.min() / max(float(np.ptp(frequency)), 1.0)))
    for first in range(0, num_samples, step):
        part = slice(first, min(first + step, num_samples))
        wavenumber = 2.0 * np.pi / SPEED_OF_LIGHT * float(frequency[part].mean())
        turns = np.exp(2j * wavenumber * np.outer(band.time, rates))  # (chirp, direction)
        of_channels = errors * np.exp(-1j * wavenumber * along)[:, None]
        steering = (of_channels * product(band.polynomials.T, turns)).reshape(num_channels * num_degrees, -1)
        basis = _span(product(steering, steering.conj().T), residual)
        flat = projected[..., part].reshape(num_channels * num_degrees, -1)
        kept[..., part] = product(basis, product(basis.conj().T, flat)).reshape(num_channels, num_degrees, -1)
    return kept


def _span(gram: Complex, residual: float) -> Complex:
    """Orthonormal columns (n, k) that span vectors v with the sum `gram` of ``v v^H``, up to a relative residual power.

    Cholesky decomposition, pivoted by the largest residual on the diagonal.
    """
    left = gram.diagonal().real.copy()
    least = residual * left.sum()
    factors, basis = np.empty((2, *gram.shape), np.complex128)
    number = 0
    while number < len(gram) and left.sum() > least:
        pivot = int(left.argmax())
        known = factors[:number]
        factors[number] = (gram[:, pivot] - np.einsum("k,kn->n", known[:, pivot].conj(), known)) / np.sqrt(left[pivot])
        left -= np.square(np.abs(factors[number]))
        left[pivot] = 0.0
        np.maximum(left, 0.0, out=left)
        basis[number] = orthonormal(factors[number], basis[:number])
        number += 1
    return np.asarray(basis[:number].T)


def _frequencies(waveform: Waveform) -> Array:
    """Transmitted frequency at every sample [Hz]: the phase per delay, accurate to a millionth."""
    return waveform.start_frequency + waveform.slope * waveform.sample_times


def _analytic(samples: NDArray[Any], waveform: Waveform) -> NDArray[Any]:
    """Analytic (I/Q) signal of real samples: frequencies of the wrong sign are removed.

    The weights rise smoothly: with a step, leakage of strong echoes would leave echoes of the wrong sign beside it.
    """
    if np.iscomplexobj(samples):
        return samples
    number = samples.shape[-1]
    bins = np.fft.fftfreq(number, 1.0 / number) * np.sign(waveform.slope)
    to_end = np.minimum(np.abs(bins), 0.5 * number - np.abs(bins))
    weights = 1.0 + np.sign(bins) * np.sin(0.5 * np.pi * np.minimum(to_end / _TRANSITION, 1.0))
    return np.fft.ifft(np.fft.fft(samples, axis=-1) * weights, axis=-1)


@lru_cache(maxsize=16)
def _directions(
    tx_patterns: tuple[Pattern, ...], rx_patterns: tuple[Pattern, ...], view: tuple[float, float] | None
) -> Array:
    """Unit vectors (direction, 3) over a field of view, or over the beam of the antennas."""
    horizontal, vertical = (150.0, 150.0) if view is None else view
    azimuth = np.deg2rad(_across(horizontal))[:, None]
    across, side = np.cos(azimuth), np.sin(azimuth)
    forward = across if horizontal <= _WIDE_DEG else np.maximum(across, np.abs(side))
    up = forward * np.tan(np.deg2rad(_across(vertical)))
    vectors = np.stack(np.broadcast_arrays(across, side, up), axis=-1).reshape(-1, 3)
    if view is None:
        inside = is_in_beam(tx_patterns, rx_patterns, vectors)
        inside[len(vectors) // 2] = True  # the x axis: a very narrow beam contains no other direction
        vectors = vectors[inside]
    return check.frozen(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _across(angle_deg: float) -> Array:
    """Angles across a field of view, including 0 [degrees]."""
    return angle_deg * np.linspace(-0.5, 0.5, _GRID + 1) if angle_deg > 0.0 else np.zeros(1)


def _field_of_view(value: tuple[float, float] | None) -> tuple[float, float] | None:
    if value is None:
        return None
    angles = check.array("field_of_view_deg", value, (2,))
    if not ((angles >= 0.0) & (angles < 180.0)).all():
        raise ValueError(
            f"field_of_view_deg: expected angles from 0 to below 180 degrees, got {tuple(angles.tolist())}"
        )
    return float(angles[0]), float(angles[1])
