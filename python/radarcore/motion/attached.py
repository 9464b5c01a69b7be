"""Motions composed of others: one relative to another, and the inverse."""

from __future__ import annotations

import numpy as np

from radarcore.geometry.pose import Pose, transforms
from radarcore.geometry.rotation import Matrix
from radarcore.motion.group import Composed
from radarcore.motion.protocol import AnyMotion, Motion, as_motion
from radarcore.records import sealed


@sealed
class Attached(Composed):
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
    def factors(self) -> tuple[Motion, Motion]:
        """The parent, and the motion relative to it."""
        return self.parent, self.motion

    def poses_of(self, parent: Matrix, own: Matrix) -> Matrix:
        """Products of maps ``[rotation | position]``, (..., 3, 4): parent to world, and own to parent."""
        placed: Matrix = parent[..., :3] @ own
        placed[..., 3] += parent[..., 3]
        return placed

    def rates_of(self, parent: Matrix, own: Matrix, parent_rate: Matrix, own_rate: Matrix) -> Matrix:
        """Time derivatives of `poses_of`, by the product rule, (..., 3, 4)."""
        rates: Matrix = parent_rate[..., :3] @ own + parent[..., :3] @ own_rate
        rates[..., 3] += parent_rate[..., 3]
        return rates


@sealed
class Inverse(Composed):
    """Motion of the world as seen from a body: the inverse pose at every time.

    Parameters
    ----------
    motion : motion
        Any motion.
    """

    def __init__(self, motion: AnyMotion) -> None:
        self.motion: Motion = as_motion("motion", motion)

    @property
    def factors(self) -> tuple[Motion]:
        """The motion."""
        return (self.motion,)

    def poses_of(self, maps: Matrix) -> Matrix:
        """Inverses of maps ``[rotation | position]``, (..., 3, 4)."""
        back = np.swapaxes(maps[..., :3], -1, -2)
        return transforms(back, (-back @ maps[..., 3:])[..., 0])

    def rates_of(self, maps: Matrix, rates: Matrix) -> Matrix:
        """Time derivatives of `poses_of`, (..., 3, 4)."""
        back, turning = (np.swapaxes(values[..., :3], -1, -2) for values in (maps, rates))
        return transforms(turning, -(turning @ maps[..., 3:] + back @ rates[..., 3:])[..., 0])
