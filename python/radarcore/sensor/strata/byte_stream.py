"""Parsers of Strata packets in a byte stream, for both ends, which resynchronise after damage."""

from __future__ import annotations

import re
import struct
from collections import deque
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import ClassVar, Generic, TypeVar

from radarcore.sensor.errors import ProtocolError
from radarcore.sensor.strata.packets import (
    MAX_DATA_PACKET,
    MAX_PACKET,
    DataPacket,
    Kind,
    Request,
    Response,
    Status,
    crc,
    decode_data,
)

Packet = TypeVar("Packet")


@dataclass(frozen=True)
class Damage:
    """Bytes that a parser discarded.

    Attributes
    ----------
    num_bytes : int
    reason : str
    status : int
        `Status` that tells the other side where the stream goes wrong; 0 where this only goes on from a damage
        that has been told.
    """

    num_bytes: int
    reason: str
    status: int = 0


class _Parser(Generic[Packet]):
    """Packets out of a byte stream that comes in pieces.

    In step, the packet that begins at the next byte is awaited. Out of step, every byte that may begin one is tried:
    the first packet that is whole and has a good CRC wins, whatever packets are still awaited before it, because what
    looks like a header may claim more bytes than ever come. So at most one largest packet is kept between calls.
    """

    _first_byte: ClassVar[re.Pattern[bytes]]
    _starts_in_step: ClassVar[bool]
    _largest: ClassVar[int] = MAX_PACKET

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._search_from = 0
        # Packets that are not yet whole, as places in the stream: (begin, end) as they come, (end, begin) as a heap.
        self._origin = 0
        self._awaited: deque[tuple[int, int]] = deque()
        self._awaited_by_end: list[tuple[int, int]] = []
        self._damage = Damage(0, "")
        self._is_in_step = False
        self.reset()

    def reset(self) -> None:
        """Forget all bytes."""
        self._drop(len(self._buffer))
        self._forget_awaited()
        self._is_in_step = self._starts_in_step
        self._damage = Damage(0, "bytes before the first whole packet", Status.REQUEST_TYPE_INVALID)

    @property
    def num_held(self) -> int:
        """Bytes of packets that are not yet whole."""
        return len(self._buffer)

    def doubt(self) -> list[Packet | Damage]:
        """Packets behind the one that is awaited in step, which takes longer than packets do: its length is damaged.

        It is still taken if it becomes whole before one behind it.
        """
        if self._is_in_step and self._buffer:
            self._is_in_step = False
            self._damage = Damage(0, "packet that never became whole", Status.PAYLOAD_INCOMPLETE)
            self._search_from = 0
        return self.feed(b"")

    def feed(self, data: bytes) -> list[Packet | Damage]:
        """Packets that these bytes complete, and damage, in order."""
        self._buffer += data
        found: list[Packet | Damage] = []
        begin = 0
        while begin < len(self._buffer):
            if self._is_in_step:
                size = self._size(begin) if self._first_byte.match(self._buffer, begin) else 1
                if size == 0 or (size <= self._largest and begin + size > len(self._buffer)):
                    break
                packet = self._packet(begin, size)
                if isinstance(packet, Damage):
                    self._is_in_step = False
                    self._damage = packet
                    self._search_from = begin + 1
                else:
                    found.append(packet)
                    begin += size
            else:
                match = self._search()
                kept = self._first_awaited() if match is None else match[1]
                if kept > begin:
                    found.append(Damage(kept - begin, self._damage.reason, self._damage.status))
                    self._damage = Damage(0, self._damage.reason)
                begin = kept
                if match is None:
                    break
                found.append(match[0])
                begin = match[2]
                self._is_in_step = True
                self._forget_awaited()
        self._drop(begin)
        return found

    def _search(self) -> tuple[Packet, int, int] | None:
        """First whole packet and its begin and end in the buffer."""
        # Packets that have become whole.
        whole = []
        while self._awaited_by_end and self._awaited_by_end[0][0] <= self._origin + len(self._buffer):
            whole.append(heappop(self._awaited_by_end)[1] - self._origin)
        for begin in sorted(whole):
            size = self._size(begin)
            packet = self._packet(begin, size)
            if not isinstance(packet, Damage):
                return packet, begin, begin + size
        # Packets that begin in bytes not yet looked at.
        while match := self._first_byte.search(self._buffer, self._search_from):
            begin = self._search_from = match.start()
            size = self._size(begin)
            if size == 0:
                return None
            self._search_from += 1
            if not self._may_begin(begin, size):
                continue
            if begin + size > len(self._buffer):
                begin += self._origin
                self._awaited.append((begin, begin + size))
                heappush(self._awaited_by_end, (begin + size, begin))
                continue
            packet = self._packet(begin, size)
            if not isinstance(packet, Damage):
                return packet, begin, begin + size
        self._search_from = len(self._buffer)
        return None

    def _first_awaited(self) -> int:
        """Place in the buffer before which no packet can begin any more."""
        while self._awaited and self._awaited[0][1] <= self._origin + len(self._buffer):
            self._awaited.popleft()
        return self._awaited[0][0] - self._origin if self._awaited else self._search_from

    def _forget_awaited(self) -> None:
        self._awaited.clear()
        self._awaited_by_end.clear()

    def _drop(self, num_bytes: int) -> None:
        del self._buffer[:num_bytes]
        self._origin += num_bytes
        self._search_from = max(0, self._search_from - num_bytes)

    def _packet(self, begin: int, size: int) -> Packet | Damage:
        """Packet at an index of the buffer, or its damage."""
        if not self._first_byte.match(self._buffer, begin):
            reason = f"byte 0x{self._buffer[begin]:02x} begins no packet"
            return Damage(0, reason, Status.REQUEST_TYPE_INVALID)
        if size > self._largest:
            return Damage(0, f"packet of {size} bytes", Status.PAYLOAD_TOO_LONG)
        packet = bytes(self._buffer[begin : begin + size])
        if crc(packet) != 0:
            return Damage(0, f"bad CRC of a packet of {size} bytes", Status.CRC_ERROR)
        try:
            return self._decode(packet[:-2])
        except ProtocolError as error:
            return Damage(0, str(error), Status.BAD_PAYLOAD)

    def _size(self, begin: int) -> int:
        """Bytes that a packet at a place of the buffer claims, with its CRC; 0: its header is not whole."""
        raise NotImplementedError

    def _may_begin(self, begin: int, size: int) -> bool:
        """True where a packet of this size may begin, out of step.

        Of large ones only data of this radar's channel, or of none: of all that looks like a header by chance, nearly
        all claims to be large.
        """
        return size <= MAX_PACKET or (size <= self._largest and self._buffer[begin + 1] in (0x00, 0xFF))

    def _decode(self, packet: bytes) -> Packet:
        """Packet from its bytes without the CRC, which was good."""
        raise NotImplementedError

    def _u16(self, place: int) -> int:
        """Number at a place of the buffer, or -1 where the buffer ends before."""
        return self._buffer[place] | self._buffer[place + 1] << 8 if place + 2 <= len(self._buffer) else -1


class HostParser(_Parser[Response | DataPacket]):
    """Responses and data packets out of the bytes from a board, cut anywhere (Strata, framing on serial).

    Bytes that belong to no good packet come back as `Damage`. It begins out of step, since a board may have been left
    measuring. Where a packet's length is damaged in step, it waits until the claimed bytes are there: `doubt` then,
    when they do not come, or `reset`.
    """

    _first_byte = re.compile(rb"[\x40\x43\xc0\xd0-\xdf]")
    _starts_in_step = False
    _largest = MAX_DATA_PACKET

    def _size(self, begin: int) -> int:
        is_data = self._buffer[begin] >= 0xD0
        length = self._u16(begin + 4 if is_data else begin + 2)
        return 0 if length < 0 else length + (8 if is_data else 6)

    def _decode(self, packet: bytes) -> Response | DataPacket:
        if packet[0] >= 0xD0:
            return decode_data(packet)
        return Response(Kind(packet[0]), packet[1], packet[4:])


class BoardParser(_Parser[Request]):
    """Requests out of the bytes from a host, cut anywhere; a `Damage` has the status to answer."""

    _first_byte = re.compile(rb"[\x40\x43\xc0]")
    _starts_in_step = True

    def _size(self, begin: int) -> int:
        length = self._u16(begin + 6)
        # A read has no payload: its length is that of the answer.
        return 0 if length < 0 else 10 if self._buffer[begin] == Kind.READ else 10 + length

    def _decode(self, packet: bytes) -> Request:
        kind, request, value, index, length = struct.unpack_from("<BBHHH", packet)
        return Request(Kind(kind), request, value, index, length, packet[8:])
