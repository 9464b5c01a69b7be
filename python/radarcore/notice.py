"""Notices to the user: warnings that point at the user's line, and progress bars."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import current_thread, main_thread
from time import monotonic
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tqdm import tqdm

_LONG = 1.0
"""Time after which work has a progress bar [s]."""

quiet: ContextVar[bool] = ContextVar("quiet", default=False)
"""True while neither progress nor summaries are shown."""

_OURS = {"radarcore", "dataclasses", "functools"}
"""Packages between the user's line and a warning: constructors of dataclasses are ours, too."""


def warn(message: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the innermost line outside of radarcore: the caller's line."""
    from inspect import currentframe  # takes longer to load than the rest

    frame, level = currentframe(), 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in _OURS:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


def progress(
    steps: Iterable[Any] | None, description: str, unit: str, *, total: int | None = None, shown: bool = True
) -> tqdm[Any]:
    """Progress bar over some steps, or one that is advanced by hand; in terminals only."""
    from tqdm import tqdm  # takes longer to load than the rest

    disable = None if shown and not quiet.get() else True
    return tqdm(steps, desc=description, unit=unit, unit_scale=steps is None, total=total, disable=disable)


@contextmanager
def progress_if_long(description: str, unit: str, total: int, *, shown: bool = True) -> Iterator[Callable[[int], None]]:
    """Progress bar that appears after a second: a function that takes the number of steps that are done."""
    bars: list[tqdm[Any]] = []
    begin = monotonic()

    def report(num_done: int) -> None:
        if not bars and monotonic() > begin + _LONG:
            bars.append(progress(None, description, unit, total=total, shown=shown))
        for bar in bars:
            bar.update(num_done - bar.n)

    try:
        yield report
        report(total)
    finally:
        for bar in bars:
            bar.close()


@contextmanager
def gathered() -> Iterator[list[str]]:
    """Warnings of a block, in a list that is filled when it ends.

    Other threads than the main one share its filters: there, warnings are given as always.
    """
    messages: list[str] = []
    if current_thread() is not main_thread():
        yield messages
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield messages
    messages.extend(str(each.message) for each in caught)


class NewKinds:
    """Warns of each kind once: messages of one kind differ only in names and numbers."""

    def __init__(self) -> None:
        self._kinds: set[str] = set()

    def warn(self, messages: Iterable[str]) -> None:
        """Warn, at the user's line, of kinds that are new."""
        for message in messages:
            kind = re.sub(r"'[^']*'|[-+]?\d[\d.]*(?:e[-+]?\d+)?", "", message)
            if kind not in self._kinds:
                self._kinds.add(kind)
                warn(message)
