"""The thread that simulates ahead: results and failures in order, and an end that waits for nothing."""

from __future__ import annotations

import gc
import threading

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


def test_thread_ends_with_whoever_has_it() -> None:
    worker: Worker[int] = Worker("forgotten worker")
    (thread,) = (one for one in threading.enumerate() if one.name == "forgotten worker")
    assert worker.result(worker.begin(lambda: 1)) == 1
    del worker
    gc.collect()
    thread.join(30.0)
    assert not thread.is_alive()
