"""Targets of a recording: all that is detected and tracked, and the tracks that follow what is known to be there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.comparison.time_base import middles
from radarcore.processing.detection.detect import detect
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.tracking.tracker import track
from radarcore.processing.tracking.tracks import Track, Tracks, assign_to_truth
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording

_FALSE_ALARM_RATE = 1e-4
"""Detections per cell of noise: less than one per frame, which tracks outlive."""

_LONGEST_GAP = 0.5
"""Time that a track outlives without a detection [s]: while a person turns or is behind something."""


@dataclass(frozen=True, eq=False)
class Found:
    """Detections of every frame of a recording, and their tracks, by the recording's own clock."""

    recording: Recording
    detections: tuple[Detections, ...]
    tracks: Tracks


@dataclass(frozen=True, eq=False)
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


def found_in(
    recording: Recording,
    *,
    detector: Callable[[Frame], Detections] | None = None,
    range_only: bool = False,
    progress: bool = True,
) -> Found:
    """Detect and track all targets of a recording.

    Parameters
    ----------
    recording : Recording
    detector : callable, optional
        Detections of a frame; default: `radarcore.detect` with less than one false alarm per frame.
    range_only : bool
        Track ranges and velocities, without angles.
    progress : bool
        Show a progress bar when run in a terminal.
    """
    detections_of = partial(detect, false_alarm_rate=_FALSE_ALARM_RATE) if detector is None else detector
    with notice.progress(recording.frames(), "detecting", "frame", total=len(recording), shown=progress) as frames:
        detections = [detections_of(frame) for frame in frames]
    max_missed = max(1, round(_LONGEST_GAP / float(np.median(np.diff(recording.time))))) if len(recording) > 1 else 1
    wf = recording.radar.waveform
    period = 2.0 * recording.radar.max_velocity if wf.num_chirps > 1 and wf.has_uniform_chirps else None
    num_dimensions = 1 if range_only else None
    tracks = track(
        detections, smooth=True, velocity_ambiguity=period, max_missed=max_missed, num_dimensions=num_dimensions
    )
    return Found(recording, tuple(detections), tracks)


def estimates(found: Found, truth: Truth, bodies: Sequence[str]) -> dict[str, Estimates]:
    """Estimates of some bodies by the tracks that follow them.

    A track follows the body whose truth is nearest to it throughout. Of a thing of several parts, such as a person, all
    tracks of any part count: the estimate of a frame is that nearest to the truth of the named part. It is the
    detection of a track or, where it has none, the state that those before and after tell (`track(smooth=True)`).

    Parameters
    ----------
    found : Found
    truth : Truth
        Of all that is known to be there, arrays (frame, body): what tracks may follow.
    bodies : sequence of str
        Names of bodies.
    """
    waveform = found.recording.radar.waveform
    owners = assign_to_truth(found.tracks, truth)
    time = middles(found.recording)
    result = {}
    for body in bodies:
        followers = [
            one for one in found.tracks if (owner := owners[one.id]) is not None and thing_of(owner) == thing_of(body)
        ]
        of_body = truth.select([body])
        true = np.stack([of_body.range[:, 0], of_body.velocity[:, 0]], axis=1)
        nearest = _nearest(followers, found.detections, true, waveform)
        result[body] = Estimates(time, nearest[:, 0], nearest[:, 1], len(followers))
    return result


def thing_of(name: str) -> str:
    """Owner of a body: the person of ``person/trunk``, the body itself otherwise."""
    return name.partition("/")[0]


def measured(track: Track, found: Sequence[Detections], waveform: Waveform) -> NDArray[np.float64]:
    """Range [m] and velocity [m/s] of a track in its frames, (row, 2): of its detection, or what it expects without."""
    points = np.stack([track.range, track.velocity], axis=1)
    for k in np.flatnonzero(track.is_detected):
        one = found[track.frame[k]]
        near = np.stack([one.range, one.velocity], axis=1)
        points[k] = near[_nearest_of(near, points[k], waveform)]
    return points


def _nearest_of(points: NDArray[np.float64], place: NDArray[np.float64], waveform: Waveform) -> int:
    """Index of the point nearest to a place, (point, 2) and (2,) [m, m/s]; by range alone without velocities."""
    bins = np.array([waveform.range_resolution, waveform.velocity_resolution])
    return int(np.nansum(np.square((points - place) / bins), axis=1).argmin())


def _nearest(
    followers: Sequence[Track], found: Sequence[Detections], true: NDArray[np.float64], waveform: Waveform
) -> NDArray[np.float64]:
    """Range [m] and velocity [m/s] of the tracks in every frame, of several those nearest to the truth, (frame, 2)."""
    candidates: dict[int, list[NDArray[np.float64]]] = {}
    for follower in followers:
        for frame, point in zip(follower.frame, measured(follower, found, waveform), strict=True):
            candidates.setdefault(int(frame), []).append(point)
    result = np.full((len(true), 2), np.nan)
    for frame, points_of_frame in candidates.items():
        if np.isfinite(true[frame]).all():
            all_points = np.stack(points_of_frame)
            result[frame] = all_points[_nearest_of(all_points, true[frame], waveform)]
    return result
