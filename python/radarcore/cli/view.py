"""The command `radarcore view`: a board, a recording or a scene file, in a window, in pictures or in Rerun."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from radarcore import check, notice, plot
from radarcore.adapters.rerun import Viewer
from radarcore.cli.board_settings import NOT_SET, BoardSettings, gains_of, radar_of, sight
from radarcore.cli.options import OPTIONS, Count, Flag, Overwrite, Quiet, Speed, given, one_of_several
from radarcore.cli.sources import WHOLE, Reading, is_board, tracker_for
from radarcore.cli.terminal import show
from radarcore.plot.live.stream import STATIC_TIME
from radarcore.processing.clutter.static import has_offsets, remove_running_mean, without_offset
from radarcore.processing.detection.detect import detect
from radarcore.processing.inputs import with_samples
from radarcore.processing.tracking.tracker import Tracker
from radarcore.recording.frame import Frame
from radarcore.recording.recording import frames_when_due

if TYPE_CHECKING:
    from radarcore.simulate.simulator import Simulator

_PLACE = one_of_several()


@dataclass(frozen=True)
class _Opened:
    """Frames of a source and its name; their number, except of a board; the simulator of a scene."""

    name: str
    frames: Iterator[Frame]
    number: int | None = None
    simulator: Simulator | None = None


def run(
    source: Annotated[Path | None, Parameter(metavar="SOURCE")] = None,
    /,
    *,
    output: Annotated[Path | None, Parameter(alias="-o", metavar="PATH", group=(OPTIONS, _PLACE))] = None,
    rerun: Annotated[Flag, Parameter(group=(OPTIONS, _PLACE))] = False,
    overwrite: Overwrite = False,
    frames: Count = None,
    speed: Speed = 1.0,
    every: Annotated[float, Parameter(metavar="S")] = 1.0,
    subtract_mean: Annotated[bool | None, Parameter(negative="--keep-mean")] = None,
    _quiet: Quiet = False,
    settings: BoardSettings = NOT_SET,
    reading: Reading = WHOLE,
) -> None:
    """Show range and velocity live: in a window, in pictures, or with scene and tracks in the viewer Rerun.

    Parameters
    ----------
    source : path
        recording, BAG:/TOPIC, scene file (TOML), or port of a board (default: the first board that responds)
    output : path
        open no window: write pictures to a directory, or an .rrd file for Rerun
    rerun : bool
        open Rerun (extra `rerun`)
    frames : int
        end after N frames
    speed : float
        speed of a recording or scene in a window: factor of real time, or max (default: 1)
    every : float
        seconds between pictures
    subtract_mean : bool
        subtract the mean of the last seconds, or leave it in (default: out of sensors and their recordings)
    """
    is_rerun = rerun or (output is not None and output.suffix == ".rrd")
    if not is_rerun:
        plot.require()
    if frames is not None:
        check.count("frames", frames)
    check.positive("every", every, "s")
    if speed is not None:
        check.positive("speed", speed)
    with ExitStack() as stack:
        # The source is opened first: without one there is no output.
        opened = _opened(source, settings, reading, stack, is_rerun)
        shown: Iterator[Frame] = (frame.sequences()[0] for frame in islice(opened.frames, frames))
        if is_rerun:
            viewer = stack.enter_context(Viewer(output, overwrite=overwrite))
            number = _show(viewer, opened, shown, subtract_mean)
            show(f"{opened.name}: {number} frames in {'the viewer' if output is None else output}")
            return
        is_board = opened.number is None
        if output is None and speed is not None and not is_board:  # pictures need not wait for anybody
            shown = frames_when_due(shown, speed)
        plot.view(
            shown,
            output=output,
            overwrite=overwrite,
            every=every,
            title=opened.name,
            max_range=settings.max_range,
            subtract_mean=subtract_mean,
            hold=not is_board,
            say=show,
        )


def _opened(
    source: Path | None, settings: BoardSettings, reading: Reading, stack: ExitStack, is_rerun: bool
) -> _Opened:
    if source is None or is_board(source):
        from radarcore.sensor import open_sensor  # takes longer to load than the rest

        reading.refuse(source or "SOURCE", "a board")
        wanted = radar_of(settings)
        sensor = stack.enter_context(open_sensor(None if source is None else source.as_posix()))
        achieved = sensor.configure(wanted, **gains_of(settings))
        show(f"{sensor.info.port}: {sensor.info.chip}, {sight(achieved)}")
        return _Opened(f"{sensor.info.chip} on {sensor.info.port}", sensor.frames())
    # A window ends its axis at --max-range, whatever it shows.
    if wrong := [name for name in given(**vars(settings)) if is_rerun or name != "max_range"]:
        raise ValueError(f"{wrong[0]}: expected a board, which it sets, got {source}")
    if source.suffix == ".toml":
        from radarcore.scenefile.load import load_scene  # takes longer to load than the rest

        reading.refuse(source)
        simulation = load_scene(source)
        simulator, times = simulation.simulator(), simulation.run.times
        return _Opened(str(source), (simulator.frame(time) for time in times), len(times), simulator)
    reader = stack.enter_context(reading.open(source))
    return _Opened(str(source), iter(reader), len(reader))


def _show(viewer: Viewer, opened: _Opened, frames: Iterator[Frame], subtract_mean: bool | None) -> int:
    """Show frames with their detections and tracks; returns their number."""
    first = list(islice(frames, 1))
    frames = chain(first, frames)
    if first and (first[0].truth is None if subtract_mean is None else subtract_mean):
        frames = _moving(frames)
    tracker: Tracker | None = None
    number = 0
    try:
        with notice.progress(frames, "reading", "frame", total=opened.number) as counted:
            for frame in counted:
                tracker = tracker or tracker_for(frame.radar)
                viewer.show_frame(frame)
                if opened.simulator is not None:
                    middle = frame.time + frame.radar.middle
                    viewer.show_poses(opened.simulator.scene, middle, opened.simulator.radar_motion)
                    viewer.show_depth(opened.simulator.depth_image(middle))
                found = detect(frame)
                viewer.show_detections(found)
                viewer.show_tracks(tracker.update(found), found.time)
                number += 1
    except KeyboardInterrupt:
        if opened.number is not None:  # Ctrl-C is the usual end of a board
            raise
    return number


def _moving(frames: Iterator[Frame]) -> Iterator[Frame]:
    """The frames as the window shows them: without the offset of every chirp and the mean of the last seconds."""
    even = (with_samples(one, without_offset(one.cube), one.radar) if has_offsets(one) else one for one in frames)
    return remove_running_mean(even, time_constant=STATIC_TIME)
