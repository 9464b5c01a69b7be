"""A thread that works ahead, for one who asks; it is never waited for when its work is no longer wanted."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")

_Job = tuple["Future[Result]", Callable[[], Result]]


class Worker(Generic[Result]):
    """Does one thing after the other in a thread of its own.

    A pool of threads is waited for when a program ends, with all that it has begun; a heavy frame takes long.

    Parameters
    ----------
    name : str
        Name of the thread.
    """

    def __init__(self, name: str) -> None:
        self._jobs: SimpleQueue[_Job[Result] | None] = SimpleQueue()
        self._closed: Future[None] = Future()
        self._thread = threading.Thread(target=_work, args=(self._jobs,), name=name, daemon=True)
        self._thread.start()
        self._forgotten = weakref.finalize(self, self._jobs.put, None)

    def begin(self, work: Callable[[], Result]) -> Future[Result]:
        """Put something at the end of what is to be done."""
        future: Future[Result] = Future()
        self._jobs.put((future, work))
        return future

    def result(self, future: Future[Result]) -> Result:
        """Result, once it is done; RuntimeError when the worker is closed before."""
        either: tuple[Future[Any], ...] = (future, self._closed)
        wait(either, return_when=FIRST_COMPLETED)
        if self._closed.done():
            raise RuntimeError("closed before it was done")
        return future.result()

    def close(self) -> None:
        """End after what is under way, and free those who wait for it; may be called twice."""
        if not self._closed.done():
            self._closed.set_result(None)
        with suppress(Empty):
            while True:
                if (job := self._jobs.get_nowait()) is not None:
                    job[0].cancel()
        self._forgotten()


def _work(jobs: SimpleQueue[_Job[Result] | None]) -> None:
    """Do the jobs until one is None."""
    while (job := jobs.get()) is not None:
        future, work = job
        if not future.set_running_or_notify_cancel():
            continue
        try:
            future.set_result(work())
        except BaseException as error:  # for whoever asks for the result
            future.set_exception(error)
        del job, future, work  # nothing is kept while there is nothing to do
