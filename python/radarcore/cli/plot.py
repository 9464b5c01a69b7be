"""Pictures of `radarcore plot`: of a recording or of a scene file."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np
from cyclopts import Parameter

from radarcore import check, plot
from radarcore.cli.options import (
    AS_USUAL,
    Count,
    Detecting,
    Number,
    OutputFile,
    Overwrite,
    Quiet,
    Source,
    SubtractMean,
    given,
)
from radarcore.cli.sources import WHOLE, Reading, beside, moving, moving_frame, subtracts_mean
from radarcore.cli.terminal import show
from radarcore.output import check_file
from radarcore.plot import canvas
from radarcore.processing.clutter.static import remove_mean
from radarcore.processing.detection.detect import detect
from radarcore.processing.tracking.tracker import track
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import Simulation, load_scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from radarcore.plot import Image

Part = TypeVar("Part", Frame, Recording)

OF_FRAMES: dict[str, Callable[..., Axes]] = {
    "chirp": plot.chirp,
    "range-profile": plot.range_profile,
    "map": plot.range_doppler_map,
    "detections": lambda frame, **view: _detections(frame, **view),
    "range-angle": plot.range_angle_map,
}
"""Pictures of one frame."""

OF_RECORDINGS: dict[str, Callable[..., Axes]] = {
    "range-time": plot.range_time,
    "spectrogram": plot.spectrogram,
    "tracks": lambda recording, **view: _tracks(recording, **view),
}
"""Pictures of a recording; a scene is simulated for them."""

OF_IMAGES: dict[str, Callable[[Image], Axes]] = {"depth": plot.depth_image, "reflectance": plot.reflectance_image}
"""Pictures of what the rays of a scene hit."""

FIGURES = ("overview", "experiment")
"""Pictures of several panels, which write themselves."""

KINDS = ("overview", *OF_FRAMES, *OF_RECORDINGS, *OF_IMAGES, "above", "experiment")
"""Names of the pictures; the last four need a scene."""


VIEWS = {
    "overview": ("channel", "max_range", "max_velocity", "subtract_mean"),
    "chirp": ("channel",),
    "range-profile": ("channel", "max_range", "subtract_mean"),
    "map": ("channel", "max_range", "max_velocity", "subtract_mean"),
    "detections": ("channel", "false_alarm_rate", "min_range", "max_range", "max_velocity", "subtract_mean"),
    "range-angle": ("max_range", "subtract_mean"),
    "range-time": ("channel", "max_range", "subtract_mean"),
    "spectrogram": ("channel", "min_range", "max_range", "max_velocity", "subtract_mean"),
    "tracks": ("false_alarm_rate", "min_range", "max_range", "subtract_mean"),
    "experiment": ("max_range",),
}
"""Options of the pictures."""

_WITHOUT_STATIC = "static echoes removed"


def run(
    source: Source,
    /,
    *,
    output: OutputFile = None,
    kind: Annotated[str, Parameter(metavar="KIND", choices=KINDS)] = "overview",
    frame: Count = None,
    sequence: Number = 0,
    channel: Count = None,
    max_velocity: Annotated[float | None, Parameter(metavar="V")] = None,
    subtract_mean: SubtractMean = None,
    overwrite: Overwrite = False,
    _quiet: Quiet = False,
    detecting: Detecting = AS_USUAL,
    reading: Reading = WHOLE,
) -> None:
    """Draw a recording or a scene file.

    Parameters
    ----------
    source : path
        recording, BAG:/TOPIC, or scene file (TOML)
    output : path
        picture: .png, .pdf, .svg (default: NAME-KIND.png beside the source)
    kind : str
        the last four need a scene file
    frame : int
        index of the frame (default: the middle one)
    sequence : int
        index of the sub-sequence, of several
    channel : int
        one channel (default: the powers of all, added)
    max_velocity : float
        end of the velocity axis to either side [m/s]
    """
    plot.require()
    output = output or beside(source, f"-{kind}.png")
    suffixes = (".png", ".pdf", ".svg", ".jpg")
    if output.suffix.lower() not in suffixes:
        raise ValueError(f"{output}: expected a picture ({', '.join(suffixes)}), got suffix {output.suffix!r}")
    check_file(output, overwrite=overwrite)
    chosen = detecting.given | given(channel=channel, max_velocity=max_velocity, subtract_mean=subtract_mean)
    wrong = sorted(name for name, value in chosen.items() if value is not False and name not in VIEWS.get(kind, ()))
    if wrong:
        kinds = ", ".join(name for name, names in VIEWS.items() if wrong[0] in names)
        raise ValueError(f"{wrong[0]}: expected a picture of kind {kinds}, got {kind!r}")
    if kind in FIGURES:
        chosen |= {"path": output, "overwrite": overwrite}
    if source.suffix == ".toml":
        reading.refuse(source)
        figure = _of_scene(load_scene(source), kind, frame, sequence, chosen)
    else:
        recording = _sequence(reading.load(source), sequence)
        figure = _of_recording(recording, source, kind, frame, chosen)
    if kind not in FIGURES:
        canvas.save(figure, output, overwrite=overwrite)
    show(output)


def _of_recording(recording: Recording, path: Path, kind: str, number: int | None, view: dict[str, Any]) -> Any:
    if kind not in OF_RECORDINGS and kind not in OF_FRAMES and kind != "overview":
        raise ValueError(f"{path}: expected a scene file for a picture of kind {kind!r}, got a recording")
    if len(recording) == 0:
        raise ValueError(f"{path}: expected at least one frame, got none")
    can_remove = "subtract_mean" in VIEWS[kind]  # a picture of samples shows them as they are
    removes = can_remove and subtracts_mean(recording, view.pop("subtract_mean", None))
    if kind in OF_RECORDINGS:
        return OF_RECORDINGS[kind](recording, **view, subtract_mean=removes).figure
    index = _number(number, len(recording))
    shown = moving_frame(recording, index) if removes else recording[index]
    if kind == "overview":
        return plot.overview(recording[index], None, moving=shown if removes else None, **view)
    ax = OF_FRAMES[kind](shown, **view)
    told = ["", _WITHOUT_STATIC] if removes else []
    ax.set_title(f"{ax.get_title()}, frame {index} of {len(recording)}" + "\n".join(told))
    return ax.figure


def _sequence(whole: Part, number: int) -> Part:
    """One of the sub-sequences of a frame or recording."""
    parts: tuple[Part, ...] = whole.sequences()
    return parts[check.index("sequence", number, len(parts))]


def _of_scene(simulation: Simulation, kind: str, number: int | None, sequence: int, view: dict[str, Any]) -> Any:
    run, simulator = simulation.run, simulation.simulator()
    angles = simulator.view_deg
    removes = bool(view.pop("subtract_mean", False))
    if kind in OF_RECORDINGS:
        return OF_RECORDINGS[kind](_sequence(simulation.record(), sequence), **view, subtract_mean=removes).figure
    if kind == "experiment":
        return plot.experiment(
            _sequence(simulation.record(), sequence),
            simulation.scene,
            simulation.radar_motion,
            field_of_view_deg=angles,
            **view,
        )
    times = run.times
    if kind == "above":
        shown = np.linspace(times[0], times[-1], 4) if number is None else [times[_number(number, len(times))]]
        return plot.scene_from_above(simulation.scene, simulation.radar_motion, shown, field_of_view_deg=angles).figure
    time = times[_number(number, len(times))]
    middle = time + simulation.radar.middle
    if kind in OF_IMAGES:
        return OF_IMAGES[kind](simulator.depth_image(middle)).figure
    frame = _sequence(simulator.frame(time), sequence)
    seen = remove_mean(frame) if removes else frame
    if kind == "overview":
        return plot.overview(frame, simulator.depth_image(middle), moving=seen if removes else None, **view)
    return OF_FRAMES[kind](seen, **view).figure


def _number(number: int | None, num_frames: int) -> int:
    return num_frames // 2 if number is None else check.index("frame", number, num_frames)


def _detections(
    frame: Frame,
    *,
    channel: int | None = None,
    max_range: float | None = None,
    max_velocity: float | None = None,
    **chosen: Any,
) -> Axes:
    """The range-velocity map, of one channel or all, with what is detected in all of them."""
    found = detect(frame, max_range=max_range, **chosen)
    return plot.range_doppler_map(frame, channel, detections=found, max_range=max_range, max_velocity=max_velocity)


def _tracks(recording: Recording, *, subtract_mean: bool = False, **limits: Any) -> Axes:
    """Tracks in range over time, and the true ranges of all bodies where they are known."""
    frames = moving(recording) if subtract_mean else recording.frames()
    found = track(frames, detector=partial(detect, **limits), num_dimensions=1)
    ax = plot.tracks(recording, found)
    ax.set_title(f"Tracks{f', {_WITHOUT_STATIC}' if subtract_mean else ''}")
    return ax
