"""Maximum-likelihood frequencies of a tone from the cells around its peak, and their Cramer-Rao bound."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core

REACH = 4
"""Cells used on each side of the peak. With Hann windows over both axes the standard deviation is 1.26 to 1.34 times
the bound for all samples (2 cells: 1.48 to 1.63; the peak of the map alone: 1.87). Echoes farther away are still
attenuated by the window's sidelobes."""

_FARTHEST = 4 * REACH
"""Cells from the middle of a tone to the farthest cell of a tone nearby."""

_DEGREE = 24
"""Degree of the polynomials; their error is pi^25 / 25! = 2e-13 for a peak one cell from the middle."""

_LEAST_VARIANCE = 1e-9
"""Noise variances below this, relative to a cell, belong to combinations of cells that the window makes zero."""


@dataclass(frozen=True, eq=False)
class Axes:
    """Shape of a tone in neighbouring cells of slow and of fast time, and the noise in them.

    Both have the same number of cells; the shorter axis is padded with zeros.

    Attributes
    ----------
    series : (axis, place, degree, 8 cell) float64
        Power series, by the distance from the middle cell [cells], of a tone of amplitude 1 and of its derivative.
        Both are given directly and as the conjugate of their product with the pseudo-inverse of the noise covariance
        (noise power 1 in a single cell): complex numbers (2, 2, cell). The patch has `place` cells before the middle.
    num_cells : (int, int)
        Rows and columns of a patch.
    lobes : (axis, degree, cell) complex128
        Power series of a tone of amplitude 1 in the cells up to 16 on each side of the middle cell.
    """

    series: NDArray[np.float64]
    num_cells: tuple[int, int]
    lobes: NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Fit:
    """Best-fitting tones.

    Attributes
    ----------
    offset : (tone, 2) float64
        From the middle cell along slow and fast time [cells].
    amplitude : (tone, channel) complex128
        In the unit of the samples.
    energy_gain : (tone,) float64
        Combined SNR of the cells for a tone of ``abs(amplitude)**2`` = 1 and noise of 1 per cell.
    information : (tone, 2) float64
        ``1 / (2 snr information)`` is the variance of the offset [cells^2]: the Cramer-Rao bound for these cells, with
        the combined SNR of the cells summed over channels. The two offsets are independent.
    """

    offset: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    energy_gain: NDArray[np.float64]
    information: NDArray[np.float64]


def axes_of(
    windows: tuple[NDArray[np.float64], NDArray[np.float64]],
    num_cells: tuple[int, int],
    *,
    is_conjugate: bool = False,
) -> Axes:
    """Axes from the windows over slow and fast time.

    Parameters
    ----------
    windows : (slow, fast) float64
    num_cells : (int, int)
        Rows and columns of a patch.
    is_conjugate : bool
        Fast time is transformed with the opposite sign.
    """
    most = max(num_cells)
    series = np.zeros((2, _DEGREE + 1, 2, 2 * most - 1), dtype=np.complex128)
    inverse = np.zeros((2, most, most), dtype=np.complex128)
    lobes = np.zeros((2, _DEGREE + 1, 2 * _FARTHEST + 1), dtype=np.complex128)
    for i, (weights, number) in enumerate(zip(windows, num_cells, strict=True)):
        n = np.arange(len(weights))
        waves = np.exp(-2j * np.pi * np.outer(np.arange(-_FARTHEST, _FARTHEST + 1), n) / len(n))
        turns = 2j * np.pi * (n - np.average(n, weights=weights)) / len(n)
        tone = np.stack([(waves * weights) @ turns**q / factorial(q) for q in range(_DEGREE + 2)])
        some = waves[_FARTHEST + 1 - number :][:number]  # the noise is the same in all cells
        covariance = (some * weights**2) @ some.conj().T / np.sum(weights**2)
        if is_conjugate and i == 1:
            tone, covariance = tone.conj(), covariance.conj()
        variances, parts = np.linalg.eigh(covariance)
        kept = variances > _LEAST_VARIANCE
        inverse[i, :number, :number] = (parts[:, kept] / variances[kept]) @ parts[:, kept].conj().T
        lobes[i] = tone[:-1]
        tone = tone[:, _FARTHEST + 1 - number : _FARTHEST + number]
        cells = slice(most - number, most + number - 1)
        series[i, :, 0, cells] = tone[:-1]
        if np.count_nonzero(kept) > 1:  # a single component has no frequency
            series[i, :, 1, cells] = tone[1:] * np.arange(1, _DEGREE + 2)[:, None]
    places = np.stack([series[..., most - 1 - k : 2 * most - 1 - k] for k in range(most)], axis=1)
    through = (places @ inverse[:, None, None].mT).conj()
    parts = np.stack([places, through], axis=3).reshape(2, most, _DEGREE + 1, -1)
    return Axes(parts.view(np.float64), num_cells, lobes)


def fit(
    cells: NDArray[Any],
    peaks: NDArray[np.intp],
    start: NDArray[np.float64],
    axes: Axes,
    *,
    is_cyclic: bool,
    has_images: bool = False,
) -> Fit:
    """Fit one tone to the cells around each peak.

    Tones beside stronger ones are refitted after subtraction of these: their lobes are in the same cells. Otherwise the
    weak echo of a person beside a wall gets the direction of the wall.

    Parameters
    ----------
    cells : (channel, row, column) complex64 or complex128
        Map of all channels; each channel has its own amplitudes.
    peaks : (tone, 2) int
        Rows and columns of the middle cells, the origin of offsets.
    start : (tone, 2) float64
        Initial offset.
    axes : Axes
    is_cyclic : bool
        Columns wrap around at the edges, as rows do; otherwise only cells inside of the edges are used.
    has_images : bool
        Tones are real. A real tone is a complex tone plus its conjugate, and their main lobes overlap near column 0:
        tones there are refitted after subtraction of the conjugates.
    """
    map_, middles = np.ascontiguousarray(cells), np.ascontiguousarray(peaks, dtype=np.int64)
    return Fit(
        *_core.fit_tones(
            map_,
            middles,
            np.ascontiguousarray(start),
            axes.series,
            axes.lobes,
            num_cells=axes.num_cells,
            is_cyclic=is_cyclic,
            has_images=has_images,
        )
    )
