"""Velocities above the unambiguous limit: probabilities of the Doppler periods that explain a frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.processing.angles.directions import waves_of
from radarcore.processing.angles.steering import channel_corrections, steering_weights
from radarcore.processing.detection.map import Layout, layout_of
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.inputs import (
    checked_samples,
    cube_and_radar,
    require_one_frame,
    require_transmitters_apart,
    require_uniform_chirps,
)
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import require_range
from radarcore.recording.frame import Frame
from radarcore.units import SPEED_OF_LIGHT

_Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class VelocityHypotheses:
    """Possible velocities of detections, in steps of whole periods; NaN for hypotheses above the largest velocity.

    Attributes
    ----------
    detections : Detections
        The detections given.
    velocity, range, azimuth, elevation : (detection, hypothesis) float64
        Coordinates under each hypothesis [m/s, m, rad].
    probability : (detection, hypothesis) float64
        Sums to 1; NaN for a detection without a velocity.

    See Also
    --------
    processing.velocity_hypotheses : Makes them.

    Examples
    --------
    >>> radar = rc.bgt60tr13c(num_chirps=32)
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-3.0, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, radar).frame()
    >>> found = rc.processing.velocity_hypotheses(frame, rc.detect(frame), max_velocity=6.0)
    >>> found.resolved().velocity.round(1).tolist()
    [-3.0]
    """

    detections: Detections
    velocity: NDArray[np.float64]
    range: NDArray[np.float64]
    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]
    probability: NDArray[np.float64]

    def resolved(self, least_probability: float = 0.99) -> Detections:
        """Detections with the most probable velocities and their directions.

        Velocity and angles are NaN where no hypothesis has `least_probability`.
        """
        least = check.number("least_probability", least_probability)
        rows, best = np.arange(len(self.velocity)), np.nan_to_num(self.probability).argmax(axis=1)
        is_known = self.probability[rows, best] >= least
        names = ("velocity", "azimuth", "elevation")
        chosen: dict[str, Any] = {name: np.where(is_known, getattr(self, name)[rows, best], np.nan) for name in names}
        chosen["range"] = np.where(is_known, self.range[rows, best], self.detections.range)
        covariance = self.detections.covariance.copy()
        covariance[~is_known, 1:] = covariance[~is_known, :, 1:] = np.nan
        return replace(self.detections, **chosen, covariance=covariance)


def velocity_hypotheses(
    frame: Frame | ArrayLike, detections: Detections, radar: Radar | None = None, *, max_velocity: float
) -> VelocityHypotheses:
    """Possible velocities of detections up to a limit, and their probabilities.

    A velocity is measured up to whole periods of ``2 Waveform.max_velocity``. The likelihood of each hypothesis is the
    power of one plane wave in all channels at its range and velocity. Two effects discriminate. Within a frame the
    target moves by ``wavelength / 2`` per chirp and period, so its beat frequency drifts. In time-division multiplex
    the phases of later transmitters depend on the velocity, and only few hypotheses fit a plane wave. If both effects
    are below the noise, the probabilities are equal.

    All hypotheses within `max_velocity` have equal prior probability. Residual power counts as noise. Targets in the
    same cell are not separated.

    Parameters
    ----------
    frame : Frame, or (channel, chirp, sample) float32, float64, complex64 or complex128
        Beat signal, finite.
    detections : Detections
        Of this frame, by `detect`.
    radar : Radar, optional
        Of a cube; a frame has its own. A ramp, and at least two chirps at equal intervals.
    max_velocity : float
        Largest velocity of a target, towards or away [m/s]; half a velocity bin is added for errors.

    Returns
    -------
    hypotheses : VelocityHypotheses

    Raises
    ------
    ValueError, TypeError
        For shapes that do not fit the radar, chirps at unequal intervals, a CW radar, and transmitters in
        Doppler-division multiplex, whose empty bands resolve the ambiguity.

    See Also
    --------
    detect : Detections of a frame.
    track : `detector=lambda frame: velocity_hypotheses(frame, rc.detect(frame), max_velocity=9.0).resolved()`

    Examples
    --------
    >>> radar = rc.bgt60tr13c(num_chirps=32)
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-3.0, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, radar).frame()
    >>> found = rc.processing.velocity_hypotheses(frame, rc.detect(frame), max_velocity=6.0)
    >>> found.velocity.round(1).tolist(), found.probability.round(3).tolist()
    ([[-3.0, 5.3]], [[1.0, 0.0]])
    """
    require_one_frame("frame", frame)
    require_transmitters_apart(frame, radar)
    cube, radar = cube_and_radar(frame, radar)
    check.instance("detections", detections, Detections)
    limit = check.positive("max_velocity", max_velocity, "m/s")
    wf = radar.waveform
    require_range(wf)
    require_uniform_chirps(wf)
    lengths = {"num_channels": radar.num_channels, "num_chirps": wf.num_chirps, "num_samples": wf.num_samples}
    samples = check.finite("frame", checked_samples(cube, "(channel, chirp, sample)", num_dimensions=3, **lengths))

    # Whole Doppler periods around the measured velocity. The range changes too, because the beat frequency is fixed.
    layout = layout_of(radar, "hann", "hann", False, np.iscomplexobj(samples))
    by_doppler = layout.coordinates.slopes()[:, 1] / wf.chirp_interval
    most = int(np.ceil((limit + wf.max_velocity) / by_doppler[1]))
    turns = np.arange(-most, most + 1)
    distance, velocity = (
        values[:, None] + step * turns
        for values, step in zip((detections.range, detections.velocity), by_doppler, strict=True)
    )
    is_possible = (np.abs(velocity) <= limit + 0.5 * wf.velocity_resolution) & np.isfinite(distance)
    within = is_possible.any(axis=0)
    distance, velocity, is_possible = distance[:, within], velocity[:, within], is_possible[:, within]
    rows, columns = np.nonzero(is_possible)
    far, speed = distance[rows, columns], velocity[rows, columns]

    # Amplitude of every channel for every hypothesis, and its projection onto one wave.
    amplitude = _amplitudes(samples, radar, layout, far, speed)
    seen = waves_of(amplitude, radar, speed, None, far).directions
    undone = steering_weights(
        radar.virtual_array, wf.wavelength, np.nan_to_num(seen.azimuth), np.nan_to_num(seen.elevation)
    )
    channels = amplitude * channel_corrections(radar, speed, None)
    found = {name: np.full(velocity.shape, np.nan) for name in ("power", "wave", "azimuth", "elevation")}
    found["power"][rows, columns] = np.square(np.abs(channels)).mean(axis=1)
    found["wave"][rows, columns] = np.square(np.abs((channels * undone).mean(axis=1)))
    found["azimuth"][rows, columns], found["elevation"][rows, columns] = seen.azimuth, seen.elevation

    # Likelihoods with the noise of the detection, or with the residual of the best hypothesis if that is larger.
    num_channels = radar.num_channels
    power, wave = (np.where(is_possible, found[name], 0.0) for name in ("power", "wave"))
    best = wave.argmax(axis=1) if wave.size else np.zeros(len(wave), dtype=int)
    noise = power.max(axis=1, initial=0.0) / 10.0 ** (0.1 * detections.snr_db)
    if num_channels > 1 and wave.size:
        left = (power - wave)[np.arange(len(wave)), best] * num_channels / (num_channels - 1)
        noise = np.maximum(noise, left)
    with np.errstate(invalid="ignore", divide="ignore"):
        exponent = num_channels * (wave - wave.max(axis=1, initial=0.0, keepdims=True)) / noise[:, None]
        likelihood = np.where(is_possible, np.exp(exponent), 0.0)
        probability = likelihood / likelihood.sum(axis=1, keepdims=True)
    velocity[~is_possible] = distance[~is_possible] = np.nan
    return VelocityHypotheses(detections, velocity, distance, found["azimuth"], found["elevation"], probability)


def _amplitudes(
    samples: NDArray[Any], radar: Radar, layout: Layout, distance: _Reals, velocity: _Reals
) -> NDArray[np.complex128]:
    """Windowed sum of the samples after phase compensation, (hypothesis, channel); eq. (1) of docs/theory.md."""
    wf, window = radar.waveform, np.outer(layout.slow, layout.fast)
    windowed = (samples * window).reshape(len(samples), -1)
    ramp = wf.sample_times
    time = wf.chirp_times[:, None] + ramp - wf.middle
    amplitude = np.empty((len(distance), len(samples)), dtype=np.complex128)
    for row, far, speed in zip(amplitude, distance, velocity, strict=True):
        delay = 2.0 / SPEED_OF_LIGHT * (far + speed * time)
        phase = delay * (wf.start_frequency + wf.slope * ramp - 0.5 * wf.slope * delay)
        row[:] = windowed @ np.exp(-2j * np.pi * phase).ravel()
    return amplitude
