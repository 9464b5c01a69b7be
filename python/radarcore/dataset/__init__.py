"""Datasets: variations of scenes, labels, storage, and streams for training.

Only the names here are public; the modules load when they are used.
"""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
