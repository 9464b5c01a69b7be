"""Tones fitted by the core against the same fit in plain arrays; cells that the core refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tone_reference as reference
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
@pytest.mark.parametrize(
    ("dtype", "shape"), [(np.complex64, (3, 32, 40)), (np.complex128, (1, 32, 5)), (np.complex64, (2, 6, 1))]
)
def test_tones_about_peaks(shape: tuple[int, int, int], dtype: Any, is_cyclic: bool) -> None:
    """Echoes in noise, at the edges too, of maps that are smaller than a patch along one axis or both."""
    rng = np.random.default_rng(3)
    num_cells = min(2 * REACH + 1, shape[1]), min(2 * REACH + 1, shape[2])
    windows = [window_weights("window", "hann", length) if length > 1 else np.ones(1) for length in shape[1:]]
    axes = axes_of((windows[0], windows[1]), num_cells)
    cells = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(dtype)
    peaks = np.stack([rng.integers(length, size=12) for length in shape[1:]], axis=1)
    peaks[:2] = [[0, 0], [shape[1] - 1, shape[2] - 1]]
    for row, column in peaks:
        cells[:, row, column] += 30.0
    start = rng.uniform(-0.4, 0.4, (12, 2))
    found = fit(cells, peaks, start, axes, is_cyclic=is_cyclic)
    expected = reference.fit_tones(cells, peaks, start, axes, is_cyclic=is_cyclic)
    for name in ("offset", "amplitude", "energy_gain", "information"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-9, atol=1e-9, err_msg=name)


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
        _core.fit_tones(cells, outside, start, series, num_cells=(5, 3), is_cyclic=True)
    with pytest.raises(ValueError, match=r"series: expected shape \(2, 3, n, 24\), got \(2, 3, 2, 23\)"):
        _core.fit_tones(cells, outside, start, series[..., 1:].copy(), num_cells=(3, 3), is_cyclic=True)
