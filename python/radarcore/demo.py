"""The demo: the paper's experiment in small, compared with its truth.

A UR10 carries the radar at 250 mm/s towards a cylinder on a table while a person walks in and out; all of it is in
``experiment.toml``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check, plot
from radarcore.models.robots import data
from radarcore.processing.peaks import strongest_peak
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import load_scene

TARGETS = {"cylinder": "cylinder", "person": "person/trunk"}
"""What is compared, and the body whose truth counts."""

# A peak is looked for this close to the truth: range [m] and velocity [m/s].
_GATE = (0.4, 0.6)


@dataclass(frozen=True)
class Comparison:
    """How well the radar saw one target over a recording; errors in bins, over the frames in which it was visible."""

    name: str
    num_frames: int
    """Frames in which the body was visible."""
    num_range_within: int
    """Of these, frames with a range error below half a bin."""
    num_velocity_within: int
    """Of these, frames with a velocity error below one bin."""
    median_range_error: float
    median_velocity_error: float
    max_range_error: float
    max_velocity_error: float


@dataclass(frozen=True)
class Track:
    """The strongest peak near a body's truth in every frame; NaN where there was none, or no body to be seen."""

    time: NDArray[np.float64]
    """Middle of the frame [s]."""
    range: NDArray[np.float64]
    """[m]."""
    velocity: NDArray[np.float64]
    """[m/s]."""


def scene_text(with_robots: bool) -> str:
    """The scene file of the experiment."""
    text = files("radarcore").joinpath("experiment.toml").read_text(encoding="utf-8")
    return text.replace("meshes = false", "meshes = true") if with_robots else text


def track(recording: Recording, body: str) -> Track:
    """Strongest peak near the truth of a body, frame by frame."""
    gate_range, gate_velocity = _GATE
    waveform = recording.radar.waveform
    ranges, velocities = np.full(len(recording), np.nan), np.full(len(recording), np.nan)
    for k, frame in enumerate(recording.frames()):
        assert frame.truth is not None  # the simulator always gives it
        truth = frame.truth.select([body])
        distance, velocity = float(truth.range[0]), float(truth.velocity[0])
        if np.isnan(distance):
            continue
        peak = strongest_peak(
            frame.cube,
            waveform,
            min_range=max(0.0, distance - gate_range),
            max_range=distance + gate_range,
            min_velocity=velocity - gate_velocity,
            max_velocity=velocity + gate_velocity,
        )
        ranges[k], velocities[k] = peak.range, peak.velocity
    return Track(np.asarray(recording.time) + 0.5 * waveform.duration, ranges, velocities)


def compare(recording: Recording, name: str, body: str, found: Track) -> Comparison:
    """A track against the truth of a body; a frame in which nothing was found counts as an infinite error."""
    assert recording.truth is not None  # the simulator always gives it
    truth = recording.truth.select([body])
    waveform = recording.radar.waveform
    is_visible = np.isfinite(truth.range[:, 0])

    def errors(estimate: NDArray[np.float64], true: NDArray[np.float64], bin_width: float) -> NDArray[np.float64]:
        error: NDArray[np.float64] = np.abs(estimate - true[:, 0])[is_visible] / bin_width
        return np.nan_to_num(error, nan=np.inf)

    range_errors = errors(found.range, truth.range, waveform.range_resolution)
    velocity_errors = errors(found.velocity, truth.velocity, waveform.velocity_resolution)
    return Comparison(
        name=name,
        num_frames=int(is_visible.sum()),
        num_range_within=int((range_errors < 0.5).sum()),
        num_velocity_within=int((velocity_errors < 1.0).sum()),
        median_range_error=float(np.median(range_errors)) if is_visible.any() else np.nan,
        median_velocity_error=float(np.median(velocity_errors)) if is_visible.any() else np.nan,
        max_range_error=float(range_errors.max()) if is_visible.any() else np.nan,
        max_velocity_error=float(velocity_errors.max()) if is_visible.any() else np.nan,
    )


def table(comparisons: list[Comparison]) -> list[str]:
    """The comparisons as lines of text."""
    lines = [
        "            frames     range error [bins]   velocity error [bins]   frames with errors below",
        "            visible    median    largest    median      largest     1/2 range bin   1 velocity bin",
    ]
    for c in comparisons:
        within = f"{c.num_range_within} of {c.num_frames}", f"{c.num_velocity_within} of {c.num_frames}"
        lines.append(
            f"{c.name:<10}  {c.num_frames:>7}    {c.median_range_error:6.3f}    {c.max_range_error:7.3f}    "
            f"{c.median_velocity_error:6.3f}      {c.max_velocity_error:7.3f}     {within[0]:<13}   {within[1]}"
        )
    return lines


def run(
    directory: Path,
    *,
    duration: float | None = None,
    ray_budget: int | None = None,
    with_robots: bool | None = None,
    say: Callable[[str], None] = print,
) -> dict[str, Any]:
    """Simulate, record, compare and draw; what it finds goes to `say`, line by line, and is returned.

    Parameters
    ----------
    directory : path
        Where scene file, recording and picture go.
    duration : float, optional
        Length of the recording [s]; default: that of the scene file.
    ray_budget : int, optional
        Most rays of a cast; default: that of `Simulator`.
    with_robots : bool, optional
        Use the real UR10 and human meshes; default: when the extra `robots` is installed.
    """
    plot.require()
    if duration is not None:
        check.positive("duration", duration, "s")
    if ray_budget is not None:
        check.count("ray_budget", ray_budget)
    if with_robots is None:
        with_robots = data.is_available()
    directory.mkdir(parents=True, exist_ok=True)
    file = directory / "scene.toml"
    file.write_text(scene_text(with_robots), encoding="utf-8")
    simulation = load_scene(file)
    changes: dict[str, Any] = {}
    if duration is not None:
        changes["stop"] = simulation.run.start + duration
    if ray_budget is not None:
        changes["ray_budget"] = ray_budget
    simulation = replace(simulation, run=simulation.run.model_copy(update=changes))
    settings, waveform = simulation.run, simulation.radar.waveform

    say(
        f"BGT60TR13C: {simulation.radar.num_channels} channels x {waveform.num_chirps} chirps x "
        f"{waveform.num_samples} samples, range bin {100 * waveform.range_resolution:.1f} cm, "
        f"velocity bin {waveform.velocity_resolution:.3f} m/s"
    )
    extra = "real UR10 and human meshes" if with_robots else "analytic shapes (pip install radarcore[robots]: meshes)"
    say(f"{len(simulation.scene.bodies)} bodies, {simulation.scene.num_triangles} triangles, {extra}")

    # Simulate and record.
    path = directory / "recording"
    began = time.perf_counter()
    recording = simulation.record(path=path, overwrite=True)
    elapsed = time.perf_counter() - began
    real_time_factor = len(recording) / settings.rate / elapsed
    say(
        f"{len(recording)} frames in {elapsed:.1f} s: {1e3 * elapsed / len(recording):.0f} ms per frame, "
        f"{real_time_factor:.2f} x real time"
    )

    # Compare with the truth.
    tracks = {body: track(recording, body) for body in TARGETS.values()}
    comparisons = [compare(recording, name, body, tracks[body]) for name, body in TARGETS.items()]
    say("")
    for line in table(comparisons):
        say(line)

    # One picture.
    picture = directory / "experiment.png"
    plot.experiment(
        recording,
        simulation.scene,
        simulation.radar_motion,
        {body: asdict(found) for body, found in tracks.items()},
        field_of_view_deg=settings.field_of_view_deg,
        max_range=6.0,
        path=picture,
    )
    say("")
    say(f"scene {file}, recording {path}, picture {picture}")
    return {
        "frames": len(recording),
        "seconds": elapsed,
        "real_time_factor": real_time_factor,
        "triangles": simulation.scene.num_triangles,
        "targets": [asdict(comparison) for comparison in comparisons],
        "scene": str(file),
        "recording": str(path),
        "picture": str(picture),
    }
