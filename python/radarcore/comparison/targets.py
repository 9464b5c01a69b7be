"""Tracks of a recording against the truth of its bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.processing.detection import detect
from radarcore.processing.point_cloud import Detections
from radarcore.processing.tracking import track
from radarcore.processing.tracks import Track, assign_to_truth
from radarcore.radar.waveform import Waveform
from radarcore.recording.recording import Recording

_FALSE_ALARM_RATE = 1e-4
"""Detections per cell of noise: less than one per frame, which tracks outlive."""

_LONGEST_GAP = 0.5
"""Time that a track outlives without a detection [s]: while a person turns or is behind something."""


@dataclass(frozen=True)
class Comparison:
    """Accuracy of one target over a recording; errors in bins, over the frames in which it was visible and tracked."""

    name: str
    num_frames: int
    """Frames in which the body was visible."""
    num_tracked: int
    """Visible frames in which a track followed the target."""
    num_tracks: int
    """Tracks that followed the target, side by side or one after the other."""
    num_range_within: int
    """Visible frames with a range error below half a bin."""
    num_velocity_within: int
    """Visible frames with a velocity error below one bin."""
    median_range_error: float
    median_velocity_error: float
    max_range_error: float
    max_velocity_error: float


@dataclass(frozen=True)
class Estimates:
    """Estimates of a target in every frame; NaN where no track follows it."""

    time: NDArray[np.float64]
    """Middle of the frame [s]."""
    range: NDArray[np.float64]
    """[m]."""
    velocity: NDArray[np.float64]
    """[m/s]."""
    num_tracks: int
    """Tracks that follow the target in some frame."""


def estimates(recording: Recording, bodies: Sequence[str], *, progress: bool = True) -> dict[str, Estimates]:
    """Detect and track all targets of a simulated recording, and give those that follow some bodies.

    A track follows the body whose truth is nearest to it throughout. Of a thing of several parts, such as a person, all
    tracks of any part count: the estimate of a frame is that nearest to the truth of the named part. It is the
    detection of a track or, where it has none, the state that those before and after tell (`track(smooth=True)`).

    Parameters
    ----------
    recording : Recording
        With truth.
    bodies : sequence of str
        Names of bodies.
    progress : bool
        Show a progress bar when run in a terminal.
    """
    assert recording.truth is not None  # the simulator always gives it
    waveform = recording.radar.waveform
    with notice.progress(recording.frames(), "detecting", "frame", total=len(recording), shown=progress) as frames:
        found = [detect(frame, false_alarm_rate=_FALSE_ALARM_RATE) for frame in frames]
    max_missed = max(1, round(_LONGEST_GAP / float(np.median(np.diff(recording.time))))) if len(recording) > 1 else 1
    tracks = track(found, smooth=True, max_velocity=recording.radar.max_velocity, max_missed=max_missed)
    owners = assign_to_truth(tracks, recording.truth)
    result = {}
    for body in bodies:
        followers = [one for one in tracks if (owner := owners[one.id]) is not None and _thing(owner) == _thing(body)]
        truth = recording.truth.select([body])
        true = np.stack([truth.range[:, 0], truth.velocity[:, 0]], axis=1)
        nearest = _nearest(followers, found, true, waveform)
        time = np.asarray(recording.time) + 0.5 * waveform.duration
        result[body] = Estimates(time, nearest[:, 0], nearest[:, 1], len(followers))
    return result


def compare(recording: Recording, name: str, body: str, found: Estimates) -> Comparison:
    """Errors of estimates against the truth of a body."""
    assert recording.truth is not None  # the simulator always gives it
    truth = recording.truth.select([body])
    waveform = recording.radar.waveform
    is_visible = np.isfinite(truth.range[:, 0])
    is_tracked = is_visible & np.isfinite(found.range)

    def errors(estimate: NDArray[np.float64], true: NDArray[np.float64], bin_width: float) -> NDArray[np.float64]:
        error: NDArray[np.float64] = np.abs(estimate - true[:, 0])[is_tracked] / bin_width
        return error

    range_errors = errors(found.range, truth.range, waveform.range_resolution)
    velocity_errors = errors(found.velocity, truth.velocity, waveform.velocity_resolution)
    return Comparison(
        name=name,
        num_frames=int(is_visible.sum()),
        num_tracked=int(is_tracked.sum()),
        num_tracks=found.num_tracks,
        num_range_within=int((range_errors < 0.5).sum()),
        num_velocity_within=int((velocity_errors < 1.0).sum()),
        median_range_error=float(np.median(range_errors)) if is_tracked.any() else np.nan,
        median_velocity_error=float(np.median(velocity_errors)) if is_tracked.any() else np.nan,
        max_range_error=float(range_errors.max()) if is_tracked.any() else np.nan,
        max_velocity_error=float(velocity_errors.max()) if is_tracked.any() else np.nan,
    )


def table(comparisons: Sequence[Comparison]) -> list[str]:
    """The comparisons as lines of text."""
    lines = [
        "            frames            range error [bins]  velocity error [bins]  frames with errors below",
        "            visible  tracked   median    largest    median    largest    1/2 range bin  1 velocity bin",
    ]
    lines += [
        f"{c.name:<10}  {c.num_frames:>7}  {c.num_tracked:>7}   {c.median_range_error:6.3f}    "
        f"{c.max_range_error:7.3f}    {c.median_velocity_error:6.3f}    {c.max_velocity_error:7.3f}    "
        f"{c.num_range_within:>13}  {c.num_velocity_within:>14}"
        for c in comparisons
    ]
    return lines


def _thing(name: str) -> str:
    """Owner of a body: the person of ``person/trunk``, the body itself otherwise."""
    return name.partition("/")[0]


def _nearest(
    followers: Sequence[Track], found: Sequence[Detections], true: NDArray[np.float64], waveform: Waveform
) -> NDArray[np.float64]:
    """Range [m] and velocity [m/s] of the tracks in every frame, of several those nearest to the truth, (frame, 2)."""
    bins = np.array([waveform.range_resolution, waveform.velocity_resolution])
    candidates: dict[int, list[NDArray[np.float64]]] = {}
    for follower in followers:
        states = np.stack([follower.range, follower.velocity], axis=1)
        for frame, state, is_detected in zip(follower.frame, states, follower.is_detected, strict=True):
            points = np.stack([found[frame].range, found[frame].velocity], axis=1)
            distances = np.square((points - state) / bins).sum(axis=1)
            candidates.setdefault(int(frame), []).append(points[distances.argmin()] if is_detected else state)
    result = np.full((len(true), 2), np.nan)
    for frame, points_of_frame in candidates.items():
        if np.isfinite(true[frame]).all():
            all_points = np.stack(points_of_frame)
            result[frame] = all_points[np.square((all_points - true[frame]) / bins).sum(axis=1).argmin()]
    return result
