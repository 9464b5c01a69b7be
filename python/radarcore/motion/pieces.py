"""Gaps in a series of times, and the pieces between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check

_Floats = NDArray[np.float64]

# Rounding of times [s], as at the ends of a series: at least this, and some steps of the numbers.
_SLACK, _STEPS = 1e-9, 4.0


def slack(times: _Floats) -> float:
    """Rounding of times of a series [s]."""
    return max(_SLACK, _STEPS * float(np.spacing(np.abs(times).max())))


class Pieces:
    """Pieces of a series between gaps: at least two times each.

    Parameters
    ----------
    series : str
        Name of the class, for messages.
    times : (n,) array
        Times of the series, increasing [s]; each has a neighbour that is near enough.
    max_gap : float or None
        Neighbouring times further apart than this [s] bound a gap; None: there is none.
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
        """True at times within a piece, but for rounding."""
        wanted = check.numbers("times", times)
        piece = self._nearest(wanted)
        is_known: NDArray[np.bool_] = (wanted >= self._first[piece] - self._slack) & (
            wanted <= self._last[piece] + self._slack
        )
        return is_known

    def split(self, times: _Floats) -> tuple[_Floats, NDArray[np.intp]]:
        """Times within the pieces, and the index of each one's piece; a ValueError for those within a gap."""
        if not (is_known := self.known(times)).all():
            time = float(times[~is_known][0])
            first, last = self.gaps[np.searchsorted(self.gaps[:, 1], time)]
            raise ValueError(
                f"time: {time:.9g} s is within a gap of this {self._series}, from {first:.9g} to {last:.9g} s; ask "
                f"known(times) before, or bridge gaps by a larger max_gap or within_gaps='interpolate'"
            )
        piece = self._nearest(times)
        return np.clip(times, self._first[piece], self._last[piece]), piece

    def _nearest(self, times: _Floats) -> NDArray[np.intp]:
        """Index of the piece that begins before a time, but for rounding; the first one for earlier times."""
        return np.maximum(np.searchsorted(self._first - self._slack, times, side="right") - 1, 0)
