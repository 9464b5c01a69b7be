"""Cache of what several scenes of one file share: radars, meshes, arms and their lines."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

_Made = TypeVar("_Made")

_MOST = 256
"""Largest number of objects; the least recently used one goes first."""


class BuildCache:
    """Radars, meshes and arms by the tables that describe them; files are read once."""

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

    def __reduce__(self) -> tuple[type[BuildCache], tuple[()]]:
        """Another process makes its own."""
        return BuildCache, ()
