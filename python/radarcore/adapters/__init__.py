"""Data of other programs, decoded by pure functions that import none of them."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
