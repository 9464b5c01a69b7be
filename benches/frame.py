"""Run time of a frame, stage by stage: a person and an arm in a room, and ten boxes; and of one from a depth image.

python benches/frame.py            print the tables
python benches/frame.py --write    also write its section of benches/results/performance.md
python benches/frame.py --tiny     one frame each
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any
from unittest import mock

import numpy as np

import radarcore as rc
from page import PERFORMANCE, machine, milliseconds, table, write_section
from radarcore import _core
from radarcore.models import RADAR_AT_TOOL0, Human, JointTrajectory, RobotArm
from radarcore.motion.protocol import Motion

RATE = 40.0

ADD_NOISE, ENGINE = _core.add_noise, _core.Simulator
"""Names of the core that the stopwatch replaces."""

ENOUGH_TIMES = 8
"""Times at which delays of smooth motion need to be taken at most."""

TEXT = """\
## A frame, stage by stage

A person of {person} triangles walks and a UR10 of {arm} triangles moves in a room; ten boxes turn and move in front of
a static sensor. 3 receivers, 64 chirps, 128 samples, {machine}, two threads. Written by
`python benches/frame.py --write`: medians over {frames} frames at 40 Hz [ms], default settings and fast sampling.
"noise" is the core's part of the receiver, "Python" everything outside of the core: placement, truth, checks. "rays"
is the mean number cast per frame; the others are reused from the previous frame, which a static sensor permits wherever
nothing moves in view. "paths" is the number of material points. "more than {enough} times" counts the frames whose
delays need more node times. The last two rows are processor time on one thread: of such frames, and of a first
frame, which reuses nothing.

{table}

The same call without a scene, from depth images of {image} pixels that all move:

{depth}
"""


@dataclass
class Stopwatch:
    """An engine of the core that notes run times [s]: its own, of its stages, and of the receiver in the core."""

    engine: _core.Simulator
    seconds: float = 0.0
    noise: float = 0.0
    ideal: _core.IdealFrame | None = None

    @property
    def stages(self) -> dict[str, float]:
        """Run times of the stages of the last frame [s]."""
        return {} if self.ideal is None else dict(self.ideal.stage_times)

    def frame(self, motion: _core.Placement, rates: _core.Placement | None = None) -> _core.IdealFrame | None:
        """The engine's frame."""
        start = time.perf_counter()
        ideal = self.engine.frame(motion, rates)
        self.seconds += time.perf_counter() - start
        self.ideal = ideal or self.ideal
        return ideal

    def add_noise(self, *arguments: Any) -> None:
        """The core's noise."""
        start = time.perf_counter()
        ADD_NOISE(*arguments)
        self.noise = time.perf_counter() - start


@dataclass
class Column:
    """Run times [s] and counts of frames."""

    name: str
    stages: dict[str, np.ndarray]
    counts: dict[str, np.ndarray]
    cpu: np.ndarray = field(default_factory=lambda: np.empty(0))
    first: np.ndarray = field(default_factory=lambda: np.empty(0))


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


def boxes() -> rc.Scene:
    """Ten boxes that move and turn."""
    cube = rc.shapes.box((0.2, 0.2, 0.2))
    return rc.Scene(
        rc.Body(
            cube,
            motion=rc.Linear(
                rc.Pose([2.0 + 0.1 * k, 0.3 * k - 1.35, 0.0]),
                velocity=[0.1 * k - 0.5, 0.0, 0.0],
                angular_velocity=[0.0, 0.1, 0.3 * k],
            ),
            name=f"box {k}",
        )
        for k in range(10)
    )


def column_of(name: str, make: Callable[[int], rc.Simulator], num_frames: int) -> Column:
    """Stages on two threads, and processor times on one, by simulators of a number of threads."""
    column = measure(name, make(2), num_frames)
    column.cpu, column.first = processor_times(make, num_frames)
    return column


def simulator_of(scene: rc.Scene, radar: rc.Radar, settings: dict[str, Any], threads: int) -> rc.Simulator:
    return rc.Simulator(scene, radar, threads=threads, **settings)


def depth_images(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances of a wavy wall that comes closer, now and one frame before [m]: every pixel has a range rate."""
    y, z = np.meshgrid(np.linspace(-1.0, 1.0, columns), np.linspace(0.75, -0.75, rows))
    now = 2.5 + 0.3 * np.sin(3.0 * y + 1.0) * np.cos(2.0 * z)
    return now, now + (0.8 + 0.5 * y - 0.2 * z) / RATE


def depth_row(radar: rc.Radar, rows: int, columns: int, num_frames: int) -> list[str]:
    """Number of paths and run times of `frame_from_depth`."""
    now, before = depth_images(rows, columns)
    watches: list[Stopwatch] = []

    def engine(*arguments: Any, **settings: Any) -> Stopwatch:
        watches.append(Stopwatch(ENGINE(*arguments, **settings)))
        return watches[-1]

    times = []
    with mock.patch.object(_core, "Simulator", engine):
        for _ in range(num_frames + 1):  # the first warms up
            start = time.perf_counter()
            frame = rc.frame_from_depth(
                now, 0.5, radar, camera=(60.0, 45.0), albedo=0.2, previous=before, interval=1.0 / RATE, threads=2
            )
            times.append(time.perf_counter() - start)
    core = np.median([watch.seconds for watch in watches[1:]])
    whole = np.array(times[1:])
    spread = [core, np.median(whole), whole.mean(), np.quantile(whole, 0.95)]
    return ["frame_from_depth", str(frame.stats["paths"]), *(milliseconds(float(each)) for each in spread)]


def processor_times(make: Callable[[int], rc.Simulator], num_frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Processor times [s] on one thread of frames one after another, and of first frames."""
    times, first = np.empty(num_frames), np.empty(min(num_frames, 5))
    for number in range(len(first)):
        simulator = make(1)
        start = time.process_time()
        simulator.frame(0.0)
        first[number] = time.process_time() - start
    for number in range(num_frames):
        start = time.process_time()
        simulator.frame((number + 1) / RATE)
        times[number] = time.process_time() - start
    return times, first


def measure(name: str, simulator: rc.Simulator, num_frames: int) -> Column:
    """Run times of the stages, and some counts, of frames one after another."""
    simulator.frame(0.0)
    watch = Stopwatch(simulator._engines[0])
    vars(simulator)["_engines"] = [watch]
    stages: list[dict[str, float]] = []
    counts: list[list[float]] = []
    with mock.patch.object(_core, "add_noise", watch.add_noise):
        for number in range(1, num_frames + 1):
            watch.seconds = 0.0
            start = time.perf_counter()
            frame = simulator.frame(number / RATE)
            everything = time.perf_counter() - start
            rest = watch.seconds - sum(watch.stages.values())
            python = everything - watch.seconds - watch.noise
            times = {"the rest of the core": rest, "noise": watch.noise, "Python": python, "all": everything}
            stages.append({**watch.stages, **times})
            counts.append([frame.stats[key] for key in ("rays_cast", "paths", "delay_nodes")])
    rays, paths, nodes = np.array(counts, dtype=np.float64).T
    return Column(
        name,
        {key: np.array([times[key] for times in stages]) for key in stages[0]},
        {"rays": rays, "paths": paths, f"more than {ENOUGH_TIMES} times": nodes > ENOUGH_TIMES},
    )


def rows(columns: list[Column]) -> list[list[str]]:
    """Medians of all stages, spread of the whole, means of rays and paths, number of frames with many times."""
    found = [
        [stage, *(milliseconds(float(np.median(column.stages[stage]))) for column in columns)]
        for stage in columns[0].stages
    ]
    whole = [column.stages["all"] for column in columns]
    found.append(["all, mean", *(milliseconds(float(times.mean())) for times in whole)])
    found.append(["all, 95 %", *(milliseconds(float(np.quantile(times, 0.95))) for times in whole)])
    for title in columns[0].counts:
        counts = [column.counts[title] for column in columns]
        found.append([title, *(f"{each.sum() if each.dtype == bool else each.mean():.0f}" for each in counts)])
    found.append(["CPU, one thread", *(milliseconds(float(np.median(column.cpu))) for column in columns)])
    found.append(["CPU, first frame", *(milliseconds(float(np.median(column.first))) for column in columns)])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the section of benches/results/performance.md")
    parser.add_argument("--tiny", action="store_true", help="one frame each")
    options = parser.parse_args()
    num_frames = 1 if options.tiny else 60
    bodies, sensors, triangles = scene()
    radar = rc.bgt60tr13c(
        start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=64, chirp_interval=300e-6
    )
    columns = []
    for name, motion in sensors.items():
        for sampling in ("adaptive",) if options.tiny else ("adaptive", "fast"):
            view = {"radar_motion": motion, "field_of_view_deg": (90.0, 60.0), "sampling": sampling}
            columns.append(column_of(f"{name}, {sampling}", partial(simulator_of, bodies, radar, view), num_frames))
    columns.append(column_of("ten boxes", partial(simulator_of, boxes(), radar, {}), num_frames))
    text = table(["stage", *(column.name for column in columns)], rows(columns))
    print(text, end="\n\n")
    shape = (24, 32) if options.tiny else (240, 320)
    depth = table(["call", "paths", "core", "all", "all, mean", "all, 95 %"], [depth_row(radar, *shape, num_frames)])
    print(depth)
    if options.write:
        filled = TEXT.format(
            table=text,
            machine=machine(),
            frames=num_frames,
            enough=ENOUGH_TIMES,
            image=f"{shape[1]} x {shape[0]}",
            depth=depth,
            **triangles,
        )
        write_section(PERFORMANCE, "frame", filled)


if __name__ == "__main__":
    main()
