"""Motions relative to another motion."""

from __future__ import annotations

from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.pose import Matrix, Pose
from radarcore.motion.function import as_motion
from radarcore.motion.protocol import AnyMotion, Motion, newest_of, poses_at
from radarcore.sealed import sealed


@check.knows_keywords
@sealed
class Attached:
    """A motion relative to another: a body, or the radar, mounted on something that moves.

    Parameters
    ----------
    parent : motion
        Any motion, such as that of a body or of a robot's link.
    motion : motion
        Relative to the parent, in its coordinates; default: at its origin, with its axes.

    See Also
    --------
    Linear : Constant velocity.
    models.MovingArm.link_motion : Motion of a robot's link, for a radar on it.

    Examples
    --------
    >>> cart = rc.Linear(rc.Pose(), velocity=[1.0, 0.0, 0.0])
    >>> radar = rc.Attached(cart, rc.Pose([0.2, 0.0, 0.5]))
    >>> radar.at(2.0).position
    array([2.2, 0. , 0.5])
    """

    def __init__(self, parent: AnyMotion, motion: AnyMotion | None = None) -> None:
        self.parent: Motion = as_motion("parent", parent)
        self.motion: Motion = Pose() if motion is None else as_motion("motion", motion)

    @property
    def newest(self) -> float | None:
        """Time of the newest update of either motion [s]; None if neither is live."""
        return newest_of(self.parent, self.motion)

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return self.parent.at(time) @ self.motion.at(time)

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        return carried_poses(poses_at(self.parent, times), poses_at(self.motion, times))

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        parent, own = (poses_at(motion, [time])[0] for motion in (self.parent, self.motion))
        return carried_rates(parent, self.parent.rate_at(time), own, self.motion.rate_at(time))


def carried_poses(parent: Matrix, own: Matrix) -> Matrix:
    """Products of maps ``[rotation | position]``, (..., 3, 4): of the parent to the world, and to the parent."""
    placed: Matrix = parent[..., :3] @ own
    placed[..., 3] += parent[..., 3]
    return placed


def carried_rates(parent: Matrix, parent_rate: Matrix, own: Matrix, own_rate: Matrix) -> Matrix:
    """Time derivatives of `carried_poses`, by the product rule, (..., 3, 4)."""
    rates: Matrix = parent_rate[..., :3] @ own + parent[..., :3] @ own_rate
    rates[..., 3] += parent_rate[..., 3]
    return rates
