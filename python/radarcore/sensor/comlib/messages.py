"""ComLib messages and their payloads, between bytes and records.

The host asks with one payload message to an endpoint of the board; the board answers with any number of payload
messages and then one status of that endpoint. A payload begins with the code of the message. Numbers are
little-endian. There is no checksum: a reader out of step waits for silence.
"""

from __future__ import annotations

import struct
from dataclasses import astuple, dataclass
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from radarcore.sensor.comlib.codes import Adc, Base, Fmcw, Protocol, ProtocolStatus, SignalPart, status_text
from radarcore.sensor.errors import ProtocolError
from radarcore.sensor.interface import Damage

MESSAGE_START = 0x5A
STATUS_START = 0x5B
END_MARKER = b"\xdb\xe0"


@dataclass(frozen=True)
class Message:
    """Payload message from or to an endpoint; the payload begins with the code."""

    endpoint: int
    payload: bytes

    @property
    def code(self) -> int:
        """Code of the message; -1 where it is empty."""
        return self.payload[0] if self.payload else -1

    def encode(self) -> bytes:
        """Bytes on the wire."""
        return struct.pack("<BBH", MESSAGE_START, self.endpoint, len(self.payload)) + self.payload + END_MARKER


@dataclass(frozen=True)
class StatusMessage:
    """Status of an endpoint, 0 for OK: ends the answer to a request."""

    endpoint: int
    status: int

    def encode(self) -> bytes:
        """Bytes on the wire."""
        return struct.pack("<BBH", STATUS_START, self.endpoint, self.status)


class Parser:
    """Messages out of bytes that are cut anywhere.

    A `Damage` has the status that a board reports. Everything behind it is discarded until `reset`: call it when the
    line has been silent.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._wrong: ProtocolStatus | None = None

    @property
    def num_held(self) -> int:
        """Bytes of a message that is not yet whole."""
        return len(self._buffer)

    def reset(self) -> None:
        """Expect a message with the next byte: the line has been silent."""
        self._buffer.clear()
        self._wrong = None

    def feed(self, data: bytes) -> list[Message | StatusMessage | Damage]:
        """Messages and damage that these bytes complete, in order."""
        self._buffer += data
        found: list[Message | StatusMessage | Damage] = []
        status = 0
        while self._buffer and self._wrong is None and (item := self._next()) is not None:
            if isinstance(item, ProtocolStatus):
                self._wrong = status = item
            else:
                found.append(item)
        if self._wrong is not None and self._buffer:
            found.append(Damage(len(self._buffer), status_text(0, self._wrong), status))
            self._buffer.clear()
        return found

    def _next(self) -> Message | StatusMessage | ProtocolStatus | None:
        """Take the message at the front of the buffer: itself, the error in it, or None where it is not whole."""
        if self._buffer[0] not in (MESSAGE_START, STATUS_START):
            return ProtocolStatus.BAD_START
        if len(self._buffer) < 4:
            return None
        start, endpoint, number = struct.unpack_from("<BBH", self._buffer)
        if start == STATUS_START:
            del self._buffer[:4]
            return StatusMessage(endpoint, number)
        end = 4 + number
        # The first byte of the end marker may be wrong already.
        if not END_MARKER.startswith(bytes(self._buffer[end : end + 2])):
            return ProtocolStatus.BAD_END_MARKER
        if len(self._buffer) < end + 2:
            return None
        payload = bytes(self._buffer[4:end])
        del self._buffer[: end + 2]
        return Message(endpoint, payload)


# Payloads


class Endpoint(NamedTuple):
    """Type and version of an endpoint."""

    type: int
    version: int = 1

    @property
    def letters(self) -> str:
        """The four letters of the type; other bytes are escaped."""
        letters = self.type.to_bytes(4, "big").decode("ascii", errors="backslashreplace")
        return "".join(letter if letter.isprintable() else rf"\x{ord(letter):02x}" for letter in letters)


def decode_endpoints(payload: bytes) -> list[Endpoint]:
    """Endpoints from 1 on; ProtocolError if the answer is of a wrong size."""
    if len(payload) < 2 or len(payload) != 2 + 6 * payload[1]:
        raise ProtocolError(f"ComLib endpoints: expected 2 + 6 n bytes, got {payload[:8].hex(' ')}...")
    return [Endpoint(*fields) for fields in struct.iter_unpack("<IH", payload[2:])]


@dataclass(frozen=True)
class _Record:
    """Numbers behind the code of a payload, and in some a text behind them."""

    _code: ClassVar[int]
    _name: ClassVar[str]
    _layout: ClassVar[str]
    _has_text: ClassVar[bool] = False

    def encode(self) -> bytes:
        """Payload of numbers with its code; ValueError if one does not fit."""
        numbers = astuple(self)
        try:
            return struct.pack(f"<B{self._layout}", self._code, *numbers)
        except struct.error as error:
            raise ValueError(f"ComLib {self._name}: {error}, got {numbers}") from None

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload; ProtocolError when its size is wrong."""
        return cls(*_fields(cls._name, f"<x{cls._layout}", payload, has_text=cls._has_text))


@dataclass(frozen=True)
class Firmware(_Record):
    """Answer to `Protocol.FIRMWARE`."""

    _code, _name, _layout, _has_text = Protocol.FIRMWARE, "firmware", "HHH", True

    major: int
    minor: int
    build: int
    description: str


@dataclass(frozen=True)
class Info(_Record):
    """Answer to `Base.GET_INFO`: capabilities of the board."""

    _code, _name, _layout, _has_text = Base.INFO, "device info", "II8B", True

    min_frequency_khz: int
    max_frequency_khz: int
    num_tx: int
    num_rx: int
    max_tx_power: int
    num_sensors: int
    hardware_major: int
    hardware_minor: int
    interleaved_rx: int
    data_format: int
    description: str


@dataclass(frozen=True)
class Format(_Record):
    """Format of the frames."""

    _code, _name, _layout = Base.FORMAT, "frame format", "IIBB"

    num_samples: int
    num_chirps: int
    rx_mask: int
    signal_part: int = SignalPart.I


@dataclass(frozen=True)
class FmcwSettings(_Record):
    """Frequencies [kHz], `Direction` and power step of the chirps."""

    _code, _name, _layout = Fmcw.SETTINGS, "FMCW settings", "IIBB"

    lower_khz: int
    upper_khz: int
    direction: int
    tx_power: int


@dataclass(frozen=True)
class AdcSettings(_Record):
    """Sample rate [Hz], bits of a sample, and calibration after the conversion."""

    _code, _name, _layout = Adc.SETTINGS, "ADC settings", "IBB"

    sample_rate: int
    resolution: int = 12
    post_calibration: int = 0


@dataclass(frozen=True)
class Temperature(_Record):
    """Thousandths of a degree Celsius of a sensor."""

    _code, _name, _layout = Base.TEMPERATURE, "reading", "Bi"

    sensor: int
    thousandths: int


def encode_number(code: int, number: int) -> bytes:
    """Payload of a code and 32 bits: frame interval [us], chirp duration [ns], slope [MHz/s]."""
    return struct.pack("<BI", code, number)


def decode_number(payload: bytes) -> int:
    """The 32 bits behind a code; ProtocolError if the payload is of a wrong size."""
    number: int
    (number,) = _fields("message", "<xI", payload)
    return number


class Frame(NamedTuple):
    """Real samples of a frame.

    Attributes
    ----------
    number : int
        Counts from the last time that the interval was set.
    codes : (rx, chirp, sample) uint16
        Codes of the ADC, of 12 bits.
    """

    number: int
    codes: NDArray[np.uint16]

    @classmethod
    def decode(cls, payload: bytes) -> Frame:
        """Decode a payload; ProtocolError for I/Q, other samples than of 12 bit, and a wrong size."""
        head = _fields("frame", "<xIIBIxBBB", payload[:18])
        number, num_chirps, num_rx, num_samples, data_format, resolution, is_interleaved = head
        if data_format != 0 or resolution != 12 or is_interleaved > 1:
            raise ProtocolError(
                f"ComLib frame: expected real samples (data format 0) of 12 bit, interleaved 0 or 1, "
                f"got {data_format}, {resolution}, {is_interleaved}"
            )
        num_codes = num_rx * num_chirps * num_samples
        size = 18 + -(-num_codes * resolution // 8)
        if len(payload) != size:
            shape = (num_rx, num_chirps, num_samples)
            raise ProtocolError(
                f"ComLib frame: expected {size} bytes for [rx, chirp, sample] {shape}, got {len(payload)}"
            )
        codes = unpack_bits(payload[18:], num_codes, resolution)
        # Chirp by chirp: receivers in turn, sample by sample, or one after the other.
        if is_interleaved:
            codes = codes.reshape(num_chirps, num_samples, num_rx).transpose(2, 0, 1)
        else:
            codes = codes.reshape(num_chirps, num_rx, num_samples).transpose(1, 0, 2)
        return cls(number, np.ascontiguousarray(codes))


def unpack_bits(data: bytes, num_codes: int, resolution: int) -> NDArray[np.uint16]:
    """Codes of `resolution` bits in a row, the lowest bit first: (num_codes,)."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8), count=num_codes * resolution, bitorder="little")
    rows = np.zeros((num_codes, 16), np.uint8)
    rows[:, :resolution] = bits.reshape(num_codes, resolution)
    return np.packbits(rows, axis=1, bitorder="little").view("<u2")[:, 0].astype(np.uint16)


def _fields(name: str, layout: str, payload: bytes, *, has_text: bool = False) -> tuple[Any, ...]:
    """Fields of a payload of exactly that layout, or with a zero-terminated text behind them."""
    size = struct.calcsize(layout)
    if len(payload) < size or (len(payload) > size and not has_text):
        raise ProtocolError(f"ComLib {name}: expected {size} bytes{' or more' * has_text}, got {len(payload)}")
    fields = struct.unpack_from(layout, payload)
    return (*fields, payload[size:].split(b"\0", 1)[0].decode(errors="replace")) if has_text else fields
