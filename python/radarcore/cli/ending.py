"""Signals that end a command: all do so as Ctrl-C does."""

from __future__ import annotations

import os
import signal
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

_NAMES = ("SIGTERM", "SIGHUP", "SIGBREAK")
"""Ends by `kill` and by the system; by a terminal that closes; by Ctrl-Break and a window that closes (Windows)."""


class Ended(KeyboardInterrupt):
    """A signal has told the command to end."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number

    def __str__(self) -> str:
        return f"ended by {signal.Signals(self.number).name}"


class _Signals:
    """State of the signals of the command that runs."""

    first: int | None = None
    """Number of the first one."""
    are_held = False
    """True while they are noted and raise nothing."""


_signals = _Signals()


@contextmanager
def interrupted_by_signals() -> Iterator[None]:
    """Raise `Ended` in the main thread at the first of the signals; more of them do not disturb the clearing up.

    A signal that is ignored, as under `nohup`, or that somebody else waits for is left alone.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _signals.first, _signals.are_held = None, False

    def end(number: int, _: FrameType | None) -> None:
        _leave_closed_terminal()
        if _signals.first is None:
            _signals.first = number
            if not _signals.are_held:
                raise Ended(number)

    caught = []
    for number in (getattr(signal, name) for name in _NAMES if hasattr(signal, name)):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, end)
            caught.append(number)
    try:
        yield
    finally:
        for number in caught:
            signal.signal(number, signal.SIG_DFL)
        _signals.first, _signals.are_held = None, False


def raise_if_ended() -> None:
    """Raise `Ended` again where a signal has come, for loops without an end.

    Python drops what is raised while it tidies up a generator or a weak reference.
    """
    if _signals.first is not None and not _signals.are_held:
        raise Ended(_signals.first)


def hold_signals() -> None:
    """Let signals wait until the command has ended: what it clears up would be left half done."""
    _signals.are_held = True
    _leave_closed_terminal()


def exit_status(interrupt: KeyboardInterrupt) -> int:
    """Exit status of an interrupted command, as shells count: 128 and the number of the signal."""
    return 128 + (interrupt.number if isinstance(interrupt, Ended) else int(signal.SIGINT))


def _leave_closed_terminal() -> None:
    """Let last words go nowhere once the terminal is gone: a message that fails would take the place of the end."""
    with suppress(OSError):
        for file in (1, 2):
            if stat.S_ISCHR(os.fstat(file).st_mode) and not os.isatty(file):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, file)
                os.close(nowhere)
