"""Work that ends the process that does it: loaded by workers, and nothing else with it."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any


class Deadly:
    """Makes shards that are nothing, and ends its process at one of them: always, or until there is a marker."""

    def __init__(self, deadly: int, marker: Path | None = None) -> None:
        self.deadly, self.marker = deadly, marker

    def __call__(self, shard: int) -> Any:
        if shard == self.deadly and (self.marker is None or not self.marker.exists()):
            if self.marker is not None:
                self.marker.write_text("once")
            os.kill(os.getpid(), signal.SIGKILL)
        return SimpleNamespace(shard=shard)
