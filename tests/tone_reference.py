"""Fit of a tone to the cells about its peak in plain arrays: the oracle of the core."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.detection.tone import Axes, Fit

_NUM_STEPS = 2
"""Steps of Fisher's scoring from the parabola, which is 0.02 cells off: each about squares the error, or divides it by
the ratio of the amplitudes of signal and noise. What is left is far below the noise up to 100 dB."""

_FARTHEST = 1.0
"""A fit that goes farther than this many cells from its start has lost the peak; the start is then kept."""

_TINY = float(np.finfo(np.float64).tiny)
_BOTH = np.arange(2)[:, None]
"""Index of the axis."""


def fit_tones(
    cells: NDArray[Any], peaks: NDArray[np.int64], start: NDArray[np.float64], axes: Axes, *, is_cyclic: bool
) -> Fit:
    """The tones of the cells about some peaks."""
    num_rows, num_columns = axes.num_cells
    rows, columns = peaks.T
    top, left = rows - num_rows // 2, columns - num_columns // 2
    if not is_cyclic:  # real samples have no columns beyond the edges
        left = np.clip(left, 0, cells.shape[2] - num_columns)
    row = (top[:, None] + np.arange(num_rows)) % cells.shape[1]
    column = (left[:, None] + np.arange(num_columns)) % cells.shape[2]
    patches = cells[:, row[:, :, None], column[:, None]].swapaxes(0, 1)
    return fit_patches(patches, np.array([top - rows, left - columns]).T, start, axes)


def fit_patches(cells: NDArray[Any], first: NDArray[np.int64], start: NDArray[np.float64], axes: Axes) -> Fit:
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
        values = (offset.T[:, :, None, None] ** np.arange(series.shape[2]) @ series).view(np.complex128)
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
