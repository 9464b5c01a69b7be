"""Frames of the demo in which the strongest peak is the person: as they are, and without what stands still.

    python benches/ego_motion.py            all 200 frames
    python benches/ego_motion.py --write    also write the section of docs/ego-motion.md
    python benches/ego_motion.py --tiny     run everything once on two frames

The demo's arm carries the radar at 250 mm/s towards a metal cylinder in a room, while a person walks in and out.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from page import DOCS, printed_into
from radarcore.cli.demo import scene_text

RANGE_MARGIN, VELOCITY_MARGIN = 0.2, 0.3
"""A peak is on the person within these of the ranges [m] and velocities [m/s] of the segments that are seen."""

MOVING = 0.2
"""Speed from which the arm counts as moving [m/s]."""


def demo(num_frames: int | None) -> tuple[rc.Recording, NDArray[np.float64]]:
    """Recording of the demo and the velocity of its sensor in every frame, along its own axes [m/s]."""
    with tempfile.TemporaryDirectory() as directory:
        file = Path(directory) / "scene.toml"
        file.write_text(scene_text(with_robots=False), encoding="utf-8")
        simulation = rc.load_scene(file)
    if num_frames is not None:  # from when the arm moves
        stop = 1.0 + num_frames / simulation.run.rate
        simulation = replace(simulation, run=simulation.run.model_copy(update={"start": 1.0, "stop": stop}))
    with warnings.catch_warnings():
        # The feet of the person are faster than max_velocity for a few frames, as docs/demo.md says.
        warnings.filterwarnings("ignore", message=".*has a radial speed of")
        recording = simulation.record(progress=False)
    motion = simulation.radar_motion
    times = recording.time + recording.radar.middle
    return recording, np.array([motion.at(t).rotation.T @ motion.rate_at(t)[:, 3] for t in times.tolist()])


def is_on_person(recording: rc.Recording) -> NDArray[np.bool_]:
    """True for frames whose strongest peak is at the range and velocity of some part of the person, (frame,)."""
    assert recording.truth is not None
    segments = recording.truth.select([name for name in recording.truth.names if name.startswith("person/")])
    found = np.zeros(len(recording), dtype=bool)
    for k, frame in enumerate(recording.frames()):
        peak = rc.strongest_peak(frame)
        if peak is None:
            continue
        near = np.abs(segments.range[k] - peak.range) <= RANGE_MARGIN
        found[k] = (near & (np.abs(segments.velocity[k] - peak.velocity) <= VELOCITY_MARGIN)).any()
    return found


def main() -> None:
    """Count and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tiny", action="store_true", help="run everything once on two frames")
    parser.add_argument("--write", action="store_true", help="write the section of docs/ego-motion.md")
    arguments = parser.parse_args()
    recording, velocity = demo(2 if arguments.tiny else None)
    is_moving = np.linalg.norm(velocity, axis=1) >= MOVING
    began = time.perf_counter()
    filtered = rc.remove_static(recording, velocity)
    elapsed = time.perf_counter() - began
    began = time.perf_counter()
    joint = rc.remove_static(recording, velocity, method="space-time")
    joint_elapsed = time.perf_counter() - began
    with printed_into(DOCS / "ego-motion.md", "ego_motion", write=arguments.write):
        print(
            f"strongest peak on the person        of {len(recording)} frames   of {is_moving.sum()} with a moving arm"
        )
        for name, one in (
            ("unfiltered", recording),
            ("mean of the chirps subtracted", rc.remove_static(recording, [0.0, 0.0, 0.0])),
            ("remove_static", filtered),
            ('remove_static, "space-time"', joint),
        ):
            found = is_on_person(one)
            print(f"{name:<34}{found.sum():>11}{found[is_moving].sum():>16}")
    each, joint_each = (1e3 * seconds / len(recording) for seconds in (elapsed, joint_elapsed))
    print(f'\nremove_static: {each:.1f} ms a frame; "space-time": {joint_each:.0f} ms')


if __name__ == "__main__":
    main()
