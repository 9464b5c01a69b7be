"""From samples to the distance that a robot has to keep: processor time of each stage, and errors against the truth.

python benches/separation.py         print the tables
python benches/separation.py --write also write the section of docs/separation.md
python benches/separation.py --tiny  a few frames

A UR10 swings a radar on its flange by +-15 degrees in a room while a person walks towards it, and away from it. The
truth is the distance between the surfaces of person and arm, by all vertices of their meshes.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import radarcore as rc
from page import DOCS, machine, table, write_section

RATE, NUM_WALKS, NUM_FRAMES = 40.0, 10, 100

TEXT = """\
## Errors and time

A UR10 swings the radar on its flange by +-15 degrees in a room while somebody walks towards it: {num_walks} walks of
{num_frames} frames at 40 Hz, with the settings above. The truth is the distance between the surfaces of person and arm,
seen from above. Written by `python benches/separation.py --write`.

{errors}

Processor time of one frame on one thread ({machine}, shared with others):

{times}
"""

Array = NDArray[np.float64]


def above(bodies: list[rc.Body], when: float) -> Array:
    """All vertices of bodies, seen from above (n, 2) [m]."""
    return np.concatenate([body.motion.at(when).apply(body.mesh.vertices)[:, :2] for body in bodies])


def swing(when: float) -> Array:
    return np.deg2rad([15.0 * np.sin(1.5 * when), -112.0, 134.6, -22.6, 90.0, 0.0])


def walk(seed: int, num_frames: int) -> tuple[list[float], list[float], int, dict[str, list[float]]]:
    """Errors of distances [m], required distances [m], frames without a person, and times of the stages [ms]."""
    rng = np.random.default_rng(seed)
    moving = rc.models.RobotArm.ur10().moving(swing, base=rc.Pose([0.0, 0.0, 0.7]))
    motion = rc.Attached(moving.link_motion("tool0"), rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0)
    path = [[rng.uniform(3.8, 4.4), rng.uniform(-1.0, 1.0)], [0.9, rng.uniform(-0.2, 0.2)]]
    person = rc.models.Human(height=rng.uniform(1.6, 1.9), speed=rng.uniform(0.6, 1.2), path=path, phase=rng.uniform())
    walls = rc.materials["plasterboard"]
    room = rc.Body(rc.shapes.box([7.0, 6.0, 2.8]), material=walls, motion=rc.Pose([2.5, 0.0, 1.4]), name="room")
    radar = rc.bgt60tr13c(max_velocity=6.0)
    body, links = person.bodies(), moving.bodies()
    simulator = rc.Simulator(rc.Scene([room, *body]), radar, radar_motion=motion)
    tracker = rc.Tracker(motion, targets="people", velocity_ambiguity=2.0 * radar.max_velocity)
    errors: list[float] = []
    required: list[float] = []
    missed = 0
    times: dict[str, list[float]] = {"detect": [], "track": [], "separation": [], "all": []}
    for k in range(num_frames):
        frame = simulator.frame(k / RATE)
        marks = [time.thread_time()]
        found = rc.detect(frame)
        marks.append(time.thread_time())
        states = tracker.update(found)
        marks.append(time.thread_time())
        separations = rc.separation(states, links)
        marks.append(time.thread_time())
        for stage, spent in zip(times, [*np.diff(marks), marks[-1] - marks[0]], strict=True):
            times[stage].append(1e3 * spent)
        if not separations:
            missed += k >= 3  # a track takes three detections
            continue
        distances, _ = cKDTree(above(links, found.time)).query(above(body, found.time))
        errors.append(separations[0].distance - float(distances.min()))
        required.append(separations[0].required)
    return errors, required, missed, times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/separation.md")
    options = parser.parse_args()
    num_walks, num_frames = (1, 6) if options.tiny else (NUM_WALKS, NUM_FRAMES)
    walks = [walk(seed, num_frames) for seed in range(num_walks)]
    error = np.concatenate([errors for errors, *_ in walks])
    required = np.concatenate([each for _, each, *_ in walks])
    share = 100.0 * len(error) / max(1, num_walks * (num_frames - 3))
    rows = [
        ["median error of the distance [m]", f"{np.median(error):+.3f}"],
        ["5 to 95 % of the errors [m]", f"{np.percentile(error, 5):+.3f} to {np.percentile(error, 95):+.3f}"],
        ["required distance, median [m]", f"{np.median(required):.2f}"],
        ["frames with a distance, after the first three [%]", f"{min(share, 100.0):.1f}"],
    ]
    errors = table(["quantity", "value"], rows)
    stages = {name: np.concatenate([times[name] for *_, times in walks]) for name in walks[0][3]}
    times = table(
        ["stage", "median [ms]", "95 % [ms]"],
        [[name, f"{np.median(each):.2f}", f"{np.percentile(each, 95):.2f}"] for name, each in stages.items()],
    )
    print(f"{errors}\n\n{times}")
    if options.write:
        text = TEXT.format(num_walks=num_walks, num_frames=num_frames, errors=errors, times=times, machine=machine())
        write_section(DOCS / "separation.md", "separation", text)


if __name__ == "__main__":
    main()
