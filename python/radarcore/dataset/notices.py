"""Warnings of many samples: the first of each kind."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread

from radarcore import notice


@contextmanager
def gathered() -> Iterator[list[str]]:
    """Warnings of a block, in a list that is filled when it ends.

    In threads beside the main one, where filters belong to all of them, they go the way they always go.
    """
    messages: list[str] = []
    if current_thread() is not main_thread():
        yield messages
        return
    with warnings.catch_warnings(record=True) as kept:
        warnings.simplefilter("always")
        yield messages
    messages.extend(str(each.message) for each in kept)


def kind_of(message: str) -> str:
    """Common part of messages of one kind, which differ in names and numbers alone."""
    return re.sub(r"'[^']*'|[-+]?\d[\d.]*(?:e[-+]?\d+)?", "", message)


class Told:
    """Warns of each kind once: messages that differ in names and numbers alone are of one kind."""

    def __init__(self) -> None:
        self._kinds: set[str] = set()

    def tell(self, messages: Iterable[str]) -> None:
        """Warn, at the user's line, of what was not told yet."""
        for message in messages:
            kind = kind_of(message)
            if kind not in self._kinds:
                self._kinds.add(kind)
                notice.warn(message)
