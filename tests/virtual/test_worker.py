"""The thread that simulates ahead: results and failures in order, and an end that waits for nothing."""

from __future__ import annotations

import gc
import threading

from radarcore.virtual.source import Worker


def test_thread_ends_with_whoever_has_it() -> None:
    worker: Worker[int] = Worker("forgotten worker")
    (thread,) = (one for one in threading.enumerate() if one.name == "forgotten worker")
    assert worker.result(worker.begin(lambda: 1)) == 1
    del worker
    gc.collect()
    thread.join(30.0)
    assert not thread.is_alive()
