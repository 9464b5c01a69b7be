"""A description's counterpart in the core: made on first use, left out of pickles."""

from __future__ import annotations

from typing import Any


class Twinned:
    """A description whose counterpart in the core is the cached property `_core`."""

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_core"}
