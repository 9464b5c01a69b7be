"""Data of other programs: pure functions of what they deliver, importing none of them."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)
