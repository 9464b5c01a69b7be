"""Transfer functions from distances and weights: a histogram of distances and one transform."""

from __future__ import annotations

import numpy as np

import radarcore as rc
from proof.measure import SPEED_OF_LIGHT, Phasors, Reals

CELLS = 2**20
"""Of the histogram of distances: 10 μm wide, where weights split between two neighbours are off by 1e-4."""


def range_cell(waveform: rc.Waveform) -> float:
    """Width of a cell [m]: the histogram covers the unambiguous range of the frequencies."""
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
    turned, used = np.zeros(CELLS, dtype=complex), np.flatnonzero(histogram)
    turned[used] = histogram[used] * np.exp(-2j * start * range_cell(waveform) * used)
    transformed: Phasors = np.fft.fft(turned)[: waveform.num_samples]
    return 1j / (4.0 * np.pi) * transformed
