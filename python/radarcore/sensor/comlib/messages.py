"""ComLib messages: between bytes and records, for both ends of the wire.

The host asks with one payload message to an endpoint of the board; the board answers with any number of payload
messages and then one status of that endpoint. A payload begins with the code of the message. Numbers are
little-endian. There is no checksum: who loses step waits for silence.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Generic, TypeVar

from radarcore.sensor.comlib.codes import ProtocolStatus
from radarcore.sensor.comlib.payloads import pack

MAX_PAYLOAD = 0xFFFF
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
        """Bytes on the wire; ValueError if endpoint or payload do not fit."""
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
        """Bytes on the wire; ValueError if a number does not fit."""
        return pack("status", "<BBH", STATUS_START, self.endpoint, self.status)


@dataclass(frozen=True)
class Damage:
    """Bytes that the host's parser discarded, with the reason."""

    num_bytes: int
    reason: str


Found = TypeVar("Found")


class _Parser(Generic[Found]):
    """Parser of messages in a byte stream; after an error everything is discarded up to a silence."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._is_confused = False

    @property
    def is_idle(self) -> bool:
        """True when the next byte begins a message."""
        return not (self._buffer or self._is_confused)

    @property
    def num_held(self) -> int:
        """Bytes of a message that is not yet whole."""
        return len(self._buffer)

    def reset(self) -> None:
        """Expect a message with the next byte: the line has been silent."""
        self._buffer.clear()
        self._is_confused = False

    def feed(self, data: bytes) -> list[Found]:
        """Messages and errors that these bytes complete, in order."""
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
        """Discard bytes."""


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
        """Status that the board reports when no byte has come for its time-out; it then expects a message."""
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
