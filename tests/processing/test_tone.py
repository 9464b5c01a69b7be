"""Tones fitted by the core are where they were put; cells that the core refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from radarcore import _core
from radarcore.processing.detection.tone import REACH, axes_of, fit
from radarcore.processing.spectra.windows import window_weights


def power(shape: tuple[int, int]) -> NDArray[np.float64]:
    """Noise, in steps, so that neighbours may be equal; some cells have none."""
    drawn = np.random.default_rng(1).exponential(size=shape)
    return np.floor(8.0 * drawn)


def all_cells(shape: tuple[int, int]) -> NDArray[np.int64]:
    return np.ascontiguousarray(np.indices(shape).reshape(2, -1).T, dtype=np.int64)


@pytest.mark.parametrize("is_cyclic", [True, False])
@pytest.mark.parametrize("place", [(0.1, 0.1), (0.96, 0.98), (0.51, 0.49)])
@pytest.mark.parametrize(
    ("dtype", "shape"), [(np.complex64, (3, 32, 40)), (np.complex128, (1, 32, 5)), (np.complex64, (2, 6, 1))]
)
def test_tones_are_found_between_cells(
    shape: tuple[int, int, int], dtype: Any, place: tuple[float, float], is_cyclic: bool
) -> None:
    """At the edges too, of maps that are smaller than a patch along one axis or both; real samples have no wrap."""
    num_channels, num_rows, num_samples = shape
    num_columns = num_samples if is_cyclic else num_samples // 2 + 1
    windows = [window_weights("window", "hann", length) if length > 1 else np.ones(1) for length in shape[1:]]
    num_cells = min(2 * REACH + 1, num_rows), min(2 * REACH + 1, num_columns)
    axes = axes_of((windows[0], windows[1]), num_cells)
    tone = np.array([num_rows, num_columns]) * place * (np.array(shape[1:]) > 1)
    amplitude = np.random.default_rng(3).standard_normal((num_channels, 2)).view(np.complex128)[:, 0]
    rows, columns = (
        np.fft.fft(np.exp(2j * np.pi * f * np.arange(len(w)) / len(w)) * w) for f, w in zip(tone, windows, strict=True)
    )
    cells = np.multiply.outer(amplitude, np.outer(rows, columns[:num_columns])).astype(dtype)
    peak = np.minimum(np.rint(tone), [num_rows - 1, num_columns - 1]).astype(np.int64)
    start = tone - peak + 0.05 * (np.array(shape[1:]) > 1)
    found = fit(cells, peak[None], start[None], axes, is_cyclic=is_cyclic)
    np.testing.assert_allclose(found.offset[0], tone - peak, atol=1e-5)
    np.testing.assert_allclose(np.abs(found.amplitude[0]), np.abs(amplitude), rtol=5e-3)


def test_cells_outside_of_a_map_are_refused() -> None:
    map_ = power((4, 5))
    outside = np.array([[1, 5]])
    with pytest.raises(ValueError, match=r"cells: expected cells of a map of shape \(4, 5\), got \[1, 5\]"):
        _core.local_maxima(map_, outside, is_cyclic=True)
    with pytest.raises(ValueError, match=r"cells: expected cells of a map of shape \(4, 5\), got \[-1, 0\]"):
        _core.training_medians(map_, np.array([[-1, 0]]), guards=(1, 1), trainings=(1, 1))
    with pytest.raises(TypeError, match="power: expected a C-contiguous array"):
        _core.between_cells(map_.T, all_cells((2, 2)), is_cyclic=True)
    series = np.zeros((2, 3, 2, 24))
    cells, start = map_[None].astype(np.complex64), np.zeros((1, 2))
    with pytest.raises(ValueError, match=r"num_cells: expected 1 to 4 and 1 to 5, got \[5, 3\]"):
        _core.fit_tones(cells, outside, start, series, None, num_cells=(5, 3), is_cyclic=True)
    with pytest.raises(ValueError, match=r"series: expected shape \(2, 3, n, 24\), got \(2, 3, 2, 23\)"):
        _core.fit_tones(cells, outside, start, series[..., 1:].copy(), None, num_cells=(3, 3), is_cyclic=True)
