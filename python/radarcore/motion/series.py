"""Series of values at given times: gaps between them, and times before the first and after the last."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.units import SPEED_OF_LIGHT

EXTRAPOLATE = ("hold", "continue", "error")
"""Extrapolation modes of a series."""

_Floats = NDArray[np.float64]

# Longer steps [s] with a slower motion [m/s or rad/s] are implausible for times in seconds. A chest that breathes six
# times a minute is at its ends every 5 s. In milliseconds, 100 poses per second have steps of 10 "s", and 20 m/s are
# 20 mm/s.
LONG_STEP, _SLOW = 5.0, 0.02
# Longest single step, which is a whole motion [s].
_LONG_MOTION = 100.0
# Shorter steps are noise of a body at rest [m or rad].
_NOISE = 1e-3

# Speeds below this are rest [m/s or rad/s].
_AT_REST = 1e-6


def steps_between(maps: _Floats) -> _Floats:
    """Distances or angles, the larger of both, from each of the maps (n, ..., 3, 4) to the next, (n - 1, ...)."""
    changes = np.diff(maps, axis=0)
    # The norm of the change of a rotation matrix is sqrt(2) times the angle, if it is small.
    turned = np.sqrt(0.5 * np.square(changes[..., :3]).sum(axis=(-2, -1)))
    return np.asarray(np.maximum(turned, np.linalg.norm(changes[..., 3], axis=-1)))


def warn_of_milliseconds(name: str, intervals: _Floats, steps: _Floats, longest: float = LONG_STEP) -> bool:
    """Warn of times in milliseconds, with steps longer than `longest` [s] and a slow motion; True if so.

    `steps`: distance or angle in each interval, (n - 1,) [m or rad].
    """
    is_slow = steps.max() > _NOISE and bool((steps < _SLOW * intervals).all())
    if not (is_slow and np.median(intervals) > longest):
        return False
    notice.warn(
        f"{name}: expected times in seconds, got steps of {np.median(intervals):.4g} s in which nothing is faster than "
        f"{1e3 * (steps / intervals).max():.2g} mm/s or mrad/s; milliseconds?"
    )
    return True


def check_steps(name: str, times: _Floats, steps: _Floats) -> None:
    """Refuse a series whose steps, (n - 1,) [m or rad], are too fast; warn of times in milliseconds."""
    intervals = np.diff(times)
    check.below(name, steps / intervals, SPEED_OF_LIGHT, "m/s or rad/s")
    warn_of_milliseconds(name, intervals, steps, LONG_STEP if len(steps) > 1 else _LONG_MOTION)


class Ends:
    """Rule of a series for times beyond its ends.

    ``"hold"``: it rests at the end, ``"continue"``: it keeps the velocity of the end, ``"error"``: a ValueError.
    By default vertices and joints rest; a body continues, with one warning if it moves at the end.

    Parameters
    ----------
    series : str
        Name of the class, for messages.
    times : (n,) array
        Times of the series, increasing [s].
    extrapolate : "hold", "continue", "error" or None
        Choice of the user.
    speeds : (float, float), optional
        Largest rates at the first and at the last time [m/s or rad/s] of a series that continues by default.
    """

    def __init__(
        self, series: str, times: _Floats, extrapolate: str | None, speeds: tuple[float, float] | None = None
    ) -> None:
        self.choice: str | None = None if extrapolate is None else check.choice("extrapolate", extrapolate, EXTRAPOLATE)
        self._series, self._speeds = series, speeds or (0.0, 0.0)
        self._kind = self.choice or ("hold" if speeds is None else "continue")
        self._first, self._last = float(times[0]), float(times[-1])
        self._slack = slack(times)
        self._has_warned = False

    def split(self, times: ArrayLike) -> tuple[_Floats, _Floats]:
        """Times within the series, and the time before or after it with the velocity of that end [s]."""
        wanted = check.numbers("times", times)
        inside = np.clip(wanted, self._first, self._last)
        if (wanted != inside).any():
            self._check(wanted)
        return inside, wanted - inside if self._kind == "continue" else np.zeros_like(wanted)

    def moves(self, times: ArrayLike) -> NDArray[np.bool_]:
        """True at times where the series has a velocity: not beyond ends that are held (up to rounding)."""
        wanted = check.numbers("times", times)
        within = (self._first - self._slack <= wanted) & (wanted <= self._last + self._slack)
        return within | (self._kind == "continue")

    def _check(self, wanted: _Floats) -> None:
        """Refuse times beyond the ends, or warn of them, if the rule says so."""
        beyond = np.maximum(self._first - wanted, wanted - self._last)
        farthest = float(wanted.flat[int(beyond.argmax())])
        if beyond.max() <= self._slack:
            return
        text = f"expected {self._first:g} to {self._last:g} s, the times of this {self._series}, got {farthest:.9g} s"
        if self._kind == "error":
            raise ValueError(f"time: {text} (extrapolate='error')")
        moves = self._speeds[farthest > self._last] > _AT_REST
        if self.choice is None and moves and not self._has_warned:
            self._has_warned = True
            notice.warn(
                f"time: {text}: it keeps the velocity of its end; choose by extrapolate='continue', 'hold' or 'error'"
            )


# Rounding of times [s]: at least this, and some steps of the numbers.
_SLACK, _STEPS = 1e-9, 4.0


def slack(times: _Floats) -> float:
    """Rounding of times of a series [s]."""
    return max(_SLACK, _STEPS * float(np.spacing(np.abs(times).max())))


class Segments:
    """Segments of a series between gaps: at least two times each.

    Parameters
    ----------
    series : str
        Name of the class, for messages.
    times : (n,) array
        Times of the series, increasing [s]; each has a neighbour that is near enough.
    max_gap : float or None
        Neighbouring times with a larger distance [s] bound a gap; None: no gaps.
    """

    def __init__(self, series: str, times: _Floats, max_gap: float | None) -> None:
        self._series = series
        self._slack = slack(times)
        breaks = np.flatnonzero(np.diff(times) > (np.inf if max_gap is None else max_gap + self._slack))
        starts, stops = np.append(0, breaks + 1), np.append(breaks + 1, len(times))
        self.parts: list[slice[int, int, None]] = [
            slice(start, stop) for start, stop in zip(starts.tolist(), stops.tolist(), strict=True)
        ]
        self._first, self._last = times[starts], times[stops - 1]
        self.gaps: NDArray[np.float64] = check.frozen(np.column_stack([self._last[:-1], self._first[1:]]))

    @staticmethod
    def neighbours(times: _Floats, max_gap: float) -> NDArray[np.intp]:
        """Indices of the times that have a neighbour within `max_gap`, or a ValueError if none has."""
        steps = np.diff(times)
        is_near = steps <= max_gap + slack(times)
        kept = np.flatnonzero(np.append(is_near, False) | np.append(False, is_near))
        if kept.size == 0:
            raise ValueError(
                f"max_gap: expected at least {steps.min():g} s, the shortest step of the times, got {max_gap:g} s"
            )
        return kept

    def known(self, times: ArrayLike) -> NDArray[np.bool_]:
        """True at times within a segment, but for rounding."""
        wanted = check.numbers("times", times)
        segment = self._nearest(wanted)
        is_known: NDArray[np.bool_] = (wanted >= self._first[segment] - self._slack) & (
            wanted <= self._last[segment] + self._slack
        )
        return is_known

    def split(self, times: _Floats) -> tuple[_Floats, NDArray[np.intp]]:
        """Times within the segments, and the index of each one's segment; a ValueError for those within a gap."""
        if not (is_known := self.known(times)).all():
            time = float(times[~is_known][0])
            first, last = self.gaps[np.searchsorted(self.gaps[:, 1], time)]
            raise ValueError(
                f"time: {time:.9g} s is within a gap of this {self._series}, from {first:.9g} to {last:.9g} s; ask "
                f"known(times) before, or bridge gaps by a larger max_gap or within_gaps='interpolate'"
            )
        segment = self._nearest(times)
        return np.clip(times, self._first[segment], self._last[segment]), segment

    def _nearest(self, times: _Floats) -> NDArray[np.intp]:
        """Index of the segment that begins before a time, but for rounding; the first one for earlier times."""
        return np.maximum(np.searchsorted(self._first - self._slack, times, side="right") - 1, 0)
