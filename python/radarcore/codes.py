"""12-bit codes of the ADC: their two packings on the wire, their scale, and the chip's test pattern."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check

NUM_CODES = 4096
"""Codes of a 12-bit ADC: from 0 to 4095."""

FULL_SCALE_VOLT = 1.21
"""Voltage of a sample of 1 at the ADC's input [V]; -1 is as much below zero."""


def unpack_msb(data: bytes) -> NDArray[np.uint16]:
    """Codes in the order of the chip and of Strata: two in three bytes, most significant bit first.

    Parameters
    ----------
    data : bytes
        A multiple of three bytes; ``12 34 56`` (hex) holds 0x123 and 0x456.

    Returns
    -------
    codes : (num_samples,) uint16

    Raises
    ------
    ValueError
        For a number of bytes that is no multiple of three.
    """
    if len(data) % 3:
        raise ValueError(f"data: expected a multiple of 3 bytes, got {len(data)}")
    triples = np.frombuffer(data, np.uint8).reshape(-1, 3)
    middle = triples[:, 1]
    codes = np.empty((len(triples), 2), np.uint16)
    codes[:, 0] = triples[:, 0]
    codes[:, 0] <<= 4
    codes[:, 0] |= middle >> 4
    codes[:, 1] = middle & 0x0F
    codes[:, 1] <<= 8
    codes[:, 1] |= triples[:, 2]
    return codes.reshape(-1)


def pack_msb(codes: ArrayLike) -> bytes:
    """What `unpack_msb` reads.

    Parameters
    ----------
    codes : array_like of integers
        From 0 to 4095, an even number of them; any shape, taken in C order.

    Raises
    ------
    ValueError
        For an odd number of codes, or one that needs more than 12 bits.
    """
    values = _checked(codes).reshape(-1)
    if values.size % 2:
        raise ValueError(f"codes: expected an even number of them, got {values.size}")
    first, second = values[0::2], values[1::2]
    triples = np.empty((len(first), 3), np.uint8)
    triples[:, 0] = first >> 4
    triples[:, 1] = (first & 0x0F) << 4 | second >> 8
    triples[:, 2] = second & 0xFF
    return triples.tobytes()


def unpack_lsb(data: bytes, num_samples: int) -> NDArray[np.uint16]:
    """Codes in the order of ComLib: one stream of bits, least significant bit first.

    Parameters
    ----------
    data : bytes
        ``ceil(12 num_samples / 8)`` bytes; ``21 43 65`` (hex) holds 0x321 and 0x654. Bits after the last code are
        not looked at.
    num_samples : int
        Number of codes, odd ones allowed.

    Returns
    -------
    codes : (num_samples,) uint16

    Raises
    ------
    ValueError
        For another number of bytes.
    """
    count = check.count("num_samples", num_samples, 0)
    if len(data) != (3 * count + 1) // 2:
        raise ValueError(f"data: expected {(3 * count + 1) // 2} bytes for {count} samples, got {len(data)}")
    padded = data if count % 2 == 0 else bytes(data) + b"\0"
    triples = np.frombuffer(padded, np.uint8).reshape(-1, 3)
    middle = triples[:, 1]
    codes = np.empty((len(triples), 2), np.uint16)
    codes[:, 0] = middle & 0x0F
    codes[:, 0] <<= 8
    codes[:, 0] |= triples[:, 0]
    codes[:, 1] = triples[:, 2]
    codes[:, 1] <<= 4
    codes[:, 1] |= middle >> 4
    return codes.reshape(-1)[:count]


def pack_lsb(codes: ArrayLike) -> bytes:
    """What `unpack_lsb` reads; an odd number of codes ends with four zero bits.

    Parameters
    ----------
    codes : array_like of integers
        From 0 to 4095; any shape, taken in C order.

    Raises
    ------
    ValueError
        For a code that needs more than 12 bits.
    """
    values = _checked(codes).reshape(-1)
    padded = values if values.size % 2 == 0 else np.append(values, np.uint16(0))
    first, second = padded[0::2], padded[1::2]
    triples = np.empty((len(first), 3), np.uint8)
    triples[:, 0] = first & 0xFF
    triples[:, 1] = first >> 8 | (second & 0x0F) << 4
    triples[:, 2] = second >> 4
    return triples.tobytes()[: (3 * values.size + 1) // 2]


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
    samples: NDArray[np.float32] = np.multiply(_checked(codes), 2, dtype=np.float32)
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


def test_pattern(num_samples: int) -> NDArray[np.uint16]:
    """The first codes that the chip sends in place of its samples when its test pattern is on (SFCTL.LFSR_EN).

    Parameters
    ----------
    num_samples : int
        Number of codes.

    Returns
    -------
    codes : (num_samples,) uint16
        From 0x001 on; repeats after 4095.
    """
    return np.resize(_period(), check.count("num_samples", num_samples, 0))


test_pattern.__test__ = False  # type: ignore[attr-defined]  # or pytest takes it for a test where it is imported


@cache
def _period() -> NDArray[np.uint16]:
    """One period of the test pattern, (4095,)."""
    codes = np.empty(NUM_CODES - 1, np.uint16)
    state = 1
    for i in range(len(codes)):
        codes[i] = state
        feedback = (state ^ state >> 1 ^ state >> 2 ^ state >> 8) & 1
        state = state >> 1 | feedback << 11
    return codes


def _checked(codes: ArrayLike) -> NDArray[np.uint16]:
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
