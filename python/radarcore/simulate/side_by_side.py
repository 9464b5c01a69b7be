"""Work on several items side by side, with results in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import TypeVar

Worker = TypeVar("Worker")
Item = TypeVar("Item")
Result = TypeVar("Result")

_AHEAD = 2
"""Items per worker whose results may wait for those before them: items that take longer leave nobody idle."""


def in_order(
    work: Callable[[Worker, Item], Result], items: Iterable[Item], workers: list[Worker], stop: Callable[[Worker], None]
) -> Iterator[Result]:
    """Results of ``work(worker, item)`` in the order of the items, which are taken one by one.

    Parameters
    ----------
    work : function of a worker and an item
        It should release the interpreter: every worker has a thread.
    items : iterable
    workers : list
        Each works on one item at a time, the next that is there.
    stop : function of a worker
        Ends its work early when nobody wants the results any more: after an error, or Ctrl-C.
    """
    if len(workers) == 1:
        for item in items:
            yield work(workers[0], item)
        return
    free: SimpleQueue[Worker] = SimpleQueue()
    for worker in workers:
        free.put(worker)

    def done(item: Item) -> Result:
        worker = free.get()
        try:
            return work(worker, item)
        finally:
            free.put(worker)

    with ThreadPoolExecutor(len(workers), "radarcore") as pool:
        pending: deque[Future[Result]] = deque()
        try:
            for item in items:
                if len(pending) == _AHEAD * len(workers):
                    yield _first(pending)
                pending.append(pool.submit(done, item))
            while pending:
                yield _first(pending)
        finally:
            for future in pending:
                future.cancel()
            if pending:
                for worker in workers:
                    stop(worker)


def _first(pending: deque[Future[Result]]) -> Result:
    """Result of the first future, which leaves the queue when it is there."""
    result = pending[0].result()
    pending.popleft()
    return result
