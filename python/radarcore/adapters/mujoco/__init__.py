"""MuJoCo models as radarcore scenes: live poses, or rendered depth (extra `mujoco`)."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
