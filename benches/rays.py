"""Gains of the core's methods to trace rays and to build trees: the Rust benches `trace` and `bvh`, as ratios.

python benches/rays.py            print the tables: cargo bench several times, a quarter of an hour
python benches/rays.py --write    also write its section of benches/results/performance.md
python benches/rays.py --tiny     run a few of the benches for a moment
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from page import PERFORMANCE, machine, milliseconds, table, write_section

ROOT = Path(__file__).parent.parent
RUNS = 5
SIDE = 256  # pixels of an image in benches/trace.rs
SHORT = ["--warm-up-time", "0.2", "--measurement-time", "0.5"]
"""Criterion's options: several short runs, so that what is compared is measured at nearly the same time."""

FEW = ["--quick", "--warm-up-time", "0.01", "--measurement-time", "0.01", "5k"]
"""Benches for --tiny, in the build of the tests."""

LEVELS = {"avx512": "AVX-512", "avx2": "AVX2", "baseline": "baseline"}
"""Instruction sets, the best first."""

SCENES = {
    **{f"room_{size}": f"room {size}" for size in ("5k", "100k", "1M")},
    **{f"spheres/{number}_bodies": f"room and spheres, {number} bodies" for number in (10, 50, 200)},
}
"""Images by their names in benches/trace.rs."""

PAIRS = {
    **{
        f"image of {number} bodies, each with its tree": (
            f"trace/spheres/{number}_bodies/1_thread",
            "of one tree with all triangles",
            f"trace/spheres/{number}_bodies_as_one/1_thread",
        )
        for number in (10, 50, 200)
    },
    "new poses of 50 bodies": ("motion/50_bodies", "image of them", "trace/motion/50_bodies/1_thread"),
    "image by a tree refitted after a twist": (
        "trace/twisted/refitted/1_thread",
        "by a new tree",
        "trace/twisted/rebuilt/1_thread",
    ),
    **{
        f"new vertices for a room of {size}": (
            f"bvh/deform/surface_flat/room_{size}",
            "room built anew",
            f"bvh/build/surface_flat/room_{size}",
        )
        for size in ("5k", "100k", "1M")
    },
}
"""Method, its bench, the alternative, and its bench."""

PAGE_TEXT = """\
## Parts of ray casting

Images of 256 x 256 pixels, 60 degrees, and builds, in the core without Python. `python benches/rays.py --write` runs
`cargo bench --bench trace --bench bvh` {runs} times and writes this section. {machine}. The time of a run is its
fastest sample; times, and ratios within a run, are medians over the runs. On other machines times change more than
ratios.

{images}

Tiles of 8 x 8 rays on one thread with the best instruction set. "×" is the speedup over the other instruction sets
("baseline" is available on every processor of the target) and over single rays. "2 threads" is the speedup with two
threads, which suffer more from other work on the machine than one does. The rooms are those above; the spheres have 1
k triangles each and separate poses, their room has 5 k.

{pairs}

"×" is the speedup of the first over the second. Images use one thread, builds use all cores. The 50 bodies have 10 k
triangles each. The twisted body is a sphere of 100 k, twisted as far as its tree is kept.

Builds of the rooms in ms, on all cores: the tree alone, flat triangles, and smooth normals. "×" is the time relative
to the previous column.

{builds}
"""

Times = dict[str, float]
"""Times of the benches of a run [s], by their names."""


def run_benches(options: list[str], profile: str = "bench") -> Times:
    """Run cargo bench once."""
    benches = ["--bench", "trace", "--bench", "bvh"]
    command = ["cargo", "bench", "--quiet", "--locked", "--profile", profile, *benches, "--", *options]
    with tempfile.TemporaryDirectory() as directory:
        environment = {**os.environ, "CRITERION_HOME": directory}
        try:
            done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        except OSError as error:
            sys.exit(f"benches/rays.py: no cargo: {error}")
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}:\n{done.stderr.strip()}")
        return times_in(Path(directory))


def times_in(directory: Path) -> Times:
    """Fastest sample that criterion has left in a directory, which other work has delayed least."""
    times = {}
    for path in directory.rglob("new/benchmark.json"):
        name = json.loads(path.read_text(encoding="utf-8"))["full_id"]
        samples = json.loads(path.with_name("sample.json").read_text(encoding="utf-8"))
        times[name] = 1e-9 * float(np.min(np.divide(samples["times"], samples["iters"])))
    return times


def median(runs: list[Times], name: str) -> float:
    """Time of a bench [s]."""
    return float(np.median([run[name] for run in runs]))


def ratio(runs: list[Times], name: str, other: str) -> str:
    """Ratio of the run times of two benches."""
    return f"{np.median([run[name] / run[other] for run in runs]):.3g}"


def image_table(runs: list[Times]) -> str:
    levels = [level for level in LEVELS if f"trace/room_5k/{level}" in runs[0]]
    others = {level: f"× {LEVELS[level]}" for level in levels[1:]} | {"one_by_one": "× one by one"}
    rows = []
    for scene, name in SCENES.items():
        own = f"trace/{scene}/1_thread"
        if own in runs[0]:
            seconds = median(runs, own)
            ratios = [ratio(runs, f"trace/{scene}/{other}", own) for other in others]
            threads = ratio(runs, own, f"trace/{scene}/2_threads")
            rows.append([name, milliseconds(seconds), f"{1e-6 * SIDE**2 / seconds:.3g}", *ratios, threads])
    return table(["scene", "ms", "Mray/s", *others.values(), "2 threads"], rows)


def pair_table(runs: list[Times]) -> str:
    rows = [
        [what, milliseconds(median(runs, own)), instead, milliseconds(median(runs, other)), ratio(runs, other, own)]
        for what, (own, instead, other) in PAIRS.items()
        if own in runs[0]
    ]
    return table(["what", "ms", "instead", "ms", "×"], rows)


def build_table(runs: list[Times]) -> str:
    rows = []
    for size in ("5k", "100k", "1M"):
        tree, flat, smooth = (f"bvh/build/{part}/room_{size}" for part in ("tree", "surface_flat", "surface_smooth"))
        if tree in runs[0]:
            times = [milliseconds(median(runs, part)) for part in (tree, flat, smooth)]
            rows.append([f"room {size}", *times[:2], ratio(runs, flat, tree), times[2], ratio(runs, smooth, flat)])
    return table(["scene", "tree", "flat", "×", "smooth", "×"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true", help="run a few of the benches for a moment")
    parser.add_argument("--write", action="store_true", help=f"write the section of {PERFORMANCE.name}")
    arguments = parser.parse_args()
    runs = [run_benches(FEW, "dev")] if arguments.tiny else [run_benches(SHORT) for _ in range(RUNS)]
    images, pairs, builds = image_table(runs), pair_table(runs), build_table(runs)
    print(images, pairs, builds, sep="\n\n")
    if arguments.write:
        text = PAGE_TEXT.format(runs=len(runs), machine=machine(), images=images, pairs=pairs, builds=builds)
        write_section(PERFORMANCE, "rays", text)


if __name__ == "__main__":
    main()
