"""Frequencies of a tone from the cells about its peak: the estimate of maximum likelihood, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

REACH = 4
"""Cells on each side of the peak that are used. With Hann windows over both axes the standard deviation is then 1.26 to
1.34 times the least possible with all samples (2 cells: 1.48 to 1.63; the peak of the map alone: 1.87), while echoes
farther away still meet the sidelobes of the window."""

_DEGREE = 24
"""Degree of the polynomials: pi^25 / 25! = 2e-13, for a peak one cell away from the middle."""

_NUM_STEPS = 2
"""Steps of Fisher's scoring from the parabola, which is 0.02 cells off: each about squares the error, or divides it by
the ratio of the amplitudes of signal and noise. What is left is far below the noise up to 100 dB."""

_FARTHEST = 1.0
"""A fit that goes farther than this many cells from its start has lost the peak; the start is then kept."""

_LEAST_VARIANCE = 1e-9
"""Parts of the noise below this, relative to a cell, are combinations of cells that the window makes zero."""

_TINY = float(np.finfo(np.float64).tiny)
_BOTH = np.arange(2)[:, None]
"""Index of the axis."""
_EXPONENTS = np.arange(_DEGREE + 1.0)


@dataclass(frozen=True, eq=False)
class Axes:
    """Shape of a tone in neighbouring cells of slow and of fast time, and the noise in them.

    Both have the same number of cells; the shorter axis has zeros beyond its own.

    Attributes
    ----------
    series : (axis, place, degree, 8 cell) float64
        Power series, by the distance from the middle cell [cells], of a tone of amplitude 1 and of its derivative, both
        as they are and as the conjugate of their product with the pseudo-inverse of the covariance of the noise, whose
        power is 1 in a single cell: complex numbers (2, 2, cell). They are in the cells of a patch that has `place`
        cells before the middle one.
    """

    series: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fit:
    """Tones that fit the cells best.

    Attributes
    ----------
    offset : (tone, 2) float64
        From the middle cell along slow and fast time [cells].
    amplitude : (tone, channel) complex128
        Of every channel, in the unit of the samples.
    energy_gain : (tone,) float64
        Power over the noise of the cells together, for a tone of ``abs(amplitude)**2`` = 1 and noise of 1 per cell.
    information : (tone, 2) float64
        ``1 / (2 snr information)`` is the variance of the offset [cells^2], the Cramer-Rao bound for these cells, with
        the sum over channels of the SNR of the cells together; the two offsets do not depend on each other.
    """

    offset: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    energy_gain: NDArray[np.float64]
    information: NDArray[np.float64]


@lru_cache(maxsize=16)
def axes_of(windows: tuple[bytes, bytes], num_cells: tuple[int, int], *, is_conjugate: bool = False) -> Axes:
    """The axes of the transforms of windows over slow and fast time.

    Parameters
    ----------
    windows : (bytes, bytes)
        float64; as bytes, by which the axes are kept for the next frame.
    num_cells : (int, int)
        Rows and columns of a patch.
    is_conjugate : bool
        Fast time is transformed with the opposite sign.
    """
    most = max(num_cells)
    series = np.zeros((2, _DEGREE + 1, 2, 2 * most - 1), dtype=np.complex128)
    inverse = np.zeros((2, most, most), dtype=np.complex128)
    for i, (window, number) in enumerate(zip(windows, num_cells, strict=True)):
        weights = np.frombuffer(window)
        n = np.arange(len(weights))
        waves = np.exp(-2j * np.pi * np.outer(np.arange(1 - number, number), n) / len(n))
        turns = 2j * np.pi * (n - np.average(n, weights=weights)) / len(n)
        tone = np.stack([(waves * weights) @ turns**q / factorial(q) for q in range(_DEGREE + 2)])
        some = waves[:number]  # the noise is the same in all cells
        covariance = (some * weights**2) @ some.conj().T / np.sum(weights**2)
        if is_conjugate and i == 1:
            tone, covariance = tone.conj(), covariance.conj()
        variances, parts = np.linalg.eigh(covariance)
        kept = variances > _LEAST_VARIANCE
        inverse[i, :number, :number] = (parts[:, kept] / variances[kept]) @ parts[:, kept].conj().T
        cells = slice(most - number, most + number - 1)
        series[i, :, 0, cells] = tone[:-1]
        if np.count_nonzero(kept) > 1:  # a single part has no frequency
            series[i, :, 1, cells] = tone[1:] * np.arange(1, _DEGREE + 2)[:, None]
    places = np.stack([series[..., most - 1 - k : 2 * most - 1 - k] for k in range(most)], axis=1)
    through = (places @ inverse[:, None, None].mT).conj()
    return Axes(np.stack([places, through], axis=3).reshape(2, most, _DEGREE + 1, -1).view(np.float64))


def fit(cells: NDArray[Any], first: NDArray[np.intp], start: NDArray[np.float64], axes: Axes) -> Fit:
    """Fit one tone to each patch of cells.

    With noise of covariance C along an axis, ``t^H C^-1 x`` is what cells x have of a tone t: all that is needed is
    products of this kind, of the tone and of its derivatives.

    Parameters
    ----------
    cells : (tone, channel, row, column) complex
        Cells of all channels about every peak, with amplitudes of their own.
    first : (tone, 2) int
        First row and column of each patch, relative to the middle cell that offsets count from.
    start : (tone, 2) float64
        Offset to start from.
    axes : Axes
    """
    number, num_channels, num_rows, num_columns = cells.shape
    by_row = cells.swapaxes(1, 2).astype(np.complex128, order="C").reshape(number, num_rows, -1)
    series = axes.series[_BOTH, -first.T]  # (axis, tone, degree, 8 cell)
    offset = start.copy()
    for _ in range(_NUM_STEPS):
        # Tone and derivative in the cells, both through the inverse; their products with each other and the cells.
        values = (offset.T[:, :, None, None] ** _EXPONENTS @ series).view(np.complex128)
        values = values.reshape(2, number, 2, 2, -1)
        pair, through = values[:, :, 0], values[:, :, 1]  # (axis, tone, 2, cell)
        products = pair @ through.mT  # (axis, tone, 2, 2)
        in_columns = through[0, :, :, :num_rows] @ by_row  # (tone, 2, channel, column), the last two in one
        found = in_columns.reshape(number, -1, num_columns) @ through[1, :, :, :num_columns].mT
        found = found.reshape(number, 2, num_channels, 2).mT  # (tone, 2, 2, channel): of rows, of columns

        # What of the derivatives is across the tone: a change of phase is none of frequency.
        along = products / products[..., :1, :1]
        across = (along[..., 1, 1] - along[..., 1, 0] * along[..., 0, 1]).real.T
        # Fisher's scoring.
        energies = np.vecdot(found[:, :1, :1], found).real.reshape(number, 4)
        slope = energies[:, 2:0:-1] / np.maximum(energies[:, :1], _TINY) - along[..., 1, 0].real.T
        step = slope / np.maximum(across, _TINY)
        offset += np.minimum(np.maximum(step, -0.5), 0.5)
    lost = np.abs(offset - start) > _FARTHEST
    if lost.any():
        offset = np.where(lost.any(axis=1, keepdims=True), start, offset)
    # The last step is too small to change the amplitude, whose slope is zero at the peak.
    gain = np.multiply(*products[:, :, 0, 0].real)
    return Fit(offset, found[:, 0, 0] / gain[:, None], gain, across)
