"""A board behind a pseudo terminal, for programs that open serial ports."""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from radarcore.sensor.emulator.peripheral import StreamPeripheral, Unplugged
from radarcore.sensor.errors import SensorError

_WAIT = 0.05
"""Longest wait of the threads [s], after which they see that the port is closed."""


class PtyPort:
    """A pty with a board at its other end, from now until `close` or until the board is unplugged.

    Clients may come and go. While none reads, the board is asked for bytes only until the terminal's own buffer is
    full; a client that opens the port with a serial library throws those away.

    Parameters
    ----------
    peripheral : StreamPeripheral
        The board. Its two calls come from two threads.
    link : path, optional
        Symbolic link to the pty, removed at the end. One that leads nowhere is replaced.

    Attributes
    ----------
    path : str
        Device file that a client opens.

    Raises
    ------
    SensorError
        The system has no ptys (Windows).
    FileExistsError
        There is something at `link`.
    """

    def __init__(self, peripheral: StreamPeripheral, *, link: str | os.PathLike[str] | None = None) -> None:
        try:
            import tty
        except ImportError as error:
            raise SensorError("a board behind a pty needs Linux or macOS; use an emulated USB bus here") from error
        self._peripheral = peripheral
        self._link = None if link is None else Path(link)
        self._closed = threading.Event()
        # The slave stays open here: without it, reading the master fails whenever no client is there.
        self._master, self._slave = os.openpty()
        try:
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.path = os.ttyname(self._slave)
            self._make_link()
        except BaseException:
            self._close_files()
            raise
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
        for thread in self._threads:
            thread.join()
        if self._link is not None and self._link.is_symlink() and str(self._link.readlink()) == self.path:
            self._link.unlink()

    def __enter__(self) -> PtyPort:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _make_link(self) -> None:
        if self._link is None:
            return
        if self._link.is_symlink() and not self._link.exists():
            self._link.unlink()  # of a process that was killed
        if self._link.is_symlink() or self._link.exists():
            raise FileExistsError(f"link: expected a name that is free, got {self._link}, which exists")
        self._link.symlink_to(self.path)

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
        if not select.select([self._master], [], [], _WAIT)[0]:
            return
        with suppress(BlockingIOError):
            self._peripheral.receive(os.read(self._master, 4096))

    def _send(self) -> None:
        """Bytes of the board to the client; no more are asked for before there was room for these."""
        data = self._peripheral.send(4096, _WAIT)
        while data and not self._closed.is_set():
            if select.select([], [self._master], [], _WAIT)[1]:
                with suppress(BlockingIOError):
                    data = data[os.write(self._master, data) :]

    def _close_files(self) -> None:
        os.close(self._master)
        os.close(self._slave)
