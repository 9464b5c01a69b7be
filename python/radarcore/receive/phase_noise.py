"""Phase noise of the oscillator: the phase now minus the phase one delay earlier (range correlation).

With a phase ``phi(t)`` of the oscillator an echo of delay tau is rotated by phi(t) - phi(t - tau). Its power spectral
density is that spectrum of phi times 4 sin^2(pi f tau) (Budge, Burt, Range correlation effects in radars, 1993).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.products import product
from radarcore.receive.noise import RandomStreams, even_length, real_noise

_SLOW_PER_DECADE = 16
"""Tones per decade of the offsets that turn by less than half a turn in a chirp."""

_LONGEST = 8.0
"""Longest period of a tone [frames]: slower ones are the same for the whole frame, and nearly none."""

Pairs = tuple[tuple[float, float], ...]


def phase_density(pairs: Pairs, offset: ArrayLike) -> NDArray[np.float64]:
    """One-sided power spectral density of the phase [rad^2/Hz] at offsets [Hz]: twice the single-sideband level."""
    logarithms = np.log10(np.asarray(offset, np.float64))
    at, levels = np.log10([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs])
    if len(at) == 1:
        decibels = levels[0] - 20.0 * (logarithms - at[0])
    else:
        part = np.clip(np.searchsorted(at, logarithms) - 1, 0, len(at) - 2)
        slope = np.diff(levels) / np.diff(at)
        decibels = levels[part] + slope[part] * (logarithms - at[part])
    density: NDArray[np.float64] = 2.0 * 10.0 ** (decibels / 10.0)
    return density


def phase_differences(
    pairs: Pairs,
    delays: tuple[float, ...],
    starts: NDArray[np.float64],
    sample_times: NDArray[np.float64],
    draws: RandomStreams,
) -> NDArray[np.float32]:
    """Phase now minus the phase `delays` earlier [rad], (delay, chirp, sample), all of one oscillator.

    Offsets from the inverse of `_LONGEST` frames to half the sample rate. Offsets above a quarter turn within the
    samples of a chirp are drawn again for every chirp; slower ones are tones that run through the frame.

    Parameters
    ----------
    pairs : ((offset [Hz], level [dBc/Hz]), ...)
    delays : tuple of float
        Delays of echoes [s].
    starts : (chirp,) array
        Starts of the chirps [s].
    sample_times : (sample,) array
        Times of the samples in a chirp [s], evenly spaced.
    """
    chirps, samples = tuple(starts.tolist()), tuple(sample_times.tolist())
    fast, num_samples = _fast_offsets(pairs, delays, chirps, samples), len(samples)
    normal = draws.normal("phase noise", (len(chirps), 2 * fast.shape[-1]))
    # The same draws for all delays.
    parts = (normal.view(np.complex64) * fast[:, None]).view(np.float32)
    result = real_noise(parts, np.ones(fast.shape[-1], np.float32), num_samples)
    deviation, of_chirps, of_samples = _slow_offsets(pairs, delays, chirps, samples)
    tones = deviation * draws.complex_normal("slow phase noise", deviation.shape[-1:])
    result += product((tones[:, None] * of_chirps).view(np.float32), of_samples)
    return result


@lru_cache(maxsize=16)
def _fast_offsets(
    pairs: Pairs, delays: tuple[float, ...], starts: tuple[float, ...], sample_times: tuple[float, ...]
) -> NDArray[np.complex64]:
    """Complex deviations (delay, offset) of the offsets that are drawn for every chirp."""
    length, width = _bands(starts, sample_times)
    frequency = width * np.arange(length // 2 + 1)
    # Not the mean, which is slow; the band at the upper end is half as wide.
    deviation = np.zeros(len(frequency))
    deviation[1:] = np.sqrt(phase_density(pairs, frequency[1:]) * width)
    deviation[-1] *= 0.5**0.5
    return (deviation * _differences(frequency, delays)).astype(np.complex64)


@lru_cache(maxsize=16)
def _slow_offsets(
    pairs: Pairs, delays: tuple[float, ...], starts: tuple[float, ...], sample_times: tuple[float, ...]
) -> tuple[NDArray[np.complex64], NDArray[np.complex64], NDArray[np.float32]]:
    """Complex deviations (delay, tone) of the slow tones, and their phasors at chirps and at samples in them.

    The phase of a tone at a sample is the sum of a phase per chirp and a phase per sample. So the result is the real
    part of the product of both phasors; sample phasors are (2 tone, sample), cosine and negative sine in turn.
    """
    _, width = _bands(starts, sample_times)
    highest = 0.5 * width
    span = starts[-1] - starts[0] + 0.5 / width
    lowest = min(1.0 / (_LONGEST * span), 0.5 * highest)
    number = max(1, round(_SLOW_PER_DECADE * np.log10(highest / lowest)))
    edges = np.geomspace(lowest, highest, number + 1)
    frequency = np.sqrt(edges[1:] * edges[:-1])
    deviation = np.sqrt(phase_density(pairs, frequency) * np.diff(edges))
    of_chirps = np.exp(2j * np.pi * np.multiply.outer(np.array(starts), frequency))
    angle = 2.0 * np.pi * np.multiply.outer(frequency, np.array(sample_times))
    of_samples = np.stack([np.cos(angle), -np.sin(angle)], axis=1).reshape(2 * len(frequency), -1)
    deviations = (deviation * _differences(frequency, delays)).astype(np.complex64)
    return deviations, of_chirps.astype(np.complex64), of_samples.astype(np.float32)


def _bands(starts: tuple[float, ...], sample_times: tuple[float, ...]) -> tuple[int, float]:
    """Number and width [Hz] of the bands of the sample rate that are drawn for every chirp, finer than it resolves."""
    length = even_length(2 * len(sample_times))
    if len(sample_times) > 1:
        step = sample_times[1] - sample_times[0]
    else:  # one sample per chirp, at the chirp rate
        step = (starts[-1] - starts[0]) / (len(starts) - 1) if len(starts) > 1 else 1e-6
    return length, 1.0 / (length * step)


def _differences(frequency: NDArray[np.floating], delays: tuple[float, ...]) -> NDArray[np.complex128]:
    """``1 - exp(-j 2 pi f tau)``, (delay, frequency): range correlation of a delay."""
    angle = np.pi * np.multiply.outer(np.asarray(delays), frequency)
    # Without the cancellation of near delays.
    differences: NDArray[np.complex128] = 2j * np.sin(angle) * np.exp(-1j * angle)
    return differences
