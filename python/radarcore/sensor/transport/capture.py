"""Conversations with a board on disk: written while they happen, and played as if the board were there.

A capture is a text file of JSON lines. The first is the header: ``format``, ``version``, ``stream`` (name of the port)
and ``started`` (seconds since 1970). Each of the others has ``time`` (seconds since the start), ``direction``
("write", "read", or "discard" for what came and was thrown away) and ``bytes`` in hexadecimal.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from radarcore import check
from radarcore.sensor.errors import CaptureError, ProtocolError, SensorDisconnectedError
from radarcore.sensor.transport.stream import Stream, drained

FORMAT = "radarcore capture"
VERSION = 1
DIRECTIONS = ("write", "read", "discard")


class _Event(NamedTuple):
    """Bytes sent or received together."""

    time: float
    direction: str
    data: bytes


class Capture:
    """A stream that writes down every byte of another one.

    Parameters
    ----------
    stream : Stream
        The one that is used; it is closed together with this one.
    path : path
        File that is made, or overwritten. A line is complete on disk before its bytes are returned.

    Raises
    ------
    OSError
        The file cannot be made.
    CaptureError
        Once, in the call after a failed write (a full disk). The file then ends with its last whole line; the
        conversation goes on without it.
    """

    def __init__(self, stream: Stream, path: str | os.PathLike[str]) -> None:
        self.name: str = stream.name
        self._stream = stream
        self._start = time.monotonic()
        self._lock = threading.Lock()
        self._path = Path(path)
        self._file = self._path.open("wb", buffering=0)
        self._num_whole = 0  # bytes of whole lines
        self._is_closed = False
        self._failure: CaptureError | None = None
        self._write_line({"format": FORMAT, "version": VERSION, "stream": stream.name, "started": time.time()})

    def read(self, size: int, timeout: float) -> bytes:
        """Received bytes, 1 to `size`; none if none came within `timeout` [s]."""
        self._raise_once()
        data = self._stream.read(size, timeout)
        self._note("read", data)
        return data

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of `data`, or raise `SensorTimeoutError` when `timeout` [s] is over."""
        self._raise_once()
        # Noted before it is sent, since another thread may have the answer before this one goes on.
        self._note("write", data)
        self._stream.write(data, timeout)

    def discard(self) -> None:
        """Discard received bytes, as the stream does; it is written down nevertheless."""
        self._raise_once()
        self._note("discard", drained(self._stream))

    def close(self) -> None:
        """Close the stream and the file; may be called twice."""
        self._stream.close()
        with self._lock:
            self._is_closed = True
            self._file.close()

    def _note(self, direction: str, data: bytes) -> None:
        if data:
            elapsed = round(time.monotonic() - self._start, 6)
            self._write_line({"time": elapsed, "direction": direction, "bytes": bytes(data).hex()})

    def _write_line(self, line: dict[str, Any]) -> None:
        with self._lock:
            if self._is_closed:
                raise SensorDisconnectedError(f"{self.name}: the port has been closed")
            if self._file.closed:
                return
            data = memoryview(f"{json.dumps(line)}\n".encode())
            num_whole = self._num_whole + len(data)
            try:
                while data:  # a full disk accepts only a part
                    data = data[self._file.write(data) :]
                self._num_whole = num_whole
            except OSError as error:
                self._failure = CaptureError(f"{self._path}: {error.strerror}; the capture ends here")
                with suppress(OSError):
                    self._file.truncate(self._num_whole)
                self._file.close()

    def _raise_once(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure


class Replay:
    """A stream that replays a capture: recorded reads come once the writes before them have been made.

    Times are not kept: what may come comes at once. At the end of the capture the stream is like a board that is
    unplugged.

    Parameters
    ----------
    path : path
        The capture.
    checks_writes : bool
        A write that differs from the recorded one is a `ProtocolError`. If not checked, every write stands for the
        next recorded one.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        The file is no capture, or is damaged or cut off; the message has the line.
    """

    def __init__(self, path: str | os.PathLike[str], *, checks_writes: bool = True) -> None:
        self.name: str = os.fspath(path)
        self._checks_writes = checks_writes
        self._events = deque(_events(Path(path)))
        self._num_written = 0  # bytes of the next recorded write that have been made
        self._come: deque[_Event] = deque()  # what was read or thrown away before that write
        self._closed = False
        self._changed = threading.Condition()
        self._advance()

    def read(self, size: int, timeout: float) -> bytes:
        """1 to `size` bytes of one recorded read; none if another write is to be made first."""
        size = check.count("size", size)
        timeout = check.non_negative("timeout", timeout, "s")
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._has_read() or not self._events, timeout)
            self._check_open()
            if not self._has_read():
                if self._events:
                    return b""
                raise SensorDisconnectedError(f"{self.name}: the capture ends here")
            event = self._come.popleft()
            if len(event.data) > size:
                self._come.appendleft(event._replace(data=event.data[size:]))
            return event.data[:size]

    def write(self, data: bytes, timeout: float) -> None:
        """Compare with the recorded writes; reads recorded after them become available."""
        check.non_negative("timeout", timeout, "s")
        with self._changed:
            self._check_open()
            if not self._checks_writes:
                if self._events:
                    self._events.popleft()
                    self._advance()
                return
            while data:
                if not self._events:
                    raise ProtocolError(f"{self.name}: expected no further write, got {_shown(data)}")
                event = self._events[0]
                expected = event.data[self._num_written :]
                length = min(len(data), len(expected))
                if data[:length] != expected[:length]:
                    raise ProtocolError(
                        f"{self.name}: expected the write of {event.time:g} s, {_shown(expected)}, got {_shown(data)}"
                    )
                data = data[length:]
                self._num_written += length
                if self._num_written == len(event.data):
                    self._num_written = 0
                    self._events.popleft()
                    self._advance()

    def discard(self) -> None:
        """Discard the bytes discarded in the capture; without such, all that may be read."""
        with self._changed:
            while self._come and self._come.popleft().direction == "read":
                pass

    def close(self) -> None:
        """End the replay; may be called twice."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _has_read(self) -> bool:
        """True when something may be read; discarded bytes before it are skipped."""
        while self._come and self._come[0].direction == "discard":
            self._come.popleft()
        return bool(self._come)

    def _advance(self) -> None:
        """Release the reads that come before the next write."""
        while self._events and self._events[0].direction != "write":
            self._come.append(self._events.popleft())
        with self._changed:  # the lock may be taken again by its own thread
            self._changed.notify_all()

    def _check_open(self) -> None:
        if self._closed:
            raise SensorDisconnectedError(f"{self.name}: the port has been closed")


def _events(path: Path) -> list[_Event]:
    """Events of a capture, in order."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: expected a capture of text lines, got other data ({error})") from error
    lines = text.split("\n")
    if lines.pop():
        raise ValueError(f"{path}: line {len(lines) + 1}: the file is cut off within the line")
    header = _record(path, 1, lines[0] if lines else "")
    if header.get("format") != FORMAT:
        raise ValueError(f"{path}: expected a header with the format {FORMAT!r}, got {header.get('format')!r}")
    if header.get("version") != VERSION:
        raise ValueError(f"{path}: expected version {VERSION}, got {header.get('version')!r}")
    return [_event(path, number, line) for number, line in enumerate(lines[1:], 2)]


def _record(path: Path, number: int, line: str) -> dict[str, Any]:
    try:
        record = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: line {number}: expected JSON, got {line[:60]!r}") from error
    if not isinstance(record, dict):
        raise ValueError(f"{path}: line {number}: expected a JSON object, got {line[:60]!r}")
    return record


def _event(path: Path, number: int, line: str) -> _Event:
    record = _record(path, number, line)
    try:
        direction = check.choice("direction", record["direction"], DIRECTIONS)
        data = bytes.fromhex(record["bytes"])
        event = _Event(check.number("time", record["time"], "s"), direction, data)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{path}: line {number}: expected time, direction and bytes: {error}") from error
    if not data:
        raise ValueError(f"{path}: line {number}: expected at least one byte, got none")
    return event


def _shown(data: bytes) -> str:
    """Bytes for a message: the first in hexadecimal, and how many there are."""
    return f"{data[:32].hex(' ')}{' ...' if len(data) > 32 else ''} ({len(data)} bytes)"
