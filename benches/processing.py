"""Run time from samples to tracks, stage by stage: people who walk in a room with a cylinder.

python benches/processing.py         print the tables
python benches/processing.py --write also write the section of docs/tracking.md
python benches/processing.py --tiny  a few frames

Every frame goes through ``rc.detect(frame)`` and ``Tracker.update`` with their defaults, on one thread. Times are CPU
times, so other programs on the machine have little effect.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from page import PERFORMANCE, machine, table, write_section
from radarcore import _core
from radarcore.processing.detection import detect as detection

RATE = 40.0
"""Frames per second of the stream."""

STAGES: dict[str, tuple[Any, str]] = {
    "transforms": (detection, "_map"),
    "CFAR": (_core, "maxima_above"),
    "sidelobes": (_core, "above_sidelobes"),
    "fit": (detection, "fit"),
    "directions": (detection, "waves_of"),
}
"""Where the functions of the stages of `rc.detect` are looked up."""

TEXT = """\
## Detection and tracking

From samples to tracks, `rc.detect(frame)` and `Tracker.update`, with the defaults of both and of `rc.bgt60tr13c()`, on
one thread ({machine}, shared with others). People walk in front of three walls and a metal cylinder. Processor time
per frame; "x real time" is the interval of {rate:.0f} frames per second over the mean. Written by
`python benches/processing.py --write`.

{tables}
"""

Array = NDArray[np.float64]


CYLINDER = (2.4, 0.5, 1.0)
"""Middle of the cylinder [m]."""

WAYS = {
    "a person": [[[4.0, 0.8], [1.3, 0.3], [1.0, -1.8]]],
    "four people": [
        [[4.0, 0.8], [1.3, 0.3], [1.0, -1.8]],
        [[1.5, 1.4], [1.8, 0.2], [4.4, -0.6]],
        [[4.6, -1.6], [1.8, -0.8]],
        [[1.1, -0.5], [3.2, -0.2], [4.4, 1.2]],
    ],
}
"""Waypoints [m] of people in a room."""


def walkers(ways: list[list[list[float]]]) -> list[rc.models.Human]:
    """Somebody along each way."""
    return [rc.models.Human(height=1.75, speed=0.85, path=way) for way in ways]


def recording(people: list[rc.models.Human], duration: float) -> rc.Recording:
    """People walk about in front of three walls and a metal cylinder."""
    sides = {
        "back": ((0.1, 5.0, 2.8), (5.2, 0.0, 1.4)),
        "left": ((6.0, 0.1, 2.8), (2.2, 2.4, 1.4)),
        "right": ((6.0, 0.1, 2.8), (2.2, -2.4, 1.4)),
    }
    walls = [
        rc.Body(rc.shapes.box(size), material=rc.materials["plasterboard"], motion=rc.Pose(list(place)), name=name)
        for name, (size, place) in sides.items()
    ]
    cylinder = rc.Body(
        rc.shapes.cylinder(radius=0.06, length=0.5),
        material=rc.materials["metal"],
        motion=rc.Pose(list(CYLINDER)),
        name="cylinder",
    )
    limbs = [body for k, person in enumerate(people) for body in person.bodies(name=f"person {k}")]
    simulator = rc.Simulator(
        rc.Scene([*walls, cylinder, *limbs]),
        rc.bgt60tr13c(),
        radar_motion=rc.Pose([0.0, 0.0, 1.0]),
        sampling="fast",
    )
    return simulator.record(0.0, duration, rate=RATE, progress=False)


class Stopwatch:
    """Time spent in functions [s], by their names; they do not call each other."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, whose time is added up."""

        def run(*arguments: Any, **settings: Any) -> Any:
            start = time.thread_time()
            result = function(*arguments, **settings)
            self.seconds[name] = self.seconds.get(name, 0.0) + time.thread_time() - start
            return result

        return run


def measure(rec: rc.Recording, num_rounds: int, *, by_stage: bool) -> tuple[dict[str, Array], Array, Array]:
    """Times (round, frame) of stages [s], and the numbers of detections and of tracks in every frame (frame,)."""
    watch, rows = Stopwatch(), []
    counts = np.zeros((2, len(rec)))
    frames = list(rec.frames())
    with ExitStack() as patches:
        for name, (owner, attribute) in STAGES.items() if by_stage else ():
            timed = watch.timed(name, getattr(owner, attribute))
            patches.enter_context(mock.patch.object(owner, attribute, timed))
        for number in range(num_rounds + 1):
            tracker = rc.Tracker(velocity_ambiguity=2.0 * rec.radar.waveform.max_velocity)
            for k, frame in enumerate(frames):
                watch.seconds = dict.fromkeys(STAGES if by_stage else (), 0.0)
                start = time.thread_time()
                found = rc.detect(frame)
                middle = time.thread_time()
                states = tracker.update(found)
                end = time.thread_time()
                counts[:, k] = len(found), len(states)
                if number > 0:  # the first round makes what is kept for later frames
                    rows.append({**watch.seconds, "detect": middle - start, "track": end - middle, "all": end - start})
    times = {name: np.array([row[name] for row in rows]).reshape(num_rounds, -1) for name in rows[0]}
    return times, *counts


def times_of(name: str, rec: rc.Recording, num_rounds: int) -> str:
    """Table of the stages, with what was in the frames."""
    whole, num_detections, num_tracks = measure(rec, num_rounds, by_stage=False)
    stages, *_ = measure(rec, num_rounds, by_stage=True)
    parts = {stage: stages[stage] for stage in STAGES}
    parts["rest of detect"] = stages["detect"] - sum(parts.values())
    parts["tracker"] = stages["track"]
    parts["all"] = whole["all"]
    shape = " x ".join(map(str, rec.cube.shape[1:]))
    lines = [f"{name.capitalize()}: {len(rec)} frames of {shape} float32, {num_rounds} rounds;"]
    for kind, counts in (("detections", num_detections), ("tracks", num_tracks)):
        lines.append(f"{counts.mean():.1f} {kind} a frame ({counts.min():.0f} to {counts.max():.0f})")
    # Other programs only make rounds slower: the best round is the time of the work.
    header = ["stage", "mean [ms]", "median", "worst", "mean of best round", "x real time"]
    rows = []
    for stage, each in parts.items():
        mean, best = each.mean(), each.mean(axis=1).min()
        values = (mean, np.median(each), each.max(), best)
        rows.append([stage, *(f"{1e3 * value:.3f}" for value in values), f"{1.0 / (RATE * mean):.0f}"])
    return f"{lines[0]} {', '.join(lines[1:])}.\n\n{table(header, rows)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/tracking.md")
    options = parser.parse_args()
    duration, num_rounds = (0.1, 1) if options.tiny else (3.0, 10)
    tables = [times_of(name, recording(walkers(ways), duration), num_rounds) for name, ways in WAYS.items()]
    print("\n\n".join(tables))
    if options.write:
        text = TEXT.format(machine=machine(), rate=RATE, tables="\n\n".join(tables))
        write_section(PERFORMANCE, "processing", text)


if __name__ == "__main__":
    main()
