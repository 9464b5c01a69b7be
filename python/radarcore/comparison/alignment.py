"""Recordings and truth on one time base: offsets of clocks, middles of frames, missing frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.comparison.clocks import rival_peak
from radarcore.comparison.targets import Found, measured
from radarcore.comparison.truth import RecordedTruth, TruthOverTime
from radarcore.processing.detection.point_cloud import Detections
from radarcore.recording.frame import TRUTH_FIELDS, Truth
from radarcore.recording.recording import middles, usual_interval

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RecordingOffset:
    """Offset of a recording's clock.

    Parameters
    ----------
    seconds : float
        Common time minus the recording's time [s].
    deviation : float
        Standard deviation [s]; 0 for a given offset.
    is_estimated : bool
    """

    seconds: float
    deviation: float = 0.0
    is_estimated: bool = False


_WIDTH = 2.0
"""Width of a detection's support of the truth [bins of range and of velocity]."""

_MOST_FRAMES = 200
"""Largest number of frames in the search."""

_GRID = 4
"""Samples of the truth per frame interval in the search."""

_OVERLAP = 0.5
"""Least overlap of recording and truth, as a part of the shorter one."""

_UNLIMITED = 5.0
"""Largest offset in the search if the truth has no end [s]."""

_ALIKE = 0.95
"""Another offset fits equally well from this part of the best score on (both above the least score)."""

_NEAR = 2.0
"""Largest error of a target's detection, in range and in velocity [bins]."""

_HUBER = 1.5
"""Errors above this many deviations have less weight (Huber)."""

_BIAS = 0.3
"""Deviation of a target's constant velocity error, relative to the spread of its errors."""

_STEPS = 20
_SETTLED = 1e-6
"""Change of the offset that ends the search [s]."""


def estimated_offset(
    found: Sequence[Detections],
    truth: TruthOverTime,
    *,
    bins: tuple[float, float],
    interval: float,
    longest: float | None = None,
    span: tuple[float, float] | None = None,
) -> RecordingOffset:
    """Clock offset of detections, estimated from true ranges and velocities over time.

    A search finds the offset with most frames in which a detection agrees with the truth in range and velocity. The
    detection nearest to the truth is then chosen for every target and frame. A least-squares fit of their velocities
    refines the offset, with less weight for errors above 1.5 deviations and a small bias per target. Only changes of
    velocity determine the offset. Ranges are not used, because the reflecting point hardly ever is the true point.

    Parameters
    ----------
    found : sequence of Detections
        Of every frame, with times of the recording's clock [s].
    truth : TruthOverTime
    bins : (float, float)
        Width of a bin of range and of velocity [m, m/s].
    interval : float
        Ordinary interval of frames [s].
    longest : float, optional
        Largest magnitude of the offset [s].
    span : (float, float), optional
        First and last time of the truth [s]. Offsets must leave half of the truth, or of the frames, in common.
        Default: a truth without an end, offsets up to 5 s.

    Raises
    ------
    ValueError
        If no detection fits the truth at any offset, several offsets fit equally well (repeated motions), or no
        detected target changes its velocity.
    """
    seen = [one for one in found if len(one) > 0]
    if not seen:
        raise ValueError("offset: expected detections to align the clock by, got none; give the offset")
    widths = np.array(bins)
    candidates = _candidates(seen, span, interval, longest)
    # Evaluate the truth once on a fine grid of times, because motions may be slow to evaluate.
    step = interval / _GRID
    start, end = seen[0].time + candidates[0] - interval, seen[-1].time + candidates[-1] + interval
    grid = start + step * np.arange(int(np.ceil((end - start) / step)) + 2)
    known = truth.at(grid)
    few = seen[:: -(-len(seen) // _MOST_FRAMES)]
    scores = _scores(few, grid, known, candidates, widths)
    best = int(scores.argmax())
    if not scores[best] > 0.0:
        raise ValueError("offset: expected detections near the truth at some offset, got none; give the offset")
    if (rival := _rival(scores, best)) is not None:
        raise ValueError(
            f"offset: expected motions that fit at one offset only, got two, {candidates[best]:.3f} and "
            f"{candidates[rival]:.3f} s; give a smaller max_offset, or the offset"
        )
    return _fitted(seen, RecordedTruth(grid, known), float(candidates[best]), widths, interval)


def _candidates(
    found: Sequence[Detections], span: tuple[float, float] | None, interval: float, longest: float | None
) -> _Floats:
    """Offsets of the search, in steps of the frame interval [s]."""
    first, last = found[0].time, found[-1].time
    if span is None:
        low, high = -_UNLIMITED, _UNLIMITED
    else:
        common = _OVERLAP * min(last - first, span[1] - span[0])
        low, high = span[0] - last + common, span[1] - first - common
    if longest is not None:
        longest = check.positive("max_offset", longest, "s")
        low, high = max(low, -longest), min(high, longest)
        if low > high:
            raise ValueError(f"max_offset: expected a value at which recording and truth overlap, got {longest:g} s")
    return low + interval * np.arange(int(np.ceil((high - low) / interval)) + 1, dtype=np.float64)


def _scores(found: Sequence[Detections], grid: _Floats, known: Truth, candidates: _Floats, widths: _Floats) -> _Floats:
    """Support of each offset: up to 1 per frame and target, for a detection within about 2 bins of the truth.

    A target at rest supports all offsets equally.
    """
    times = np.array([one.time for one in found])
    true = np.stack([known.range, known.velocity]) / widths[:, None, None]  # (2, time, target)
    # The detections in one array, padded with NaN.
    measured = np.full((2, len(found), max(map(len, found))), np.nan)
    for k, one in enumerate(found):
        measured[:, k, : len(one)] = np.stack([one.range, one.velocity]) / widths[:, None]
    scores = np.zeros(len(candidates))
    for k, offset in enumerate(candidates):
        at = true[:, np.rint((times + offset - grid[0]) / (grid[1] - grid[0])).astype(np.intp)]
        distance = np.square(measured[..., None] - at[:, :, None]).sum(axis=0)  # (frame, detection, target)
        scores[k] = np.exp(-0.5 / _WIDTH**2 * np.fmin.reduce(distance, axis=1, initial=np.inf)).sum()
    return scores


def _rival(scores: _Floats, best: int) -> int | None:
    """Offset on another peak with nearly the best score; None if there is none."""
    rival = rival_peak(scores, best)
    if rival is None:
        return None
    # Subtract the support of targets at rest, which is equal for all offsets.
    floor = scores.min()
    return rival if scores[rival] - floor > _ALIKE * (scores[best] - floor) else None


def _fitted(
    found: Sequence[Detections], truth: RecordedTruth, offset: float, widths: _Floats, interval: float
) -> RecordingOffset:
    """Offset with the best fit of the velocities, from an offset that errs by at most about a frame interval."""
    times = np.array([one.time for one in found])
    step = 0.1 * interval
    deviation = np.inf
    for _ in range(_STEPS):
        known, ahead, behind = (truth.at(times + offset + shift) for shift in (0.0, step, -step))
        measured = np.array([_nearest(one, known[k], widths) for k, one in enumerate(found)])  # (frame, target)
        errors = measured - known.velocity
        slopes = (ahead.velocity - behind.velocity) / (2.0 * step)
        # Sums over all targets of the normal equation of the offset, with the biases eliminated.
        moment = weight = 0.0
        for error, slope in zip(errors.T, slopes.T, strict=True):
            usable = np.isfinite(error) & np.isfinite(slope)
            if usable.sum() > 3:
                by_error, by_slope = _weighed(error[usable], slope[usable], 1e-3 * widths[1])
                moment, weight = moment + by_error, weight + by_slope
        if not weight > 0.0:
            break
        change, deviation = moment / weight, weight**-0.5
        offset += float(np.clip(change, -interval, interval))
        if abs(change) < _SETTLED:
            break
    if not deviation < interval:
        raise ValueError(
            "offset: expected a detected target with changing velocity to align the clock by, got none; give the offset"
        )
    return RecordingOffset(offset, deviation, True)


def _nearest(found: Detections, known: Truth, widths: _Floats) -> _Floats:
    """Velocity of the detection nearest to each target of the truth, (target,); NaN where none is near."""
    ranges = np.abs(found.range[:, None] - known.range) / widths[0]
    velocities = np.abs(found.velocity[:, None] - known.velocity) / widths[1]
    distance = np.where(np.isnan(ranges + velocities), np.inf, np.maximum(ranges, velocities))
    nearest = distance.argmin(axis=0)
    return np.where(distance[nearest, np.arange(len(nearest))] <= _NEAR, found.velocity[nearest], np.nan)


def _weighed(errors: _Floats, slopes: _Floats, least: float) -> tuple[float, float]:
    """Weighted sums of slopes times errors and of squared slopes, with the bias eliminated.

    Errors are weighted by their spread, at least `least` [m/s]; the bias of a target is small against the spread.
    """
    middle = float(np.median(errors))
    spread = max(1.4826 * float(np.median(np.abs(errors - middle))), least)
    weights = np.minimum(1.0, _HUBER * spread / np.maximum(np.abs(errors - middle), least)) / spread**2
    # Least squares for offset and bias; the bias has a prior of mean zero.
    total = weights.sum() + (_BIAS * spread) ** -2
    by_slope, by_error = weights @ slopes, weights @ errors
    return (
        float(weights @ (slopes * errors) - by_slope * by_error / total),
        float(weights @ (slopes * slopes) - by_slope**2 / total),
    )


AUTO = "auto"
"""Offset to estimate."""

Offset = float | str


@dataclass(frozen=True, eq=False)
class Alignment:
    """Clock and truth of every recording.

    Parameters
    ----------
    clocks : tuple of RecordingOffset
    truths : tuple of TruthOverTime
        In common time.
    is_by_tracks : bool
        True without any truth: the tracks of A then replace it.
    """

    clocks: tuple[RecordingOffset, ...]
    truths: tuple[TruthOverTime, ...]
    is_by_tracks: bool


def offsets(offset: Any, num_recordings: int) -> tuple[Offset, ...]:
    """Offset of every recording, a number or "auto"; a single offset belongs to the last recording."""
    if not isinstance(offset, tuple | list):
        return (0.0,) * (num_recordings - 1) + (_offset(offset),)
    if len(offset) != num_recordings:
        raise ValueError(f"offset: expected one, or {num_recordings} of {num_recordings} recordings, got {len(offset)}")
    return tuple(map(_offset, offset))


def aligned(
    found: Sequence[Found], wanted: Sequence[Offset], given: TruthOverTime | None, longest: float | None
) -> Alignment:
    """Offsets of the clocks, given or estimated, and the truth of every recording.

    Parameters
    ----------
    found : sequence of Found
        Of A, and of B if given.
    wanted : sequence of float or "auto"
        One per recording.
    given : TruthOverTime or None
        Truth for all recordings; None: each recording's own truth, or the tracks of A.
    longest : float or None
        Largest estimated offset [s].
    """
    if given is not None:
        clocks: list[RecordingOffset] = []
        for one, offset in zip(found, wanted, strict=True):
            # A truth without an end is limited to the duration of A.
            times = middles(found[0].recording, clocks[0].seconds).tolist() if clocks else []
            span = given.span or ((times[0], times[-1]) if times else None)
            clocks.append(_clock(one, offset, given, longest, span))
        return Alignment(tuple(clocks), (given,) * len(found), is_by_tracks=False)
    if isinstance(wanted[0], str):
        raise ValueError("offset: expected a number for A, whose clock is the time base without a truth, got 'auto'")
    first = RecordingOffset(wanted[0])
    has_truth = [one.recording.truth is not None for one in found]
    of_a = _own_truth(found[0], first.seconds) if has_truth[0] else _truth_of_tracks(found[0], first.seconds)
    if len(found) == 1:
        return Alignment((first,), (of_a,), is_by_tracks=not has_truth[0])

    # B is aligned with the truth of A, or with A's tracks without any truth. If only B has one, A is aligned with it.
    if wanted[1] == AUTO and has_truth[1] and not has_truth[0]:
        of_b = _own_truth(found[1], 0.0)
        back = _clock(found[0], AUTO, of_b, longest, of_b.span)
        second = RecordingOffset(first.seconds - back.seconds, back.deviation, back.is_estimated)
    else:
        second = _clock(found[1], wanted[1], of_a, longest, of_a.span)
    of_b = _own_truth(found[1], second.seconds) if has_truth[1] else of_a
    return Alignment((first, second), (of_a if has_truth[0] else of_b, of_b), is_by_tracks=not any(has_truth))


def _offset(value: Any) -> Offset:
    if isinstance(value, str):
        if value != AUTO:
            raise ValueError(f"offset: expected seconds or 'auto', got {value!r}")
        return AUTO
    return check.number("offset", value, "s")


def _clock(
    found: Found,
    wanted: Offset,
    truth: TruthOverTime,
    longest: float | None,
    span: tuple[float, float] | None,
) -> RecordingOffset:
    """Offset of a recording, given or estimated."""
    if not isinstance(wanted, str):
        return RecordingOffset(wanted)
    wf = found.recording.radar.waveform
    return estimated_offset(
        found.detections,
        truth,
        bins=(wf.range_resolution, wf.velocity_resolution),
        interval=usual_interval(found.recording),
        longest=longest,
        span=span,
    )


def _own_truth(found: Found, offset: float) -> RecordedTruth:
    assert found.recording.truth is not None  # the caller has checked this
    return RecordedTruth(middles(found.recording, offset), found.recording.truth)


def _truth_of_tracks(found: Found, offset: float) -> RecordedTruth:
    """The tracks of a recording in place of a truth, named by their numbers; NaN in frames that one is not in."""
    tracks = found.tracks
    rows = np.full((len(TRUTH_FIELDS), len(tracks.time), len(tracks)), np.nan)
    for k, track in enumerate(tracks):
        rows[:2, track.frame, k] = measured(track, found.detections, found.recording.radar.waveform)[:, :2].T
        rows[2:, track.frame, k] = track.azimuth, track.elevation
    names = tuple(f"track {track.id}" for track in tracks)
    return RecordedTruth(middles(found.recording, offset), Truth(names, *rows))
