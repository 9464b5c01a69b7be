"""Pictures of `radarcore plot`: of a recording or of a scene file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radarcore import check, plot
from radarcore.processing.peaks import strongest_peak
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import load_scene
from radarcore.scenefile.simulation import Simulation
from radarcore.simulate.times import frame_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from radarcore.plot import Image

OF_FRAMES: dict[str, Callable[..., Axes]] = {
    "chirp": plot.chirp,
    "range-profile": plot.range_profile,
    "map": plot.range_doppler_map,
}
"""Pictures of one frame."""

OF_RECORDINGS: dict[str, Callable[..., Axes]] = {
    "range-time": plot.range_time,
    "spectrogram": plot.spectrogram,
    "tracks": lambda recording: _tracks(recording),
}
"""Pictures of a recording; a scene is simulated for them."""

OF_IMAGES: dict[str, Callable[[Image], Axes]] = {"depth": plot.depth_image, "reflectance": plot.reflectance_image}
"""Pictures of what the rays of a scene hit."""

KINDS = ("overview", *OF_FRAMES, *OF_RECORDINGS, *OF_IMAGES, "above", "experiment")
"""Names of the pictures; the last four need a scene."""


def draw(source: Path, picture: Path, *, kind: str = "overview", frame: int | None = None) -> None:
    """Draw a recording or a scene file.

    Parameters
    ----------
    source : path
        Recording, or scene file (``.toml``).
    picture : path
        Output file, in the format of the suffix.
    kind : str
        One of `KINDS`.
    frame : int, optional
        Number of the frame, from the end when negative; default: the one in the middle.
    """
    plot.require()
    check.choice("kind", kind, KINDS)
    suffixes = (".png", ".pdf", ".svg", ".jpg")
    if picture.suffix.lower() not in suffixes:
        raise ValueError(f"{picture}: expected a picture ({', '.join(suffixes)}), got suffix {picture.suffix!r}")
    figure = (
        _of_scene(load_scene(source), kind, frame) if source.suffix == ".toml" else _of_recording(source, kind, frame)
    )
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=150)


def _of_recording(path: Path, kind: str, number: int | None) -> Any:
    recording = Recording.load(path)
    if kind in OF_RECORDINGS:
        return OF_RECORDINGS[kind](recording).figure
    if kind not in OF_FRAMES and kind != "overview":
        raise ValueError(f"{path}: expected a scene file for a picture of kind {kind!r}, got a recording")
    if len(recording) == 0:
        raise ValueError(f"{path}: expected at least one frame, got none")
    frame = recording[_number(number, len(recording))]
    return plot.overview(frame, None) if kind == "overview" else OF_FRAMES[kind](frame).figure


def _of_scene(simulation: Simulation, kind: str, number: int | None) -> Any:
    run, simulator = simulation.run, simulation.simulator()
    view = simulator.view_deg
    if kind in OF_RECORDINGS:
        return OF_RECORDINGS[kind](simulation.record()).figure
    if kind == "experiment":
        return plot.experiment(simulation.record(), simulation.scene, simulation.radar_motion, field_of_view_deg=view)
    times = frame_times(run.start, run.stop, run.rate)
    if kind == "above":
        shown = np.linspace(times[0], times[-1], 4) if number is None else [times[_number(number, len(times))]]
        return plot.scene_from_above(simulation.scene, simulation.radar_motion, shown, field_of_view_deg=view).figure
    time = times[_number(number, len(times))]
    middle = time + 0.5 * simulation.radar.waveform.duration
    if kind in OF_IMAGES:
        return OF_IMAGES[kind](simulator.depth_image(middle)).figure
    frame = simulator.frame(time)
    return plot.overview(frame, simulator.depth_image(middle)) if kind == "overview" else OF_FRAMES[kind](frame).figure


def _number(number: int | None, num_frames: int) -> int:
    return num_frames // 2 if number is None else check.index("frame", number, num_frames)


def _tracks(recording: Recording) -> Axes:
    """True ranges of all bodies, and the strongest echo of every frame."""
    middle = 0.5 * recording.radar.waveform.duration
    peaks = [strongest_peak(frame.cube, recording.radar.waveform) for frame in recording.frames()]
    name = "strongest echo"
    track = {
        "time": recording.time + middle,
        "range": np.array([peak.range for peak in peaks]),
        "velocity": np.array([peak.velocity for peak in peaks]),
    }
    ax = plot.tracks(recording, {}) if recording.truth is not None else None
    return plot.tracks(recording, {name: track}, ax, colors={name: "black"})
