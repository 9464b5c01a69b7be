"""Checks of an installed wheel, run by `make wheel-check` with nothing but the required packages around it."""

import importlib.metadata
import sys
from pathlib import Path

import radarcore

# The installed package is meant, not the source tree.
source = Path(__file__).resolve().parents[1] / "python"
assert source not in Path(radarcore.__file__).resolve().parents, radarcore.__file__

assert radarcore.__version__ == importlib.metadata.version("radarcore"), radarcore.__version__

# Importing radarcore imports numpy and nothing else heavy, installed or not.
heavy = {"scipy", "pydantic", "matplotlib", "tqdm", "trimesh", "usb"} & set(sys.modules)
assert not heavy, f"import radarcore also imports {sorted(heavy)}"
