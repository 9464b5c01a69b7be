"""Datasets: frames per second and core, against the simulator alone, size of a frame, and memory.

python benches/dataset.py            print the tables
python benches/dataset.py --write    also write the section of docs/datasets.md
python benches/dataset.py --tiny     a few frames of each, and no table that means anything
"""

from __future__ import annotations

import argparse
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from tempfile import TemporaryDirectory

import radarcore as rc
from page import DOCS, machine, table, write_section
from radarcore.dataset.making import Recipe, num_cores
from radarcore.dataset.store import attributes_of, create, layout_of, samples_in_shard, writable, write_shard

RADAR = 'radar.preset = "bgt60tr13c"\n'
ADC = "radar.receiver = { output = 'real', noise_figure_db = 12.0, gain_db = 60.0, full_scale = 1.2, adc_bits = 12 }\n"
LONG, LONGEST, SHORT = (f"run.stop = {stop:g}\n" for stop in (0.25, 1.0, 0.02))
"""Ten frames, forty, and a single one in a tiny run."""

PERSON = (
    LONG
    + """
[[human]]
name = "person"
path = [[{ uniform = [2.0, 4.0] }, 0.0], [1.0, 0.0]]
speed = { uniform = [0.5, 1.5] }
"""
)
ROOM = """
[[body]]
name = "wall"
shape = { kind = "plate", width = 4.0, height = 2.5 }
pose.position = [5.0, 0.0, 0.0]
[[body]]
name = "box"
shape = { kind = "box", size = [0.4, 0.4, 0.4] }
pose.position = [{ uniform = [1.5, 4.0] }, { uniform = [-1.0, 1.0] }, -0.5]
"""
BALL = """
[[point]]
name = "ball"
position = [{ uniform = [1.0, 2.5] }, 0.0, 0.0]
velocity = [{ uniform = [-1.0, 1.0] }, 0.0, 0.0]
"""
SCENES = {
    "a person in a room, 10 frames": (RADAR + PERSON + ROOM, 20),
    "the same, codes of an ADC": (RADAR + ADC + PERSON + ROOM, 20),
    "a ball, 40 frames": (RADAR + LONGEST + BALL, 60),
    "a ball, 1 frame": (RADAR + SHORT + BALL, 600),
}
"""Scene files, and samples of each."""

PER_SHARD = 5
"""Samples of a shard in the table of several workers: some shards for each of them."""

SMALL = 'radar.preset = "bgt60tr13c"\nradar.num_chirps = 8\nradar.num_samples = 32\nrun.stop = 0.25\n'


def simulated(scene: Path, count: int, clock: Callable[[], float] = time.process_time) -> tuple[int, float]:
    """Frames of some samples, and their time in `Simulator.frame` [s]; by default CPU time."""
    variation = rc.dataset.Variation.load(scene)
    seconds, num_frames = 0.0, 0
    for index in range(count):
        simulation = variation.sample(index, seed=1).simulation()
        simulator = simulation.simulator(threads=1)
        began = clock()
        for start in simulation.run.times:
            simulator.frame(start)
            num_frames += 1
        seconds += clock() - began
    return num_frames, seconds


def made(scene: Path, out: Path, count: int, workers: int, per_shard: int) -> tuple[float, float]:
    """Wall time of a dataset, and CPU time of this process and its children [s]."""
    shutil.rmtree(out, ignore_errors=True)
    began, before = time.perf_counter(), cores_used()
    rc.dataset.make(scene, out, count=count, workers=workers, samples_per_shard=per_shard, progress=False)
    return time.perf_counter() - began, cores_used() - before


def cores_used() -> float:
    """CPU time of this process and its finished children [s], independent of other programs."""
    return sum(used.ru_utime + used.ru_stime for used in map(getrusage, (RUSAGE_SELF, RUSAGE_CHILDREN)))


def size_of(path: Path) -> int:
    """Size of a folder [bytes]."""
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())


def resident() -> float:
    """Memory of this process [MB]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return float(line.split()[1]) / 1024.0
    return float("nan")


def speeds(folder: Path, tiny: bool) -> str:
    """Table of frames per second of one core, and of their size; a terabyte of the first scene."""
    rows, sizes = [], []
    for name, (text, count) in SCENES.items():
        scene, out = folder / "scene.toml", folder / "out"
        scene.write_text(text.replace(LONG, SHORT).replace(LONGEST, SHORT) if tiny else text)
        number = 1 if tiny else count
        # Fewer samples than cores would have more threads.
        few = 1 if tiny else num_cores()
        if not tiny:
            made(scene, out, few, 1, few)  # so that all is loaded
        num_frames, alone = simulated(scene, number)
        # Planning and the end take the same time for any number of samples.
        first = made(scene, out, few, 1, few)[1]
        # Shards have the length of a large dataset.
        per_shard = min(few + number, samples_in_shard(10**6, size_of(out) // few, None))
        own = made(scene, out, few + number, 1, per_shard)[1] - first
        start = max(0.0, first - own * few / number)
        per_frame = size_of(out) / num_frames * number / (few + number)
        sizes.append((per_frame, num_frames / own))
        rows.append(
            [
                name,
                f"{num_frames / alone:.1f}",
                f"{num_frames / own:.1f}",
                f"{100.0 * alone / own:.0f} %",
                f"{start:.2f}",
                f"{per_frame:.0f}",
                f"{3600.0 * num_frames / own * per_frame / 1e9:.2f}",
            ]
        )
    header = [
        *("scene", "`Simulator.frame` [1/s]", "stored [1/s]", "share", "start [s]"),
        *("bytes per frame", "GB per hour and core"),
    ]
    (size, stored), (codes, _), *_ = sizes
    hours = 1e12 / size / stored / 3600.0
    terabyte = f"A terabyte of the first scene is {1e6 / size:.0f} million frames, {hours:.0f} core hours."
    return f"{table(header, rows)}\n\n{terabyte} ADC codes take {100.0 * codes / size:.0f} % of it."


def rate(scene: Path, count: int) -> float:
    """Frames per second that `Simulator.frame` makes of some samples, by the clock."""
    num_frames, seconds = simulated(scene, count, time.perf_counter)
    return num_frames / seconds


def scaling(folder: Path, tiny: bool) -> str:
    """Table of frames per second by the clock, of one and of all cores."""
    scene, out = folder / "people.toml", folder / "people"
    cores = 1 if tiny else num_cores()
    scene.write_text(SMALL + BALL if tiny else RADAR + PERSON + ROOM)
    rows, count = [], 1 if tiny else 20
    per_sample = simulated(scene, 1)[0]
    alone = [rate(scene, count)]
    for workers in [cores] if tiny else sorted({1, cores}):
        # Parallel processes of the simulator are the upper limit.
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            together = sum(pool.map(rate, [scene] * workers, [count] * workers))
        few, number = workers * PER_SHARD, (2 if tiny else 16) * workers * PER_SHARD
        start = 0.0 if tiny else made(scene, out, few, workers, PER_SHARD)[0]
        stored = (number - few) * per_sample / (made(scene, out, number, workers, PER_SHARD)[0] - start)
        rows.append((workers, together, stored))
    # Before and after, as the clock of a core changes.
    alone.append(rate(scene, count))
    one = sum(alone) / len(alone)
    header = [
        *("workers", "Simulator.frame in parallel processes [1/s]", "stored [1/s]"),
        *("share of workers x one process", "share of parallel processes"),
    ]
    return table(
        header,
        [
            [
                f"{n}",
                f"{together:.1f}",
                f"{stored:.1f}",
                f"{100.0 * stored / (n * one):.0f} %",
                f"{100.0 * stored / together:.0f} %",
            ]
            for n, together, stored in rows
        ],
    )


def memory(folder: Path, tiny: bool) -> str:
    """Table of the memory of a process that makes small frames."""
    scene = folder / "small.toml"
    scene.write_text(SMALL + BALL)
    per_sample, rows = 10, []
    for num_frames in (10, 20) if tiny else (100, 1000, 10_000):
        made(scene, folder / "small", num_frames // per_sample, 1, 100)
        rows.append([f"{num_frames}", f"{resident():.0f}"])
    return table(["frames made in one process", "memory [MB]"], rows)


def writing(folder: Path, tiny: bool) -> str:
    """Table of the time that the files of a shard take, of float samples and of compressed codes."""
    rows = []
    for name, receiver in {"float32": "", "codes of an ADC": ADC}.items():
        scene = folder / "writing.toml"
        scene.write_text(RADAR + receiver + (SHORT if tiny else LONG) + BALL)
        recipe = Recipe(rc.dataset.Variation.load(scene), 1, rc.dataset.Labels(), 1)
        number = 1 if tiny else 60
        frames = recipe.first_frames(number)
        layout = layout_of(recipe.variation, recipe.variation.label_names, recipe.labels, frames, number, number)
        attrs = attributes_of(recipe.variation, layout, 1, recipe.labels, frames[0].radar)
        create(folder / name, layout, {}, attrs)
        rows_of_all = layout.empty_rows(0)
        for index in range(number):
            recipe.fill({key: values[index, ...] for key, values in rows_of_all.items()}, layout, index)
        began = cores_used()
        write_shard(folder / name, writable(folder / name), layout, 0, rows_of_all)
        seconds = cores_used() - began
        size = size_of(folder / name) / 1e6
        rows.append([name, f"{size:.1f}", f"{1e3 * seconds / number:.2f}", f"{size / seconds:.0f}"])
    return table(["shard", "size [MB]", "writing per sample of 10 frames [ms]", "MB/s of one core"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true", help="a few frames of each")
    parser.add_argument("--write", action="store_true", help="write the section of docs/datasets.md")
    options = parser.parse_args()
    texts = [f"{machine()}:"]
    with TemporaryDirectory() as name:
        for part in (speeds, scaling, memory, writing):
            texts.append(part(Path(name), options.tiny))
            print(texts[-1], end="\n\n", flush=True)
    if options.write:
        write_section(DOCS / "datasets.md", "dataset", "\n\n".join(texts))


if __name__ == "__main__":
    main()
