"""The thread that simulates ahead: results and failures in order, and an end that waits for nothing."""

from __future__ import annotations

import gc
import threading
import time
from functools import partial

import pytest

from radarcore.virtual.source import Worker


def test_results_and_failures_are_those_of_the_work_in_its_order() -> None:
    done: list[int] = []
    worker: Worker[int] = Worker("counting")

    def work(number: int) -> int:
        done.append(number)
        return 10 // number

    begun = [worker.begin(lambda number=number: work(number)) for number in (5, 0, 2)]  # type: ignore[misc]
    assert worker.result(begun[2]) == 5
    assert worker.result(begun[0]) == 2
    with pytest.raises(ZeroDivisionError):
        worker.result(begun[1])
    assert done == [5, 0, 2]
    worker.close()


def test_who_waits_is_freed_by_the_end_and_what_has_not_begun_never_does() -> None:
    worker: Worker[object] = Worker("waiting")
    is_begun, goes_on = threading.Event(), threading.Event()
    begun: list[int] = []

    def work() -> bool:
        is_begun.set()
        return goes_on.wait(30.0)

    heavy, next_one = worker.begin(work), worker.begin(partial(begun.append, 1))
    assert is_begun.wait(30.0)
    timer = threading.Timer(0.05, worker.close)
    timer.start()
    began = time.monotonic()
    with pytest.raises(RuntimeError, match="closed before it was done"):
        worker.result(heavy)
    assert time.monotonic() - began < 10.0
    timer.join()
    worker.close()
    goes_on.set()
    assert heavy.result(30.0)
    with pytest.raises(RuntimeError, match="closed before it was done"):
        worker.result(next_one)
    assert begun == []


def test_thread_ends_with_whoever_has_it() -> None:
    worker: Worker[int] = Worker("forgotten worker")
    (thread,) = (one for one in threading.enumerate() if one.name == "forgotten worker")
    assert worker.result(worker.begin(lambda: 1)) == 1
    del worker
    gc.collect()
    thread.join(30.0)
    assert not thread.is_alive()
