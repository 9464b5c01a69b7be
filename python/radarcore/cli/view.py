"""The command `radarcore view`: a scene file or a recording in the viewer Rerun."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from radarcore import notice
from radarcore.adapters.rerun import Viewer
from radarcore.cli.source import open_recording
from radarcore.cli.static import moving, removes_static
from radarcore.processing.detection import detect
from radarcore.processing.tracking import Tracker
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame
from radarcore.scenefile.load import load_scene
from radarcore.simulate.times import frame_times


def run(options: argparse.Namespace) -> int:
    """Show every frame: what is there, what the radar sees of it, and what is detected and tracked."""
    source: Path = options.source
    if options.output is not None and options.output.suffix != ".rrd":
        raise ValueError(f"{options.output}: expected a file for Rerun (.rrd), got suffix {options.output.suffix!r}")
    frames = _of_scene if source.suffix == ".toml" else _of_recording
    if source.suffix == ".toml" and options.config.given:
        got = ", ".join(f"--{name}" for name in options.config.given)
        raise ValueError(f"{source}: expected no --config with a scene file, which has its radar, got {got}")
    if source.suffix == ".toml" and options.remove_static:
        raise ValueError(
            f"{source}: expected no --remove-static with a scene file, whose frames are shown as they come"
        )
    number = 0
    with Viewer(options.output) as viewer:
        tracker: Tracker | None = None
        for frame in frames(source, options, viewer):
            tracker = tracker or _tracker(frame.radar)
            viewer.show_frame(frame)
            found = detect(frame)
            viewer.show_detections(found)
            viewer.show_tracks(tracker.update(found), found.time)
            number += 1
    shown = "the viewer" if options.output is None else options.output
    print(f"{source}: {number} frames in {shown}")
    return 0


def _of_scene(path: Path, _: argparse.Namespace, viewer: Viewer) -> Iterator[Frame]:
    """Frames of a scene file as they are simulated; poses and depth images are shown."""
    simulation = load_scene(path)
    simulator, run = simulation.simulator(), simulation.run
    times = frame_times(run.start, run.stop, run.rate)
    with notice.progress(times, "simulating", "frame", total=len(times)) as counted:
        for time in counted:
            middle = time + 0.5 * simulation.radar.waveform.duration
            viewer.show_poses(simulation.scene, middle, simulation.radar_motion)
            viewer.show_depth(simulator.depth_image(middle))
            yield simulator.frame(time).sequences()[0]


def _of_recording(path: Path, options: argparse.Namespace, _: Viewer) -> Iterator[Frame]:
    """Frames of a recording, however long; those of a sensor without what stands still."""
    with open_recording(path, options.config) as reader:
        frames = moving(reader) if removes_static(reader, options.remove_static) else iter(reader)
        with notice.progress(frames, "reading", "frame", total=len(reader)) as counted:
            for frame in counted:
                yield frame.sequences()[0]


def _tracker(radar: Radar) -> Tracker:
    """Tracker that knows how velocities of the radar fold."""
    has_period = radar.waveform.num_chirps > 1 and radar.waveform.has_uniform_chirps
    return Tracker(max_velocity=radar.max_velocity if has_period else None)
