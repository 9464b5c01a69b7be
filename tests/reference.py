"""The slow truth: a few obvious lines that everything fast is compared with."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.waveform import Waveform


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
