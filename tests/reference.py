"""The slow truth: a few obvious lines that everything fast is compared with."""

from __future__ import annotations

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
