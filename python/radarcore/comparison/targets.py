"""Peaks of a recording against the truth of its bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.peaks import strongest_peak
from radarcore.recording.recording import Recording

# A peak is looked for this close to the truth: range [m] and velocity [m/s].
_GATE = (0.4, 0.6)


@dataclass(frozen=True)
class Comparison:
    """Accuracy of one target over a recording; errors in bins, over the frames in which it was visible."""

    name: str
    num_frames: int
    """Frames in which the body was visible."""
    num_range_within: int
    """Visible frames with a range error below half a bin."""
    num_velocity_within: int
    """Visible frames with a velocity error below one bin."""
    median_range_error: float
    median_velocity_error: float
    max_range_error: float
    max_velocity_error: float


@dataclass(frozen=True)
class Track:
    """Strongest peak near a body's truth in every frame; NaN without a peak or a visible body."""

    time: NDArray[np.float64]
    """Middle of the frame [s]."""
    range: NDArray[np.float64]
    """[m]."""
    velocity: NDArray[np.float64]
    """[m/s]."""


def track(recording: Recording, body: str) -> Track:
    """Strongest peak near the truth of a body, frame by frame."""
    gate_range, gate_velocity = _GATE
    ranges, velocities = np.full(len(recording), np.nan), np.full(len(recording), np.nan)
    for k, frame in enumerate(recording.frames()):
        assert frame.truth is not None  # the simulator always gives it
        truth = frame.truth.select([body])
        distance, velocity = float(truth.range[0]), float(truth.velocity[0])
        if np.isnan(distance):
            continue
        peak = strongest_peak(
            frame,
            min_range=max(0.0, distance - gate_range),
            max_range=distance + gate_range,
            min_velocity=velocity - gate_velocity,
            max_velocity=velocity + gate_velocity,
        )
        if peak is not None:
            ranges[k], velocities[k] = peak.range, peak.velocity
    return Track(np.asarray(recording.time) + 0.5 * recording.radar.waveform.duration, ranges, velocities)


def compare(recording: Recording, name: str, body: str, found: Track) -> Comparison:
    """Errors of a track against the truth of a body; infinite in a frame without a peak."""
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
