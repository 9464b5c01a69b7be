"""USD stages as radarcore scenes, and poses of a simulator that runs on one (extra `usd`)."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
