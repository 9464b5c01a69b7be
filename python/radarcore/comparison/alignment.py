"""Recordings and truth on one time base: whose clock counts, and which truth each recording has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarcore import check
from radarcore.comparison.clock import TruthOverTime, estimated_offset
from radarcore.comparison.reference import RecordedTruth
from radarcore.comparison.targets import Found, measured
from radarcore.comparison.time_base import RecordingOffset, middles, usual_interval
from radarcore.recording.frame import TRUTH_FIELDS, Truth

AUTO = "auto"
"""Offset that is to be estimated."""

Offset = float | str


@dataclass(frozen=True, eq=False)
class Alignment:
    """Clock and truth of every recording.

    Parameters
    ----------
    clocks : tuple of RecordingOffset
    truths : tuple of TruthOverTime
        By the common base.
    is_by_tracks : bool
        Whether there is no truth at all: it is then what A has tracked.
    """

    clocks: tuple[RecordingOffset, ...]
    truths: tuple[TruthOverTime, ...]
    is_by_tracks: bool


def offsets(offset: Any, num_recordings: int) -> tuple[Offset, ...]:
    """Offset of every recording: numbers, or "auto"; a single one is that of the last."""
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
        Of A, and of B if there is one.
    wanted : sequence of float or "auto"
        One per recording.
    given : TruthOverTime or None
        Truth that counts for all; None: that of the recordings, or the tracks of A.
    longest : float or None
        Largest offset that is estimated [s].
    """
    if given is not None:
        clocks: list[RecordingOffset] = []
        for one, offset in zip(found, wanted, strict=True):
            # A truth without an end is that of the time in which A was.
            span = given.span or (_span(found[0], clocks[0].seconds) if clocks else None)
            clocks.append(_clock(one, offset, given, longest, span))
        return Alignment(tuple(clocks), (given,) * len(found), is_by_tracks=False)
    if isinstance(wanted[0], str):
        raise ValueError("offset: expected a number for A, whose clock is the time base without a truth, got 'auto'")
    first = RecordingOffset(wanted[0])
    has_truth = [one.recording.truth is not None for one in found]
    of_a = _own_truth(found[0], first.seconds) if has_truth[0] else _truth_of_tracks(found[0], first.seconds)
    if len(found) == 1:
        return Alignment((first,), (of_a,), is_by_tracks=not has_truth[0])

    # B is aligned with the truth of A; if only B has one, A with that; without any, with the tracks of A.
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
    """The offset of a recording, given or estimated."""
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
    assert found.recording.truth is not None  # who asks knows
    return RecordedTruth(middles(found.recording, offset), found.recording.truth)


def _truth_of_tracks(found: Found, offset: float) -> RecordedTruth:
    """The tracks of a recording in place of a truth, named by their numbers; NaN in frames that one is not in."""
    tracks = found.tracks
    rows = np.full((len(TRUTH_FIELDS), len(tracks.time), len(tracks)), np.nan)
    for k, track in enumerate(tracks):
        rows[:2, track.frame, k] = measured(track, found.detections, found.recording.radar.waveform).T
        rows[2:, track.frame, k] = track.azimuth, track.elevation
    names = tuple(f"track {track.id}" for track in tracks)
    return RecordedTruth(middles(found.recording, offset), Truth(names, *rows))


def _span(found: Found, offset: float) -> tuple[float, float]:
    """Time of the first and the last frame, by the common base [s]."""
    time = middles(found.recording, offset)
    return float(time[0]), float(time[-1])
