"""Public names of a package that load on first use, as its stub lists them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module


def attach(package: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package.

    The names come from the ``__init__.pyi`` beside it, one line ``from module import name as name`` each. They are read
    word by word, because Python's parser takes longer to load than everything else.
    """
    face = sys.modules[package]
    with open(f"{face.__file__}i", encoding="utf-8") as stub:  # noqa: PTH123  # pathlib loads as long as this file
        origins = {line.split()[3]: line.split()[1] for line in stub}
    names = sorted(origins)

    def load(name: str) -> object:
        if name not in origins:
            # With both given, the interpreter suggests similar names from `dir`.
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=face)
        module = origins[name]
        # A name that another package does not have yet is a file in it; so are all names of its own.
        found = None if module == package else getattr(import_module(module), name, None)
        value = import_module(f"{module}.{name}") if found is None else found
        setattr(face, name, value)
        return value

    return load, names.copy, names
