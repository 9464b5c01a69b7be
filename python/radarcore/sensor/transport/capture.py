"""Conversations with a board on disk: written while they happen, and played as if the board were there.

A capture is a text file of JSON lines. The first is the header: ``format``, ``version``, ``stream`` (name of the port)
and ``started`` (seconds since 1970). Each of the others has ``time`` (seconds since the start), ``direction``
("write" or "read") and ``bytes`` in hexadecimal.
"""

from __future__ import annotations

import json
import os
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from radarcore import check, notice
from radarcore.sensor.errors import ProtocolError, SensorDisconnectedError
from radarcore.sensor.transport.stream import Stream

FORMAT = "radarcore capture"
VERSION = 1
DIRECTIONS = ("write", "read")


class _Event(NamedTuple):
    """Bytes sent or received together."""

    time: float
    direction: str
    data: bytes


class Capture:
    """A stream that writes down every byte of another one.

    A write that fails (a full disk) is a warning. The file then ends with its last whole line; the conversation
    continues without it.

    Parameters
    ----------
    stream : Stream
        The wrapped stream; both are closed together.
    path : path
        File that is made, or overwritten. A line is complete on disk before its bytes are returned.

    Raises
    ------
    OSError
        The file cannot be made.
    """

    def __init__(self, stream: Stream, path: str | os.PathLike[str]) -> None:
        self.name: str = stream.name
        self._stream = stream
        self._start = time.monotonic()
        self._path = Path(path)
        self._file = self._path.open("wb", buffering=0)
        self._num_whole = 0  # bytes of whole lines
        self._write_line({"format": FORMAT, "version": VERSION, "stream": stream.name, "started": time.time()})

    def read(self, size: int, timeout: float) -> bytes:
        """Received bytes, 1 to `size`; none if none came within `timeout` [s]."""
        data = self._stream.read(size, timeout)
        self._note("read", data)
        return data

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of `data`, or raise `SensorTimeoutError` when `timeout` [s] is over."""
        self._note("write", data)
        self._stream.write(data, timeout)

    def close(self) -> None:
        """Close the stream and the file; may be called twice."""
        self._stream.close()
        self._file.close()

    def _note(self, direction: str, data: bytes) -> None:
        if data:
            elapsed = round(time.monotonic() - self._start, 6)
            self._write_line({"time": elapsed, "direction": direction, "bytes": bytes(data).hex()})

    def _write_line(self, line: dict[str, Any]) -> None:
        if self._file.closed:
            return
        data = memoryview(f"{json.dumps(line)}\n".encode())
        num_whole = self._num_whole + len(data)
        try:
            while data:  # a full disk accepts only a part
                data = data[self._file.write(data) :]
            self._num_whole = num_whole
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self._num_whole)
            self._file.close()
            notice.warn(f"{self._path}: {error.strerror}; the capture ends here", RuntimeWarning)


class Replay:
    """A stream that replays a capture: recorded reads come once the writes before them have been made.

    Times are not stored: possible answers come at once. A write that differs from the recorded one is a
    `ProtocolError`. At the end of the capture the stream is like a board that is unplugged.

    Parameters
    ----------
    path : path
        The capture.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        The file is no capture, or is damaged or cut off; the message has the line.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.name: str = os.fspath(path)
        self._events = deque(_events(Path(path)))
        self._num_written = 0  # bytes of the next recorded write that have been made
        self._come: deque[bytes] = deque()  # bytes read before that write
        self._closed = False
        self._advance()

    def read(self, size: int, timeout: float) -> bytes:
        """1 to `size` bytes of one recorded read; none if another write is to be made first."""
        self._check_open()
        if not self._come:
            if not self._events:
                raise SensorDisconnectedError(f"{self.name}: the capture ends here")
            time.sleep(timeout)
            return b""
        data = self._come.popleft()
        if len(data) > size:
            self._come.appendleft(data[size:])
        return data[:size]

    def write(self, data: bytes, timeout: float) -> None:
        """Compare with the recorded writes; reads recorded after them become available."""
        del timeout
        self._check_open()
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
            if length == len(expected):
                self._num_written = 0
                self._events.popleft()
                self._advance()

    def close(self) -> None:
        """End the replay; may be called twice."""
        self._closed = True

    def _advance(self) -> None:
        """Release the reads that come before the next write."""
        while self._events and self._events[0].direction != "write":
            self._come.append(self._events.popleft().data)

    def _check_open(self) -> None:
        if self._closed:
            raise SensorDisconnectedError(f"{self.name}: the port has been closed")


def _events(path: Path) -> list[_Event]:
    """Events of a capture, in order."""
    *lines, rest = path.read_bytes().split(b"\n")
    if rest or not lines:
        raise ValueError(f"{path}: line {len(lines) + 1}: the file is cut off within the line")
    events = []
    for number, line in enumerate(lines, 1):
        expected = "time, direction and bytes" if number > 1 else f"the header of a {FORMAT} of version {VERSION}"
        try:
            record = json.loads(line)
            if number > 1:
                events.append(_event(record))
            elif (record["format"], record["version"]) != (FORMAT, VERSION):
                raise ValueError("another format or version")
        except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
            raise ValueError(f"{path}: line {number}: expected {expected}, got {line[:60]!r} ({error})") from error
    return events


def _event(record: dict[str, Any]) -> _Event:
    direction = check.choice("direction", record["direction"], DIRECTIONS)
    data = bytes.fromhex(record["bytes"])
    if not data:
        raise ValueError("expected at least one byte, got none")
    return _Event(check.number("time", record["time"], "s"), direction, data)


def _shown(data: bytes) -> str:
    """Bytes for a message: the first in hexadecimal, and how many there are."""
    return f"{data[:32].hex(' ')}{' ...' if len(data) > 32 else ''} ({len(data)} bytes)"
