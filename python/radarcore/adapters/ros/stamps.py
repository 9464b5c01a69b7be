"""Stamps of messages: whole nanoseconds, as a float64 of seconds since 1970 is off by a tenth of a microsecond."""

from __future__ import annotations

import math
from typing import Any

from radarcore import check

_BILLION = 10**9


def nanoseconds(stamp: Any) -> int:
    """Time of a stamp [ns], exact: of ROS 2 (sec, nanosec), ROS 1 (secs, nsecs) or Gazebo (sec, nsec).

    See Also
    --------
    adapters.ros.header_nanoseconds : Of the header of a message.
    adapters.ros.seconds : Seconds since a start.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> rc.adapters.ros.nanoseconds(SimpleNamespace(sec=1_700_000_000, nanosec=123_456_789))
    1700000000123456789
    """
    for whole, part in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")):
        if hasattr(stamp, whole) and hasattr(stamp, part):
            return int(getattr(stamp, whole)) * _BILLION + int(getattr(stamp, part))
    raise TypeError(f"stamp: expected sec and nanosec (or secs and nsecs), got {type(stamp).__name__}")


def header_nanoseconds(message: Any) -> int | None:
    """Stamp in the header of a message [ns]; None if it has none.

    See Also
    --------
    adapters.ros.nanoseconds : Of a stamp.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> stamp = SimpleNamespace(sec=5, nanosec=250_000_000)
    >>> rc.adapters.ros.header_nanoseconds(SimpleNamespace(header=SimpleNamespace(stamp=stamp)))
    5250000000
    """
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return None if stamp is None else nanoseconds(stamp)


def seconds(time_ns: int, start_ns: int = 0) -> float:
    """Time since `start_ns` [s], rounded once: times of motions should count from the start of a recording.

    See Also
    --------
    adapters.ros.nearest_nanoseconds : The way back.

    Examples
    --------
    >>> rc.adapters.ros.seconds(1_700_000_000_250_000_000, start_ns=1_700_000_000_000_000_000)
    0.25
    """
    return (int(time_ns) - int(start_ns)) / _BILLION


def nearest_nanoseconds(time: float) -> int:
    """Whole nanoseconds nearest to a time [s].

    See Also
    --------
    adapters.ros.seconds : The way back.

    Examples
    --------
    >>> rc.adapters.ros.nearest_nanoseconds(0.1 + 0.2)
    300000000
    """
    given = check.number("time", time, "s")
    whole = math.floor(given)
    return whole * _BILLION + round((given - whole) * 1e9)
