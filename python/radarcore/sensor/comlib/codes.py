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
    IRDR = 0x69524452
    """The one endpoint of the firmware of 2016/17, whose messages are others."""


class Protocol(IntEnum):
    """Codes of endpoint 0, the protocol itself."""

    ENDPOINTS = 0x00
    FIRMWARE = 0x01


class Base(IntEnum):
    """Codes of an RBAS endpoint. ``GET_`` asks for the code behind it."""

    FRAME = 0x00
    GET_FRAME = 0x01
    SET_INTERVAL = 0x02
    GET_INFO = 0x22
    INFO = 0x23
    GET_TEMPERATURE = 0x30
    TEMPERATURE = 0x31
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
    """Direction of the chirps of a frame; boards can alternate, too."""

    UP = 0
    DOWN = 1


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
    """Status of endpoint 0: faults of the stream."""

    OK = 0x0000
    SILENCE = 0x0001
    BAD_START = 0x0002
    NO_SUCH_ENDPOINT = 0x0003
    EMPTY_PAYLOAD = 0x0005
    PAYLOAD_TOO_LARGE = 0x0006
    BAD_END_MARKER = 0x0007
    UNKNOWN_MESSAGE = 0xFFFF


def status_text(endpoint: int, code: int) -> str:
    """Name and number of a status, for messages: ``busy (0x0002)``; endpoint 0 has names of its own."""
    names: type[IntEnum] = Status if endpoint else ProtocolStatus
    if code not in {status.value for status in names}:
        return f"unknown status (0x{code:04X})"
    return f"{names(code).name.lower().replace('_', ' ').replace('tx', 'TX')} (0x{code:04X})"
