"""What a frame costs, stage by stage: a person walks and an arm moves in a room, 3 receivers x 64 chirps x 128 samples.

python benches/frame.py            print the tables
python benches/frame.py --write    also write the section of docs/performance.md
python benches/frame.py --tiny     one frame each
"""

from __future__ import annotations

import argparse
import os
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

# Threads of numpy's BLAS that wait for work would slow everything else down.
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np

import radarcore as rc
from page import PERFORMANCE, machine, milliseconds, table, write_section
from radarcore import _core
from radarcore.models import RADAR_AT_TOOL0, Human, JointTrajectory, RobotArm
from radarcore.motion.protocol import Motion
from radarcore.simulate import simulator as simulate
from radarcore.simulate.places import Places

RATE = 40.0

STAGES: list[tuple[str, Any, str]] = [
    ("places of bodies", Places, "at"),
    ("places of bodies", Places, "place_ahead"),
    ("places of bodies", Places, "rates_at"),
    ("rays and cells", rc.Simulator, "_cast_rays"),
    ("material points", rc.Simulator, "_scatterers"),
    ("material points", rc.Simulator, "_courses"),
    ("delays and amplitudes", rc.Simulator, "_follow"),
    ("sum over paths", _core, "beat_signal"),
    ("truth", rc.Simulator, "_truth"),
    ("receiver", simulate, "receive"),
]
"""What is timed, and where it is; time of one stage inside another counts for the inner one."""

TEXT = """\
## A frame, stage by stage

A person of {person} triangles walks and a UR10 of {arm} triangles moves in a room; 3 receivers, 64 chirps, 128
samples, {machine}, two threads. Written by `python benches/frame.py --write`: medians over {frames} frames at 40 Hz
[ms], adaptive sampling within a budget of rays. "rays" is the mean number cast per frame; the others are reused from
the previous frame, which a static sensor permits wherever nothing moves in view. "paths" is the number of material
points.

{table}
"""


def scene() -> tuple[rc.Scene, dict[str, Motion], dict[str, int]]:
    """The scene, the motions of a still sensor and of one on the arm, and the numbers of triangles."""
    arm = RobotArm.ur10()
    angles = np.deg2rad([[0.0, -112.0, 134.6, -22.6, 90.0, 0.0], [20.0, -95.0, 120.0, -30.0, 80.0, 0.0]])
    moving = arm.moving(JointTrajectory([0.0, 2.0], angles), base=rc.Pose([0.0, 0.0, 0.7]))
    person = Human(speed=1.3, path=[[4.6, 1.8], [3.0, 0.6], [3.2, -1.6]])
    people, links = person.bodies(subdivisions=3), moving.bodies()
    room = rc.Body(
        rc.shapes.box((6.6, 6.0, 2.8)),
        material=rc.materials["plasterboard"],
        motion=rc.Pose([2.5, 0.0, 1.4]),
        name="room",
    )
    sensors: dict[str, Motion] = {
        "still sensor": rc.Pose([-0.4, -0.6, 1.1]),
        "sensor on the arm": rc.Attached(moving.link_motion("tool0"), rc.Pose([0.0, 0.0, 0.05]) @ RADAR_AT_TOOL0),
    }
    triangles = {
        name: sum(len(body.mesh.triangles) for body in bodies) for name, bodies in (("person", people), ("arm", links))
    }
    return rc.Scene([room, *links, *people]), sensors, triangles


@contextmanager
def timed(times: dict[str, float]) -> Iterator[None]:
    """Time spent in every stage [s]."""
    running: list[list[float]] = []

    def wrap(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            inner = [0.0]
            running.append(inner)
            start = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                elapsed = time.perf_counter() - start
                running.pop()
                times[name] += elapsed - inner[0]
                if running:
                    running[-1][0] += elapsed

        return call

    patches = [patch.object(where, what, wrap(name, getattr(where, what))) for name, where, what in STAGES]
    for each in patches:
        each.start()
    try:
        yield
    finally:
        for each in patches:
            each.stop()


def measure(simulator: rc.Simulator, num_frames: int) -> tuple[dict[str, float], dict[str, float]]:
    """Median times of the stages [s], and means of some counts."""
    simulator.frame(0.0)
    stages: dict[str, list[float]] = defaultdict(list)
    counts: dict[str, list[float]] = defaultdict(list)
    for number in range(1, num_frames + 1):
        times: dict[str, float] = dict.fromkeys((name for name, _, _ in STAGES), 0.0)
        with timed(times):
            start = time.perf_counter()
            frame = simulator.frame(number / RATE)
            times["all"] = time.perf_counter() - start
        times["the rest, in Python"] = times["all"] - sum(times[name] for name in {name for name, _, _ in STAGES})
        for name, seconds in times.items():
            stages[name].append(seconds)
        for name in ("rays_cast", "paths"):
            counts[name].append(frame.stats[name])
    medians = {name: float(np.median(seconds)) for name, seconds in stages.items()}
    return medians, {name: float(np.mean(values)) for name, values in counts.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the section of docs/performance.md")
    parser.add_argument("--tiny", action="store_true", help="one frame each")
    options = parser.parse_args()
    num_frames = 1 if options.tiny else 60
    bodies, sensors, triangles = scene()
    radar = rc.bgt60tr13c(
        start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=64, chirp_interval=300e-6
    )
    columns: list[tuple[str, dict[str, float], dict[str, float]]] = []
    for name, motion in sensors.items():
        for budget in (10_000,) if options.tiny else (10_000, 40_000):
            simulator = rc.Simulator(
                bodies,
                radar,
                radar_motion=motion,
                field_of_view_deg=(90.0, 60.0),
                ray_budget=budget,
                threads=2,
            )
            columns.append((f"{name}, {budget // 1000} k", *measure(simulator, num_frames)))
    names = [*dict.fromkeys(name for name, _, _ in STAGES), "the rest, in Python", "all"]
    rows = [[name, *(milliseconds(times[name]) for _, times, _ in columns)] for name in names]
    for title, count in (("rays", "rays_cast"), ("paths", "paths")):
        rows.append([title, *(f"{counts[count]:.0f}" for _, _, counts in columns)])
    text = table(["stage", *(name for name, _, _ in columns)], rows)
    print(text)
    if options.write:
        filled = TEXT.format(table=text, machine=machine(), frames=num_frames, **triangles)
        write_section(PERFORMANCE, "frame", filled)


if __name__ == "__main__":
    main()
