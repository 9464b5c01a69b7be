"""Meshes of many triangles: time and memory to build them, and to cast an image of them.

python benches/large.py            print the table: 1 and 10 million triangles, half a minute
python benches/large.py --write    also write its section of benches/results/performance.md
python benches/large.py --tiny     run everything once on few triangles
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

import radarcore as rc
from meshes import room
from page import PERFORMANCE, machine, table, write_section

RADAR = rc.Radar(rc.Waveform(start_frequency=60e9, slope=1e12, sample_rate=1e6, num_samples=8))
"""A simulator wants one; casting does not use it."""

PAGE_TEXT = """\
## Large scenes

Rooms as above: `Mesh` and the first image of 256 x 256 pixels. Written by `python benches/large.py --write`.
{machine}, all of them. "core" is the memory of the core per triangle: triangles, BVH, shading, vertices. "peak" is
the peak memory of the whole process, including the numpy arrays of vertices and triangles.

{table}"""


def measure(num_triangles: int, shading: str) -> list[str]:
    """One row, measured in this process."""
    import resource

    vertices, triangles = room(num_triangles)
    start = time.perf_counter()
    mesh = rc.Mesh(vertices, triangles, shading=shading, progress=False)
    built = time.perf_counter()
    scene = rc.Scene([rc.Body(mesh)])
    image = rc.Simulator(scene, RADAR, field_of_view_deg=(60.0, 60.0)).depth_image()
    end = time.perf_counter()
    if not (image.body == 0).all():
        sys.exit(f"{num_triangles} triangles: the room has holes")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return [
        shading,
        f"{len(triangles):,}",
        f"{built - start:.2g}",
        f"{1e3 * (end - built):.0f}",
        f"{scene.memory / len(triangles):.0f}",
        f"{peak / 2**30:.2f}",
    ]


def main() -> None:
    """Rows in processes of their own, so that each has its own peak."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true", help="run everything once on few triangles")
    parser.add_argument("--write", action="store_true", help=f"write the section of {PERFORMANCE.name}")
    parser.add_argument("--row", nargs=2, metavar=("TRIANGLES", "SHADING"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if sys.platform == "win32":
        sys.exit("benches/large.py: memory of a process is not measured on Windows")
    if arguments.row:
        print("\t".join(measure(int(arguments.row[0]), arguments.row[1])))
        return
    rows = []
    for num_triangles in (2000,) if arguments.tiny else (1_000_000, 10_000_000):
        for shading in ("flat", "smooth"):
            command = [sys.executable, __file__, "--row", str(num_triangles), shading]
            row = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            rows.append(row.strip().split("\t"))
    text = table(["shading", "triangles", "build [s]", "image [ms]", "core [bytes/triangle]", "peak [GiB]"], rows)
    print(text)
    if arguments.write:
        write_section(PERFORMANCE, "large", PAGE_TEXT.format(machine=machine(), table=text))


if __name__ == "__main__":
    main()
