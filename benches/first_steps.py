"""Times from nothing to the first picture: an empty environment, a wheel with what it needs, an own mesh in six lines.

python benches/first_steps.py            needs a wheel, dist/*.whl (make wheel), and a package index
python benches/first_steps.py --tiny     the six lines alone, in the environment that runs this
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

DIST = Path(__file__).resolve().parents[1] / "dist"

PART = """\
v 0 -200 -100
v 0 200 -100
v 0 200 100
v 0 -200 100
f 1 2 3 4
"""
"""The own mesh: a plate of 40 x 20 cm, in millimetres."""

LINES = """\
import radarcore as rc

part = rc.Body(rc.load_mesh("part.obj", scale=1e-3), motion=rc.Pose([1.5, 0.0, 0.0]))
frame = rc.Simulator(rc.Scene([part]), rc.bgt60tr13c()).frame()
print(f"found at {rc.strongest_peak(frame).range:.2f} m")
rc.plot.range_doppler_map(frame).figure.savefig("part.png")
"""


class StepTime:
    """Time since it was made, of the clock and of the processor in the processes that have ended since [s]."""

    def __init__(self) -> None:
        self._start = self._now()

    @staticmethod
    def _now() -> tuple[float, float]:
        times = os.times()
        return time.perf_counter(), times.children_user + times.children_system

    def __str__(self) -> str:
        elapsed, busy = (now - start for now, start in zip(self._now(), self._start, strict=True))
        return f"{elapsed:6.1f} s, of the processor {busy:5.1f} s"


def run(python: Path, directory: Path) -> str:
    """Time of the lines, which must find the plate and leave a picture."""
    directory.joinpath("part.obj").write_text(PART, encoding="utf-8")
    directory.joinpath("first.py").write_text(LINES, encoding="utf-8")
    # Nothing from outside of a fresh environment; pictures go to a file, with a display or without.
    environment = {**os.environ, "MPLBACKEND": "agg"}
    if python != Path(sys.executable):
        environment.pop("PYTHONPATH", None)
    watch = StepTime()
    output = subprocess.run(
        [python, "first.py"], cwd=directory, env=environment, check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    seconds = str(watch)
    assert output == "found at 1.50 m\n", output
    assert directory.joinpath("part.png").read_bytes().startswith(b"\x89PNG"), "part.png is no picture"
    return seconds


def whole_way(wheel: Path, directory: Path) -> None:
    """Print the time of every step from an empty environment on."""
    watch = StepTime()
    venv.create(directory / "fresh", with_pip=True)
    print(f"an empty environment       {watch}")
    python = directory / "fresh" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    watch = StepTime()
    install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", f"{wheel}[plot]"]
    subprocess.run(install, check=True)
    print(f"the wheel and what it needs{watch}")
    print(f"first picture              {run(python, directory)}")
    print(f"again                      {run(python, directory)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, help="another wheel than dist/*.whl")
    parser.add_argument("--tiny", action="store_true", help="nothing is installed")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if arguments.tiny:
            print(f"first picture, {len(LINES.splitlines())} lines: {run(Path(sys.executable), Path(name))}")
            return
        wheels = [arguments.wheel] if arguments.wheel else sorted(DIST.glob("*.whl"))
        if len(wheels) != 1:
            sys.exit(f"expected one wheel in {DIST}, got {len(wheels)}: make wheel, or --wheel FILE")
        whole_way(wheels[0].resolve(), Path(name))


if __name__ == "__main__":
    main()
