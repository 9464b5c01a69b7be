"""Ctrl-C in the midst of a call, for tests of how soon it is heard."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable

import pytest


def time_to_hear(work: Callable[[], object], after: float) -> float:
    """Time of all threads from Ctrl-C, `after` seconds after the start of the work, to its end [s]."""
    sent: list[float] = []

    def interrupt() -> None:
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        work()
    heard = time.process_time()
    timer.join()
    return heard - sent[0]


def time_of(work: Callable[[], object]) -> float:
    """Time of all threads, which no other program stops [s]."""
    began = time.process_time()
    work()
    return time.process_time() - began
