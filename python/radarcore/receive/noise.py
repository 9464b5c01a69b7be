"""Noise of the receiver: random streams of a frame, noise of a spectrum, thermal noise, the transient of turning on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.radar.receiver import AdcErrors, Receiver
from radarcore.radar.waveform import Waveform
from radarcore.receive.filters import low_pass_gain
from radarcore.units import power_from_db

_MEMORY = 10.0
"""Times in which the slowest part of the low-pass falls to 1/e after which noise has forgotten: to 5e-5."""

_ALIASES = 64
"""Bands above and below the sampled one from which noise is folded into it."""


def thermal_noise(receiver: Receiver, waveform: Waveform, num_channels: int, draws: RandomStreams) -> NDArray[Any]:
    """Noise (channel, chirp, sample) [sqrt(W)]: float32 or, of an I/Q receiver, complex64.

    White noise of k T F per Hz through the low-pass; the residual above the sampled band aliases into it.
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


def turn_on_noise(
    receiver: Receiver, errors: AdcErrors, waveform: Waveform, num_channels: int, draws: RandomStreams
) -> NDArray[Any]:
    """Noise of turning on (channel, chirp, sample) [sqrt(W)]: a draw for every channel and chirp, decaying."""
    assert errors.turn_on_db is not None
    draw = draws.normal if receiver.output == "real" else draws.complex_normal
    level = _deviation(receiver, waveform.sample_rate) * power_from_db(errors.turn_on_db) ** 0.5
    decay = level * np.exp(-np.arange(waveform.num_samples) / (waveform.sample_rate * errors.turn_on_time))
    starts: NDArray[Any] = draw("turn-on", (num_channels, waveform.num_chirps, 1))
    noise: NDArray[Any] = starts * decay.astype(np.float32)
    return noise


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


_EFFECTS = (
    "thermal noise",
    "phase noise",
    "slow phase noise",
    "turn-on",
    "chirp offset",
    "ADC noise",
    "segment offset",
)

GOLDEN = 0x9E3779B97F4A7C15
"""Step of SplitMix64: 2**64 over the golden ratio."""


@dataclass(frozen=True)
class RandomStreams:
    """Normally distributed numbers of a frame.

    Parameters
    ----------
    seed : int
        Of the simulation.
    start : float
        Start of the frame [s].
    """

    seed: int
    start: float

    def normal(self, effect: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Numbers of mean 0 and deviation 1."""
        numbers = np.zeros(shape, np.float32)
        _core.add_noise(numbers, [_key(self.seed, _EFFECTS.index(effect))], 1.0, self.start)
        return numbers

    def complex_normal(self, effect: str, shape: tuple[int, ...]) -> NDArray[np.complex64]:
        """Circular numbers whose real and imaginary parts have the deviation 1."""
        numbers: NDArray[np.complex64] = self.normal(effect, (*shape, 2)).view(np.complex64)[..., 0]
        return numbers


def _key(seed: int, stream: int) -> int:
    """Key of a stream. The first has the seed itself, as a receiver with thermal noise alone."""
    return seed if stream == 0 else int(mixed(np.array([(seed + stream * GOLDEN) % 2**64], dtype=np.uint64))[0])


def mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Words in which every bit depends on all bits of the given ones: the mixer of SplitMix64.

    G. L. Steele, D. Lea, C. H. Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
    """
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))


def even_length(least: int) -> int:
    """Smallest even number from `least` on without prime factors above 5: a fast length of transforms."""
    from scipy.fft import next_fast_len  # takes longer to load than the rest

    return 2 * int(next_fast_len((least + 1) // 2, real=True))


def real_noise(normal: NDArray[np.float32], root: NDArray[np.float32], num_samples: int) -> NDArray[np.float32]:
    """Real noise (..., sample) with the variance ``root[k]**2`` in the k-th of the equal bands from 0 to half the rate.

    Parameters
    ----------
    normal : (..., 2 (n // 2 + 1)) float32
        Standard normal numbers.
    root : (n // 2 + 1,) float32
        Deviation of the part at ``k / n`` of the sample rate, ``n`` even.
    num_samples : int
        Samples that are kept. Noise repeats itself after n of them: those lost should be more than it remembers.
    """
    length = 2 * (len(root) - 1)
    spectrum = normal.view(np.complex64) * (0.5 * length * root)
    # Both ends have one real number each, of the whole variance.
    spectrum[..., [0, -1]] = 2.0 * spectrum[..., [0, -1]].real
    return np.asarray(np.fft.irfft(spectrum, length, axis=-1)[..., :num_samples], np.float32)


def complex_noise(normal: NDArray[np.float32], root: NDArray[np.float32], num_samples: int) -> NDArray[np.complex64]:
    """Circular noise (..., sample) of the variance ``root[k]**2`` in either of the real parts, in n bands of the rate.

    `normal` is (..., 2 n), `root` (n,) in the order of `numpy.fft.fftfreq`; otherwise as `real_noise`.
    """
    spectrum = normal.view(np.complex64) * (len(root) * root)
    return np.asarray(np.fft.ifft(spectrum, axis=-1)[..., :num_samples], np.complex64)
