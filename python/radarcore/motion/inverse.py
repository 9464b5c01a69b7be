"""Motions the other way round."""

from __future__ import annotations

import numpy as np

from radarcore.geometry.pose import Matrix, transforms
from radarcore.motion.function import as_motion
from radarcore.motion.group import Composed
from radarcore.motion.protocol import AnyMotion, Motion
from radarcore.sealed import sealed


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
