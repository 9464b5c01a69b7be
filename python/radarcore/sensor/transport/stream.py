"""Connections to a board: byte streams, or vendor requests with bulk packets; and the base of all streams."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from time import monotonic
from typing import Protocol

from radarcore import check
from radarcore.sensor.errors import ProtocolError, SensorDisconnectedError, SensorTimeoutError

SLICE = 0.05
"""Longest wait in the operating system [s]: so long a `close` waits for a `read` of another thread."""

_SILENCE = 0.02
"""Silence that ends the discarding of received bytes [s]: two 8 ms latency timers of a USB bridge."""

_DISCARD_TIME = 0.2
"""Longest time of throwing away [s]: a board that measures never falls silent."""


class Stalled(ProtocolError):  # noqa: N818  # the USB term
    """The board refused a USB transfer (a STALL)."""


class Stream(Protocol):
    """A connection that carries bytes in both directions, cut anywhere.

    One thread may read while another writes and a third closes. What is unplugged or closed raises
    `SensorDisconnectedError`, also in a call that is under way.
    """

    name: str

    def read(self, size: int, timeout: float) -> bytes:
        """Received bytes, 1 to `size`; none if none came within `timeout` [s]."""

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of `data`, or raise `SensorTimeoutError` when `timeout` [s] is over."""

    def discard(self) -> None:
        """Discard received bytes, until the line is silent but for 0.2 s at most."""

    def close(self) -> None:
        """Give the port back; may be called twice."""


class VendorPort(Protocol):
    """A USB device that is spoken to in control transfers and answers there and in bulk packets.

    Threads and unplugging are as with `Stream`. A transfer that the board refuses raises `Stalled`, one that it does
    not answer within `timeout` [s] `SensorTimeoutError`.
    """

    name: str
    product: str

    def control_write(
        self, request_type: int, request: int, value: int, index: int, data: bytes, timeout: float
    ) -> None:
        """A control transfer to the board."""

    def control_read(
        self, request_type: int, request: int, value: int, index: int, length: int, timeout: float
    ) -> bytes:
        """A control transfer from the board, at most `length` bytes."""

    def read_packet(self, size: int, timeout: float) -> bytes:
        """Bulk transfer of at most `size` bytes; none when none came within `timeout` [s]."""

    def close(self) -> None:
        """Give the device back; may be called twice."""


def drained(stream: Stream) -> bytes:
    """Bytes waiting in a stream, read until it falls silent, for 0.2 s at most."""
    data = bytearray()
    deadline = monotonic() + _DISCARD_TIME
    while monotonic() < deadline and (chunk := stream.read(65536, _SILENCE)):
        data += chunk
    return bytes(data)


class ByteStream(ABC):
    """The part that streams of all kinds share: deadlines, partial transfers, and closing while others wait."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._closed = threading.Event()
        self._reading = threading.Lock()
        self._writing = threading.Lock()

    def read(self, size: int, timeout: float) -> bytes:
        """Received bytes, 1 to `size`; none if none came within `timeout` [s]."""
        size = check.count("size", size)
        deadline = monotonic() + check.non_negative("timeout", timeout, "s")
        with self._reading:
            while True:
                self._check_open()
                data = self._read_some(size, max(deadline - monotonic(), 0.0))
                if data or monotonic() >= deadline:
                    return data

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of `data`, or raise `SensorTimeoutError` when `timeout` [s] is over."""
        deadline = monotonic() + check.non_negative("timeout", timeout, "s")
        num_sent = 0
        with self._writing:
            while num_sent < len(data):
                self._check_open()
                num_sent += self._write_some(data[num_sent : num_sent + 4096], max(deadline - monotonic(), 0.0))
                if num_sent < len(data) and monotonic() >= deadline:
                    raise SensorTimeoutError(
                        f"{self.name}: the board took {num_sent} of {len(data)} bytes in {timeout:g} s"
                    )

    def discard(self) -> None:
        """Discard received bytes, until the line is silent but for 0.2 s at most."""
        drained(self)

    def close(self) -> None:
        """Give the port back; may be called twice."""
        self._closed.set()
        with self._reading, self._writing:
            self._give_back()

    def _check_open(self) -> None:
        if self._closed.is_set():
            raise SensorDisconnectedError(f"{self.name}: the port has been closed")

    @abstractmethod
    def _read_some(self, size: int, timeout: float) -> bytes:
        """Received bytes, at most `size`; may return none early, and must return within about `SLICE`."""

    @abstractmethod
    def _write_some(self, data: bytes, timeout: float) -> int:
        """Send a part of `data` and return its length; may return 0 early, as `_read_some`."""

    @abstractmethod
    def _give_back(self) -> None:
        """Release the port; called more than once."""
