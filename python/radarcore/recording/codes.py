"""Scale of the ADC's 12-bit codes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.radar.radar import Radar

NUM_CODES = 4096
"""Codes of a 12-bit ADC: from 0 to 4095."""

FULL_SCALE_VOLT = 1.21
"""Voltage of a sample of 1 at the ADC's input [V]; -1 is as much below zero."""


def to_samples(codes: ArrayLike) -> NDArray[np.float32]:
    """Samples from -1 to 1: ``2 code / 4095 - 1``, every step in float32 (Strata, scaling).

    Parameters
    ----------
    codes : array_like of integers
        From 0 to 4095.

    Returns
    -------
    samples : float32, the shape of `codes`
        Parts of the ADC's full scale, `FULL_SCALE_VOLT`.
    """
    samples: NDArray[np.float32] = np.multiply(checked_codes(codes), 2, dtype=np.float32)
    samples /= np.float32(NUM_CODES - 1)
    samples -= np.float32(1.0)
    return samples


def to_codes(samples: ArrayLike) -> NDArray[np.uint16]:
    """Codes nearest to samples; gives back the codes that `to_samples` had.

    Parameters
    ----------
    samples : array_like of real numbers
        Parts of full scale; below -1 and above 1 the ADC clips.

    Returns
    -------
    codes : uint16, the shape of `samples`

    Raises
    ------
    ValueError
        For NaN.
    """
    given = np.asarray(samples)
    if given.dtype.kind not in "fiu":
        raise TypeError(f"samples: expected real numbers, got {given.dtype}")
    values = given.astype(np.float64)
    if np.isnan(values).any():
        raise ValueError("samples: expected numbers, got NaN")
    half = (NUM_CODES - 1) / 2.0
    np.clip(values, -1.0, 1.0, out=values)
    values += 1.0
    values *= half
    codes: NDArray[np.uint16] = np.rint(values).astype(np.uint16)
    return codes


def adc_codes(samples: NDArray[np.floating], radar: Radar) -> NDArray[np.uint16] | None:
    """Codes of samples as a radar's receiver delivered them; None if they are not codes of 12 bits."""
    receiver = radar.receiver
    return to_codes(samples) if receiver is not None and receiver.has_codes else None


def checked_codes(codes: ArrayLike) -> NDArray[np.uint16]:
    """The codes as uint16, none above 4095."""
    values = np.asarray(codes)
    if values.size == 0:
        return np.empty(values.shape, np.uint16)
    if values.dtype.kind not in "iu":
        raise TypeError(f"codes: expected integers, got {values.dtype}")
    low, high = int(values.min()), int(values.max())
    if low < 0 or high >= NUM_CODES:
        raise ValueError(f"codes: expected 0 to {NUM_CODES - 1}, got {low if low < 0 else high}")
    return values.astype(np.uint16, copy=False)
