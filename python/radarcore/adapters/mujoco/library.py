"""The package mujoco, loaded on use, and what its rendering needs of the system."""

from __future__ import annotations

import os
from importlib.util import find_spec
from types import ModuleType
from typing import Any

GL_HINT = (
    "an OpenGL library that draws without a display: Debian packages libegl1 libegl-mesa0 libgl1-mesa-dri libgl1, or "
    "libosmesa6, and MUJOCO_GL=egl or MUJOCO_GL=osmesa in the environment before mujoco is imported"
)


def is_available() -> bool:
    """True when the extra `mujoco` is installed.

    See Also
    --------
    adapters.mujoco.LiveModel : What it is needed for.

    Examples
    --------
    >>> rc.adapters.mujoco.is_available()
    True
    """
    return find_spec("mujoco") is not None


def mujoco_module() -> ModuleType:
    """The package, or an ImportError that names the extra."""
    if not is_available():
        raise ImportError("MuJoCo models need mujoco: pip install radarcore[mujoco]")
    try:
        import mujoco
    except Exception as error:  # what MUJOCO_GL asks for is loaded here; every back end fails in its own way
        raise no_graphics(error) from error
    module: ModuleType = mujoco
    return module


def gl_context(columns: int, rows: int) -> Any:
    """A new context to draw into images of up to this size; where there is none, every library fails in its own way."""
    # A context that could not be made has nothing to free, and says nothing about it.
    return type("Context", (mujoco_module().GLContext,), {"_context": None})(columns, rows)


def no_graphics(error: object) -> ImportError:
    """The error where nothing can be drawn."""
    chosen = os.environ.get("MUJOCO_GL")
    setting = "MUJOCO_GL is not set" if chosen is None else f"MUJOCO_GL={chosen}"
    return ImportError(f"rendering needs {GL_HINT}; {setting}: {' '.join(str(error).split())}")
