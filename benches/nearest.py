"""Nearest point of a walking person: errors and standard deviations, with and without separated echoes.

python benches/nearest.py         print the table
python benches/nearest.py --write also write the section of docs/tracking.md
python benches/nearest.py --tiny  two short walks

A UR10 swings the radar, as in benches/separation.py, in the room of ``radarcore demo``. Walks and noise are random.
"""

from __future__ import annotations

import argparse
import warnings
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from page import DOCS, RESULTS, table, write_section
from radarcore.cli import demo
from radarcore.comparison.targets import truth_of

TEXT = """\
## Nearest point of a person

`separate_echoes` reduces the median error of `nearest` (`smooth=True`) in the room of [the demo](demo.md):
{medians}; [by range](../benches/results/nearest.md). Other walks and the demo were used to choose constants. Written
by `python benches/nearest.py --write`.
"""
TABLE = """\
# Nearest point of a person, by range

Errors of `nearest` of `rc.track(..., targets="people", smooth=True)` without `separate_echoes` (detections) and with
it, against the nearest visible point of the body. Median and 95 % are of magnitudes. Last column: rms of error over
`nearest_deviation`. {num_frames} frames of every walk. Written by `python benches/nearest.py --write`.

{table}
"""
HEADER = ["bodies", "echoes", "range [m]", "frames", "median [cm]", "95 % [cm]", "error / deviation"]

RATE = 40.0
DEMO = rc.load_scene(Path(demo.__file__).with_name("experiment.toml"))
THINGS = [body for body in DEMO.scene.bodies if body.name in ("room", "table", "cylinder")]
DETECTOR = partial(rc.detect, false_alarm_rate=1e-4)  # as in `rc.compare`

EDGES = [0.0, 2.0, 3.0, 5.0]
"""Of the bins of true ranges [m]."""


def walk(seed: int, num_frames: int, *, meshes: bool) -> tuple[rc.Recording, rc.Attached]:
    """Frames of a person on a random path, and the motion of the radar."""
    rng = np.random.default_rng(seed)
    side, width, turn, phase = rng.choice([-1.0, 1.0]), *rng.uniform([0.8, 1.9, 0.0], [2.2, 3.3, 4.0])
    path = [[turn + rng.uniform(0.8, 1.6), 0.7 + 0.5 * width], [turn, 0.5 * width], [turn, -0.5 * width], [5.2, -1.8]]
    height, speed, gait = rng.uniform([1.6, 0.7, 0.0], [1.9, 1.4, 1.0])
    person = rc.models.Human(height=height, speed=speed, path=path * np.array([1.0, side]), turn_radius=0.2, phase=gait)
    arm = (rc.models.RobotArm.named("ur10") if meshes else rc.models.RobotArm.ur10()).moving(
        lambda t: np.deg2rad([15.0 * np.sin(1.5 * t + phase), -112.0, 134.6, -22.6, 90.0, 0.0]),
        base=rc.Pose([0.0, 0.0, 0.7]),
    )
    motion = rc.Attached(arm.link_motion("tool0"), rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0)
    bodies = (person.mesh_bodies if meshes else person.bodies)(name="person")
    scene = rc.Scene([*THINGS, *arm.bodies(), *bodies])
    simulator = rc.Simulator(scene, DEMO.radar, radar_motion=motion, seed=seed)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*has a radial speed of")  # feet, for a few frames
        return simulator.record(0.0, num_frames / RATE, RATE, progress=False), motion


def errors(recording: rc.Recording, motion: rc.Attached, *, separate_echoes: bool) -> NDArray[np.float64]:
    """True range, error and standard deviation of the nearest point in every frame of the longest track, (frame, 3)."""
    assert recording.truth is not None
    true, _ = truth_of(recording.truth, "person/trunk")
    follow = partial(rc.track, recording, detector=DETECTOR, smooth=True, targets="people", max_missed=20)
    tracks = follow(motion=motion, separate_echoes=separate_echoes)
    one = max(tracks, key=lambda each: np.isfinite(true[each.frame]).sum(), default=None)
    if one is None:
        return np.zeros((0, 3))
    rows = np.stack([true[one.frame], one.nearest - true[one.frame], one.nearest_deviation], axis=1)
    return np.asarray(rows[np.isfinite(rows).all(axis=1)])


def lines(bodies: str, echoes: str, rows: NDArray[np.float64]) -> list[list[str]]:
    """Lines of the table: bins of ranges, and all."""
    result = []
    for low, high in [*pairwise(EDGES), (EDGES[0], EDGES[-1])]:
        _, error, deviation = rows[(rows[:, 0] >= low) & (rows[:, 0] < high)].T
        if len(error) >= 20 or (low, high) == (EDGES[0], EDGES[-1]):
            values = *np.percentile(100.0 * np.abs(error), [50.0, 95.0]), np.sqrt(np.mean(np.square(error / deviation)))
            text = (f"{value:.{digits}f}" for value, digits in zip(values, (1, 1, 2), strict=True))
            result.append([bodies, echoes, f"{low:g} to {high:g}", str(len(error)), *text])
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/tracking.md")
    options = parser.parse_args()
    num_shapes, num_meshes, num_frames = (1, 1, 6) if options.tiny else (10, 3, 100)
    if not rc.models.robots.is_available():
        num_meshes = 0
        print("the extra `robots` is not installed, walks of meshes are left out: pip install radarcore[robots]\n")
    rows = []
    for name, number in (("shapes", num_shapes), ("meshes", num_meshes)):
        walks = [walk(3000 + seed, num_frames, meshes=name == "meshes") for seed in range(number)]
        for is_separated in (False, True) if walks else ():
            found = np.concatenate([errors(*each, separate_echoes=is_separated) for each in walks])
            rows += lines(name, "separated" if is_separated else "detections", found)
    text = table(HEADER, rows)
    print(text)
    if options.write:
        (RESULTS / "nearest.md").write_text(TABLE.format(num_frames=num_frames, table=text), encoding="utf-8")
        total = [row for row in rows if row[2] == f"{EDGES[0]:g} to {EDGES[-1]:g}"]
        pairs = zip(total[::2], total[1::2], strict=True)
        medians = ", ".join(f"{before[0]} {before[4]} to {after[4]} cm" for before, after in pairs)
        write_section(DOCS / "tracking.md", "nearest", TEXT.format(medians=medians))


if __name__ == "__main__":
    main()
