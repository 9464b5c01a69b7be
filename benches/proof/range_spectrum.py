"""Transfer functions from distances and weights: a histogram of distances and one transform."""

from __future__ import annotations

import numpy as np

import radarcore as rc
from proof.measure import SPEED_OF_LIGHT, Phasors, Reals

CELLS = 2**20
"""Of the histogram of distances: 10 μm wide, where weights split between two neighbours are off by 1e-4."""


def range_cell(waveform: rc.Waveform) -> float:
    """Width of a cell [m]: the histogram is as long as the ranges that the frequencies tell apart."""
    step = waveform.slope / waveform.sample_rate
    return SPEED_OF_LIGHT / (2.0 * step * CELLS)


def add(histogram: Reals, waveform: rc.Waveform, distance: Reals, weight: Reals) -> None:
    """Add weights at distances [m], each split between two cells."""
    if distance.size == 0:
        return
    place, part = np.divmod(distance / range_cell(waveform), 1.0)
    first = place.astype(np.int64)
    for cells, shares in ((first, weight * (1.0 - part)), (first + 1, weight * part)):
        start = cells.min()
        counts = np.bincount(cells - start, shares)
        histogram[start : start + len(counts)] += counts


def spectrum(histogram: Reals, waveform: rc.Waveform) -> Phasors:
    """(j / 4 pi) sum of weights times exp(-2jkR) at the frequencies of the sweep: one transform."""
    start = 2.0 * np.pi * waveform.start_frequency / SPEED_OF_LIGHT
    used = np.flatnonzero(histogram)
    first, last = (used[0], used[-1]) if used.size else (0, 0)
    turned = np.zeros(last - first + 1, dtype=complex)
    turned[used - first] = histogram[used] * np.exp(-2j * start * range_cell(waveform) * used)
    shift = np.exp(-2j * np.pi / CELLS * first * np.arange(waveform.num_samples))
    return 1j / (4.0 * np.pi) * shift * lines(turned, waveform.num_samples)


def lines(values: Phasors, number: int) -> Phasors:
    """The first lines of a transform of `CELLS` values, of which those that are not given are 0.

    A transform that is nearly all zeros is a convolution with a chirp (Bluestein), as long as what is not.
    """
    if len(values) > CELLS // 8:
        transformed: Phasors = np.fft.fft(values, CELLS)[:number]
        return transformed
    chirp = np.exp(1j * np.pi / CELLS * (np.arange(max(len(values), number)) ** 2 % (2 * CELLS)))
    kernel = np.zeros(1 << (len(values) + number - 2).bit_length(), dtype=complex)
    kernel[:number] = chirp[:number]
    kernel[len(kernel) - len(values) + 1 :] = chirp[1 : len(values)][::-1]
    turned = np.fft.fft(values * chirp[: len(values)].conj(), len(kernel))
    found: Phasors = np.fft.ifft(turned * np.fft.fft(kernel))[:number] * chirp[:number].conj()
    return found
