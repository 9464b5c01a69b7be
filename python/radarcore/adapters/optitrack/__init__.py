"""Motion capture by OptiTrack: take files of Motive, and its live stream, to motions."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
