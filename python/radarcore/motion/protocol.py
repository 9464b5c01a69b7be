"""Interface of a motion, and poses of any motion at several times."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Matrix, Pose, transforms


class Motion(Protocol):
    """Motion of a body or sensor: a pose at every time, and its rate of change.

    A motion may also have ``poses_at(times)``, which returns ``[rotation | position]`` at several times [s],
    (n, 3, 4); one without is evaluated time by time. One that a running program updates has ``newest``, see `Live`.
    """

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        ...

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        ...


AnyMotion = Motion | Callable[[float], Pose]
"""Motion as `Body` and `Simulator` take it: `Pose`, `Linear`, `Trajectory`, `Attached`, `Live`, a function of time."""


def newest_update(motion: object) -> float | None:
    """Time of the newest update [s] of a motion that is live, or rides on one; None of others.

    Minus infinity before the first update.
    """
    return getattr(motion, "newest", None)


def newest_of(*motions: object) -> float | None:
    """The latest of the newest updates of motions [s]; None if none of them is live."""
    times = [time for motion in motions if (time := newest_update(motion)) is not None]
    return max(times, default=None)


def factors_of(motion: Motion) -> tuple[Motion, ...]:
    """The motions that a motion such as `Attached` is composed of; empty for other motions.

    Empty for a subclass, too, which may have poses of its own.
    """
    factors: tuple[Motion, ...] = getattr(motion, "factors", ()) if "factors" in vars(type(motion)) else ()
    return factors


def with_factors(motions: Iterable[Motion]) -> list[Motion]:
    """The motions and all their factors: each once, factors before the motions composed of them."""
    found: dict[int, Motion] = {}
    pending = list(motions)
    while pending:
        missing = [factor for factor in factors_of(pending[-1]) if id(factor) not in found]
        if missing:
            pending += missing
        else:
            motion = pending.pop()
            found[id(motion)] = motion
    return list(found.values())


def poses_at(motion: Motion, times: ArrayLike) -> Matrix:
    """``[rotation | position]`` of any motion at several times [s], (n, 3, 4): body coordinates to the world."""
    together: Callable[[ArrayLike], Matrix] | None = getattr(motion, "poses_at", None)
    maps = one_by_one(motion, times) if together is None else together(times)
    if np.shape(maps) != (expected := (np.size(times), 3, 4)):
        raise ValueError(f"poses_at: expected shape {expected}, got {np.shape(maps)}")
    return maps


def one_by_one(motion: Motion, times: ArrayLike) -> Matrix:
    """``[rotation | position]`` by `Motion.at`, time by time, (n, 3, 4)."""
    poses = [motion.at(time) for time in check.numbers("times", times).tolist()]
    return np.array([transforms(pose.rotation, pose.position) for pose in poses]).reshape(-1, 3, 4)
