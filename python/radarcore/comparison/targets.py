"""Targets of a recording: frames, detections and tracks, the assignment of tracks to bodies, and errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.motion.protocol import AnyMotion
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
"""Frames with errors below these limits are counted [bins]."""


@dataclass(frozen=True)
class Errors:
    """Errors of a quantity, in its unit, over the frames with both a truth and a measurement.

    Parameters
    ----------
    bias : float
        Median of the signed errors.
    median, percentile_95, rms, largest : float
        Of the magnitudes; NaN without errors.
    bin_width : float
        Width of a bin of the waveform, in the same unit.
    num_within : int
        Frames with an error below the limit, predictions included: half a range bin, one velocity bin.
    """

    bias: float
    median: float
    percentile_95: float
    rms: float
    largest: float
    bin_width: float
    num_within: int

    @property
    def median_bins(self) -> float:
        """`median` in bins."""
        return self.median / self.bin_width

    @property
    def percentile_95_bins(self) -> float:
        """`percentile_95` in bins."""
        return self.percentile_95 / self.bin_width

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
        Frames with a visible target (known truth).
    num_tracked : int
        Visible frames with a track of the target.
    num_predicted : int
        Tracked frames without an echo of the target, in which the track is a prediction.
    num_tracks : int
        Tracks of the target, at the same time or in succession.
    range, velocity : Errors
        Over the visible frames in which an echo updated the track [m, m/s].
    """

    name: str
    num_frames: int
    num_tracked: int
    num_predicted: int
    num_tracks: int
    range: Errors
    velocity: Errors

    @property
    def range_share(self) -> float:
        """Share of the visible frames with a range error below half a bin; NaN without visible frames."""
        return self.range.num_within / self.num_frames if self.num_frames > 0 else np.nan

    @property
    def velocity_share(self) -> float:
        """Share of the visible frames with a velocity error below one bin; NaN without visible frames."""
        return self.velocity.num_within / self.num_frames if self.num_frames > 0 else np.nan

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        errors = {
            f"{quantity}_error": {
                name: getattr(part, name)
                for kind in ("median", "percentile_95", "rms", "largest")
                for name in (kind, f"{kind}_bins")
            }
            | {"bias": part.bias}
            for quantity, part in (("range", self.range), ("velocity", self.velocity))
        }
        return {
            "name": self.name,
            "num_frames": self.num_frames,
            "num_tracked": self.num_tracked,
            "num_predicted": self.num_predicted,
            "num_tracks": self.num_tracks,
            "num_range_within": self.range.num_within,
            "num_velocity_within": self.velocity.num_within,
            **errors,
        }


def target_errors(
    name: str, estimated: Estimates, true: tuple[_Floats, _Floats], bins: tuple[float, float]
) -> TargetErrors:
    """Errors of estimates of range and velocity against the truth of the same frames.

    Parameters
    ----------
    name : str
    estimated : Estimates
    true : (range, velocity)
        Arrays (frame,) [m, m/s]; NaN where unknown.
    bins : (float, float)
        Widths of a bin of range and of velocity [m, m/s].
    """
    is_visible = np.isfinite(true[0])
    is_tracked = is_visible & np.isfinite(estimated.range)
    is_measured = is_tracked & estimated.is_detected
    range_errors, velocity_errors = (
        _errors(values - known, is_measured, width, limit)
        for values, known, width, limit in zip(
            (estimated.range, estimated.velocity), true, bins, (RANGE_LIMIT, VELOCITY_LIMIT), strict=True
        )
    )
    return TargetErrors(
        name,
        num_frames=int(is_visible.sum()),
        num_tracked=int(is_tracked.sum()),
        num_predicted=int((is_tracked & ~is_measured).sum()),
        num_tracks=estimated.num_tracks,
        range=range_errors,
        velocity=velocity_errors,
    )


def _errors(errors: _Floats, is_measured: NDArray[np.bool_], bin_width: float, limit: float) -> Errors:
    known = errors[np.isfinite(errors) & is_measured]
    num_within = int((np.abs(errors) < limit * bin_width).sum())
    if len(known) == 0:
        return Errors(*(np.nan,) * 5, bin_width=bin_width, num_within=num_within)
    sizes = np.abs(known)
    return Errors(
        bias=float(np.median(known)),
        median=float(np.median(sizes)),
        percentile_95=float(np.quantile(sizes, 0.95)),
        rms=float(np.sqrt(np.mean(np.square(known)))),
        largest=float(sizes.max()),
        bin_width=bin_width,
        num_within=num_within,
    )


@dataclass(frozen=True)
class Dropped:
    """A gap of missing frames.

    Parameters
    ----------
    frame : int
        Index of the frame after the gap.
    time : float
        Start of this frame in common time [s].
    count : int
        Number of missing frames.
    is_counted : bool
        True if the recording counts them itself; False if derived from the gap of the times.
    """

    frame: int
    time: float
    count: int
    is_counted: bool


def dropped_frames(recording: Recording, offset: float = 0.0) -> tuple[Dropped, ...]:
    """Missing frames of a recording, from its own counts and from gaps of its times."""
    interval = usual_interval(recording)
    by_gap = np.zeros(len(recording), dtype=np.int64)
    by_gap[1:] = np.rint(np.diff(recording.time) / interval).astype(np.int64) - 1
    counted = np.zeros(len(recording), dtype=np.int64) if recording.lost is None else np.asarray(recording.lost)
    numbers = np.maximum(by_gap, counted)
    return tuple(
        Dropped(int(k), float(recording.time[k]) + offset, int(numbers[k]), bool(counted[k] >= by_gap[k]))
        for k in np.flatnonzero(numbers > 0)
    )


FALSE_ALARM_RATE = 1e-4
"""Detections per cell of noise: fewer than one per frame, which tracks tolerate."""

_LONGEST_GAP = 0.5
"""Longest time of a track without a detection [s], for example while a person turns or is hidden."""


@dataclass(frozen=True, eq=False)
class Found:
    """Detections of every frame of a recording and their tracks, with times of the recording's clock."""

    recording: Recording
    detections: tuple[Detections, ...]
    follow: Callable[..., Tracks]
    """`track` with the settings of the recording."""
    motion: AnyMotion | None = None
    """Motion of the sensor; None: tracks of people are in the sensor frame."""

    @cached_property
    def tracks(self) -> Tracks:
        """Tracks of points."""
        return self.follow(self.detections)

    @cached_property
    def people(self) -> Tracks:
        """Tracks of objects of the size of people."""
        detections = iter(self.detections)
        return self.follow(
            self.recording,
            detector=lambda _: next(detections),
            separate_echoes=True,
            targets="people",
            motion=self.motion,
        )


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates of a target in every frame; NaN without a track."""

    time: NDArray[np.float64]
    """Middle of the frame [s]."""
    range: NDArray[np.float64]
    """[m]."""
    velocity: NDArray[np.float64]
    """[m/s]."""
    is_detected: NDArray[np.bool_]
    """False where there is no echo and the track is a prediction."""
    num_tracks: int
    """Number of tracks of the target."""


def found_in(
    recording: Recording,
    *,
    motion: AnyMotion | None = None,
    detector: Callable[[Frame], Detections] | None = None,
    range_only: bool = False,
    progress: bool = True,
) -> Found:
    """Detect and track all targets of a recording.

    Parameters
    ----------
    recording : Recording
    motion : Motion, optional
        Of the sensor, for tracks of people: static objects are then not tracked. Default: the sensor is at rest.
    detector : callable, optional
        Detections of a frame; default: `radarcore.detect` with less than one false alarm per frame.
    range_only : bool
        Track ranges and velocities without angles.
    progress : bool
        Show a progress bar when run in a terminal.
    """
    detections_of = partial(detect, false_alarm_rate=FALSE_ALARM_RATE) if detector is None else detector
    with notice.progress(recording.frames(), "detecting", "frame", total=len(recording), shown=progress) as frames:
        detections = [detections_of(frame) for frame in frames]
    wf = recording.radar.waveform
    follow = partial(
        track,
        smooth=True,
        velocity_ambiguity=2.0 * recording.radar.max_velocity if wf.num_chirps > 1 and wf.has_uniform_chirps else None,
        max_missed=max(1, round(_LONGEST_GAP / usual_interval(recording))),
        num_dimensions=1 if range_only else None,
    )
    return Found(recording, tuple(detections), follow, motion)


def truth_of(truth: Truth, body: str) -> tuple[_Floats, _Floats]:
    """True range [m] and velocity [m/s] of a target, (frame,) each; NaN where it is not visible.

    For an object with several parts, such as a person, the range is the distance to the nearest visible point of any
    part. The velocity belongs to the named part, because a track follows the whole object and not the hand in front.
    """
    parts = [name for name in truth.names if thing(name) == thing(body)]
    return np.fmin.reduce(truth.select(parts).range, axis=1), truth.select([body]).velocity[:, 0]


def estimates(found: Found, truth: Truth, bodies: Iterable[str], offset: float = 0.0) -> dict[str, Estimates]:
    """Estimates of bodies from their tracks.

    Each track is assigned to the body with the nearest truth over the whole track. The estimate of a frame is the
    track's detection or, without a detection, its smoothed state (`track(smooth=True)`).

    An object with several parts, such as a person, has a single track of `Found.people`: the track present in most of
    the frames in which the object is visible. With several such objects, only tracks assigned to the object are
    candidates. The estimates are the range of the track's nearest point and its velocity.

    Parameters
    ----------
    found : Found
    truth : Truth
        Of all known bodies, arrays (frame, body); tracks may be assigned to any of them.
    bodies : iterable of str
        Names of bodies.
    offset : float
        Time of the estimates minus the recording's time [s].
    """
    waveform, time = found.recording.radar.waveform, middles(found.recording, offset)
    bodies = list(bodies)
    num_parts = Counter(map(thing, truth.names))
    people = {body for body in bodies if num_parts[thing(body)] > 1}
    result = {}
    for body in bodies:
        true = np.stack(truth_of(truth, body), axis=1)
        rows = np.full((len(time), 3), np.nan)
        if body in people:
            followers = _followers(found.people, truth, body) if len(people) > 1 else list(found.people)
            followers.sort(key=lambda one: -np.isfinite(true[one.frame, 0]).sum())
            for one in followers[:1]:
                nearest = np.where(np.isnan(one.nearest), one.range, one.nearest)
                rows[one.frame] = np.stack([nearest, one.velocity, one.is_detected], axis=1)
            number = len(followers[:1])
        else:
            followers = _followers(found.tracks, truth, body)
            rows, number = _nearest(followers, found.detections, true, waveform), len(followers)
        result[body] = Estimates(time, rows[:, 0], rows[:, 1], rows[:, 2] == 1.0, number)
    return result


def _followers(tracks: Tracks, truth: Truth, body: str) -> list[Track]:
    """Tracks assigned to a body; for an object with several parts, to any of its parts."""
    owners = assign_to_truth(tracks, truth)
    return [one for one in tracks if (owner := owners[one.id]) is not None and thing(owner) == thing(body)]


def measured(track: Track, found: Sequence[Detections], waveform: Waveform) -> NDArray[np.float64]:
    """Range [m] and velocity [m/s] of a track in its frames, and 1 for a detection, else 0, (row, 3).

    Values come from the detection or, without one, from the track's state.
    """
    points = np.stack([track.range, track.velocity, track.is_detected], axis=1)
    for k in np.flatnonzero(track.is_detected):
        one = found[track.frame[k]]
        near = np.stack([one.range, one.velocity], axis=1)
        points[k, :2] = near[_nearest_of(near, points[k, :2], waveform)]
    return points


def _nearest_of(points: NDArray[np.float64], place: NDArray[np.float64], waveform: Waveform) -> int:
    """Index of the point (point, 2) nearest to a place (2,) [m, m/s]; without velocities, by range alone."""
    bins = np.array([waveform.range_resolution, waveform.velocity_resolution])
    return int(np.nansum(np.square((points - place) / bins), axis=1).argmin())


def _nearest(
    followers: Sequence[Track], found: Sequence[Detections], true: NDArray[np.float64], waveform: Waveform
) -> NDArray[np.float64]:
    """Row of `measured` in every frame from the track nearest to the truth, (frame, 3)."""
    candidates: dict[int, list[NDArray[np.float64]]] = {}
    for follower in followers:
        for frame, point in zip(follower.frame, measured(follower, found, waveform), strict=True):
            candidates.setdefault(int(frame), []).append(point)
    result = np.full((len(true), 3), np.nan)
    for frame, points_of_frame in candidates.items():
        if np.isfinite(true[frame]).all():
            all_points = np.stack(points_of_frame)
            result[frame] = all_points[_nearest_of(all_points[:, :2], true[frame], waveform)]
    return result
