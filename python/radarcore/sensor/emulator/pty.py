"""A board behind a pseudo terminal, for programs that open serial ports."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Protocol

from radarcore.sensor.errors import SensorError

_WAIT = 0.05
"""Longest wait of the threads [s], after which they see that the port is closed."""

_NOBODY = 0.01
"""Time between looks for a client [s], while there is none."""

_SILENCE = 0.005
"""Silence after which nothing is left in the terminal's buffers [s]."""


class Unplugged(Exception):  # noqa: N818  # what has happened
    """The board is gone from its port."""


class StreamPeripheral(Protocol):
    """A board behind a byte stream: CDC or UART. Calls raise `Unplugged` when it is gone, in any thread."""

    def receive(self, data: bytes) -> None:
        """Bytes from the host, cut anywhere."""

    def send(self, size: int, timeout: float) -> bytes:
        """Bytes of one transfer to the host: 1 to `size`, none when nothing is to be sent within `timeout` [s]."""

    def hang_up(self) -> None:
        """The client has gone: forget incomplete requests and unsent answers, and go on."""


class PtyPort:
    """A pty with a board at its other end, from now until `close` or until the board is unplugged.

    Clients may come and go. Without a client, the board gets no requests; while a client does not read, only until
    the terminal's own buffer is full, and then its requests wait too. Partial requests and unread answers of a client
    are dropped when it leaves (on Linux; elsewhere its end is invisible).

    Parameters
    ----------
    peripheral : StreamPeripheral
        The board, called by two threads.
    link : path, optional
        Symbolic link to the pty, removed at the end.
    replace_link : bool
        Replace a symbolic link of that name, as a killed server leaves one behind.

    Attributes
    ----------
    path : str
        Device file that a client opens.

    Raises
    ------
    SensorError
        The system has no ptys (Windows).
    OSError
        There is something named `link`, or it cannot be made.
    """

    def __init__(
        self,
        peripheral: StreamPeripheral,
        *,
        link: str | os.PathLike[str] | None = None,
        replace_link: bool = False,
    ) -> None:
        try:
            import tty
        except ImportError as error:
            raise SensorError("a board behind a pty needs Linux or macOS") from error
        self._peripheral = peripheral
        self._link = None if link is None else Path(link).absolute()  # the working directory may change
        self._closed = threading.Event()
        self._has_client = threading.Event()
        self._writing = threading.Lock()
        """Held while bytes go to the client, and while it is found gone."""
        self._is_stuck = False
        """True while the client does not read."""
        self._master, slave = os.openpty()
        self._slave: int | None = slave
        try:
            tty.setraw(slave)
            os.set_blocking(self._master, False)
            self.path: str = os.ttyname(slave)
            if self._link is not None:
                _make_link(self._link, self.path, replace_link)
        except BaseException:
            self._close_files()
            raise
        if sys.platform == "linux":
            # Without it the master tells whether a client is there; the settings stay.
            os.close(slave)
            self._slave = None
        self._ending = threading.Lock()
        self._threads = [
            threading.Thread(target=self._run, args=(step,), name=f"pty {self.path}", daemon=True)
            for step in (self._receive, self._send)
        ]
        self._num_running = len(self._threads)
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Hang up; may be called twice."""
        self._closed.set()
        # Another server may have replaced the link.
        if self._link is not None and self._link.is_symlink() and str(self._link.readlink()) == self.path:
            self._link.unlink()
        for thread in self._threads:
            thread.join()

    def __enter__(self) -> PtyPort:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _run(self, step: Callable[[], None]) -> None:
        """Carry one direction until the port is closed or the board is gone; the last one to end hangs up."""
        try:
            while not self._closed.is_set():
                step()
        except Unplugged:
            pass
        finally:
            self._closed.set()
            with self._ending:
                self._num_running -= 1
                if self._num_running == 0:
                    self._close_files()

    def _receive(self) -> None:
        """Bytes of the client to the board."""
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        events = dict(poll.poll(1e3 * _WAIT)).get(self._master, 0)
        has_gone = bool(events & select.POLLHUP)
        if events & select.POLLIN:
            if self._is_stuck and not has_gone:
                # Answers to more requests would pile up.
                self._closed.wait(_NOBODY)
                return
            self._has_client.set()
            with suppress(BlockingIOError):
                self._peripheral.receive(os.read(self._master, 4096))
        elif has_gone:
            self._hang_up()
            self._closed.wait(_NOBODY)
        else:
            self._has_client.set()

    def _send(self) -> None:
        """Bytes of the board to the client; no more are requested before there was room for these."""
        if not self._has_client.wait(_WAIT):
            return
        data = self._peripheral.send(4096, _WAIT)
        while data and not self._closed.is_set():
            has_room = bool(select.select([], [self._master], [], _WAIT)[1])
            self._is_stuck = not has_room
            with self._writing:
                if not self._has_client.is_set():
                    break
                if has_room:
                    with suppress(BlockingIOError):
                        data = data[os.write(self._master, data) :]
        self._is_stuck = False

    def _hang_up(self) -> None:
        """End a conversation when its client has gone: the next client must not see its data."""
        if not self._has_client.is_set():
            return
        with self._writing:
            self._has_client.clear()
            self._peripheral.hang_up()
            # Its unread data lies at the other end.
            with suppress(OSError):
                slave = os.open(self.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
                try:
                    while select.select([slave], [], [], _SILENCE)[0]:
                        os.read(slave, 65536)
                finally:
                    os.close(slave)

    def _close_files(self) -> None:
        os.close(self._master)
        if self._slave is not None:
            os.close(self._slave)


def _make_link(link: Path, path: str, replace: bool) -> None:
    """Make a symbolic link, in place of another one if asked."""
    if replace and link.is_symlink():
        link.unlink()
    try:
        link.symlink_to(path)
    except OSError as error:
        remedy = (
            "; --force (replace_link=True) replaces a link that a killed server has left" if link.is_symlink() else ""
        )
        raise OSError(error.errno, f"{error.strerror}{remedy}", str(link)) from None
