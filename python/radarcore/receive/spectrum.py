"""Stationary noise of a given spectrum, drawn in the frequency domain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def even_length(least: int) -> int:
    """Smallest even number from `least` on without prime factors above 5: a fast length of transforms."""
    number = max(2, least + least % 2)
    while True:
        rest = number
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return number
        number += 2


def real_noise(normal: NDArray[np.float32], root: NDArray[np.float32], num_samples: int) -> NDArray[np.float32]:
    """Real noise (..., sample) with the variance ``root[k]**2`` in the k-th of the equal bands from 0 to half the rate.

    Parameters
    ----------
    normal : (..., 2 (n // 2 + 1)) float32
        Standard normal numbers.
    root : (n // 2 + 1,) float32
        Deviation of the part at ``k / n`` of the sample rate, ``n`` even.
    num_samples : int
        Samples that are kept. Noise repeats itself after n of them: those lost should be more than it remembers.
    """
    length = 2 * (len(root) - 1)
    spectrum = normal.view(np.complex64) * (0.5 * length * root)
    # Both ends have one real number each, of the whole variance.
    spectrum[..., [0, -1]] = 2.0 * spectrum[..., [0, -1]].real
    return np.asarray(np.fft.irfft(spectrum, length, axis=-1)[..., :num_samples], np.float32)


def complex_noise(normal: NDArray[np.float32], root: NDArray[np.float32], num_samples: int) -> NDArray[np.complex64]:
    """Circular noise (..., sample) of the variance ``root[k]**2`` in either of the real parts, in n bands of the rate.

    `normal` is (..., 2 n), `root` (n,) in the order of `numpy.fft.fftfreq`; otherwise as `real_noise`.
    """
    spectrum = normal.view(np.complex64) * (len(root) * root)
    return np.asarray(np.fft.ifft(spectrum, axis=-1)[..., :num_samples], np.complex64)
