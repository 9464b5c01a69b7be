"""Ways to have shards made: in this process, by processes of this machine, by any executor, by a cluster of dask."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
    wait,
)
from contextlib import contextmanager
from threading import Thread
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from radarcore.dataset.shards import Done

Make = Callable[[int], "Done"]
"""Function of a shard's number that makes the shard."""

Name = Callable[[int], str]
"""Name of a shard in messages."""


def serial(make: Make, shards: Sequence[int]) -> Generator[Done, None, None]:
    """Shards made here, in order."""
    yield from map(make, shards)


def processes(make: Make, shards: Sequence[int], workers: int, name: Name) -> Generator[Done, None, None]:
    """Shards made by processes of this machine, as they end.

    Where a process was lost, those that may have ended it are made alone, one after the other: the one that ends its
    process once more is named by a ChildProcessError. All others go on.
    """
    left = dict.fromkeys(shards)
    while left:
        is_broken = False
        with _pool(workers) as pool:
            futures = {pool.submit(make, shard): shard for shard in left}
            for future in as_completed(futures):
                try:
                    done = future.result()
                except BrokenExecutor:
                    is_broken = True
                    continue
                del left[done.shard]
                yield done
        if is_broken:
            # Handed out in order: to every worker, and a few that wait for the first that is free.
            with _pool(1) as pool:
                for shard in list(left)[: 2 * workers + 1]:
                    try:
                        done = pool.submit(make, shard).result()
                    except BrokenExecutor as error:
                        raise _lost(name(shard)) from error
                    del left[shard]
                    yield done


def executed(make: Make, shards: Sequence[int], executor: Executor, name: Name) -> Generator[Done, None, None]:
    """Shards made by an executor, as they end; one that was lost with its worker is tried once more, then named."""
    lost: list[int] = []
    futures: dict[Future[Done], int] = {}
    try:
        for attempt in (1, 2):
            try:
                futures = {executor.submit(make, shard): shard for shard in (shards if attempt == 1 else lost)}
            except BrokenExecutor as error:
                raise _lost(name(lost[0] if lost else shards[0]), "; the executor is broken") from error
            lost = []
            for future in as_completed(futures):
                try:
                    yield future.result()
                except (BrokenExecutor, CancelledError) as error:
                    if attempt == 2:
                        raise _lost(name(futures[future])) from error
                    lost.append(futures[future])
                except Exception as error:
                    if type(error).__name__ == "KilledWorker":  # of dask, which has tried several workers
                        raise _lost(name(futures[future])) from error
                    raise
            lost.sort()
            if not lost:
                return
    finally:
        wait([future for future in futures if not future.cancel()])


@contextmanager
def dask(address: str, timeout: float) -> Iterator[Executor]:
    """Executor of a cluster whose scheduler is at an address; a ConnectionError if none answers in time [s]."""
    try:
        from distributed import Client
    except ImportError as error:
        raise ImportError("clusters need dask distributed: pip install radarcore[dask]") from error
    began = time.monotonic()
    unanswered = ConnectionError(f"scheduler: expected one of dask at {address}, got no answer within {timeout:g} s")
    try:
        _greet(address, timeout)
    except (OSError, TimeoutError) as error:
        raise unanswered from error
    except ValueError as error:
        raise ValueError(f"scheduler: expected an address as tcp://HOST:8786, got {address!r} ({error})") from error
    except Exception as error:  # whatever the bytes of another service are taken for
        raise ConnectionError(
            f"scheduler: expected one of dask at {address}, got the answer of something else ({type(error).__name__})"
        ) from error
    connect: Any = Client  # whose types are not complete
    try:
        client = connect(address, timeout=max(1.0, timeout + began - time.monotonic()), set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise unanswered from error
    with client:
        if not client.scheduler_info()["workers"]:
            raise ConnectionError(f"scheduler: expected workers of the scheduler at {address}, got none")
        # Not pure: the same shard may be needed once more, after a disk was full.
        yield client.get_executor(pure=False)


def _greet(address: str, timeout: float) -> None:
    """Connect to a scheduler and ask who it is: a client that finds none closes late, and with a traceback."""
    from distributed import Security
    from distributed.comm.core import connect

    security: Any = Security  # whose types are not complete, nor those of what connects
    reach: Any = connect
    options = security().get_connection_args("client")

    async def greet() -> None:
        # The whole of it within the time: a service that is silent is none.
        async with asyncio.timeout(timeout):
            connection = await reach(address, timeout=timeout, **options)
            try:
                await connection.write({"op": "identity", "reply": True})
                if dict(await connection.read()).get("type") != "Scheduler":
                    raise TypeError("no scheduler")
            finally:
                connection.abort()

    # In a thread of its own: notebooks have a loop in theirs.
    with ThreadPoolExecutor(1) as thread:
        thread.submit(lambda: asyncio.run(greet())).result()


def num_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with the block, at once where it was interrupted.

    They start afresh: a copy of this process would have locks of its threads, of those of the core among them.
    """
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    """Begin a worker: Ctrl-C is for the process that waits for it, and with that it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)


def _lost(what: str, why: str = "") -> ChildProcessError:
    return ChildProcessError(
        f"{what}: its worker was lost twice (killed, or out of memory){why}; what is complete stays, "
        "resume=True goes on with the rest"
    )


def at_most(workers: int, shards: Sequence[Any]) -> int:
    """Workers that have something to do."""
    return max(1, min(workers, len(shards)))
