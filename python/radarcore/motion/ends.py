"""Times before the first and after the last of a series: one rule for poses, joint angles and vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.units import SPEED_OF_LIGHT

BEYOND = ("hold", "continue", "error")
"""Ways to go on beyond the ends of a series."""

_Floats = NDArray[np.float64]

# Longer steps [s] with a slower motion [m/s or rad/s] are implausible for times in seconds. A chest that breathes six
# times a minute is at its ends every 5 s. In milliseconds, 100 poses per second have steps of 10 "s", and 20 m/s are
# 20 mm/s.
LONG_STEP, _SLOW = 5.0, 0.02
# Longest single step, which is a whole motion [s].
_LONG_MOTION = 100.0
# Shorter steps are noise of a body at rest [m or rad].
_NOISE = 1e-3

# Rounding of times [s]: at least this, and some steps of the numbers.
_SLACK, _STEPS = 1e-9, 4.0
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
            raise ValueError(f"time: {text} (beyond='error')")
        moves = self._speeds[farthest > self._last] > _AT_REST
        if self.choice is None and moves and not self._told:
            self._told = True
            notice.warn(
                f"time: {text}: it goes on at the velocity of its end; choose by beyond='continue', 'hold' or 'error'"
            )
