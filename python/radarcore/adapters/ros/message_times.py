"""Times of a series of messages: their stamps, repaired where they cannot be the times of the values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import notice

Nanoseconds = NDArray[np.int64]
Values = NDArray[np.float64]

_SECOND = 10**9

LATEST_FIRST = 60 * _SECOND
"""A single stamp of zero is the start of a simulated clock if others follow within this time [ns]."""

_LONG_GAP, _MANY = 0.2, 5.0
"""A gap in a series is at least this long [s], and this many times as long as the usual interval."""

_SHORT = 0.7
"""Intervals below this share of the mean are suspect. The mean is 1.33 periods if one of four messages is lost."""

_WINDOW, _NUM_INTERVALS, _NUM_PAUSES = 0.1, 5.0, 2.0
"""Speeds are compared over windows of at least this time [s], this many mean intervals, and pauses."""

_TOO_FAST, _NOISE = 2.0, 0.05
"""Speeds of suspect intervals are wrong above this multiple of the speed over windows, plus this [m/s]."""

_CLEARLY, _SLIGHT = 0.25, 0.02
"""Regular times are better below this ratio of squared errors, if the stamps err by more than this speed [m/s]."""

_PAUSE = 3.0
"""A pause above this multiple of the usual pause between bunches is a gap."""


def unpacked(messages: Iterable[Any]) -> tuple[str, list[tuple[Any, int | None]]]:
    """Name of the topic, and messages with their times of recording [ns] (None for bare messages)."""
    name, found = "messages", []
    for entry in messages:
        is_recorded = hasattr(entry, "time_ns") and hasattr(entry, "message")
        name = entry.topic if is_recorded else name
        found.append((entry.message, entry.time_ns) if is_recorded else (entry, None))
    return name, found


def message_times(
    name: str, stamps: Sequence[int], received: Sequence[int | None], values: Values, unit: str
) -> tuple[Nanoseconds, NDArray[np.intp]]:
    """Increasing times of messages [ns], and the indices of these messages. Every repair raises a warning.

    1. Stamps of zero are replaced by the times of recording.
    2. The series ends where the stamps start again, by a reset or a loop.
    3. The first of several equal stamps counts, as in TF.
    4. Messages with irregular stamps and regular values get regular times: the stamps are reception times.

    Parameters
    ----------
    name : str
        For warnings.
    stamps, received : sequence of int
        Header stamps, and times of recording or None [ns], in the order of arrival.
    values : (n, m) float64
        Positions and other finite values.
    unit : str
        Unit of their speed.
    """
    times = _without_zeros(name, np.array(stamps, np.int64), received)
    num_kept = _first_run(name, times)
    order = np.argsort(times[:num_kept], kind="stable")
    times = times[order]
    repeats = np.flatnonzero(np.diff(times) == 0) + 1
    num_different = sum(not np.allclose(values[order[k]], values[order[k - 1]], rtol=0.0, atol=1e-9) for k in repeats)
    if num_different:
        notice.warn(f"{name}: {num_different} of {len(times)} messages repeat a stamp with other values; left out")
    times, order = np.delete(times, repeats), np.delete(order, repeats)
    return _regularized(name, times, values[order], unit), order


def warn_of_gap(name: str, times: Values) -> None:
    """Warn of the longest gap in times [s] that a spline crosses."""
    intervals = np.diff(times)
    k = int(intervals.argmax())
    if intervals[k] > max(_LONG_GAP, _MANY * float(np.median(intervals))):
        notice.warn(
            f"{name}: no messages from {times[k]:g} to {times[k + 1]:g} s; a spline goes through this gap and "
            "shorter ones"
        )


def _without_zeros(name: str, stamps: Nanoseconds, received: Sequence[int | None]) -> Nanoseconds:
    """Stamps; zeros become the time of recording less the median delay of the other messages."""
    is_set = stamps != 0
    num_zeros = int((~is_set).sum())
    if num_zeros == 0 or (num_zeros == 1 and (stamps[is_set] < LATEST_FIRST).all()):
        return stamps
    if None in received:
        raise ValueError(
            f"{name}: expected stamps in headers, got zero in {num_zeros} of {len(stamps)} messages; give messages of "
            "a BagReader, which have times of recording, too"
        )
    recorded = np.array(received, np.int64)
    delay = np.median(recorded[is_set] - stamps[is_set]).astype(np.int64) if is_set.any() else np.int64(0)
    notice.warn(
        f"{name}: header stamps of {num_zeros} of {len(stamps)} messages are zero; times of recording replace them"
    )
    return np.where(is_set, stamps, recorded - delay)


def _first_run(name: str, stamps: Nanoseconds) -> int:
    """Number of messages before the stamps start again; late messages are no restart."""
    latest = np.maximum.accumulate(stamps)
    late = np.concatenate([[False], stamps[1:] < latest[:-1], [False]])
    begins, ends = np.flatnonzero(~late[:-1] & late[1:]) + 1, np.flatnonzero(late[:-1] & ~late[1:]) + 1
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        back = int(latest[begin - 1] - stamps[begin])
        # Late messages fill a hole; a second run overlaps earlier stamps.
        overlaps = False
        if end - begin > 1:
            before = stamps[:begin]
            overlaps = bool(((before > stamps[begin]) & (before < stamps[begin:end].max())).any())
        if overlaps or back > _SECOND:
            notice.warn(
                f"{name}: stamps go back by {back / _SECOND:g} s after message {begin}, by a reset, a loop or a second "
                f"publisher; the {len(stamps) - begin} of {len(stamps)} messages from there on are left out (to use "
                "them, cut the bag there)"
            )
            return begin
    return len(stamps)


def _regularized(name: str, times_ns: Nanoseconds, values: Values, unit: str) -> Nanoseconds:
    """Times of messages, made regular if the stamps are reception times; warns of wrong speeds."""
    if len(times_ns) < 4:
        return times_ns
    times = (times_ns - times_ns[0]) / _SECOND
    intervals, steps = np.diff(times), np.linalg.norm(np.diff(values, axis=0), axis=1)
    pause = float(np.median(intervals[intervals >= intervals.mean()]))
    is_gap = intervals > _PAUSE * pause
    mean = float(intervals[~is_gap].mean())
    window = max(_WINDOW, _NUM_INTERVALS * mean, _NUM_PAUSES * pause)
    if times[-1] < window:
        return times_ns

    # Compare the speeds over short intervals with the speeds over windows.
    speed = float((steps / intervals)[intervals < _SHORT * mean].max(initial=0.0))
    begins = np.flatnonzero(times <= times[-1] - window)
    ends = np.searchsorted(times, times[begins] + window)
    spans = times[ends] - times[begins]
    usual_speed = float((np.linalg.norm(values[ends] - values[begins], axis=1) / spans).max())
    is_too_fast = speed > _TOO_FAST * usual_speed + _NOISE

    # Compare the errors of interpolating every pose between its neighbours, by the stamps and in the middle.
    inner = ~(is_gap[:-1] | is_gap[1:])
    share = (intervals[1:] / (intervals[:-1] + intervals[1:]))[:, None]
    by_stamps, by_number = (
        float(np.square(values[1:-1] - weight * values[:-2] - (1.0 - weight) * values[2:])[inner].sum())
        for weight in (share, 0.5)
    )
    is_jitter = by_number < _CLEARLY * by_stamps and by_stamps > inner.sum() * (_SLIGHT * mean) ** 2
    if not (is_too_fast or is_jitter):
        return times_ns

    regular = _regular(times, np.flatnonzero(is_gap) + 1)
    if by_number < by_stamps and (np.diff(regular) > 0.0).all():
        moved = float(np.abs(regular - times).max())
        end = f"regular times replace them, up to {moved:.3g} s earlier"
        times_ns = times_ns[0] + np.round(regular * _SECOND).astype(np.int64)
    else:
        end = "they are kept, and velocities are wrong there"
    span = f"{intervals.min():.3g} to {intervals[~is_gap].max():.3g} s, {mean:.3g} s on average"
    notice.warn(
        f"{name}: stamps with bunches or jitter (intervals {span}) give speeds of {max(speed, usual_speed):.3g} {unit} "
        f"({usual_speed:.3g} {unit} over {window:.3g} s); {end}"
    )
    return times_ns


def _regular(times: Values, starts: NDArray[np.intp]) -> Values:
    """Latest regular times that are nowhere later than `times`, anew after each gap [s].

    A message is not received before it is sent: the nearest line below the times of the longest segment has the period
    (Moon, Skelly, Towsley, "Estimation and removal of clock skew from network delay measurements", INFOCOM 1999).
    """
    segments = np.split(times, starts)
    longest = max(segments, key=len)
    hull: list[tuple[int, float]] = []
    for k, time in enumerate(longest.tolist()):
        while len(hull) > 1:
            (i, first), (j, second) = hull[-2:]
            if (second - first) * (k - j) < (time - second) * (j - i):
                break
            hull.pop()
        hull.append((k, time))
    middle = 0.5 * (len(longest) - 1)
    (i, first), (j, second) = next(edge for edge in pairwise(hull) if edge[1][0] >= middle)
    period = (second - first) / (j - i)
    rises = [period * np.arange(len(segment)) for segment in segments]
    return np.concatenate([rise + (segment - rise).min() for rise, segment in zip(rises, segments, strict=True)])
