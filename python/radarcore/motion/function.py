"""Motions given by a function of time, and derivatives by finite differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Matrix, Pose, not_a_pose
from radarcore.motion.protocol import Motion, one_by_one
from radarcore.sealed import sealed


@sealed
class Function:
    """A motion given by a function of time.

    Parameters
    ----------
    pose : callable
        Maps a time [s] to a `Pose`.
    rate : callable, optional
        Maps a time [s] to the time derivative of ``[rotation | position]``, (3, 4) [1/s | m/s]. Default: central
        differences of fourth order over steps of 0.5 ms, off by 2e-15 of the motion's fifth derivative [m/s^5].

    See Also
    --------
    Trajectory : Motion through several poses.
    Live : Motion of a program that has a pose now.

    Examples
    --------
    >>> swing = rc.Function(lambda time: rc.Pose([2.0 + 0.1 * np.sin(time), 0.0, 0.0]))
    >>> swing.rate_at(0.0)[0, 3].round(6).item()
    0.1
    """

    def __init__(self, pose: Callable[[float], Pose], rate: Callable[[float], ArrayLike] | None = None) -> None:
        if not callable(pose):
            raise TypeError(f"pose: expected a function of time, got {type(pose).__name__}")
        self._pose, self._rate = pose, rate

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        pose = self._pose(time)
        if not isinstance(pose, Pose):
            raise not_a_pose("pose", "a function that returns Pose", pose, f" at {time:g} s")
        return pose

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4), one after another."""
        return one_by_one(self, times)

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        if self._rate is not None:
            return check.array("rate", self._rate(time), (3, 4))
        return derivative(lambda when: self.poses_at([when])[0], time)


# Step of the finite differences of a function of time [s].
_STEP = 5e-4


def as_motion(name: str, motion: object) -> Motion:
    """The motion, a function wrapped, or a TypeError that names the argument."""
    if hasattr(motion, "at") and hasattr(motion, "rate_at"):
        return cast(Motion, motion)
    if callable(motion):
        return Function(motion)
    raise not_a_pose(name, "Pose, Linear, Trajectory, Attached, Live or a function of time", motion)


def derivative(values: Callable[[float], Matrix], time: float) -> Matrix:
    """Time derivative of a function of time: central differences of fourth order, over steps of 0.5 ms."""
    near, far = ((values(time + step) - values(time - step)) / (2.0 * step) for step in (_STEP, 2.0 * _STEP))
    rate: Matrix = (4.0 * near - far) / 3.0
    return rate
