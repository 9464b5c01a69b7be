"""Speed-up of frames and recordings by threads.

python benches/cores.py            print the table
python benches/cores.py --write    also write its section of benches/results/performance.md
python benches/cores.py --tiny     a few frames on one and two threads
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np

import radarcore as rc
from frame import RATE, measure, scene
from page import PERFORMANCE, machine, milliseconds, table, write_section

FINE = {"rcs_floor": 1e-3, "ray_budget": np.inf}
"""Settings of frames of many rays."""

FRAMES_PER_THREAD = 20
"""Frames of a recording per thread, of at least five: the first of every thread has no tiles to take over."""

TEXT = """\
## Cores

The person and the arm in a room of "A frame, stage by stage", from a sensor on the arm, on {machine}. Written by
`python benches/cores.py --write`: medians over {frames} frames [ms], and in brackets the median of one thread over it.
"Fine" frames have `rcs_floor=1e-3` and {fine_rays} rays in the mean. The last row is the time per frame of `record`,
which simulates one frame per thread in parallel.

{table}
"""


def thread_numbers() -> list[int]:
    """1, 2, 4, ... up to the number of cores."""
    cores = os.cpu_count() or 1
    return [number for number in (1, 2, 4, 8, 16, 32, 64) if number <= max(2, cores)]


def recorded(simulator: rc.Simulator, num_frames: int) -> float:
    """Time per frame of a recording [s]."""
    simulator.frame(0.0)
    start = time.perf_counter()
    simulator.record(1.0 / RATE, (num_frames + 1) / RATE, RATE, progress=False)
    return (time.perf_counter() - start) / num_frames


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the section of benches/results/performance.md")
    parser.add_argument("--tiny", action="store_true", help="a few frames on one and two threads")
    options = parser.parse_args()
    num_frames, numbers = (2, [1, 2]) if options.tiny else (40, thread_numbers())
    bodies, sensors, _ = scene()
    radar = rc.bgt60tr13c(
        start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=64, chirp_interval=300e-6
    )

    def simulator(threads: int, **settings: float) -> rc.Simulator:
        motion = sensors["sensor on the arm"]
        return rc.Simulator(
            bodies, radar, radar_motion=motion, field_of_view_deg=(90.0, 60.0), threads=threads, **settings
        )

    times: dict[str, list[float]] = {}
    fine_rays = 0.0
    for threads in numbers:
        default = measure("", simulator(threads), num_frames)
        for stage, seconds in default.stages.items():
            times.setdefault("frame, all" if stage == "all" else stage, []).append(float(np.median(seconds)))
        fine = measure("", simulator(threads, **FINE), max(2, num_frames // 4))
        fine_rays = float(fine.counts["rays"].mean())
        times.setdefault("fine frame, all", []).append(float(np.median(fine.stages["all"])))
        recorded_frames = num_frames if options.tiny else FRAMES_PER_THREAD * max(5, threads)
        times.setdefault("record", []).append(recorded(simulator(threads), recorded_frames))
    rows = [
        [name, *(f"{milliseconds(each)} ({seconds[0] / each:.1f}x)" for each in seconds)]
        for name, seconds in times.items()
    ]
    text = table(["stage", *(f"{number} thread{'s' if number > 1 else ''}" for number in numbers)], rows)
    print(text)
    if options.write:
        filled = TEXT.format(table=text, machine=machine(), frames=num_frames, fine_rays=f"{fine_rays:.0f}")
        write_section(PERFORMANCE, "cores", filled)


if __name__ == "__main__":
    main()
