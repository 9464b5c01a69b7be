"""CoppeliaSim through its ZeroMQ remote API (extra `coppelia`): depth and grey images, meshes and poses.

Every call is one of the API `sim-1`, as CoppeliaSim 4.6 and later have it.
"""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
