"""Strata over a port: packets out of a byte stream, requests with their answers, and data packets."""

from __future__ import annotations

import re
import struct
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from time import monotonic
from typing import ClassVar, Generic, Protocol, TypeVar

from radarcore.sensor.errors import ProtocolError, RequestError, SensorDisconnectedError, SensorTimeoutError
from radarcore.sensor.interface import Damage
from radarcore.sensor.strata.packets import (
    MAX_CONTROL_PAYLOAD,
    MAX_DATA_PACKET,
    MAX_PACKET,
    Code,
    DataPacket,
    Info,
    Kind,
    Request,
    Response,
    Status,
    crc,
    decode_data,
    encode_request,
    status_text,
)
from radarcore.sensor.transport.stream import Stalled, Stream
from radarcore.sensor.transport.usbport import UsbVendorPort

Packet = TypeVar("Packet")

REQUEST_TIMEOUT = 1.0
"""Time-out of the first answer to a request [s], as the vendor's own host has it."""

RETRIES = 2
"""Requests are made again: where an answer is damaged, that costs less than a measurement."""

DAMAGED = range(Status.HEADER_INCOMPLETE, Status.REQUEST_TYPE_INVALID + 1)
"""Status of requests that were damaged on their way."""

_SILENT_TIMEOUT = 0.3
"""Time-out of the only request to a board that has not answered at all, until something comes from it [s]."""

_LATE = 0.1
"""Longest wait for the answer to a request that was given up, lest it be taken for the next request's answer [s]."""

_READ_SIZE = 512 * 31
_SLOWEST_PACKET = 0.25
"""Bytes of a data packet come one after the other. A packet that takes longer [s] has a damaged length."""

_DISCARD_TIME = 2.0
"""Longest time of discarding packets [s]."""

_STREAM_QUIET = 0.02
"""Silence that ends it on a stream [s]: all that was sent before an answer arrives before it."""

_VENDOR_QUIET = 0.1
"""Silence that ends it on vendor USB [s]: packets have an endpoint of their own, which may be behind the answers."""

_MOST_PACKETS = 4096
"""Packets kept while a request waits for its answer: several seconds of any frames."""


@dataclass
class DamageCount:
    """Damage since the last good frame or answer.

    Attributes
    ----------
    num_places : int
        How often the stream went wrong.
    num_bytes : int
        Discarded bytes.
    num_lost : int
        Packets that are missing, or were discarded with an incomplete slice.
    reason : str
        Reason of the last damage.
    """

    num_places: int = 0
    num_bytes: int = 0
    num_lost: int = 0
    reason: str = ""

    def add(self, damage: Damage) -> None:
        """Count discarded bytes."""
        self.num_places += damage.status != 0
        self.num_bytes += damage.num_bytes
        self.reason = damage.reason

    def text(self, num_held: int = 0) -> str:
        """Text such as "12 bytes dropped at 1 place (bad CRC of a packet of 12 bytes), 3 packets lost".

        `num_held` are bytes of incomplete packets. Empty without damage.
        """
        parts = []
        if self.num_bytes:
            places = _number(max(self.num_places, 1), "place")
            parts.append(f"{_number(self.num_bytes, 'byte')} dropped at {places} ({self.reason})")
        if self.num_lost:
            parts.append(f"{_number(self.num_lost, 'packet')} lost")
        if num_held:
            parts.append(f"{_number(num_held, 'byte')} of a packet that is not whole")
        return ", ".join(parts)


def _number(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"


class _Parser(Generic[Packet]):
    """Packets out of a byte stream that comes in pieces.

    In step, a packet begins at the next byte. After damage, the first whole packet with a good CRC is searched for, at
    every byte that may begin one. A false header in front of it may claim more bytes than ever come, so it does not
    wait for those.
    """

    _kinds: ClassVar[bytes]
    """First bytes of packets."""
    _header: ClassVar[re.Pattern[bytes]]
    """Place where a packet may begin, after damage: it does not claim too much. An incomplete header may, too."""
    _starts_in_step: ClassVar[bool]
    _largest: ClassVar[int] = MAX_PACKET

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.reset()

    def reset(self) -> None:
        """Forget all bytes."""
        self._buffer.clear()
        self._lose_step(Damage(0, "bytes before the first whole packet", Status.REQUEST_TYPE_INVALID))
        self._is_in_step = self._starts_in_step

    @property
    def num_held(self) -> int:
        """Bytes of incomplete packets."""
        return len(self._buffer)

    def doubt(self) -> list[Packet | Damage]:
        """Packets behind the incomplete one, which takes longer than packets do: its length is damaged.

        It is still taken if it becomes whole before one behind it.
        """
        if self._is_in_step and self._buffer:
            self._lose_step(Damage(0, "packet that never became whole", Status.PAYLOAD_INCOMPLETE))
        return self.feed(b"")

    def feed(self, data: bytes) -> list[Packet | Damage]:
        """Packets that these bytes complete, and damage, in order."""
        self._buffer += data
        found: list[Packet | Damage] = []
        while self._buffer and (self._step(found) if self._is_in_step else self._search(found)):
            pass
        return found

    def _step(self, found: list[Packet | Damage]) -> bool:
        """Take the packet at the front of the buffer; False where it is incomplete."""
        size = self._size(0) if self._buffer[0] in self._kinds else 1
        if size == 0 or len(self._buffer) < size <= self._largest:
            return False
        packet = self._packet(0, size)
        if isinstance(packet, Damage):
            self._lose_step(packet)
        else:
            found.append(packet)
            del self._buffer[:size]
        return True

    def _lose_step(self, damage: Damage) -> None:
        self._is_in_step = False
        self._damage = damage
        self._pending: list[int] = []  # places of incomplete packets
        self._num_searched = 0  # bytes before which all other places have been tried

    def _search(self, found: list[Packet | Damage]) -> bool:
        """Discard bytes up to the first packet with a good CRC and take it; False where there is none yet."""
        places = [*self._pending, *(match.start() for match in self._header.finditer(self._buffer, self._num_searched))]
        self._pending, self._num_searched = [], len(self._buffer)
        for begin in places:
            size = self._size(begin)
            if size == 0:
                self._num_searched = begin  # the header is incomplete
                break
            if size > self._largest:
                continue
            if begin + size > len(self._buffer):
                self._pending.append(begin)
            elif not isinstance(packet := self._packet(begin, size), Damage):
                self._discard(begin, found)
                found.append(packet)
                del self._buffer[:size]
                self._is_in_step = True
                return True
        self._discard([*self._pending, self._num_searched][0], found)
        return False

    def _discard(self, num_bytes: int, found: list[Packet | Damage]) -> None:
        if num_bytes:
            found.append(Damage(num_bytes, self._damage.reason, self._damage.status))
            self._damage = Damage(0, self._damage.reason)
            del self._buffer[:num_bytes]
            self._pending = [begin - num_bytes for begin in self._pending]
            self._num_searched -= num_bytes

    def _packet(self, begin: int, size: int) -> Packet | Damage:
        """Packet at a place of the buffer, or its damage."""
        if self._buffer[begin] not in self._kinds:
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
        """Bytes that a packet at a place of the buffer claims, with its CRC; 0: its header is incomplete."""
        raise NotImplementedError

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

    _kinds = bytes([0x40, 0x43, 0xC0, *range(0xD0, 0xE0)])
    # Of large packets only data of this radar's channel, or of none: nearly all accidental headers claim to be large.
    _header = re.compile(
        rb"(?=[\x40\x43\xc0](?:..[\x00-\x0f]|.{0,2}\Z)|[\xd0-\xdf](?:[\x00\xff]|.{4}[\x00-\x0f]|.{0,4}\Z))", re.DOTALL
    )
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

    _kinds = b"\x40\x43\xc0"
    _header = re.compile(rb"(?=[\x40\x43](?:.{6}[\x00-\x0f]|.{0,6}\Z)|\xc0)", re.DOTALL)
    _starts_in_step = True

    def _size(self, begin: int) -> int:
        length = self._u16(begin + 6)
        # A read has no payload: its length is the length of the answer.
        return 0 if length < 0 else 10 if self._buffer[begin] == Kind.READ else 10 + length

    def _decode(self, packet: bytes) -> Request:
        kind, request, value, index, length = struct.unpack_from("<BBHHH", packet)
        return Request(Kind(kind), request, value, index, length, packet[8:])


class Link(Protocol):
    """Requests to a board, and the data packets it sends."""

    name: str

    def ask(self, request: Request, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> bytes:
        """Payload of the answer; `RequestError` where the board refuses, `SensorTimeoutError` where it is silent.

        The first answer is waited for up to `timeout` [s], those to all retries together once more as long.
        """

    def packets(self, timeout: float) -> list[DataPacket | Damage]:
        """Data packets since the last call, and damage among them; waits for the first up to `timeout` [s]."""

    @property
    def num_held(self) -> int:
        """Bytes of incomplete packets."""

    def discard(self) -> None:
        """Discard data packets until none come any more."""

    def close(self) -> None:
        """Give the port back."""


class StreamLink:
    """Link over a byte stream, which responses and data packets share; a reader of either reads it."""

    def __init__(self, stream: Stream) -> None:
        self.name: str = stream.name
        self._stream = stream
        self._parser = HostParser()
        self._packets: deque[DataPacket | Damage] = deque(maxlen=_MOST_PACKETS)
        self._responses: deque[Response] = deque()
        self._damage = DamageCount()  # since the last request was sent
        self._fed = monotonic()  # when the parser has last made something of its bytes
        self._num_due = 0  # answers to come; of interrupted requests too
        self._is_silent = False  # the board has not answered at all, and nothing has come from it since

    @property
    def num_held(self) -> int:
        """Bytes of incomplete packets."""
        return self._parser.num_held

    def ask(self, request: Request, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> bytes:
        """Send a request and wait for its answer."""
        if self._is_silent:
            timeout, retries = min(timeout, _SILENT_TIMEOUT), 0
        total = timeout if retries == 0 else 2.0 * timeout
        for tries_left in reversed(range(retries + 1)):
            patience = timeout if tries_left == retries else timeout / retries
            try:
                return _payload(self.name, request, self._response(request, patience, total))
            except SensorTimeoutError:
                if tries_left == 0:
                    # One answer alone may have been lost on its way.
                    self._is_silent = retries > 0 or timeout <= _SILENT_TIMEOUT
                    raise
            except RequestError as error:
                if tries_left == 0 or error.status not in DAMAGED:
                    raise
        raise AssertionError("unreachable")

    def packets(self, timeout: float) -> list[DataPacket | Damage]:
        """Data packets since the last call, and damage among them."""
        deadline = monotonic() + timeout
        while not self._packets:
            remaining = max(deadline - monotonic(), 0.0)
            self._read(remaining)
            if remaining == 0.0:
                break
        taken = list(self._packets)
        self._packets.clear()
        return taken

    def discard(self) -> None:
        """Discard data packets until none come any more."""
        _discard(self, _STREAM_QUIET)

    def close(self) -> None:
        """Give the port back."""
        self._stream.close()

    def _response(self, request: Request, timeout: float, total: float) -> Response:
        """Response that comes within `timeout` [s]; `total` is the time-out of all tries, for the error message."""
        # Answers to requests that were given up.
        while self._num_due > 0 and self._next_response(_LATE) is not None:
            pass
        self._responses.clear()
        self._num_due = 1
        self._damage = DamageCount()
        self._stream.write(encode_request(request), timeout)
        response = self._next_response(timeout)
        if response is None:
            damage = self._damage.text(self.num_held)
            self._parser.reset()
            raise SensorTimeoutError(
                f"{self.name}: no answer to {_text(request)} within {total:g} s{'; ' + damage if damage else ''}"
            )
        return response

    def _next_response(self, timeout: float) -> Response | None:
        deadline = monotonic() + timeout
        while not self._responses:
            if (remaining := deadline - monotonic()) <= 0.0:
                return None
            self._read(remaining)
        self._num_due -= 1
        return self._responses.popleft()

    def _read(self, timeout: float) -> None:
        """Wait for bytes up to `timeout` [s], and sort what they complete."""
        data = self._stream.read(_READ_SIZE, timeout)
        if data:
            self._is_silent = False
        found = self._parser.feed(data)
        now = monotonic()
        if not found and self.num_held and now - self._fed > _SLOWEST_PACKET:
            found = self._parser.doubt()
        if found or not self.num_held:
            self._fed = now
        for item in found:
            if isinstance(item, Response):
                self._responses.append(item)
                continue
            if isinstance(item, Damage):
                self._damage.add(item)
            self._packets.append(item)


class VendorLink:
    """Link over vendor requests and a bulk endpoint."""

    num_held = 0

    def __init__(self, port: UsbVendorPort) -> None:
        self.name: str = port.name
        self._port = port
        self._is_silent = False

    def ask(self, request: Request, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> bytes:
        """Send a request and fetch its answer; transfers of USB have retries of their own."""
        del retries
        try:
            answer = self._answer(request, min(timeout, _SILENT_TIMEOUT) if self._is_silent else timeout)
        except SensorTimeoutError:
            self._is_silent = True
            raise
        self._is_silent = False
        return answer

    def packets(self, timeout: float) -> list[DataPacket | Damage]:
        """The next data packet, or its damage."""
        data = self._port.read_packet(MAX_DATA_PACKET, timeout)
        if not data:
            return []
        self._is_silent = False
        try:
            return [decode_data(data)]
        except ProtocolError as error:
            return [Damage(len(data), str(error), Status.BAD_PAYLOAD)]

    def discard(self) -> None:
        """Discard data packets until none come any more."""
        _discard(self, _VENDOR_QUIET)

    def close(self) -> None:
        """Give the port back."""
        self._port.close()

    def _answer(self, request: Request, timeout: float) -> bytes:
        where = (request.request, request.value, request.index)
        try:
            if request.kind == Kind.READ:
                answer = self._port.control_read(Kind.READ, *where, request.length, timeout)
                return _payload(self.name, request, Response(request.kind, 0, answer))
            self._port.control_write(request.kind, *where, request.payload, timeout)
            if request.kind == Kind.TRANSFER:
                return self._port.control_read(Kind.FETCH, *where, MAX_CONTROL_PAYLOAD, timeout)
            return _payload(self.name, request, Response(request.kind, self._status(timeout)))
        except Stalled as error:
            status = self._status(timeout)
            if status == 0:
                raise ProtocolError(f"{self.name}: {_text(request)} was refused without a reason") from error
            raise _refusal(self.name, request, status) from error

    def _status(self, timeout: float) -> int:
        """Status of the last request."""
        answer = self._port.control_read(Kind.READ, Code.BOARD_INFO, Info.STATUS, 1, 4, timeout)
        if len(answer) != 4:
            raise ProtocolError(f"{self.name}: expected a status of 4 bytes, got {len(answer)}")
        return answer[1]


def _discard(link: Link, quiet: float) -> None:
    """Discard packets of a link until none has come for `quiet` [s]."""
    deadline = monotonic() + _DISCARD_TIME
    with suppress(SensorDisconnectedError):  # nothing more will come; the next request raises it
        while link.packets(quiet) and monotonic() < deadline:
            pass


def _payload(name: str, request: Request, response: Response) -> bytes:
    """Payload of a response that fits its request."""
    if response.status != 0:
        raise _refusal(name, request, response.status)
    if response.kind != request.kind:
        raise ProtocolError(f"{name}: expected an answer of kind 0x{request.kind:02X}, got 0x{response.kind:02X}")
    expected = {Kind.READ: request.length, Kind.WRITE: 0}.get(Kind(request.kind), len(response.payload))
    if len(response.payload) != expected:
        raise ProtocolError(
            f"{name}: expected {expected} bytes as answer to {_text(request)}, got {len(response.payload)}"
        )
    return response.payload


def _refusal(name: str, request: Request, status: int) -> RequestError:
    return RequestError(f"{name}: the board refuses {_text(request)}: {status_text(status)}", status)


def _text(request: Request) -> str:
    return f"request 0x{request.request:02X} (value 0x{request.value:04X}, index 0x{request.index:04X})"
