"""Slices of samples from Strata data packets, and losses between them."""

from __future__ import annotations

from dataclasses import dataclass

from radarcore import check
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
    """The board ended its stream with an error: a code (see `STATUS_NAMES`) or a text; `timestamp` [us]."""

    error: int | str
    timestamp: int | None = None


class SliceAssembler:
    """Assembler of slices from data packets, with losses between them (Strata, receiver rules).

    Parameters
    ----------
    max_size : int
        Largest slice [bytes]; packets beyond it are thrown away with what they belong to.
    """

    def __init__(self, max_size: int) -> None:
        self._max_size = check.count("max_size", max_size)
        self._counter: int | None = None
        self._parts: list[DataPacket] = []
        self._size = 0

    def reset(self) -> None:
        """Begin anew: the next packet may have any counter."""
        self._counter = None
        self._take()

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
            found.append(StreamError(packet.error, packet.timestamp))
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
