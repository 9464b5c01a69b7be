"""Strata requests and data packets over a port, which one thread reads as fast as packets come."""

from __future__ import annotations

import queue
import threading
import time
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import Protocol

from radarcore.sensor.errors import (
    CaptureError,
    ProtocolError,
    RequestError,
    SensorDisconnectedError,
    SensorError,
    SensorTimeoutError,
)
from radarcore.sensor.strata import packets as strata
from radarcore.sensor.strata.byte_stream import Damage, HostParser
from radarcore.sensor.strata.damage import DamageCount
from radarcore.sensor.strata.packets import Code, DataPacket, Info, Kind, Request, Response, Status
from radarcore.sensor.transport import Stalled, Stream, VendorPort

REQUEST_TIMEOUT = 1.0
"""Time-out of the first answer to a request [s], as the vendor's own host has it."""

RETRIES = 2
"""Requests are made again: where an answer is damaged, that costs less than a measurement."""

# A board that has not answered at all is asked once, and waited for so long [s], until something comes from it.
_SILENT_TIMEOUT = 0.3
# An answer to a request that was given up is waited for so long, lest it be taken for that of the next one.
_LATE = 0.1
_READ_SIZE = 512 * 31
# Bytes of a data packet come one after the other. One that takes longer [s] has a damaged length.
_SLOWEST_PACKET = 0.25
# Bytes are waited for so long at once.
_POLL = 0.1
# Silence that ends the discarding of packets [s]. A stream brings all that was sent before an answer before it, and
# there is little to wait for; a vendor's packets have an endpoint of their own, which may be behind the answers.
_STREAM_QUIET = 0.02
_VENDOR_QUIET = 0.1
# Packets kept for whoever takes them: several seconds of any frames.
_MOST_PACKETS = 4096

DAMAGED = range(Status.HEADER_INCOMPLETE, Status.REQUEST_TYPE_INVALID + 1)
"""Status of requests that were damaged on their way."""


class Link(Protocol):
    """Requests to a board, and the data packets it sends."""

    name: str
    most_payload: int

    def ask(self, request: Request, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> bytes:
        """Payload of the answer; `RequestError` where the board refuses, `SensorTimeoutError` where it is silent.

        The first answer is waited for up to `timeout` [s], those to all retries together once more as long.
        """

    def packets(self, timeout: float) -> list[DataPacket | Damage]:
        """Data packets since the last call, and damage among them; waits for the first up to `timeout` [s]."""

    @property
    def num_held(self) -> int:
        """Bytes that have come, of packets that are not yet whole."""

    def discard(self) -> None:
        """Discard data packets until none come any more."""

    def close(self) -> None:
        """Give the port back."""


class _Inbox:
    """Data packets on their way from the thread that reads to the one that takes them."""

    def __init__(self) -> None:
        # Not `Queue`, whose lock may stay locked where Ctrl-C meets its code.
        self._queue: queue.SimpleQueue[DataPacket | Damage | SensorError] = queue.SimpleQueue()
        self._failure: SensorError | None = None

    def put(self, item: DataPacket | Damage) -> None:
        """Keep a packet if there is room; otherwise the counter of the next packet shows the loss."""
        if self._queue.qsize() < _MOST_PACKETS:
            self._queue.put(item)

    def fail(self, error: SensorError) -> None:
        """End of the packets."""
        self._failure = error
        self._queue.put(error)

    def check(self) -> None:
        failure = self._failure
        if failure is not None:
            if isinstance(failure, CaptureError):
                self._failure = None  # raised once: the board still works
            raise type(failure)(*failure.args) from failure

    def take(self, timeout: float) -> list[DataPacket | Damage]:
        items: list[DataPacket | Damage] = []
        try:
            item = self._queue.get(timeout=timeout) if timeout > 0.0 else self._queue.get_nowait()
            while not isinstance(item, SensorError):
                items.append(item)
                item = self._queue.get_nowait()
        except queue.Empty:
            return items
        if items or not isinstance(item, CaptureError):
            self._queue.put(item)  # for the next call as well
        if not items:
            self.check()
        return items

    def discard(self, quiet: float) -> None:
        deadline = time.monotonic() + 2.0
        with suppress(SensorDisconnectedError):  # nothing more will come; the next request tells
            while time.monotonic() < deadline and self.take(quiet):
                pass


class _Reading(ABC):
    """Base of both links: a thread that polls the port, and the packets it has found."""

    _quiet: float
    """Silence that ends the discarding of packets [s]."""

    def __init__(self, port: Stream | VendorPort) -> None:
        self.name: str = port.name
        self._inbox = _Inbox()
        self._asking = threading.Lock()
        self._closing = port.close
        self._is_closed = False
        self._is_silent = False
        """True once a board has not answered at all, until something comes from it."""
        self._thread = threading.Thread(target=self._read, name="radarcore-read", daemon=True)
        self._thread.start()

    def packets(self, timeout: float) -> list[DataPacket | Damage]:
        """Data packets since the last call, and damage among them."""
        return self._inbox.take(timeout)

    def discard(self) -> None:
        """Discard data packets until none come any more."""
        self._inbox.discard(self._quiet)

    def close(self) -> None:
        """Close the port, which ends what the thread waits for, and the thread."""
        if self._is_closed:
            return
        self._is_closed = True
        try:
            self._closing()
        finally:
            self._thread.join()

    @abstractmethod
    def _poll(self) -> None:
        """Wait a little for packets, and sort them."""

    def _read(self) -> None:
        try:
            while not self._is_closed:
                try:
                    self._poll()
                except CaptureError as error:
                    self._inbox.fail(error)
        except SensorError as error:
            self._inbox.fail(error)


class StreamLink(_Reading):
    """Link over a byte stream: responses and data packets share it."""

    most_payload = strata.MAX_REQUEST_PAYLOAD
    _quiet = _STREAM_QUIET

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self._parser = HostParser()
        self._parser_lock = threading.Lock()
        self._responses: queue.SimpleQueue[Response] = queue.SimpleQueue()
        self._damage = DamageCount()  # since the last request was sent
        self._fed = time.monotonic()  # when the parser has last made something of its bytes
        self._num_due = 0  # answers to come; of interrupted requests too
        super().__init__(stream)

    @property
    def num_held(self) -> int:
        """Bytes that have come, of packets that are not yet whole."""
        return self._parser.num_held

    def ask(self, request: Request, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> bytes:
        """Send a request and wait for its answer."""
        with self._asking:
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

    def _response(self, request: Request, timeout: float, total: float) -> Response:
        """Response that comes within `timeout` [s]; `total` is that of all tries, which the error names."""
        self._inbox.check()
        self._forget_answers()
        self._num_due += 1
        self._damage = DamageCount()
        self._stream.write(strata.encode_request(request), timeout)
        deadline = time.monotonic() + timeout
        while True:
            try:
                response = self._responses.get(timeout=min(_POLL, max(deadline - time.monotonic(), 1e-3)))
                self._num_due -= 1
                return response
            except queue.Empty:
                self._inbox.check()
                if time.monotonic() >= deadline:
                    with self._parser_lock:
                        damage = self._damage.text(self.num_held)
                        self._parser.reset()
                    raise SensorTimeoutError(
                        f"{self.name}: no answer to {_text(request)} within {total:g} s"
                        f"{'; ' + damage if damage else ''}"
                    ) from None

    def _forget_answers(self) -> None:
        """Throw away answers to requests that were given up."""
        with suppress(queue.Empty):
            while self._num_due > 0:
                self._responses.get(timeout=_LATE)
                self._num_due -= 1
        self._num_due = 0
        with suppress(queue.Empty):
            while True:
                self._responses.get_nowait()

    def _poll(self) -> None:
        data = self._stream.read(_READ_SIZE, _POLL)
        if data:
            self._is_silent = False
        with self._parser_lock:
            found = self._parser.feed(data)
            now = time.monotonic()
            if not found and self.num_held and now - self._fed > _SLOWEST_PACKET:
                found = self._parser.doubt()
            if found or not self.num_held:
                self._fed = now
        for item in found:
            if isinstance(item, Response):
                self._responses.put(item)
                continue
            if isinstance(item, Damage):
                self._damage.add(item)
            self._inbox.put(item)


class VendorLink(_Reading):
    """Link over vendor requests and a bulk endpoint."""

    most_payload = strata.MAX_CONTROL_PAYLOAD
    num_held = 0
    _quiet = _VENDOR_QUIET

    def __init__(self, port: VendorPort) -> None:
        self._port = port
        super().__init__(port)

    def ask(self, request: Request, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> bytes:
        """Send a request and fetch its answer; transfers of USB have retries of their own."""
        del retries
        with self._asking:
            self._inbox.check()
            try:
                answer = self._answer(request, min(timeout, _SILENT_TIMEOUT) if self._is_silent else timeout)
            except SensorTimeoutError:
                self._is_silent = True
                raise
            self._is_silent = False
            return answer

    def _answer(self, request: Request, timeout: float) -> bytes:
        where = (request.request, request.value, request.index)
        try:
            if request.kind == Kind.READ:
                answer = self._port.control_read(Kind.READ, *where, request.length, timeout)
                return _payload(self.name, request, Response(request.kind, 0, answer))
            self._port.control_write(request.kind, *where, request.payload, timeout)
            if request.kind == Kind.TRANSFER:
                return self._port.control_read(Kind.FETCH, *where, self.most_payload, timeout)
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

    def _poll(self) -> None:
        data = self._port.read_packet(strata.MAX_DATA_PACKET, _POLL)
        if not data:
            return
        self._is_silent = False
        try:
            self._inbox.put(strata.decode_data(data))
        except ProtocolError as error:
            self._inbox.put(Damage(len(data), str(error), Status.BAD_PAYLOAD))


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
    return RequestError(f"{name}: the board refuses {_text(request)}: {strata.status_text(status)}", status)


def _text(request: Request) -> str:
    return f"request 0x{request.request:02X} (value 0x{request.value:04X}, index 0x{request.index:04X})"
