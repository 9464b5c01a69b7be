"""12-bit codes on the wire: their two packings, and the chip's test pattern."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.recording.frame import NUM_CODES, checked_codes


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
    """Pack codes for `unpack_msb`.

    Parameters
    ----------
    codes : array_like of integers
        From 0 to 4095, an even number of them; any shape, taken in C order.

    Raises
    ------
    ValueError
        For an odd number of codes, or one that needs more than 12 bits.
    """
    values = checked_codes(codes).reshape(-1)
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
    """Pack codes for `unpack_lsb`; an odd number of codes ends with four zero bits.

    Parameters
    ----------
    codes : array_like of integers
        From 0 to 4095; any shape, taken in C order.

    Raises
    ------
    ValueError
        For a code that needs more than 12 bits.
    """
    values = checked_codes(codes).reshape(-1)
    padded = values if values.size % 2 == 0 else np.append(values, np.uint16(0))
    first, second = padded[0::2], padded[1::2]
    triples = np.empty((len(first), 3), np.uint8)
    triples[:, 0] = first & 0xFF
    triples[:, 1] = first >> 8 | (second & 0x0F) << 4
    triples[:, 2] = second >> 4
    return triples.tobytes()[: (3 * values.size + 1) // 2]


def test_pattern(num_samples: int, first: int = 0) -> NDArray[np.uint16]:  # noqa: PT028  # not a test
    """Codes that the chip sends in place of its samples when its test pattern is on (SFCTL.LFSR_EN).

    Parameters
    ----------
    num_samples : int
        Number of codes.
    first : int
        Number of the first of them; code 0 is 0x001.

    Returns
    -------
    codes : (num_samples,) uint16
        Repeats after 4095.
    """
    begin = check.count("first", first, 0) % len(_period())
    return np.resize(_period(), begin + check.count("num_samples", num_samples, 0))[begin:]


test_pattern.__test__ = False  # type: ignore[attr-defined]  # or pytest takes it for a test where it is imported


@cache
def _period() -> NDArray[np.uint16]:
    """Period of the test pattern, (4095,)."""
    codes = np.empty(NUM_CODES - 1, np.uint16)
    state = 1
    for i in range(len(codes)):
        codes[i] = state
        feedback = (state ^ state >> 1 ^ state >> 2 ^ state >> 8) & 1
        state = state >> 1 | feedback << 11
    return codes
