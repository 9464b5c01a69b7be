"""Run time of a frame in a live loop at 40 Hz: an arm, a floor and a person whose poses come step by step.

python benches/live.py            print the table
python benches/live.py --write    also write its section of benches/results/performance.md
python benches/live.py --tiny     a few frames
"""

from __future__ import annotations

import argparse
import time
from functools import cache
from typing import Any
from unittest import mock

import numpy as np

import radarcore as rc
from frame import Stopwatch
from page import PERFORMANCE, machine, milliseconds, table, write_section
from radarcore import _core
from radarcore.geometry.mesh import merged_mesh
from radarcore.models import Human, JointTrajectory, RobotArm
from radarcore.motion.group import Motions

RATE = 40.0
GOAL = 5e-3
"""Time of a frame that leaves a loop at 40 Hz most of its period [s]."""

SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"sampling": "fast"},
    "fast, 1 m^2": {"sampling": "fast", "rcs_floor": 1.0},
}

UPPER = ("trunk", "neck", "head", "left_upper_arm", "right_upper_arm", "left_forearm", "right_forearm")
"""Segments of the person's upper part."""

TILES = 24
"""Of the floor, along each side."""

TEXT = """\
## A live loop

{bodies} bodies of {triangles} triangles, whose poses and velocities come step by step (`rc.LiveGroup`): a UR10, a
floor, and a person in two parts. A still sensor with 3 receivers, 64 chirps, 128 samples; {machine}, two threads.
Written by `python benches/live.py --write`: {frames} frames at 40 Hz [ms], update of all poses and Python included.
"Python" is everything outside of the core, "the update" the part of it that takes the poses. "CPU time" sums all
threads; other programs on the machine change it less. "fast, 1 m^2" is fast sampling with `rcs_floor=1.0`: errors of
each cell are 40 dB below the echo of a person.

{table}
"""


def floor(side: float) -> rc.Mesh:
    """A square in tiles, seen from above."""
    steps = np.linspace(-0.5 * side, 0.5 * side, TILES + 1)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    corner = np.arange(TILES * (TILES + 1)).reshape(TILES, -1)[:, :-1].ravel()
    quads = np.column_stack([corner, corner + TILES + 1, corner + TILES + 2, corner + 1])
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return rc.Mesh(vertices, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


@cache
def person() -> tuple[rc.Mesh, rc.Mesh]:
    """Lower and upper part of a standing person who faces +x, as spheroids, finer ones at the trunk."""
    segments = {
        body.name.partition("/")[2]: merged_mesh([(body.mesh, body.motion.at(0.0))])
        for fine in (False, True)
        for body in Human(speed=0.0, breathing=None).bodies(name="person", subdivisions=5 if fine else 4)
        if fine == body.name.endswith("trunk")
    }
    lower = [(mesh, rc.Pose()) for name, mesh in segments.items() if name not in UPPER]
    return merged_mesh(lower), merged_mesh([(segments[name], rc.Pose()) for name in UPPER])


def scene() -> tuple[rc.Scene, rc.LiveGroup, Motions]:
    """The scene, the group that moves it, and motions in place of the program that says how."""
    angles = np.deg2rad([[0.0, -112.0, 134.6, -22.6, 90.0, 0.0], [20.0, -95.0, 120.0, -30.0, 80.0, 0.0]])
    arm = RobotArm.ur10().moving(JointTrajectory([0.0, 2.0], angles), base=rc.Pose([1.2, 0.0, 0.7]))
    links = [body for body in arm.bodies() if len(body.mesh.triangles) > 0]
    lower, upper = person()
    walk = rc.Linear(rc.Pose([3.2, 0.8, 0.0]), [-0.3, -0.6, 0.0], [0.0, 0.0, 0.2])
    sway = rc.Attached(walk, lambda t: rc.Pose.from_rpy([0, 0, 0], [0.03 * np.sin(5 * t), 0, 0]))
    bodies = [(body.mesh, body.motion) for body in links]
    bodies += [(floor(6.0), rc.Pose([2.5, 0.0, 0.0])), (lower, walk), (upper, sway)]
    group = rc.LiveGroup(len(bodies))
    materials = [rc.materials["metal"]] * len(links) + [rc.materials["concrete"]] + 2 * [rc.materials["skin"]]
    parts = zip(bodies, materials, group.motions, strict=True)
    live = rc.Scene(rc.Body(mesh, material=material, motion=motion) for (mesh, _), material, motion in parts)
    return live, group, Motions([motion for _, motion in bodies])


def turning(maps: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Angular velocities (body, 3) of poses and their rates (body, 3, 4)."""
    cross = rates[..., :3] @ np.swapaxes(maps[..., :3], -1, -2)
    return np.stack([cross[..., 2, 1], cross[..., 0, 2], cross[..., 1, 0]], axis=-1)


def measure(settings: dict[str, Any], num_frames: int) -> dict[str, np.ndarray]:
    """Run times of every frame of a loop, update and frame [s]."""
    bodies, group, motions = scene()
    radar = rc.bgt60tr13c(
        start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=64, chirp_interval=300e-6
    )
    sensor = rc.Pose([0.0, -0.6, 1.1])
    simulator = rc.Simulator(bodies, radar, radar_motion=sensor, field_of_view_deg=(90.0, 60.0), threads=2, **settings)
    times = np.zeros((num_frames, 5))

    def step(number: int) -> tuple[float, float]:
        """One turn of the loop: run time of the update, and of all [s]."""
        now = np.array([number / RATE])
        maps, rates = motions.poses_at(now)[0], motions.rates_at(now)[0]
        angular = turning(maps, rates)
        start = time.perf_counter()
        group.update(float(now[0]), maps, velocities=rates[..., 3], angular_velocities=angular)
        updated = time.perf_counter()
        simulator.frame()
        return updated - start, time.perf_counter() - start

    step(0)
    watch = Stopwatch(simulator._engines[0])
    vars(simulator)["_engines"] = [watch]
    with mock.patch.object(_core, "add_noise", watch.add_noise):
        for number in range(num_frames):
            watch.seconds, used = 0.0, time.process_time()
            update, everything = step(number + 1)
            used = time.process_time() - used
            core = watch.seconds + watch.noise
            times[number] = everything, core, everything - core, update, used
    return dict(zip(("a frame", "the core", "Python", "the update", "CPU time"), times.T, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the section of benches/results/performance.md")
    parser.add_argument("--tiny", action="store_true", help="a few frames")
    options = parser.parse_args()
    num_frames = 2 if options.tiny else 200
    found = {name: measure(settings, num_frames) for name, settings in SETTINGS.items()}
    rows = [
        [f"{part}, {name}", *(milliseconds(float(of(times[part]))) for times in found.values())]
        for part in found["fast"]
        for name, of in (("median", np.median), ("mean", np.mean), ("95 %", lambda t: np.quantile(t, 0.95)))
    ]
    within = [f"{100.0 * float((times['a frame'] <= GOAL).mean()):.0f} %" for times in found.values()]
    rows.append([f"frames within {1e3 * GOAL:g} ms", *within])
    text = table(["", *found], rows)
    print(text)
    if options.write:
        bodies, _, _ = scene()
        counts = {"bodies": len(bodies.bodies), "triangles": f"{bodies.num_triangles:,}".replace(",", " ")}
        filled = TEXT.format(table=text, machine=machine(), frames=num_frames, **counts)
        write_section(PERFORMANCE, "live", filled)


if __name__ == "__main__":
    main()
