"""Times before the first and after the last of a series: one rule for poses, joint angles and vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice

BEYOND = ("hold", "continue", "error")
"""Ways to go on beyond the ends of a series."""

_Floats = NDArray[np.float64]

# Rounding of times [s]: at least this, and some steps of the numbers.
_SLACK, _STEPS = 1e-9, 4.0
# Speeds below this are rest [m/s or rad/s].
_AT_REST = 1e-6


class Ends:
    """Rule of a series for times beyond its ends.

    ``"hold"``: it rests at the end, ``"continue"``: it keeps the velocity of the end, ``"error"``: a ValueError.
    Without a choice vertices and joints rest; a body goes on, which is warned of once where it moves at the end.

    Parameters
    ----------
    series : str
        Name of the class, for messages.
    times : (n,) array
        Times of the series, increasing [s].
    beyond : "hold", "continue", "error" or None
        Choice of the user.
    speeds : (float, float), optional
        Largest rates at the first and at the last time [m/s or rad/s] of a series that goes on without a choice.
    """

    def __init__(
        self, series: str, times: _Floats, beyond: str | None, speeds: tuple[float, float] | None = None
    ) -> None:
        self.choice: str | None = None if beyond is None else check.choice("beyond", beyond, BEYOND)
        self._series, self._speeds = series, speeds or (0.0, 0.0)
        self._kind = self.choice or ("hold" if speeds is None else "continue")
        self._first, self._last = float(times[0]), float(times[-1])
        self._slack = max(_SLACK, _STEPS * float(np.spacing(np.abs(times).max())))
        self._told = False

    def split(self, times: ArrayLike) -> tuple[_Floats, _Floats]:
        """Times within the series, and time during which the velocity of the end goes on after or before [s]."""
        wanted = np.asarray(times, dtype=np.float64)
        inside = np.clip(wanted, self._first, self._last)
        if (wanted != inside).any():
            self._check(wanted)
        return inside, wanted - inside if self._kind == "continue" else np.zeros_like(wanted)

    def moves(self, times: ArrayLike) -> NDArray[np.bool_]:
        """True at times where the series has a velocity: not beyond ends that are held, but for rounding."""
        wanted = np.asarray(times, dtype=np.float64)
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
            raise ValueError(f"time: {text} (beyond='error')")
        moves = self._speeds[farthest > self._last] > _AT_REST
        if self.choice is None and moves and not self._told:
            self._told = True
            notice.warn(
                f"time: {text}: it goes on at the velocity of its end; choose by beyond='continue', 'hold' or 'error'"
            )
