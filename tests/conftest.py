"""Before any test is loaded: MuJoCo draws without a display, by a library that it chooses when it is imported.

Commands do not see the width and the colours of the terminal that started the tests.

Where `pytest.approx` is given a relative tolerance, it has no other one: by default pytest also allows 1e-12, which is
more than the power of thermal noise.

Garbage is looked for less often, and not among the ten thousand tests and what they import: that took 3 % of all time.
"""

from __future__ import annotations

import gc
import os
from ctypes.util import find_library
from typing import Any

import pytest

for name, library in (("osmesa", "OSMesa"), ("egl", "EGL")):
    if not os.environ.get("MUJOCO_GL") and find_library(library):
        os.environ["MUJOCO_GL"] = name

# Width and colours of the terminal that started the tests would show in what commands print.
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
