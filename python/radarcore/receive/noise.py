"""Noise of the receiver: thermal noise behind the low-pass, and what turning on leaves at the start of a chirp."""

from __future__ import annotations

from functools import lru_cache
from math import ceil, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.baseband import low_pass_gain
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.receive.draws import Draws
from radarcore.receive.spectrum import complex_noise, even_length, real_noise
from radarcore.units import power_from_db

_MEMORY = 10.0
"""Times in which the slowest part of the low-pass falls to 1/e after which noise has forgotten: to 5e-5."""

_ALIASES = 64
"""Bands above and below the sampled one from which noise is folded into it."""


def thermal_noise(receiver: Receiver, waveform: Waveform, num_channels: int, draws: Draws) -> NDArray[Any]:
    """Noise (channel, chirp, sample) [sqrt(W)]: float32 or, of an I/Q receiver, complex64.

    White noise of ``k T F`` per Hz that passes the low-pass; what that leaves above the sampled band is folded into it.
    """
    shape = num_channels, waveform.num_chirps, waveform.num_samples
    deviation = np.float32(_deviation(receiver, waveform.sample_rate))
    is_real = receiver.output == "real"
    if receiver.low_pass is None:
        white: NDArray[Any] = (draws.normal if is_real else draws.complex_normal)("thermal noise", shape)
        white *= deviation
        return white
    root = _root(receiver, waveform.sample_rate, waveform.num_samples)
    rows = draws.normal("thermal noise", (*shape[:2], 2 * len(root)))
    return (real_noise if is_real else complex_noise)(rows, deviation * root, shape[2])


def kick(receiver: Receiver, waveform: Waveform, num_channels: int, draws: Draws) -> NDArray[Any]:
    """Kick at the start of chirps (channel, chirp, sample) [sqrt(W)]: a draw for every channel and chirp, decaying."""
    assert receiver.kick_db is not None
    draw = draws.normal if receiver.output == "real" else draws.complex_normal
    level = _deviation(receiver, waveform.sample_rate) * power_from_db(receiver.kick_db) ** 0.5
    decay = level * np.exp(-np.arange(waveform.num_samples) / (waveform.sample_rate * receiver.kick_time))
    starts: NDArray[Any] = draw("kick", (num_channels, waveform.num_chirps, 1))
    kicks: NDArray[Any] = starts * decay.astype(np.float32)
    return kicks


def _deviation(receiver: Receiver, sample_rate: float) -> float:
    """Deviation of a real number of white noise at the receiver's input [sqrt(W)]."""
    share = 1.0 if receiver.output == "real" else 0.5
    return sqrt(share * receiver.noise_variance(sample_rate))


@lru_cache(maxsize=16)
def _root(receiver: Receiver, sample_rate: float, num_samples: int) -> NDArray[np.float32]:
    """Deviations of the parts of noise of variance 1 before the low-pass, see `real_noise` and `complex_noise`."""
    assert receiver.low_pass is not None
    slowest = 2.0 * pi * receiver.low_pass * sin(0.5 * pi / receiver.low_pass_order)
    length = even_length(num_samples + ceil(_MEMORY * sample_rate / slowest))
    frequency = np.fft.fftfreq(length, 1.0 / sample_rate)
    aliases = frequency + sample_rate * np.arange(-_ALIASES, _ALIASES + 1)[:, None]
    power = (abs(low_pass_gain(receiver, aliases)) ** 2).sum(axis=0) / length
    if receiver.output == "real":
        # One half of the spectrum is the mirror of the other, but for both ends.
        half = power[: length // 2 + 1]
        power = np.concatenate([half[:1], 2.0 * half[1:-1], half[-1:]])
    root: NDArray[np.float32] = np.sqrt(power).astype(np.float32)
    return root
