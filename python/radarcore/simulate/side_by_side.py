"""Work on several items side by side, with results in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from queue import SimpleQueue
from typing import Any, TypeVar

Worker = TypeVar("Worker")
Item = TypeVar("Item")
Result = TypeVar("Result")

Ask = Callable[[Callable[[], Any]], Any]
"""Runs a function in the thread that takes the results, and returns its result."""

_AHEAD = 2
"""Items per worker whose results may wait for those before them: slow items leave no worker idle."""


def directly(function: Callable[[], Any]) -> Any:
    """`Ask` of a thread that takes the results itself."""
    return function()


def in_order(
    work: Callable[[Worker, Item, Ask], Result],
    items: Iterable[Item],
    workers: list[Worker],
    stop: Callable[[Worker], None],
) -> Iterator[Result]:
    """Results of ``work(worker, item, ask)`` in the order of the items, which are taken one by one.

    Parameters
    ----------
    work : function of a worker, an item and `Ask`
        It should release the interpreter: every worker has a thread. It calls functions of users, such as motions, only
        through `ask`: they run one at a time in the thread that takes the results.
    items : iterable
    workers : list
        Each works on one item at a time, the next that is there.
    stop : function of a worker
        Ends its work early when the results are no longer needed: after an error, or Ctrl-C.
    """
    if len(workers) == 1:
        for item in items:
            yield work(workers[0], item, directly)
        return
    free: SimpleQueue[Worker] = SimpleQueue()
    for worker in workers:
        free.put(worker)
    # Functions that workers want to call; None for a finished item.
    requests: SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = SimpleQueue()
    closed: Future[None] = Future()

    def ask(function: Callable[[], Any]) -> Any:
        answer: Future[Any] = Future()
        requests.put((answer, function))
        either: tuple[Future[Any], ...] = (answer, closed)
        wait(either, return_when=FIRST_COMPLETED)
        if closed.done():
            raise CancelledError
        return answer.result()

    def done(item: Item) -> Result:
        worker = free.get()
        try:
            return work(worker, item, ask)
        finally:
            free.put(worker)

    with ThreadPoolExecutor(len(workers), "radarcore") as pool:
        pending: deque[Future[Result]] = deque()

        def first() -> Result:
            """Wait for the first future, answer workers meanwhile, and remove it from the queue."""
            while not pending[0].done():
                if (asked := requests.get()) is not None:
                    answer, function = asked
                    try:
                        answer.set_result(function())
                    except Exception as error:  # raised in the worker that asked
                        answer.set_exception(error)
            result = pending[0].result()
            pending.popleft()
            return result

        try:
            for item in items:
                if len(pending) == _AHEAD * len(workers):
                    yield first()
                pending.append(pool.submit(done, item))
                pending[-1].add_done_callback(lambda _: requests.put(None))
            while pending:
                yield first()
        finally:
            closed.set_result(None)
            for future in pending:
                future.cancel()
            if pending:
                for worker in workers:
                    stop(worker)
