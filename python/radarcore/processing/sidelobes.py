"""Largest amplitude that an echo adds to the cells around it: the envelope of the sidelobes of a window."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

_PER_CELL = 16
"""Points of the window's spectrum per cell."""


def envelope(window: bytes, distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest amplitude at this distance [cells] or farther, relative to that at the peak.

    Farther than half of the transform there is no other cell: that distance has the last value. The window is float64,
    as bytes, by which its envelope is kept for the next frame.
    """
    return _envelope(window).take((distance * _PER_CELL).astype(np.intp), mode="clip")


def envelope_at(window: bytes, distance: float) -> float:
    """`envelope` at a single distance, without arrays."""
    table = _listed(window)
    return table[min(int(distance * _PER_CELL), len(table) - 1)]


@lru_cache(maxsize=64)
def _listed(window: bytes) -> list[float]:
    return [float(amplitude) for amplitude in _envelope(window)]


@lru_cache(maxsize=64)
def _envelope(window: bytes) -> NDArray[np.float64]:
    weights = np.frombuffer(window)
    spectrum = np.abs(np.fft.rfft(weights, _PER_CELL * len(weights))) / weights.sum()
    return np.maximum.accumulate(spectrum[::-1])[::-1]
