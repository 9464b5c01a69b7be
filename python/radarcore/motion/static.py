"""Motions at rest."""

from __future__ import annotations

from radarcore.geometry.pose import Pose
from radarcore.motion.attached import Attached
from radarcore.motion.linear import Linear
from radarcore.motion.protocol import Motion


def is_static(motion: Motion) -> bool:
    """True when the pose is known to be the same at all times."""
    if isinstance(motion, Linear):
        return not (motion.velocity.any() or motion.angular_velocity.any())
    if isinstance(motion, Attached):
        return is_static(motion.parent) and is_static(motion.motion)
    return isinstance(motion, Pose)
