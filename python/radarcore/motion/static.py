"""Motions at rest."""

from __future__ import annotations

from radarcore.geometry.pose import Pose
from radarcore.motion.linear import Linear
from radarcore.motion.protocol import Motion, factors_of, with_factors


def is_static(motion: Motion) -> bool:
    """True when the pose is known to be the same at all times."""
    return all(_is_at_rest(part) for part in with_factors([motion]) if not factors_of(part))


def _is_at_rest(motion: Motion) -> bool:
    if type(motion) is Linear:
        return not (motion.velocity.any() or motion.angular_velocity.any())
    return type(motion) is Pose  # a subclass may move
