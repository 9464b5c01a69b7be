"""Models of robot arms, and real meshes of an arm and of a human (extra `robots`)."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
