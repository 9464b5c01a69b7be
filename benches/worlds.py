"""Frames of many worlds at once: rate, efficiency of several threads, and the share of Python.

python benches/worlds.py            print the table
python benches/worlds.py --write    also write its section of benches/results/performance.md
python benches/worlds.py --tiny     a few worlds on one and two threads
"""

from __future__ import annotations

import argparse
import time
from typing import Any
from unittest import mock

import numpy as np

import radarcore as rc
from cores import thread_numbers
from page import PERFORMANCE, machine, milliseconds, table, write_section
from radarcore import _core

ENGINE = _core.Simulator

TEXT = """\
## Many worlds

Written by `python benches/worlds.py --write` on {machine}: {worlds} worlds of a cell with an arm of seven boxes, a ball
and a floor, all bodies but the floor with velocities; 1 channel, 16 chirps, 64 samples, fast sampling, medians over
{calls} calls after the first, every body elsewhere in each. Efficiency: rate per thread relative to one thread.

{table}

Python takes {python:.2g} % of a call on one thread.
"""


def cell() -> rc.Scene:
    """Floor, arm and ball; the worlds say where they are."""
    links = [rc.Body(rc.shapes.box((0.1, 0.1, 0.3)), name=f"link {number}") for number in range(7)]
    floor = rc.Body(rc.shapes.plate(4.0, 4.0), motion=rc.Pose([1.5, 0.0, -0.5], _flat()), name="floor")
    return rc.Scene([floor, *links, rc.Body(rc.shapes.sphere(0.1), name="ball")])


def _flat() -> Any:
    return rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, -np.pi / 2.0, 0.0]).rotation


def motions(rng: np.random.Generator, worlds: int) -> tuple[Any, Any, Any]:
    """Poses (world, 8, 3, 4) of links in a chain and the ball, velocities and angular velocities."""
    turns = rng.uniform(-1.0, 1.0, (worlds, 7))
    heights = np.cumsum(0.28 * np.cos(turns), axis=1) - 0.6
    poses = np.zeros((worlds, 8, 3, 4))
    poses[..., :3] = np.eye(3)
    cosines, sines = np.cos(turns), np.sin(turns)
    poses[:, :7, 0, 0], poses[:, :7, 0, 2] = cosines, sines
    poses[:, :7, 2, 0], poses[:, :7, 2, 2] = -sines, cosines
    poses[:, :7, :, 3] = np.stack([1.6 + 0.1 * sines, 0.2 * sines, heights], axis=-1)
    poses[:, 7, :, 3] = rng.uniform([1.0, -0.5, -0.3], [2.5, 0.5, 0.5], (worlds, 3))
    return poses, rng.normal(0.0, 0.5, (worlds, 8, 3)), rng.normal(0.0, 0.5, (worlds, 8, 3))


class Timed:
    """Engine of the core that adds up its run time [s]."""

    seconds = 0.0

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self._engine = ENGINE(*arguments, **options)

    def worlds(self, *placed: Any) -> Any:
        """Frames of the worlds, timed."""
        start = time.perf_counter()
        done = self._engine.worlds(*placed)
        Timed.seconds += time.perf_counter() - start
        return done


def measure(threads: int, worlds: int, calls: int) -> tuple[float, float]:
    """Median time of a call, and of its part outside of the core [s]."""
    radar = rc.bgt60tr13c(num_chirps=16, num_samples=64, receiver=rc.Receiver(output="real", noise_figure_db=12.0))
    radar = rc.Radar(radar.waveform, rx=radar.rx[:1], receiver=radar.receiver, rx_patterns=radar.rx_patterns[:1])
    simulator = rc.Simulator(cell(), radar, sampling="fast", threads=threads)
    bodies = simulator.scene.names[1:]
    rng = np.random.default_rng(1)
    times = []
    with mock.patch.object(_core, "Simulator", Timed):
        for _ in range(calls + 1):
            poses, velocities, turns = motions(rng, worlds)
            Timed.seconds, start = 0.0, time.perf_counter()
            simulator.worlds(poses, velocities=velocities, angular_velocities=turns, bodies=bodies)
            total = time.perf_counter() - start
            times.append((total, total - Timed.seconds))
    every, python = np.median(times[1:], axis=0)
    return float(every), float(python)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the section of benches/results/performance.md")
    parser.add_argument("--tiny", action="store_true", help="a few worlds on one and two threads")
    options = parser.parse_args()
    worlds, calls, numbers = (4, 1, [1, 2]) if options.tiny else (256, 10, thread_numbers())
    found = [measure(threads, worlds, calls) for threads in numbers]
    one, python = found[0]
    rows = [
        [
            str(threads),
            milliseconds(seconds),
            f"{worlds / seconds:.0f}",
            f"{worlds / seconds / threads:.0f}",
            f"{one / seconds / threads:.2f}",
        ]
        for threads, (seconds, _) in zip(numbers, found, strict=True)
    ]
    header = ["threads", "call [ms]", "frames per second", "per thread", "efficiency"]
    text = TEXT.format(
        machine=machine(), worlds=worlds, calls=calls, table=table(header, rows), python=100.0 * python / one
    )
    print(text)
    if options.write:
        write_section(PERFORMANCE, "worlds", text)


if __name__ == "__main__":
    main()
