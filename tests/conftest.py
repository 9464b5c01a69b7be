"""Before any test is loaded: MuJoCo draws without a display, by a library that it chooses when it is imported."""

from __future__ import annotations

import os
from ctypes.util import find_library

for name, library in (("osmesa", "OSMesa"), ("egl", "EGL")):
    if not os.environ.get("MUJOCO_GL") and find_library(library):
        os.environ["MUJOCO_GL"] = name
