"""Windows over fast and slow time."""

from __future__ import annotations

import warnings
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check

Window = str | tuple[Any, ...] | None
"""A window as `scipy.signal.get_window` names it, such as ``"hann"`` or ``("kaiser", 8.0)``; None: no window."""

_EXPECTED = "expected a window of scipy.signal.get_window or None"

_COSINES = {"boxcar": (1.0,), "hann": (0.5, 0.5), "hamming": (0.54, 1.0 - 0.54), "blackman": (0.42, 0.5, 0.08)}
"""Cosine weights of common windows. SciPy has these windows too, but its import takes a second."""


def window_weights(name: str, window: Window, length: int) -> NDArray[np.float64]:
    """Periodic window, (length,), read-only."""
    return _weights(name, hashable(name, window), length, periodic=True)


def centred_window(name: str, window: Window, length: int) -> NDArray[np.float64]:
    """Periodic window shifted by half a sample, (length,), read-only: symmetric about the middle of its samples.

    An accelerating target then has its velocity at the middle of the frame instead of half a chirp later. A window of
    two samples uses only one, as a periodic window does: two samples determine no frequency.
    """
    return _centred(name, hashable(name, window), length)


@lru_cache(maxsize=64)
def _centred(name: str, window: Window, length: int) -> NDArray[np.float64]:
    """`centred_window`, cached because all frames of a stream share it."""
    if window is None or length < 3:
        return window_weights(name, window, length)
    if isinstance(window, str) and window in _COSINES:
        return check.frozen(_sum_of_cosines(_COSINES[window], 2 * length + 1)[1::2])
    longer = _weights(name, window, length + 1, periodic=False)
    return check.frozen(0.5 * (longer[1:] + longer[:-1]))


def symmetric_window(name: str, window: Window, length: int) -> NDArray[np.float64]:
    """Symmetric window, as over the elements of an array, (length,)."""
    with warnings.catch_warnings():
        # SciPy's warning about high side lobes is for spectra; arrays of few elements accept them for narrow beams.
        warnings.filterwarnings("ignore", message="This window is not suitable for spectral analysis")
        return _weights(name, hashable(name, window), length, periodic=False)


@lru_cache(maxsize=64)
def _weights(name: str, window: Window, length: int, *, periodic: bool) -> NDArray[np.float64]:
    """Window, cached because all frames of a stream share it."""
    if window is None:
        return check.frozen(np.ones(length))
    if isinstance(window, str) and window in _COSINES and length > 0:
        if length == 1:
            return check.frozen(np.ones(1))  # as SciPy has it, whatever the window
        return check.frozen(_sum_of_cosines(_COSINES[window], length + periodic)[:length])
    from scipy.signal import get_window  # here: importing radarcore imports numpy and nothing heavier

    try:
        weights = np.asarray(get_window(window, length, fftbins=periodic), dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name}: {_EXPECTED}, got {window!r} ({error})") from None
    return check.frozen(weights)


def _sum_of_cosines(weights: tuple[float, ...], length: int) -> NDArray[np.float64]:
    """Symmetric window, formed as SciPy does, to the last bit."""
    angles = np.linspace(-np.pi, np.pi, length)
    total = np.zeros(length)
    for order, weight in enumerate(weights):
        total += weight * np.cos(order * angles)
    return total


def window_centre(weights: NDArray[np.float64]) -> float:
    """Index about which a window is symmetric (the middle of a periodic one lies half a step late)."""
    return float(weights @ np.arange(len(weights)) / weights.sum())


def independent_share(weights: NDArray[np.float64]) -> float:
    """Effective number of independent cells over the number of cells (Hann: 0.51).

    Noise in neighbouring cells of a windowed transform is correlated (Hann: -2/3 and 1/6 in amplitude). The effective
    number gives the mean of the cells the same variance: the number of cells over the sum of the squared correlations,
    by Parseval's theorem.
    """
    squares = np.square(weights)
    return float(np.square(squares.sum()) / np.square(squares).sum() / len(weights))


def hashable(name: str, window: Window) -> Window:
    """Window with tuples in place of lists and arrays, so that it can be a cache key."""
    if not (window is None or isinstance(window, str | tuple)):
        raise TypeError(f"{name}: {_EXPECTED}, got {window!r}")
    if not isinstance(window, tuple):
        return window
    return tuple(tuple(part) if isinstance(part, list | np.ndarray) else part for part in window)
