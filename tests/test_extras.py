"""Tests that need an extra are skipped where it is not installed, and say how to install it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from extra_modules import MODULES

TESTS = Path(__file__).parent
WITHOUT_EXTRAS = f"""
import importlib.metadata, sys
for name in {sorted(set().union(*MODULES.values()))}:
    sys.modules[name] = None
importlib.metadata.distributions = lambda: []
"""
NEEDING_EXTRAS = {
    "usd": ["adapters/test_usd_scene_file.py"],
    "usb": ["sensor/test_usb.py"],
    "mesh": ["geometry/test_collada.py"],
    "plot": ["test_readme.py::test_python_examples_run_and_print_what_the_page_says[docs/plots.md]"],
    "rerun": ["test_readme.py::test_python_examples_run_and_print_what_the_page_says[docs/viewer.md]"],
    "ros": ["test_readme.py::test_python_examples_run_and_print_what_the_page_says[docs/bags.md]"],
    "zarr": ["dataset/test_training.py::test_stored_frames_are_those_that_are_streamed"],
}


def test_tests_that_need_an_extra_are_skipped_without_it(tmp_path: Path) -> None:
    (tmp_path / "without_extras.py").write_text(WITHOUT_EXTRAS, encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), *sys.path])
    tests = [test for tests in NEEDING_EXTRAS.values() for test in tests]
    command = [sys.executable, "-m", "pytest", "-p", "without_extras", "-p", "no:cacheprovider", "-q", "-rfEs", *tests]
    ran = subprocess.run(command, cwd=TESTS, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout
    reasons = re.findall(r"needs the extra `(\w+)`: pip install radarcore\[\1\]", ran.stdout)
    assert set(reasons) == set(NEEDING_EXTRAS)
