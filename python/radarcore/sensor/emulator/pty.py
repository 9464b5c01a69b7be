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

from radarcore.sensor.emulator.clients import clients_of
from radarcore.sensor.emulator.link import announce, make_link, remove_link
from radarcore.sensor.emulator.peripheral import HearsHangUp, StreamPeripheral, Unplugged
from radarcore.sensor.errors import SensorError

_WAIT = 0.05
"""Longest wait of the threads [s], after which they see that the port is closed."""

_NOBODY = 0.01
"""Time between looks for a client [s], while there is none."""

_SILENCE = 0.005
"""Silence after which nothing is left in the terminal's buffers [s]."""


class PtyPort:
    """A pty with a board at its other end, from now until `close` or until the board is unplugged.

    Clients may come and go. While there is none, the board is asked for nothing; while one does not read, only until
    the terminal's own buffer is full, and then its requests wait too. What a client has sent in part and what it has
    not read ends with it (on Linux; elsewhere nobody knows that it has gone).

    Parameters
    ----------
    peripheral : StreamPeripheral
        The board. Its two calls come from two threads. One that hears of it is told when a client has gone.
    link : path, optional
        Symbolic link to the pty, removed at the end. One that a killed server has left behind is replaced.

    Attributes
    ----------
    path : str
        Device file that a client opens.

    Raises
    ------
    SensorError
        The system has no ptys (Windows).
    OSError
        Somebody serves `link`, there is something else of that name, or it cannot be made.
    """

    def __init__(self, peripheral: StreamPeripheral, *, link: str | os.PathLike[str] | None = None) -> None:
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
        self._mark = None
        try:
            tty.setraw(slave)
            os.set_blocking(self._master, False)
            self.path: str = os.ttyname(slave)
            self._mark = announce(self.path)
            if self._link is not None:
                make_link(self._link, self.path)
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

    def clients(self) -> dict[int, str]:
        """Numbers and names of the processes that have the port open, as far as Linux tells this user."""
        return clients_of(self.path)

    def close(self) -> None:
        """Hang up; may be called twice."""
        self._closed.set()
        if self._link is not None:
            remove_link(self._link, self.path)
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
        """Bytes of the board to the client; no more are asked for before there was room for these."""
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
        """End a conversation when its client has gone: what was under way is not for the next one."""
        if not self._has_client.is_set():
            return
        with self._writing:
            self._has_client.clear()
            if isinstance(self._peripheral, HearsHangUp):
                self._peripheral.hang_up()
            # What it has not read lies at the other end.
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
        if self._mark is not None:
            self._mark.close()
