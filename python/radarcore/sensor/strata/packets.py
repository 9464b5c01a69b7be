"""Strata packets: requests, responses and data between bytes and records, for both ends of the wire.

Two forms carry the same requests. A byte stream (CDC, UART) has whole packets with a CRC, and responses and data
share the way to the host. Vendor USB has requests as control transfers, and data packets without a CRC, one to a
bulk transfer. Numbers are little-endian; the CRC and the SPI words of a request are sent high byte first.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from radarcore.sensor.errors import ProtocolError, RequestError

MAX_PACKET = 4095
"""Largest packet of a byte stream, all in, but for data: it never ends a USB packet of 512 bytes exactly."""

MAX_DATA_PACKET = 6 + 0xFFFF + 2
"""Largest packet of a byte stream, all in: its length has 16 bits."""

MAX_CONTROL_PAYLOAD = 4088
"""Largest payload of a control transfer of vendor USB."""

_TIMESTAMP = struct.Struct("<Q")


class Kind(IntEnum):
    """Kind of a request, ``bmReqType`` (Strata, the three request kinds)."""

    WRITE = 0x40
    READ = 0xC0
    TRANSFER = 0x43
    FETCH = 0xC3
    """Second half of a transfer, on vendor USB only."""


class Code(IntEnum):
    """Subject of a request, ``bRequest`` (Strata, platform requests)."""

    DATA = 0x0D
    COMPONENT = 0x20
    BOARD_INFO = 0x80


class Info(IntEnum):
    """``wValue`` of `Code.BOARD_INFO`."""

    NAME = 0x00
    VERSION = 0x01
    UUID = 0x02
    EXTENDED_VERSION = 0x03
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


class Avian(IntEnum):
    """``wIndex`` of `Component.AVIAN`, instance 0: function << 8 | sub-interface << 4."""

    REGISTERS_SET = 0x0110
    REGISTERS_WRITE_BURST = 0x0310
    REGISTERS_READ_BURST = 0x0410
    PIN_RESET_PULSE = 0x0520
    EXECUTE = 0x0130
    SET_BITS = 0x0230


class DataFormat(IntEnum):
    """Format of the samples in data packets (Strata, configure): 12 bits each; there are others."""

    PACKED12 = 0x10
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
    """Request of the host.

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
        """Send bytes to the board and return its answer, of any length."""
        return cls(Kind.TRANSFER, request, value, index, len(payload), payload)


@dataclass(frozen=True)
class Response:
    """Answer of the board: `kind` of the request, `status` (0: success) and payload."""

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
        True for a packet that begins, or ends, a slice.
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


def encode_request(request: Request) -> bytes:
    """Packet of a request on a byte stream."""
    head = struct.pack("<BBHHH", request.kind, request.request, request.value, request.index, request.length)
    return _with_crc(head + request.payload)


def encode_response(response: Response) -> bytes:
    """Packet of a response on a byte stream."""
    head = struct.pack("<BBH", response.kind, response.status, len(response.payload))
    return _with_crc(head + response.payload)


def encode_data(packet: DataPacket, *, with_crc: bool = True) -> bytes:
    """Data packet: `with_crc` for a byte stream, without for a bulk transfer of vendor USB.

    An error is sent in place of samples; a text of 4 bytes reads as a code. Time stamp and error count on the last
    packet of a slice only.
    """
    payload, error = packet.payload, packet.error
    if error is not None:
        payload = error.encode() if isinstance(error, str) else struct.pack("<I", error)
    if packet.timestamp is not None:
        payload += _TIMESTAMP.pack(packet.timestamp)
    flags = packet.is_first | packet.is_last << 1 | (packet.timestamp is not None) << 2 | (error is not None) << 3
    body = struct.pack("<BBHH", 0xD0 | flags, packet.channel, packet.counter, len(payload)) + payload
    return _with_crc(body) if with_crc else body


def decode_data(data: bytes) -> DataPacket:
    """Data packet of a bulk transfer, without a CRC; ProtocolError if it is none."""
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
        return struct.pack("<6H4x", *self)

    @classmethod
    def decode(cls, payload: bytes) -> Version:
        """Version from an answer; ProtocolError if it has not 16 bytes."""
        if len(payload) != 16:
            raise ProtocolError(f"Strata version: expected 16 bytes, got {len(payload)}")
        return cls(*struct.unpack("<6H4x", payload))


def encode_board_info(vendor_id: int, product_id: int, name: str) -> bytes:
    """Answer to `Info.NAME`: USB ids and the name."""
    return struct.pack("<HH", vendor_id, product_id) + name.encode()[:251] + b"\0"


def decode_board_info(payload: bytes) -> tuple[int, int, str]:
    """Vendor id, product id and name; ProtocolError if the answer is shorter than the ids."""
    if len(payload) < 4:
        raise ProtocolError(f"Strata board info: expected at least 4 bytes, got {len(payload)}")
    vendor_id, product_id = struct.unpack_from("<HH", payload)
    return vendor_id, product_id, decode_text(payload[4:])


def decode_text(payload: bytes) -> str:
    """Text up to its zero byte."""
    return payload.split(b"\0", 1)[0].decode(errors="replace")


def uuid_text(payload: bytes) -> str:
    """UUID as hexadecimal digits 8-4-4-4-12 in the order of the wire; ProtocolError if it has not 16 bytes."""
    if len(payload) != 16:
        raise ProtocolError(f"Strata UUID: expected 16 bytes, got {len(payload)}")
    digits = payload.hex()
    return "-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:]))


def data_configuration(slice_size: int, address: int = 0x60) -> bytes:
    """Payload of `Data.CONFIGURE`: slices of `slice_size` samples of 12 bit, two in three bytes.

    `address` is the radar's FIFO.
    """
    return struct.pack("<B7xHH", DataFormat.PACKED12, address, slice_size)


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
    """Words of 32 bit, low byte first; ProtocolError if the last one is cut."""
    if len(payload) % 4:
        raise ProtocolError(f"Strata values: expected a multiple of 4 bytes, got {len(payload)}")
    return list(struct.unpack(f"<{len(payload) // 4}I", payload))


def _with_crc(packet: bytes) -> bytes:
    return packet + crc(packet).to_bytes(2, "big")


def _words(order: str, words: Iterable[int]) -> bytes:
    words = list(words)
    return struct.pack(f"{order}{len(words)}I", *words)
