"""Numbers of ComLib: types of endpoints, their messages, and states."""

from __future__ import annotations

from enum import IntEnum


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
    """Sampled part of the beat signal."""

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
