"""The slow truth: a few obvious lines that everything fast is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.units import SPEED_OF_LIGHT


def beat_signal_reference(
    delay: ArrayLike,
    amplitude: ArrayLike,
    waveform: Waveform,
    delay_rate: ArrayLike = 0.0,
    delay_acceleration: ArrayLike = 0.0,
) -> NDArray[np.complex128]:
    """Beat signal of moving paths by direct sum, eq. (1): (channel, chirp, sample), in f64.

    `delay` [s], `delay_rate` [s/s] and `delay_acceleration` [s/s^2] hold at the start of the frame; they and
    `amplitude` are (path,) or (channel, path).
    """
    paths = np.broadcast_arrays(*map(np.atleast_2d, (delay, delay_rate, delay_acceleration, amplitude)))
    slow = waveform.chirp_times[:, None]  # (chirp, 1)
    fast = waveform.sample_times  # (sample,)
    time = slow + fast  # since the start of the frame, (chirp, sample)
    cube = np.zeros((len(paths[0]), *time.shape), dtype=np.complex128)
    for channel, path in np.ndindex(paths[0].shape):
        tau0, rate, acceleration, a = (values[channel, path] for values in paths)
        tau = tau0 + rate * time + 0.5 * acceleration * time**2
        turns = waveform.start_frequency * tau + waveform.slope * tau * fast - 0.5 * waveform.slope * tau**2
        cube[channel] += np.conj(a) * np.exp(2j * np.pi * turns)
    return cube


def point_echo_reference(position: ArrayLike, rcs: float, radar: Radar) -> NDArray[np.complex128]:
    """Beat signal of one moving point, eq. (1) with the radar equation: (channel, chirp, sample), in f64.

    `position` (chirp, sample, 3) [m] is the point in the sensor frame at the time of every sample.
    """
    wf, position = radar.waveform, np.asarray(position, dtype=np.float64)
    fast = wf.sample_times
    x, y, z = np.moveaxis(position, -1, 0)
    cube = np.zeros((radar.num_channels, wf.num_chirps, wf.num_samples), dtype=np.complex128)
    elements = product(zip(radar.tx, radar.tx_patterns, strict=True), zip(radar.rx, radar.rx_patterns, strict=True))
    for channel, pair in enumerate(elements):
        (range_t, gain_t), (range_r, gain_r) = (
            (
                np.linalg.norm(position - antenna, axis=-1),
                pattern.gain(
                    np.arctan2(y - antenna[1], x - antenna[0]),
                    np.arctan2(z - antenna[2], np.hypot(x - antenna[0], y - antenna[1])),
                ),
            )
            for antenna, pattern in pair
        )
        power = radar.tx_power * gain_t * gain_r * wf.wavelength**2 * rcs / (4.0 * np.pi) ** 3
        tau = (range_t + range_r) / SPEED_OF_LIGHT
        turns = wf.start_frequency * tau + wf.slope * tau * fast - 0.5 * wf.slope * tau**2
        cube[channel] = np.sqrt(power) / (range_t * range_r) * np.exp(2j * np.pi * turns)
    return cube


def nearest_hits_reference(
    triangles: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distance [m] and number of the nearest triangle along rays from the origin, inf and -1 where there is none.

    Möller, Trumbore, Fast Minimum Storage Ray/Triangle Intersection, JGT 1997. `triangles` (triangle, corner, 3),
    `directions` (ray, 3) of unit length.
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    d = directions[:, None]  # (ray, 1, 3), against (triangle, 3)
    edge1, edge2 = b - a, c - a
    p, q = np.cross(d, edge2), np.cross(-a, edge1)
    with np.errstate(divide="ignore", invalid="ignore"):  # rays along the plane: inf and NaN are no hits
        scale = 1.0 / np.sum(p * edge1, axis=-1)
        u, v = np.sum(p * -a, axis=-1) * scale, np.sum(d * q, axis=-1) * scale
        distance = np.sum(edge2 * q, axis=-1) * scale
        is_hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0)
    distance = np.where(is_hit, distance, np.inf)
    nearest = distance.argmin(axis=1)
    shortest = distance[np.arange(len(distance)), nearest]
    return shortest, np.where(np.isfinite(shortest), nearest, -1)


@dataclass(frozen=True)
class Patches:
    """Small patches of a perfectly conducting surface: centres (n, 3) [m], unit normals (n, 3) and areas (n,) [m^2]."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    areas: NDArray[np.float64]


def double_scattering_reference(first: Patches, second: Patches, radar: ArrayLike, frequency: float) -> complex:
    """Echo of 1 W from an antenna over one surface to another and back to it, by physical optics at both.

    The integral over all pairs of patches of a wave without polarisation: every patch sends on -1 times what arrives,
    (j k / 2 pi) (cos_in + cos_out) / 2 dA exp(-j k R) / R, where both cosines are positive. Both ways round.
    """
    k = 2.0 * np.pi * frequency / SPEED_OF_LIGHT

    # Coordinates come first, (3, n): sums over rows of three take twice as long.
    def ray(start: NDArray[np.float64], end: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        offset = end - start
        length = np.sqrt(np.sum(offset * offset, axis=0))
        return length, offset / length

    antenna = np.asarray(radar, dtype=np.float64)[:, None]
    points, normals = first.points.T.copy(), first.normals.T.copy()
    to_first, toward_first = ray(antenna, points)
    to_second, toward_second = ray(antenna, second.points.T)
    cos_first = -np.sum(toward_first * normals, axis=0)
    cos_second = -np.sum(toward_second * second.normals.T, axis=0)
    total = 0.0j
    for point, normal, area, distance, cosine in zip(
        second.points, second.normals, second.areas, to_second, cos_second, strict=True
    ):
        length, direction = ray(points, point[:, None])
        cos_out, cos_in = np.sum(direction * normals, axis=0), -normal @ direction
        is_lit = (cos_first > 0.0) & (cos_out > 0.0) & (cos_in > 0.0) & (cosine > 0.0)
        weight = first.areas * area * 0.25 * (cos_first + cos_out) * (cos_in + cosine) * is_lit
        total += np.sum(weight / (to_first * length * distance) * np.exp(-1j * k * (to_first + length + distance)))
    return complex(2.0 * (1j / (4.0 * np.pi)) * (1j * k / (2.0 * np.pi)) * total)
