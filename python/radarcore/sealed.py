"""Descriptions whose attributes are read-only once they are made, as those of frozen dataclasses are."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

_Kind = TypeVar("_Kind", bound=type)


def sealed(kind: _Kind) -> _Kind:
    """The class, whose attributes can be set by its own constructor alone.

    What was derived from them there would not follow later changes.
    """
    construct: Callable[..., None] = kind.__init__  # type: ignore[misc]  # of this class, not of one below it

    @wraps(construct)
    def make(self: Any, *args: Any, **given: Any) -> None:
        construct(self, *args, **given)
        object.__setattr__(self, "_is_sealed", True)

    def check(self: Any, name: str) -> None:
        if getattr(self, "_is_sealed", False):
            raise AttributeError(f"{name}: attributes of {kind.__name__} are read-only; make another one")

    def put(self: Any, name: str, value: object) -> None:
        check(self, name)
        object.__setattr__(self, name, value)

    def remove(self: Any, name: str) -> None:
        check(self, name)
        object.__delattr__(self, name)

    kind.__init__ = make  # type: ignore[misc]
    kind.__setattr__ = put  # type: ignore[assignment]
    kind.__delattr__ = remove  # type: ignore[assignment]
    return kind
