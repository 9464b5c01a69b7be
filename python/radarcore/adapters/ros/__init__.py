"""Messages of ROS 1 and ROS 2 to and from radarcore's types, by pure functions that import nothing of ROS."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
