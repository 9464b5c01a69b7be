"""ComLib messages: between bytes and records, for both ends of the wire.

The host asks with one payload message to an endpoint of the board; the board answers with any number of payload
messages and then one status of that endpoint. A payload begins with the code of the message. Numbers are
little-endian. There is no checksum: who loses step waits for silence.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarcore.sensor.errors import ProtocolError

MAX_PAYLOAD = 0xFFFF
MESSAGE_START = 0x5A
STATUS_START = 0x5B
END_MARKER = b"\xdb\xe0"


class EndpointType(IntEnum):
    """Type of an endpoint: four letters, the first in the highest byte."""

    RBAS = 0x52424153
    """Radar: frames, their format, temperature."""
    RFMC = 0x52464D43
    """FMCW settings."""
    RADX = 0x52414458
    """ADC of the controller."""
    RDPL = 0x5244504C
    RP2G = 0x52503247
    RIND = 0x52494E44
    RTDC = 0x52544443
    RCAL = 0x5243414C
    IRDR = 0x69524452
    """The one endpoint of the firmware of 2016/17, whose messages are others."""


class Protocol(IntEnum):
    """Codes of endpoint 0, the protocol itself."""

    ENDPOINTS = 0x00
    FIRMWARE = 0x01
    RESET = 0x02


class Base(IntEnum):
    """Codes of an RBAS endpoint. ``GET_`` asks for the code behind it."""

    FRAME = 0x00
    GET_FRAME = 0x01
    SET_INTERVAL = 0x02
    TEST = 0x03
    GET_VERSION = 0x20
    VERSION = 0x21
    GET_INFO = 0x22
    INFO = 0x23
    GET_TEMPERATURE = 0x30
    TEMPERATURE = 0x31
    GET_TX_POWER = 0x32
    TX_POWER = 0x33
    GET_CHIRP_DURATION = 0x34
    CHIRP_DURATION = 0x35
    GET_MIN_INTERVAL = 0x36
    MIN_INTERVAL = 0x37
    GET_FORMAT = 0x40
    FORMAT = 0x41


class Fmcw(IntEnum):
    """Codes of an RFMC endpoint; `SLOPE` asks and answers."""

    GET_SETTINGS = 0x00
    SETTINGS = 0x01
    SLOPE = 0x02


class Adc(IntEnum):
    """Codes of a RADX endpoint."""

    GET_SETTINGS = 0x00
    SETTINGS = 0x01


class Direction(IntEnum):
    """Direction of the chirps of a frame."""

    UP = 0
    DOWN = 1
    ALTERNATING_UP = 2
    ALTERNATING_DOWN = 3


class SignalPart(IntEnum):
    """What of the beat signal is sampled."""

    I = 0  # noqa: E741  # its name in the field
    Q = 1
    IQ = 2


class Status(IntEnum):
    """Status of a radar endpoint, as far as it is known (ComLib, status codes)."""

    OK = 0x0000
    BUSY = 0x0002
    NOT_POSSIBLE = 0x0003
    TIMEOUT = 0x0004
    UNSUPPORTED_INTERVAL = 0x0005
    NO_SUCH_ANTENNA = 0x0006
    NO_SUCH_SENSOR = 0x0007
    UNSUPPORTED_FORMAT = 0x0008
    FREQUENCY_OUT_OF_RANGE = 0x0009
    TX_POWER_OUT_OF_RANGE = 0x000A
    SIGNAL_PART_NOT_AVAILABLE = 0x000B
    UNSUPPORTED_DIRECTION = 0x0020
    SAMPLE_RATE_OUT_OF_RANGE = 0x0050
    UNSUPPORTED_RESOLUTION = 0x0051
    UNSUPPORTED_GAIN = 0x0052
    UNKNOWN_MESSAGE = 0xFFFF


class ProtocolStatus(IntEnum):
    """Status of endpoint 0: what is wrong with the stream."""

    OK = 0x0000
    SILENCE = 0x0001
    BAD_START = 0x0002
    NO_SUCH_ENDPOINT = 0x0003
    EMPTY_PAYLOAD = 0x0005
    PAYLOAD_TOO_LARGE = 0x0006
    BAD_END_MARKER = 0x0007
    UNKNOWN_MESSAGE = 0xFFFF


PROTOCOL_STATUS_NAMES: dict[int, str] = {
    0x0000: "OK",
    0x0001: "time-out of an incomplete message",
    0x0002: "bad start byte",
    0x0003: "endpoint does not exist",
    0x0005: "empty payload",
    0x0006: "payload larger than the buffer",
    0x0007: "bad end marker",
    0xFFFF: "unknown message, or of a wrong size",
}
"""Names of the status codes of endpoint 0."""

STATUS_NAMES: dict[int, str] = {
    0x0000: "OK",
    0x0002: "busy",
    0x0003: "not possible in the current mode",
    0x0004: "time-out",
    0x0005: "unsupported frame interval",
    0x0006: "antenna does not exist",
    0x0007: "sensor does not exist",
    0x0008: "unsupported frame format",
    0x0009: "frequency out of range",
    0x000A: "TX power out of range",
    0x000B: "signal part not available",
    0x0020: "unsupported direction",
    0x0050: "sample rate out of range",
    0x0051: "unsupported resolution",
    0x0052: "unsupported gain level",
    0x0100: "unsupported TX mode",
    0x0101: "unsupported high-pass gain",
    0x0102: "unsupported high-pass cutoff",
    0x0103: "unsupported VGA gain",
    0x0104: "unsupported reset timer",
    0x0105: "unsupported charge pump setting",
    0x0106: "unsupported pulse setting",
    0x0107: "unsupported order of the PLL",
    0x0108: "unsupported dither setting",
    0x0109: "unsupported cycle slip setting",
    0x010A: "calibration failed",
    0x010B: "unsupported phase setting",
    0x0110: "undefined tracking mode",
    0x0111: "undefined ADC sample time",
    0x0112: "undefined ADC oversampling",
    0x0120: "gap in the sequence of shapes",
    0x0121: "unsupported number of repetitions",
    0x0122: "unsupported power mode",
    0x0123: "unsupported post delay",
    0x0124: "unsupported number of frames",
    0x0125: "unsupported shape number",
    0x0126: "unsupported pre-chirp delay",
    0x0127: "unsupported post-chirp delay",
    0x0128: "unsupported PA delay",
    0x0129: "unsupported ADC delay",
    0x012A: "unsupported wake-up time",
    0x012B: "unsupported settle time",
    0x012C: "unsupported FIFO slice size",
    0x012D: "slices cannot be released",
    0x012E: "FIFO overflow",
    0x012F: "no memory",
    0x0130: "SPI test failed",
    0x0131: "chip setup failed",
    0x0132: "memory test failed",
    0x0133: "device not supported",
    0x0134: "feature not supported",
    0x0135: "pre-chirp delay exceeds the PA delay",
    0x0136: "register out of range",
    0xFFFF: "unknown message, or of a wrong size",
}
"""Names of the status codes of all other endpoints."""


def status_text(endpoint: int, code: int) -> str:
    """Name and number of a status, for messages: ``busy (0x0002)``; endpoint 0 has names of its own."""
    names = STATUS_NAMES if endpoint else PROTOCOL_STATUS_NAMES
    return f"{names.get(code, 'unknown status')} (0x{code:04X})"


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
        """Bytes on the wire; ValueError where endpoint or payload do not fit."""
        if not 0 <= self.endpoint <= 0xFF:
            raise ValueError(f"endpoint: expected 0 to 255, got {self.endpoint}")
        if len(self.payload) > MAX_PAYLOAD:
            raise ValueError(f"payload: expected at most {MAX_PAYLOAD} bytes, got {len(self.payload)}")
        return struct.pack("<BBH", MESSAGE_START, self.endpoint, len(self.payload)) + self.payload + END_MARKER


@dataclass(frozen=True)
class StatusMessage:
    """Status of an endpoint, 0 for OK: ends the answer to a request."""

    endpoint: int
    status: int

    def encode(self) -> bytes:
        """Bytes on the wire; ValueError where a number does not fit."""
        return _pack("status", "<BBH", STATUS_START, self.endpoint, self.status)


@dataclass(frozen=True)
class Damage:
    """Bytes that the host's parser threw away, and why."""

    num_bytes: int
    reason: str


Found = TypeVar("Found")


class _Parser(Generic[Found]):
    """Messages out of a byte stream that comes in pieces; after an error everything is discarded up to a silence."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._is_confused = False

    @property
    def is_idle(self) -> bool:
        """Whether the next byte begins a message."""
        return not (self._buffer or self._is_confused)

    def reset(self) -> None:
        """Expect a message with the next byte: the line has been silent."""
        self._buffer.clear()
        self._is_confused = False

    def feed(self, data: bytes) -> list[Found]:
        """What is known with these bytes, in order."""
        self._buffer += data
        found: list[Found] = []
        begin = 0
        while not self._is_confused and begin < len(self._buffer):
            size = self._next(begin, found)
            if size == 0:
                break
            begin += size
        if self._is_confused:
            self._discard(len(self._buffer) - begin, found)
            begin = len(self._buffer)
        del self._buffer[:begin]
        return found

    def _next(self, begin: int, found: list[Found]) -> int:
        """Put the message that begins at a place of the buffer into `found`; its size, 0 where it is not whole.

        Sets `_is_confused` where it is none.
        """
        raise NotImplementedError

    def _discard(self, num_bytes: int, found: list[Found]) -> None:
        """Bytes are thrown away."""


class HostParser(_Parser[Message | StatusMessage | Damage]):
    """Messages out of the bytes from a board, cut anywhere.

    After a `Damage` everything is thrown away until `reset`: call it when the line has been silent.
    """

    _reason = ""

    def _next(self, begin: int, found: list[Message | StatusMessage | Damage]) -> int:
        start = self._buffer[begin]
        if start not in (MESSAGE_START, STATUS_START):
            return self._confuse(f"byte 0x{start:02x} begins no message")
        if len(self._buffer) < begin + 4:
            return 0
        endpoint: int
        number: int
        endpoint, number = struct.unpack_from("<xBH", self._buffer, begin)
        if start == STATUS_START:
            found.append(StatusMessage(endpoint, number))
            return 4
        end = begin + 4 + number
        if len(self._buffer) < end + 2:
            return 0
        if self._buffer[end : end + 2] != END_MARKER:
            return self._confuse(f"message of {number} bytes without its end marker")
        found.append(Message(endpoint, bytes(self._buffer[begin + 4 : end])))
        return number + 6

    def _confuse(self, reason: str) -> int:
        self._is_confused = True
        self._reason = reason
        return 0

    def _discard(self, num_bytes: int, found: list[Message | StatusMessage | Damage]) -> None:
        if num_bytes:
            found.append(Damage(num_bytes, self._reason))


class BoardParser(_Parser[Message | StatusMessage]):
    """Requests out of the bytes from a host, cut anywhere, and what a board says at once to wrong ones.

    Parameters
    ----------
    num_endpoints : int
        Endpoints 0 to `num_endpoints` exist.
    max_payload : int
        Largest payload of a request [bytes].
    """

    def __init__(self, num_endpoints: int, max_payload: int = 512) -> None:
        super().__init__()
        self._num_endpoints = num_endpoints
        self._max_payload = max_payload

    def silence(self) -> list[StatusMessage]:
        """What the board says when no byte has come for its time-out; it then expects a message."""
        if self.is_idle:
            return []
        self.reset()
        return [StatusMessage(0, ProtocolStatus.SILENCE)]

    def _next(self, begin: int, found: list[Message | StatusMessage]) -> int:
        if self._buffer[begin] != MESSAGE_START:
            return self._confuse(ProtocolStatus.BAD_START, found)
        if len(self._buffer) < begin + 4:
            return 0
        endpoint: int
        size: int
        endpoint, size = struct.unpack_from("<xBH", self._buffer, begin)
        if endpoint > self._num_endpoints:
            return self._confuse(ProtocolStatus.NO_SUCH_ENDPOINT, found)
        if size == 0:
            return self._confuse(ProtocolStatus.EMPTY_PAYLOAD, found)
        if size > self._max_payload:
            return self._confuse(ProtocolStatus.PAYLOAD_TOO_LARGE, found)
        end = begin + 4 + size
        # The first byte of the end marker may be wrong already.
        if not END_MARKER.startswith(bytes(self._buffer[end : end + 2])):
            return self._confuse(ProtocolStatus.BAD_END_MARKER, found)
        if len(self._buffer) < end + 2:
            return 0
        found.append(Message(endpoint, bytes(self._buffer[begin + 4 : end])))
        return size + 6

    def _confuse(self, status: ProtocolStatus, found: list[Message | StatusMessage]) -> int:
        self._is_confused = True
        found.append(StatusMessage(0, status))
        return 0


class Endpoint(NamedTuple):
    """Type and version of an endpoint."""

    type: int
    version: int = 1

    @property
    def letters(self) -> str:
        """The four letters of the type."""
        return self.type.to_bytes(4, "big").decode("ascii", errors="replace")


def encode_endpoints(endpoints: list[Endpoint]) -> bytes:
    """Answer to `Protocol.ENDPOINTS`; the first is endpoint 1."""
    records = b"".join(_pack("endpoint", "<IH", *endpoint) for endpoint in endpoints)
    return bytes([Protocol.ENDPOINTS, len(endpoints)]) + records


def decode_endpoints(payload: bytes) -> list[Endpoint]:
    """Endpoints from 1 on; ProtocolError where the answer is of a wrong size."""
    if len(payload) < 2 or len(payload) != 2 + 6 * payload[1]:
        raise ProtocolError(f"ComLib endpoints: expected 2 + 6 n bytes, got {payload[:8].hex(' ')}...")
    return [Endpoint(*fields) for fields in struct.iter_unpack("<IH", payload[2:])]


class Firmware(NamedTuple):
    """Answer to `Protocol.FIRMWARE`."""

    major: int
    minor: int
    build: int
    description: str

    def encode(self) -> bytes:
        """Payload with its code; ValueError where a number does not fit."""
        return _pack("firmware", "<BHHH", Protocol.FIRMWARE, *self[:3]) + self.description.encode() + b"\0"

    @classmethod
    def decode(cls, payload: bytes) -> Firmware:
        """From a payload; ProtocolError where it is too short."""
        return cls(*_fields("firmware", "<xHHH", payload, has_text=True))


class Info(NamedTuple):
    """Answer to `Base.GET_INFO`: what the board can do."""

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

    def encode(self) -> bytes:
        """Payload with its code; ValueError where a number does not fit."""
        return _pack("device info", "<BII8B", Base.INFO, *self[:10]) + self.description.encode() + b"\0"

    @classmethod
    def decode(cls, payload: bytes) -> Info:
        """From a payload; ProtocolError where it is too short."""
        return cls(*_fields("device info", "<xII8B", payload, has_text=True))


class Format(NamedTuple):
    """Format of the frames, `Base.FORMAT`."""

    num_samples: int
    num_chirps: int
    rx_mask: int
    signal_part: int = SignalPart.I

    def encode(self) -> bytes:
        """Payload with its code; ValueError where a number does not fit."""
        return _pack("frame format", "<BIIBB", Base.FORMAT, *self)

    @classmethod
    def decode(cls, payload: bytes) -> Format:
        """From a payload; ProtocolError where it is of a wrong size."""
        return cls(*_fields("frame format", "<xIIBB", payload))


class FmcwSettings(NamedTuple):
    """Frequencies [kHz], `Direction` and power step of the chirps, `Fmcw.SETTINGS`."""

    lower_khz: int
    upper_khz: int
    direction: int
    tx_power: int

    def encode(self) -> bytes:
        """Payload with its code; ValueError where a number does not fit."""
        return _pack("FMCW settings", "<BIIBB", Fmcw.SETTINGS, *self)

    @classmethod
    def decode(cls, payload: bytes) -> FmcwSettings:
        """From a payload; ProtocolError where it is of a wrong size."""
        return cls(*_fields("FMCW settings", "<xIIBB", payload))


class AdcSettings(NamedTuple):
    """Sample rate [Hz], bits of a sample, and calibration after the conversion, `Adc.SETTINGS`."""

    sample_rate: int
    resolution: int = 12
    post_calibration: int = 0

    def encode(self) -> bytes:
        """Payload with its code; ValueError where a number does not fit."""
        return _pack("ADC settings", "<BIBB", Adc.SETTINGS, *self)

    @classmethod
    def decode(cls, payload: bytes) -> AdcSettings:
        """From a payload; ProtocolError where it is of a wrong size."""
        return cls(*_fields("ADC settings", "<xIBB", payload))


class Reading(NamedTuple):
    """Thousandths of a degree Celsius of a sensor, or of a dBm of a TX antenna."""

    number: int
    thousandths: int

    def encode(self, code: int) -> bytes:
        """Payload with `Base.TEMPERATURE` or `Base.TX_POWER`."""
        return _pack("reading", "<BBi", code, *self)

    @classmethod
    def decode(cls, payload: bytes) -> Reading:
        """From a payload; ProtocolError where it is of a wrong size."""
        return cls(*_fields("reading", "<xBi", payload))


def encode_byte(code: int, number: int) -> bytes:
    """Payload of a code and 8 bits: to wait for a frame, the number of a sensor or antenna."""
    return _pack("message", "<BB", code, number)


def decode_byte(payload: bytes) -> int:
    """The 8 bits behind a code; ProtocolError where the payload is of a wrong size."""
    number: int
    (number,) = _fields("message", "<xB", payload)
    return number


def encode_number(code: int, number: int) -> bytes:
    """Payload of a code and 32 bits: frame interval [us], chirp duration [ns], slope [MHz/s]."""
    return _pack("message", "<BI", code, number)


def decode_number(payload: bytes) -> int:
    """The 32 bits behind a code; ProtocolError where the payload is of a wrong size."""
    number: int
    (number,) = _fields("message", "<xI", payload)
    return number


@dataclass(frozen=True, eq=False)
class Frame:
    """Samples of a frame.

    Attributes
    ----------
    number : int
        Counts from the last time that the interval was set.
    codes : (rx, chirp, sample, part) uint16
        Codes of the ADC; one part (I or Q) where `data_format` is 0, else I and Q.
    rx_mask : int
        Enabled receivers, the first in the lowest bit.
    data_format : int
        On the wire: 0 real, 1 block of I and block of Q, 2 I and Q in turn.
    resolution : int
        Bits of a sample.
    is_interleaved : bool
        On the wire: receivers in turn, sample by sample.
    """

    number: int
    codes: NDArray[np.uint16]
    rx_mask: int
    data_format: int = 0
    resolution: int = 12
    is_interleaved: bool = False

    def encode(self) -> bytes:
        """Payload with its code; ValueError where a number does not fit."""
        num_rx, num_chirps, num_samples, _ = self.codes.shape
        head = _pack(
            "frame",
            "<BIIBIBBBB",
            Base.FRAME,
            self.number,
            num_chirps,
            num_rx,
            num_samples,
            self.rx_mask,
            self.data_format,
            self.resolution,
            self.is_interleaved,
        )
        ordered = self.codes.transpose(_WIRE_AXES[self.is_interleaved, self.data_format])
        return head + pack_bits(ordered.ravel(), self.resolution)

    @classmethod
    def decode(cls, payload: bytes) -> Frame:
        """From a payload; ProtocolError where its size is not that of its samples."""
        head = _fields("frame", "<xIIBIBBBB", payload[:18])
        number, num_chirps, num_rx, num_samples, rx_mask, data_format, resolution, is_interleaved = head
        if data_format > 2 or not 1 <= resolution <= 16 or is_interleaved > 1:
            raise ProtocolError(
                f"ComLib frame: expected data format 0 to 2, 1 to 16 bits, interleaved 0 or 1, "
                f"got {data_format}, {resolution}, {is_interleaved}"
            )
        shape = (num_rx, num_chirps, num_samples, 2 if data_format else 1)
        num_codes = num_rx * num_chirps * num_samples * shape[3]
        size = 18 + -(-num_codes * resolution // 8)
        if len(payload) != size:
            raise ProtocolError(
                f"ComLib frame: expected {size} bytes for [rx, chirp, sample] {shape[:3]}, got {len(payload)}"
            )
        # Axes in the order of the wire, then in ours.
        axes = _WIRE_AXES[bool(is_interleaved), data_format]
        codes = unpack_bits(payload[18:], num_codes, resolution).reshape([shape[axis] for axis in axes])
        codes = np.ascontiguousarray(codes.transpose(np.argsort(axes)))
        return cls(number, codes, rx_mask, data_format, resolution, bool(is_interleaved))


_WIRE_AXES = {
    # (is_interleaved, data_format): axes of [rx, chirp, sample, part] from the outermost
    (False, 0): (1, 0, 2, 3),
    (False, 1): (1, 0, 3, 2),
    (False, 2): (1, 0, 2, 3),
    (True, 0): (1, 2, 0, 3),
    (True, 1): (1, 3, 2, 0),
    (True, 2): (1, 2, 0, 3),
}


def pack_bits(codes: NDArray[np.uint16], resolution: int) -> bytes:
    """Codes of `resolution` bits in a row, the lowest bit of the first code in the lowest bit of the first byte."""
    bits = codes.astype("<u2")[:, None].view(np.uint8)
    rows = np.unpackbits(bits, axis=1, bitorder="little")[:, :resolution]
    return np.packbits(rows, bitorder="little").tobytes()


def unpack_bits(data: bytes, num_codes: int, resolution: int) -> NDArray[np.uint16]:
    """Codes that `pack_bits` put in a row, (num_codes,)."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8), count=num_codes * resolution, bitorder="little")
    rows = np.zeros((num_codes, 16), np.uint8)
    rows[:, :resolution] = bits.reshape(num_codes, resolution)
    return np.packbits(rows, axis=1, bitorder="little").view("<u2")[:, 0].astype(np.uint16)


def _pack(name: str, layout: str, *numbers: int) -> bytes:
    try:
        return struct.pack(layout, *numbers)
    except struct.error as error:
        raise ValueError(f"ComLib {name}: {error}, got {numbers}") from None


def _fields(name: str, layout: str, payload: bytes, *, has_text: bool = False) -> tuple[Any, ...]:
    """Fields of a payload of exactly that layout, or with a zero-terminated text behind them."""
    size = struct.calcsize(layout)
    if len(payload) < size or (len(payload) > size and not has_text):
        raise ProtocolError(f"ComLib {name}: expected {size} bytes{' or more' * has_text}, got {len(payload)}")
    fields = struct.unpack_from(layout, payload)
    return (*fields, payload[size:].split(b"\0", 1)[0].decode(errors="replace")) if has_text else fields
