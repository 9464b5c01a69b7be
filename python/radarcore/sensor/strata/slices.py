"""Slices of samples from Strata data packets, losses between them, and the codes in their bytes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.recording.frame import checked_codes
from radarcore.sensor.strata.packets import DataPacket


@dataclass(frozen=True)
class Slice:
    """Samples that the board read from its radar in one go.

    Attributes
    ----------
    data : bytes
    timestamp : int or None
        Time since the board started [us].
    first_counter, num_packets : int
        Counter of its first packet, and how many it came in.
    """

    data: bytes
    timestamp: int | None
    first_counter: int
    num_packets: int


@dataclass(frozen=True)
class SliceLost:
    """Packets of slices that are missing or were thrown away.

    Attributes
    ----------
    reason : str
    num_packets : int
        Number of packets; 0 after a counter that went back, which is no measure.
    """

    reason: str
    num_packets: int


@dataclass(frozen=True)
class StreamError:
    """The board ended its stream with an error: a code (see `STATUS_NAMES`) or a text."""

    error: int | str


class SliceAssembler:
    """Assembler of slices from data packets, with losses between them (Strata, receiver rules).

    Parameters
    ----------
    max_size : int
        Largest slice [bytes]; a packet that exceeds it is discarded with its slice.
    """

    def __init__(self, max_size: int) -> None:
        self._max_size = check.count("max_size", max_size)
        self._counter: int | None = None
        self._parts: list[DataPacket] = []
        self._size = 0

    def feed(self, packet: DataPacket) -> list[Slice | SliceLost | StreamError]:
        """Slices, losses and errors that this packet completes, in order."""
        found: list[Slice | SliceLost | StreamError] = []

        # Compare its number with the last one.
        if self._counter is not None and packet.counter != (expected := (self._counter + 1) % 0x10000):
            gap = (packet.counter - expected) % 0x10000
            came = f"expected packet {expected}, got {packet.counter}"
            self._throw_away(found, f"incomplete slice: {came}")
            found.append(SliceLost(came, gap if gap < 0x8000 else 0))
        self._counter = packet.counter

        # An error ends the stream; a first packet begins a slice; any other belongs to one.
        if packet.error is not None:
            self._throw_away(found, "incomplete slice before an error")
            found.append(StreamError(packet.error))
            return found
        if packet.is_first:
            self._throw_away(found, "incomplete slice before the next one")
        elif not self._parts:
            found.append(SliceLost("packet of a slice whose first packet is missing", 1))
            return found
        elif packet.channel != self._parts[0].channel:
            found.append(SliceLost(f"packet of channel {packet.channel} in a slice of {self._parts[0].channel}", 1))
            return found
        self._parts.append(packet)
        self._size += len(packet.payload)

        # A slice ends with its last packet, or when it is too large.
        if self._size > self._max_size:
            self._throw_away(found, f"slice of more than {self._max_size} bytes")
        elif packet.is_last:
            parts = self._take()
            data = b"".join(part.payload for part in parts)
            found.append(Slice(data, packet.timestamp, parts[0].counter, len(parts)))
        return found

    def _take(self) -> list[DataPacket]:
        parts, self._parts, self._size = self._parts, [], 0
        return parts

    def _throw_away(self, found: list[Slice | SliceLost | StreamError], reason: str) -> None:
        if self._parts:
            found.append(SliceLost(reason, len(self._take())))


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
    first, middle, last = np.frombuffer(data, np.uint8).reshape(-1, 3).T.astype(np.uint16)
    return np.stack([first << 4 | middle >> 4, (middle & 0x0F) << 8 | last], axis=1).reshape(-1)


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
    triples = np.stack([first >> 4, (first & 0x0F) << 4 | second >> 8, second & 0xFF], axis=1)
    return triples.astype(np.uint8).tobytes()
