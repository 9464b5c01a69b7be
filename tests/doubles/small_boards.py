"""Small boards for tests of what carries bytes, and calls that must not hang."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import pytest

from doubles.usb_bus import Stall

HANG = 20.0
"""Longest time of any call [s]; none takes a tenth of it."""


class Loopback:
    """A board that sends back what it receives; `queue` puts transfers or exceptions before that."""

    def __init__(self, *transfers: bytes | type[Exception]) -> None:
        self.received = bytearray()
        self.transfers = list(transfers)
        self.echo = bytearray()
        self.num_asked = 0
        self.changed = threading.Condition()

    def receive(self, data: bytes) -> None:
        with self.changed:
            self.received += data
            self.echo += data
            self.changed.notify_all()

    def queue(self, *transfers: bytes | type[Exception]) -> None:
        with self.changed:
            self.transfers += transfers
            self.changed.notify_all()

    def send(self, size: int, timeout: float) -> bytes:
        with self.changed:
            self.num_asked += 1
            self.changed.wait_for(lambda: self.transfers or self.echo, timeout)
            if self.transfers:
                transfer = self.transfers.pop(0)
                if isinstance(transfer, bytes):
                    return transfer
                raise transfer
            data = bytes(self.echo[:size])
            del self.echo[:size]
            return data

    def hang_up(self) -> None:
        """Received data is still sent back."""


class Requests:
    """A vendor board: keeps what is written under (request, value, index), and sends transfers."""

    def __init__(self, *transfers: bytes | type[Exception]) -> None:
        self.values: dict[tuple[int, int, int], bytes] = {}
        self.types: list[int] = []
        self.bulk = Loopback(*transfers)
        self.send = self.bulk.send
        self.failure: type[Exception] | None = None

    def control_out(self, request_type: int, request: int, value: int, index: int, data: bytes) -> None:
        if self.failure is not None:
            raise self.failure
        self.types.append(request_type)
        self.values[request, value, index] = data

    def control_in(self, request_type: int, request: int, value: int, index: int, length: int) -> bytes:
        if self.failure is not None:
            raise self.failure
        self.types.append(request_type)
        if (request, value, index) not in self.values:
            raise Stall
        return self.values[request, value, index][:length]


def list_serial_ports(monkeypatch: pytest.MonkeyPatch, *paths: str, ids: tuple[int, int] | None = None) -> list[Any]:
    """Let the system list serial ports, all with the same USB ids or none; their descriptions."""
    from serial.tools import list_ports
    from serial.tools.list_ports_common import ListPortInfo

    ports = [ListPortInfo(path) for path in paths]
    for port in ports:
        port.vid, port.pid = ids or (None, None)
    monkeypatch.setattr(list_ports, "comports", lambda: ports)
    return ports


@contextmanager
def other_user() -> Iterator[None]:
    """Be another user for a time, if root, because root may open everything."""
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)
    try:
        yield
    finally:
        if is_root:
            os.seteuid(0)


def is_soon(condition: Callable[[], Any]) -> bool:
    """True once a condition is met, False if it is not for long."""
    deadline = time.monotonic() + HANG
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return bool(condition())


class Call:
    """A function that runs in a thread of its own."""

    def __init__(self, function: Callable[[], Any]) -> None:
        self._future = Future[Any]()
        threading.Thread(target=self._run, args=(function,), daemon=True).start()

    def _run(self, function: Callable[[], Any]) -> None:
        try:
            self._future.set_result(function())
        except BaseException as error:
            self._future.set_exception(error)

    @property
    def is_running(self) -> bool:
        return not self._future.done()

    def result(self) -> Any:
        return self._future.result(HANG)


def pieces(data: bytes, places: Sequence[int]) -> list[bytes]:
    """Data cut at places, modulo their number."""
    cuts = sorted({0, len(data), *(place % (len(data) + 1) for place in places)})
    return [data[a:b] for a, b in pairwise(cuts)]


def read_all(stream: Any, size: int) -> bytes:
    """`size` bytes of a stream, or what has come when nothing more comes."""
    data = b""
    while len(data) < size and (chunk := stream.read(size - len(data), HANG / 4)):
        data += chunk
    return data
