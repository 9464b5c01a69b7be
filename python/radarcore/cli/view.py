"""The command `radarcore view`: a scene file or a recording in the viewer Rerun."""

from __future__ import annotations

from collections.abc import Iterator

from radarcore import notice
from radarcore.adapters.rerun import Viewer
from radarcore.cli.options import OutputFile, Overwrite, Quiet, Source, SubtractMean
from radarcore.cli.sources import (
    NOT_BARE,
    WHOLE,
    AnyReader,
    BareSamples,
    Span,
    moving,
    open_recording,
    subtracts_mean,
    tracker_for,
)
from radarcore.cli.terminal import show
from radarcore.processing.detection.detect import detect
from radarcore.processing.tracking.tracker import Tracker
from radarcore.recording.frame import Frame
from radarcore.scenefile.load import Simulation, load_scene


def run(
    source: Source,
    /,
    *,
    output: OutputFile = None,
    subtract_mean: SubtractMean = None,
    overwrite: Overwrite = False,
    _quiet: Quiet = False,
    span: Span = WHOLE,
    bare: BareSamples = NOT_BARE,
) -> None:
    """Show every frame: bodies, depth image, detections and tracks.

    Parameters
    ----------
    source : path
        recording, BAG:/TOPIC, or scene file (TOML), which is simulated
    output : path
        write an .rrd file in place of opening it
    """
    if output is not None and output.suffix != ".rrd":
        raise ValueError(f"{output}: expected a file for Rerun (.rrd), got suffix {output.suffix!r}")
    if source.suffix == ".toml" and bare.description.given:
        got = ", ".join(f"--{name}" for name in bare.description.given)
        raise ValueError(f"{source}: expected no --config with a scene file, which has its radar, got {got}")
    if source.suffix == ".toml" and subtract_mean:
        raise ValueError(
            f"{source}: expected no --subtract-mean with a scene file, whose frames are shown as they come"
        )
    # The source is opened first: without one there is no output.
    if source.suffix == ".toml":
        span.refuse(source)
        simulation = load_scene(source)
        with Viewer(output, overwrite=overwrite) as viewer:
            number = _show(viewer, _of_scene(simulation, viewer))
    else:
        with open_recording(source, bare.description, span) as reader, Viewer(output, overwrite=overwrite) as viewer:
            number = _show(viewer, _of_recording(reader, subtract_mean))
    shown = "the viewer" if output is None else output
    show(f"{source}: {number} frames in {shown}")


def _show(viewer: Viewer, frames: Iterator[Frame]) -> int:
    """Show frames with their detections and tracks; returns their number."""
    number = 0
    tracker: Tracker | None = None
    for frame in frames:
        tracker = tracker or tracker_for(frame.radar)
        viewer.show_frame(frame)
        found = detect(frame)
        viewer.show_detections(found)
        viewer.show_tracks(tracker.update(found), found.time)
        number += 1
    return number


def _of_scene(simulation: Simulation, viewer: Viewer) -> Iterator[Frame]:
    """Frames of a scene file as they are simulated; poses and depth images are shown."""
    simulator, times = simulation.simulator(), simulation.run.times
    with notice.progress(times, "simulating", "frame", total=len(times)) as counted:
        for time in counted:
            middle = time + simulation.radar.middle
            viewer.show_poses(simulation.scene, middle, simulation.radar_motion)
            viewer.show_depth(simulator.depth_image(middle))
            yield simulator.frame(time).sequences()[0]


def _of_recording(reader: AnyReader, subtract_mean: bool | None) -> Iterator[Frame]:
    """Frames of a recording of any length; of a sensor without static echoes."""
    frames = moving(reader) if subtracts_mean(reader, subtract_mean) else iter(reader)
    with notice.progress(frames, "reading", "frame", total=len(reader)) as counted:
        for frame in counted:
            yield frame.sequences()[0]
