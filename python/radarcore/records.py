"""Descriptions whose attributes are read-only once they are made, and their counterparts in the core."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

_Kind = TypeVar("_Kind", bound=type)
_Made = TypeVar("_Made")


def sealed(kind: _Kind) -> _Kind:
    """The class, whose attributes can be set by its own constructor alone.

    Values derived from them there would not follow later changes. As with frozen dataclasses, a subclass may have
    further attributes.
    """
    construct: Callable[..., None] = kind.__init__  # type: ignore[misc]  # of this class, not of one below it

    @wraps(construct)
    def make(self: Any, *args: Any, **given: Any) -> None:
        construct(self, *args, **given)
        object.__setattr__(self, "_sealed", frozenset(getattr(self, "__dict__", ())))

    def checked(change: Callable[..., None]) -> Callable[..., None]:
        def act(self: Any, name: str, *value: object) -> None:
            if hasattr(self, "_sealed") and (type(self) is kind or name in self._sealed or hasattr(kind, name)):
                raise AttributeError(f"{name}: attributes of {kind.__name__} are read-only; make another one")
            change(self, name, *value)

        return act

    kind.__init__ = make  # type: ignore[misc]
    kind.__setattr__ = checked(object.__setattr__)  # type: ignore[method-assign]
    kind.__delattr__ = checked(object.__delattr__)  # type: ignore[method-assign]
    return kind


def made_of(kind: type[_Made], fields: dict[str, Any]) -> _Made:
    """An object of a sealed class from its fields, which need no checks."""
    made = object.__new__(kind)
    vars(made).update(fields, _sealed=frozenset(fields))
    return made


class Twinned:
    """A description whose counterpart in the core is the cached property `_core`."""

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_core"}
