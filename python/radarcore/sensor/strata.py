"""Strata packets: requests, responses and data between bytes and records, for both ends of the wire.

Two forms carry the same requests. A byte stream (CDC, UART) has whole packets with a CRC, and responses and data
share the way to the host. Vendor USB has requests as control transfers, and data packets without a CRC, one to a
bulk transfer. Numbers are little-endian; the CRC and the SPI words of a request are sent high byte first.
"""

from __future__ import annotations

import re
import struct
from binascii import crc_hqx
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from heapq import heappop, heappush
from typing import ClassVar, Generic, NamedTuple, TypeVar

from radarcore import check
from radarcore.sensor.errors import ProtocolError, RequestError

MAX_PACKET = 4095
"""Largest packet of a byte stream, all in: it never ends a USB packet of 512 bytes exactly."""

MAX_REQUEST_PAYLOAD = MAX_PACKET - 8 - 2
MAX_RESPONSE_PAYLOAD = MAX_PACKET - 4 - 2
MAX_DATA_PAYLOAD = MAX_PACKET - 6 - 2
MAX_CONTROL_PAYLOAD = 4088
"""Largest payload of a control transfer of vendor USB."""

MAX_WORDS = 255
"""Most SPI words in one request: the published firmware counts them in 8 bits."""

_TIMESTAMP = struct.Struct("<Q")


class Kind(IntEnum):
    """Kind of a request, ``bmReqType`` (Strata, the three request kinds)."""

    WRITE = 0x40
    READ = 0xC0
    TRANSFER = 0x43
    FETCH = 0xC3
    """Second half of a transfer, on vendor USB only."""


class Code(IntEnum):
    """What a request is about, ``bRequest`` (Strata, platform requests)."""

    MEMORY = 0x00
    GPIO = 0x01
    SPI = 0x05
    DATA = 0x0D
    COMPONENT = 0x20
    MODULE = 0x21
    BOARD_INFO = 0x80


class Info(IntEnum):
    """``wValue`` of `Code.BOARD_INFO`."""

    NAME = 0x00
    VERSION = 0x01
    UUID = 0x02
    EXTENDED_VERSION = 0x03
    BOOTLOADER = 0x04
    STATUS = 0xFF
    """Status of the last request (``wIndex`` 1), on vendor USB only."""


class Data(IntEnum):
    """``wValue`` of `Code.DATA`."""

    FLAGS = 0
    CONFIGURE = 1
    START = 3
    STOP = 4


class Component(IntEnum):
    """``wValue`` of `Code.COMPONENT`: the type; 0 asks for the number of the type in ``wIndex``."""

    COUNT = 0x0000
    AVIAN = 0x0103
    """BGT60TR13C and its relatives."""
    ATR22 = 0x0104
    LTR11 = 0x0105


class Avian(IntEnum):
    """``wIndex`` of `Component.AVIAN`, instance 0: function << 8 | sub-interface << 4."""

    RESET = 0x0000
    INITIALIZE = 0x0100
    DATA_INDEX = 0x0200
    START = 0x0300
    STOP = 0x0400
    REGISTERS_CLEAR = 0x0010
    REGISTERS_SET = 0x0110
    REGISTERS_MODIFY = 0x0210
    REGISTERS_WRITE_BURST = 0x0310
    REGISTERS_READ_BURST = 0x0410
    REGISTERS_BATCH = 0x0510
    PIN_RESET = 0x0120
    PIN_RESET_PULSE = 0x0520
    PIN_IRQ = 0x0620
    EXECUTE = 0x0130
    SET_BITS = 0x0230


class DataFormat(IntEnum):
    """Format of the samples in data packets (Strata, configure)."""

    U16 = 0x02
    U64 = 0x04
    """Time stamps of the interrupts in place of samples."""
    PACKED12 = 0x10
    RAW12 = 0x2C
    AUTO = 0xFF


class Status(IntEnum):
    """Status of a response, ``bStatus`` (Strata, status codes)."""

    SUCCESS = 0x00
    FAILED = 0x01
    INVALID_SIZE = 0x02
    INVALID_PARAMETER = 0x03
    MISSING_PARAMETER = 0x04
    UNEXPECTED_VALUE = 0x05
    OUT_OF_BOUNDS = 0x06
    OVERFLOW = 0x07
    TIMEOUT = 0x08
    BUSY = 0x09
    ABORTED = 0x0A
    UNDERFLOW = 0x0B
    OUT_OF_MEMORY = 0x0C
    INVALID_ADDRESS = 0x0D
    NOT_IMPLEMENTED = 0x10
    NOT_POSSIBLE = 0x11
    NOT_AVAILABLE = 0x12
    NOT_ALLOWED = 0x13
    NOT_INITIALIZED = 0x14
    NOT_CONFIGURED = 0x15
    NOT_OPEN = 0x16
    NOT_SUPPORTED = 0x17
    HEADER_INCOMPLETE = 0x80
    PAYLOAD_INCOMPLETE = 0x81
    PAYLOAD_TOO_LONG = 0x82
    PAYLOAD_FRAGMENTED = 0x83
    CRC_ERROR = 0x84
    REQUEST_TYPE_INVALID = 0x85
    REQUEST_UNKNOWN = 0x86
    REQUEST_NOT_IMPLEMENTED = 0x87
    BAD_LENGTH = 0x88
    BAD_VALUE = 0x89
    BAD_INDEX = 0x8A
    BAD_PAYLOAD = 0x8B
    REQUEST_NOT_AVAILABLE = 0x8C
    COMPONENT_ID_INVALID = 0x8D
    COMPONENT_TYPE_INVALID = 0x8E
    SUB_INTERFACE_INVALID = 0x8F
    FUNCTION_INVALID = 0x90


FIFO_OVERFLOW = 0x012E
"""Overflow of the FIFO in the data of older firmware; newer has `Status.OVERFLOW`."""

STATUS_NAMES: dict[int, str] = (
    {status.value: status.name.lower().replace("_", " ").replace("crc", "CRC") for status in Status}
    | dict.fromkeys(range(0x70, 0x77), "sensor firmware error")
    | {
        FIFO_OVERFLOW: "FIFO overflow",
        0x40000001: "low level error",
        0x40000002: "frame dropped",
        0x40000003: "frame pool depleted",
        0x40000004: "frame size exceeded",
        0x40000005: "queue trimmed",
    }
)
"""Names of the codes in responses and in error packets."""


def status_text(code: int) -> str:
    """Name and number of a status, for messages: ``CRC error (0x84)``."""
    return f"{STATUS_NAMES.get(code, 'unknown status')} (0x{code:02X})"


def crc(data: bytes | bytearray) -> int:
    """CRC-16/CCITT-FALSE; 0 over a packet with its CRC, high byte first, at the end."""
    return crc_hqx(data, 0xFFFF)


@dataclass(frozen=True)
class Request:
    """What the host asks.

    Attributes
    ----------
    kind : int
        `Kind`; a board has to expect any other number too.
    request, value, index : int
        ``bRequest`` (8 bit), ``wValue`` and ``wIndex`` (16 bit).
    length : int
        ``wLength``: bytes of the payload, or bytes wanted by a read, which has no payload.
    payload : bytes
    """

    kind: int
    request: int
    value: int
    index: int
    length: int
    payload: bytes = b""

    @classmethod
    def write(cls, request: int, value: int, index: int, payload: bytes = b"") -> Request:
        """Bytes for the board; the answer is a status."""
        return cls(Kind.WRITE, request, value, index, len(payload), payload)

    @classmethod
    def read(cls, request: int, value: int, index: int, length: int) -> Request:
        """Ask for exactly `length` bytes."""
        return cls(Kind.READ, request, value, index, length)

    @classmethod
    def transfer(cls, request: int, value: int, index: int, payload: bytes = b"") -> Request:
        """Bytes for the board, and as many back as it likes."""
        return cls(Kind.TRANSFER, request, value, index, len(payload), payload)


@dataclass(frozen=True)
class Response:
    """What the board answers: `kind` of the request, `status` (0: success) and payload."""

    kind: int
    status: int
    payload: bytes = b""


@dataclass(frozen=True)
class DataPacket:
    """A slice of samples or a part of one, or an error of the stream (Strata, data packet).

    Attributes
    ----------
    payload : bytes
        Samples; none in an error.
    counter : int
        Counts packets, modulo 65536.
    channel : int
    is_first, is_last : bool
        Whether it begins and ends a slice.
    timestamp : int or None
        Time since the board started [us]; only the last packet of a slice has one.
    error : int, str or None
        Code or text of an error; only a last packet has one.
    """

    payload: bytes
    counter: int
    channel: int = 0
    is_first: bool = True
    is_last: bool = True
    timestamp: int | None = None
    error: int | str | None = None


@dataclass(frozen=True)
class Damage:
    """Bytes that a parser threw away.

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


def encode_request(request: Request) -> bytes:
    """Packet of a request on a byte stream; ValueError where a number or the payload does not fit."""
    if len(request.payload) > MAX_REQUEST_PAYLOAD:
        raise ValueError(f"payload: expected at most {MAX_REQUEST_PAYLOAD} bytes, got {len(request.payload)}")
    wanted = 0 if request.kind in (Kind.READ, Kind.FETCH) else request.length
    if len(request.payload) != wanted:
        raise ValueError(f"payload: expected {wanted} bytes, got {len(request.payload)}")
    head = _pack(
        "<BBHHH",
        kind=request.kind,
        request=request.request,
        value=request.value,
        index=request.index,
        length=request.length,
    )
    return _with_crc(head + request.payload)


def encode_response(response: Response) -> bytes:
    """Packet of a response on a byte stream; ValueError where a number or the payload does not fit."""
    if len(response.payload) > MAX_RESPONSE_PAYLOAD:
        raise ValueError(f"payload: expected at most {MAX_RESPONSE_PAYLOAD} bytes, got {len(response.payload)}")
    head = _pack("<BBH", kind=response.kind, status=response.status, length=len(response.payload))
    return _with_crc(head + response.payload)


def encode_data(packet: DataPacket, *, with_crc: bool = True) -> bytes:
    """Data packet: `with_crc` for a byte stream, without for a bulk transfer of vendor USB.

    An error text of 4 bytes reads as a code. ValueError where something does not fit.
    """
    if not packet.is_last and (packet.timestamp is not None or packet.error is not None):
        raise ValueError("is_last: expected True with a time stamp or an error, got False")
    payload = packet.payload
    if packet.error is not None:
        if payload:
            raise ValueError(f"payload: expected none with an error, got {len(payload)} bytes")
        payload = packet.error.encode() if isinstance(packet.error, str) else _pack("<I", error=packet.error)
    if packet.timestamp is not None:
        payload += _pack("<Q", timestamp=packet.timestamp)
    limit = MAX_DATA_PAYLOAD if with_crc else 0xFFFF
    if len(payload) > limit:
        raise ValueError(f"payload: expected at most {limit} bytes with its time stamp, got {len(payload)}")
    flags = (
        packet.is_first | packet.is_last << 1 | (packet.timestamp is not None) << 2 | (packet.error is not None) << 3
    )
    head = _pack("<BBHH", flags=0xD0 | flags, channel=packet.channel, counter=packet.counter, length=len(payload))
    return _with_crc(head + payload) if with_crc else head + payload


def decode_data(data: bytes) -> DataPacket:
    """Data packet of a bulk transfer, without a CRC; ProtocolError where it is none."""
    if len(data) < 6 or data[0] >> 4 != 0xD:
        raise ProtocolError(
            f"Strata data packet: expected 0xD. and at least 6 bytes, got {len(data)}: {data[:6].hex()}"
        )
    flags, channel, counter, length = struct.unpack_from("<BBHH", data)
    if len(data) != 6 + length:
        raise ProtocolError(f"Strata data packet: expected 6 + {length} bytes, got {len(data)}")
    payload = bytes(data[6:])
    is_last = bool(flags & 2)
    timestamp: int | None = None
    error: int | str | None = None
    # Time stamp and error count on the last packet only.
    if is_last and flags & 4:
        if length < _TIMESTAMP.size:
            raise ProtocolError(f"Strata data packet: expected a time stamp of 8 bytes, got {length}")
        (timestamp,) = _TIMESTAMP.unpack_from(payload, length - _TIMESTAMP.size)
        payload = payload[: -_TIMESTAMP.size]
    if is_last and flags & 8:
        is_code = len(payload) == 4
        error = int.from_bytes(payload, "little") if is_code else payload.rstrip(b"\0").decode(errors="replace")
        payload = b""
    return DataPacket(payload, counter, channel, bool(flags & 1), is_last, timestamp, error)


Packet = TypeVar("Packet")


class _Parser(Generic[Packet]):
    """Packets out of a byte stream that comes in pieces.

    In step, the packet that begins at the next byte is awaited. Out of step, every byte that may begin one is tried:
    the first packet that is whole and has a good CRC wins, whatever packets are still awaited before it, because what
    looks like a header may claim 4095 bytes that never come. So at most one largest packet is kept between calls.
    """

    _first_byte: ClassVar[re.Pattern[bytes]]
    _starts_in_step: ClassVar[bool]

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

    def feed(self, data: bytes) -> list[Packet | Damage]:
        """Packets that are whole with these bytes, and what was thrown away, in order."""
        self._buffer += data
        found: list[Packet | Damage] = []
        begin = 0
        while begin < len(self._buffer):
            if self._is_in_step:
                size = self._size(begin) if self._first_byte.match(self._buffer, begin) else 1
                if size == 0 or (size <= MAX_PACKET and begin + size > len(self._buffer)):
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
            if size > MAX_PACKET:
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
        """Packet at a place of the buffer, or what is wrong with it."""
        if not self._first_byte.match(self._buffer, begin):
            reason = f"byte 0x{self._buffer[begin]:02x} begins no packet"
            return Damage(0, reason, Status.REQUEST_TYPE_INVALID)
        if size > MAX_PACKET:
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

    def _decode(self, packet: bytes) -> Packet:
        """Packet from its bytes without the CRC, which was good."""
        raise NotImplementedError

    def _u16(self, place: int) -> int:
        """Number at a place of the buffer, or -1 where the buffer ends before."""
        return self._buffer[place] | self._buffer[place + 1] << 8 if place + 2 <= len(self._buffer) else -1


class HostParser(_Parser[Response | DataPacket]):
    """Responses and data packets out of the bytes from a board, cut anywhere (Strata, framing on serial).

    Bytes that belong to no good packet come back as `Damage`. It begins out of step, since a board may have been left
    measuring. Where a packet's length is damaged in step, it waits until the claimed bytes are there; `reset` after a
    time-out, then, rather than asking again at once.
    """

    _first_byte = re.compile(rb"[\x40\x43\xc0\xd0-\xdf]")
    _starts_in_step = False

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
        How many; 0 where the counter went back, which says nothing.
    """

    reason: str
    num_packets: int


@dataclass(frozen=True)
class StreamError:
    """The board ended its stream with an error: a code (see `STATUS_NAMES`) or a text; `timestamp` [us]."""

    error: int | str
    timestamp: int | None = None


class SliceAssembler:
    """Slices out of data packets, and what is missing between them (Strata, receiver rules).

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
        """What is known with this packet, in order."""
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


class Version(NamedTuple):
    """Versions of a board's firmware and of the protocol that it speaks."""

    major: int
    minor: int
    patch: int
    build: int = 0
    protocol_major: int = 4
    protocol_minor: int = 0

    @property
    def firmware(self) -> str:
        """Text such as ``2.6.0``; the build behind it where there is one."""
        return f"{self.major}.{self.minor}.{self.patch}" + (f".{self.build}" if self.build else "")

    def encode(self) -> bytes:
        """Answer of 16 bytes."""
        return _pack("<HHHHHH", **self._asdict()) + bytes(4)

    @classmethod
    def decode(cls, payload: bytes) -> Version:
        """Version from an answer; ProtocolError where it has not 16 bytes."""
        if len(payload) != 16:
            raise ProtocolError(f"Strata version: expected 16 bytes, got {len(payload)}")
        return cls(*struct.unpack("<6H4x", payload))


def encode_board_info(vendor_id: int, product_id: int, name: str) -> bytes:
    """Answer to `Info.NAME`: USB ids and the name."""
    return _pack("<HH", vendor_id=vendor_id, product_id=product_id) + name.encode()[:251] + b"\0"


def decode_board_info(payload: bytes) -> tuple[int, int, str]:
    """Vendor id, product id and name; ProtocolError where the answer is shorter than the ids."""
    if len(payload) < 4:
        raise ProtocolError(f"Strata board info: expected at least 4 bytes, got {len(payload)}")
    vendor_id, product_id = struct.unpack_from("<HH", payload)
    return vendor_id, product_id, decode_text(payload[4:])


def decode_text(payload: bytes) -> str:
    """Text up to its zero byte."""
    return payload.split(b"\0", 1)[0].decode(errors="replace")


def uuid_text(payload: bytes) -> str:
    """UUID as hexadecimal digits 8-4-4-4-12 in the order of the wire; ProtocolError where it has not 16 bytes."""
    if len(payload) != 16:
        raise ProtocolError(f"Strata UUID: expected 16 bytes, got {len(payload)}")
    digits = payload.hex()
    return "-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:]))


def uuid_bytes(text: str) -> bytes:
    """The 16 bytes of a UUID's text; ValueError where it is none."""
    digits = text.replace("-", "")
    if not re.fullmatch("[0-9A-Fa-f]{32}", digits):
        raise ValueError(f"uuid: expected 32 hexadecimal digits, got {text!r}")
    return bytes.fromhex(digits)


class DataConfiguration(NamedTuple):
    """How the board reads samples: `slice_size` of them in one burst from register `address`."""

    data_format: int
    address: int
    slice_size: int


def data_configuration(slice_size: int, address: int = 0x60) -> bytes:
    """Payload of `Data.CONFIGURE`: slices of `slice_size` samples of 12 bit, two in three bytes.

    `address` is that of the radar's FIFO. ValueError for an odd or too large slice.
    """
    slice_size = check.count("slice_size", slice_size, 2)
    if slice_size % 2 or slice_size > 0xFFFE:
        raise ValueError(f"slice_size: expected an even number up to 65534, got {slice_size}")
    return bytes([DataFormat.PACKED12]) + bytes(7) + _pack("<HH", address=address, slice_size=slice_size)


def decode_data_configuration(payload: bytes, *, index: int = 0, max_slice_size: int = 16384) -> DataConfiguration:
    """Configuration from a request's payload, with the checks of a board.

    `index` is ``wIndex`` of the request; `max_slice_size` [samples] what the board has room for. Raises
    `RequestError` with the status that the board answers.
    """
    if index != 0:
        raise RequestError(f"data index: expected 0, got {index}", Status.OUT_OF_BOUNDS)
    if len(payload) not in (8, 12):
        raise RequestError(f"data configuration: expected 12 bytes, got {len(payload)}", Status.INVALID_SIZE)
    # Eight bytes are settings without a read-out, which is one of no samples.
    data_format, address, slice_size = struct.unpack("<B7xHH", payload.ljust(12, b"\0"))
    if data_format not in iter(DataFormat):
        raise RequestError(f"data format: expected a known one, got 0x{data_format:02x}", Status.INVALID_PARAMETER)
    if address > 0xFF:
        raise RequestError(f"read-out address: expected at most 0xff, got 0x{address:x}", Status.INVALID_PARAMETER)
    if slice_size == 0 or slice_size % 2:
        raise RequestError(f"slice size: expected an even number above 0, got {slice_size}", Status.INVALID_PARAMETER)
    if slice_size > max_slice_size:
        raise RequestError(f"slice size: expected at most {max_slice_size}, got {slice_size}", Status.OVERFLOW)
    return DataConfiguration(data_format, address, slice_size)


def encode_commands(words: Iterable[int]) -> bytes:
    """Payload of `Avian.EXECUTE`: SPI words of 32 bit, high byte first."""
    return _words(">", words)


def decode_commands(payload: bytes) -> list[int]:
    """SPI words of a request; `RequestError` with the board's status where the last one is cut."""
    if len(payload) % 4:
        raise RequestError(f"SPI words: expected a multiple of 4 bytes, got {len(payload)}", Status.BAD_LENGTH)
    return list(struct.unpack(f">{len(payload) // 4}I", payload))


def encode_values(words: Iterable[int]) -> bytes:
    """Answer to `Avian.EXECUTE`, and values of register bursts: words of 32 bit, low byte first."""
    return _words("<", words)


def decode_values(payload: bytes) -> list[int]:
    """Words of 32 bit, low byte first; ProtocolError where the last one is cut."""
    if len(payload) % 4:
        raise ProtocolError(f"Strata values: expected a multiple of 4 bytes, got {len(payload)}")
    return list(struct.unpack(f"<{len(payload) // 4}I", payload))


def _with_crc(packet: bytes) -> bytes:
    return packet + crc(packet).to_bytes(2, "big")


def _pack(layout: str, **numbers: int) -> bytes:
    """Bytes of `numbers`; ValueError with the name of the one that does not fit."""
    try:
        return struct.pack(layout, *numbers.values())
    except struct.error:
        for (name, number), letter in zip(numbers.items(), layout[1:], strict=True):
            largest = 256 ** struct.calcsize(f"<{letter}") - 1
            if not 0 <= number <= largest:
                raise ValueError(f"{name}: expected 0 to {largest}, got {number}") from None
        raise


def _words(order: str, words: Iterable[int]) -> bytes:
    words = list(words)
    if words and not 0 <= min(words) <= max(words) <= 0xFFFFFFFF:
        raise ValueError(f"words: expected numbers of 32 bit, got {min(words)} to {max(words)}")
    return struct.pack(f"{order}{len(words)}I", *words)
