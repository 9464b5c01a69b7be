"""Targets of a recording: its frames, detections and tracks, the tracks that follow a body, and their errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.plot.canvas import thing
from radarcore.processing.detection.detect import detect
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.tracking.tracker import track
from radarcore.processing.tracking.tracks import Track, Tracks, assign_to_truth
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording, middles, usual_interval

_Floats = NDArray[np.float64]

RANGE_LIMIT, VELOCITY_LIMIT = 0.5, 1.0
"""Errors below which frames are counted [bins]."""


@dataclass(frozen=True)
class Errors:
    """Errors of a quantity, in its unit, over the frames in which it is both known and estimated.

    Parameters
    ----------
    bias : float
        Median of the errors, with their signs.
    median, rms, largest : float
        Of their magnitudes; NaN without any.
    bin_width : float
        Width of a bin of the waveform, in the same unit.
    num_within : int
        Frames with an error below the limit: half a range bin, one velocity bin.
    """

    bias: float
    median: float
    rms: float
    largest: float
    bin_width: float
    num_within: int

    @property
    def median_bins(self) -> float:
        """`median` in bins."""
        return self.median / self.bin_width

    @property
    def rms_bins(self) -> float:
        """`rms` in bins."""
        return self.rms / self.bin_width

    @property
    def largest_bins(self) -> float:
        """`largest` in bins."""
        return self.largest / self.bin_width


@dataclass(frozen=True)
class TargetErrors:
    """Accuracy of one target over a recording.

    Parameters
    ----------
    name : str
    num_frames : int
        Frames in which the target was visible: its truth is known.
    num_tracked : int
        Visible frames in which a track followed the target.
    num_tracks : int
        Tracks that followed the target, side by side or one after the other.
    range, velocity : Errors
        Over the visible frames in which it was tracked [m, m/s].
    """

    name: str
    num_frames: int
    num_tracked: int
    num_tracks: int
    range: Errors
    velocity: Errors

    @property
    def range_share(self) -> float:
        """Part of the visible frames with a range error below half a bin; NaN if it was never visible."""
        return self.range.num_within / self.num_frames if self.num_frames > 0 else np.nan

    @property
    def velocity_share(self) -> float:
        """Part of the visible frames with a velocity error below one bin; NaN if it was never visible."""
        return self.velocity.num_within / self.num_frames if self.num_frames > 0 else np.nan

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        errors = {
            f"{quantity}_error": {
                name: getattr(part, name)
                for name in ("bias", "median", "rms", "largest", "median_bins", "rms_bins", "largest_bins")
            }
            for quantity, part in (("range", self.range), ("velocity", self.velocity))
        }
        return {
            "name": self.name,
            "num_frames": self.num_frames,
            "num_tracked": self.num_tracked,
            "num_tracks": self.num_tracks,
            "num_range_within": self.range.num_within,
            "num_velocity_within": self.velocity.num_within,
            **errors,
        }


def target_errors(
    name: str,
    estimated: tuple[_Floats, _Floats],
    true: tuple[_Floats, _Floats],
    bins: tuple[float, float],
    num_tracks: int,
) -> TargetErrors:
    """Errors of estimates of range and velocity, (frame,) each, against the truth of the same frames.

    Parameters
    ----------
    name : str
    estimated, true : (range, velocity)
        Arrays (frame,) [m, m/s]; NaN where they are not known.
    bins : (float, float)
        Widths of a bin of range and of velocity [m, m/s].
    num_tracks : int
        As in `TargetErrors`.
    """
    is_visible = np.isfinite(true[0])
    is_tracked = is_visible & np.isfinite(estimated[0])
    parts = [
        _errors((estimated[k] - true[k])[is_tracked], bins[k], limit)
        for k, limit in enumerate((RANGE_LIMIT, VELOCITY_LIMIT))
    ]
    return TargetErrors(name, int(is_visible.sum()), int(is_tracked.sum()), num_tracks, *parts)


def _errors(errors: _Floats, bin_width: float, limit: float) -> Errors:
    known = errors[np.isfinite(errors)]
    if len(known) == 0:
        return Errors(*(np.nan,) * 4, bin_width=bin_width, num_within=0)
    sizes = np.abs(known)
    return Errors(
        bias=float(np.median(known)),
        median=float(np.median(sizes)),
        rms=float(np.sqrt(np.mean(np.square(known)))),
        largest=float(sizes.max()),
        bin_width=bin_width,
        num_within=int((sizes < limit * bin_width).sum()),
    )


@dataclass(frozen=True)
class Dropped:
    """Frames that are missing before one that is there.

    Parameters
    ----------
    frame : int
        Index of the frame after the gap.
    time : float
        Its start, by the common base [s].
    count : int
        Number of missing frames.
    is_counted : bool
        Whether the recording counts them itself; the gap of the times tells otherwise.
    """

    frame: int
    time: float
    count: int
    is_counted: bool


def dropped_frames(recording: Recording, offset: float = 0.0) -> tuple[Dropped, ...]:
    """Frames that a recording lacks: as it counts them itself, and as gaps of its times tell."""
    interval = usual_interval(recording)
    by_gap = np.zeros(len(recording), dtype=np.int64)
    by_gap[1:] = np.rint(np.diff(recording.time) / interval).astype(np.int64) - 1
    counted = np.zeros(len(recording), dtype=np.int64) if recording.lost is None else np.asarray(recording.lost)
    numbers = np.maximum(by_gap, counted)
    return tuple(
        Dropped(int(k), float(recording.time[k]) + offset, int(numbers[k]), bool(counted[k] >= by_gap[k]))
        for k in np.flatnonzero(numbers > 0)
    )


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
    max_missed = max(1, round(_LONGEST_GAP / usual_interval(recording)))
    wf = recording.radar.waveform
    period = 2.0 * recording.radar.max_velocity if wf.num_chirps > 1 and wf.has_uniform_chirps else None
    num_dimensions = 1 if range_only else None
    tracks = track(
        detections, smooth=True, velocity_ambiguity=period, max_missed=max_missed, num_dimensions=num_dimensions
    )
    return Found(recording, tuple(detections), tracks)


def estimates(found: Found, truth: Truth, bodies: Iterable[str], offset: float = 0.0) -> dict[str, Estimates]:
    """Estimates of some bodies by the tracks that follow them.

    A track follows the body whose truth is nearest to it throughout. Of a thing of several parts, such as a person, all
    tracks of any part count: the estimate of a frame is that nearest to the truth of the named part. It is the
    detection of a track or, where it has none, the state that those before and after tell (`track(smooth=True)`).

    Parameters
    ----------
    found : Found
    truth : Truth
        Of all that is known to be there, arrays (frame, body): what tracks may follow.
    bodies : iterable of str
        Names of bodies.
    offset : float
        Added to the times of the recording it gives those of the estimates [s].
    """
    waveform = found.recording.radar.waveform
    owners = assign_to_truth(found.tracks, truth)
    time = middles(found.recording, offset)
    result = {}
    for body in bodies:
        followers = [
            one for one in found.tracks if (owner := owners[one.id]) is not None and thing(owner) == thing(body)
        ]
        of_body = truth.select([body])
        true = np.stack([of_body.range[:, 0], of_body.velocity[:, 0]], axis=1)
        nearest = _nearest(followers, found.detections, true, waveform)
        result[body] = Estimates(time, nearest[:, 0], nearest[:, 1], len(followers))
    return result


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
