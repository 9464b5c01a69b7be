"""Notices to the user: warnings that point at the user's line, and progress bars."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tqdm import tqdm

_LONG = 1.0
"""Time after which work has a progress bar [s]."""

_OURS = {"radarcore", "dataclasses", "functools"}
"""Packages between the user's line and a warning: constructors of dataclasses are ours, too."""


def warn(message: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the innermost line outside of radarcore: the one that called it."""
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

    return tqdm(
        steps, desc=description, unit=unit, unit_scale=steps is None, total=total, disable=None if shown else True
    )


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
