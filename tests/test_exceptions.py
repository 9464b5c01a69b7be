"""Exceptions and warnings of the package can be pickled, as worker processes need."""

from __future__ import annotations

import copy
import importlib
import inspect
import pickle
import pkgutil
from collections.abc import Iterator

import radarcore

VALUES = {"str": "range_resolution", "int": 3, "float": 0.15}
"""Arguments of constructors by their types."""


def exceptions() -> Iterator[type[BaseException]]:
    """All classes of exceptions in the package."""
    for module in pkgutil.walk_packages(radarcore.__path__, "radarcore."):
        if module.name.endswith("__main__"):
            continue
        try:
            content = vars(importlib.import_module(module.name)).values()
        except ImportError:  # of an extra that is not installed
            continue
        for value in content:
            if isinstance(value, type) and issubclass(value, BaseException) and value.__module__ == module.name:
                yield value


def made(kind: type[BaseException]) -> BaseException:
    has_own = inspect.isfunction(kind.__init__)
    types = [each.annotation for each in inspect.signature(kind).parameters.values()] if has_own else ["str"]
    error = kind(*(VALUES[each] for each in types))
    if hasattr(error, "protocol"):
        error.protocol = "strata"
    return error


def test_exceptions_are_the_same_in_another_process() -> None:
    for error in map(made, exceptions()):
        for again in (copy.copy(error), pickle.loads(pickle.dumps(error))):
            assert (type(again), again.args, vars(again)) == (type(error), error.args, vars(error))
            assert str(again) == str(error)
