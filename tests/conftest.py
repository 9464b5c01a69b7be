"""Before any test is loaded: MuJoCo draws without a display, by a library that it chooses when it is imported.

Tests that need an extra which is not installed are skipped, and say how to install it.

Commands do not see the width and the colours of the terminal that started the tests.

Where `pytest.approx` is given a relative tolerance, it has no other one: by default pytest also allows 1e-12, which is
more than the power of thermal noise.

Garbage is looked for less often, and not among the ten thousand tests and what they import: that took 3 % of all time.
"""

from __future__ import annotations

import gc
import os
import re
import signal
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes.util import find_library
from functools import cache
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import pytest

from extra_modules import MODULES

for name, library in (("osmesa", "OSMesa"), ("egl", "EGL")):
    if not os.environ.get("MUJOCO_GL") and find_library(library):
        os.environ["MUJOCO_GL"] = name

# The output of commands must not depend on the terminal that started the tests.
for name in ("COLUMNS", "LINES", "FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
    os.environ.pop(name, None)

gc.set_threshold(50_000, 20, 50)

_approx = pytest.approx


def _approx_without_floor(expected: Any, rel: Any = None, abs: Any = None, nan_ok: bool = False) -> Any:
    """`pytest.approx` whose absolute tolerance is zero where only a relative one is given."""
    return _approx(expected, rel, 0.0 if abs is None and rel is not None else abs, nan_ok)


pytest.approx = _approx_without_floor


def pytest_collection_finish() -> None:
    gc.freeze()


@cache
def is_installed(extra: str) -> bool:
    """True if all packages of an extra are installed."""
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {re.split(r"[^\w-]", requirement)[0] for requirement in project["optional-dependencies"][extra]}
    return wanted <= {re.sub(r"[-_.]+", "-", found.metadata["Name"]).lower() for found in distributions()}


def skip_without_extra(error: BaseException) -> None:
    """Skip the test if an extra is the reason of an error, and not installed."""
    if isinstance(error, ImportError):
        named = re.search(r"pip install radarcore\[(\w+)\]", str(error))
        module = (error.name or "").partition(".")[0]
        extra = named[1] if named else next((extra for extra in MODULES if module in MODULES[extra]), None)
        if extra is not None and not is_installed(extra):
            pytest.skip(f"needs the extra `{extra}`: pip install radarcore[{extra}]")


@contextmanager
def skipping_without_extra() -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        skip_without_extra(error)
        raise


@pytest.fixture(autouse=True)
def _commands_without_extra_skip(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands print errors, and return a status."""
    if request.path.parent.name == "cli":
        from radarcore.cli import main

        lines = main._lines
        monkeypatch.setattr(main, "_lines", lambda error, names: skip_without_extra(error) or lines(error, names))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Iterator[None]:
    with skipping_without_extra():
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    with skipping_without_extra():
        return (yield)


@pytest.fixture
def hears_interrupts() -> Iterator[None]:
    """Python's own handler, also where the tests were started in the background, with SIGINT ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
