"""Every bench once and tiny, each in a process of its own: python tests/benches_once.py

Where the system is Linux these are forks of one that has the modules which most of them import, as importing takes
longer than many of the benches.
"""

from __future__ import annotations

import multiprocessing
import runpy
import subprocess
import sys
from importlib import import_module
from pathlib import Path

BENCHES = Path(__file__).parent.parent / "benches"

SHARED = (
    *("matplotlib.backends.backend_agg", "scipy.interpolate", "scipy.optimize", "scipy.special"),
    *("radarcore.dataset.sample", "radarcore.models.people.human", "radarcore.models.robots.arm"),
)


def main() -> None:
    benches = sorted(BENCHES.glob("*.py"))
    if sys.platform != "linux":
        for bench in benches:
            subprocess.run([sys.executable, str(bench), "--tiny"], check=True)
        return
    for name in SHARED:
        import_module(name)
    sys.path[0] = str(BENCHES)
    for bench in benches:
        process = multiprocessing.get_context("fork").Process(target=run, args=(bench,))
        process.start()
        process.join()
        if process.exitcode != 0:
            sys.exit(f"{bench.name} --tiny: expected exit status 0, got {process.exitcode}")


def run(bench: Path) -> None:
    """Run a bench as `python bench --tiny` does."""
    sys.argv = [str(bench), "--tiny"]
    runpy.run_path(str(bench), run_name="__main__")


if __name__ == "__main__":
    main()
