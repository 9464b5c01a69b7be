"""Parts that several scenes of one file share: radars, meshes, arms and their lines, made once."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

_Made = TypeVar("_Made")

_MOST = 256
"""Things that are kept; the one that was not used for longest goes first."""


class Kept:
    """Radars, meshes and arms by the tables that describe them; those of files as they were when first read."""

    def __init__(self) -> None:
        self._made: OrderedDict[Hashable, Any] = OrderedDict()

    def of(self, key: Hashable, make: Callable[[], _Made]) -> _Made:
        """Object kept for the key, or made now by `make`."""
        if key not in self._made:
            self._made[key] = make()
            if len(self._made) > _MOST:
                self._made.popitem(last=False)
        self._made.move_to_end(key)
        found: _Made = self._made[key]
        return found

    def __reduce__(self) -> tuple[type[Kept], tuple[()]]:
        """Another process makes its own."""
        return Kept, ()
