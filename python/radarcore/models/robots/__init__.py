"""Robot arms by name (extra `robots`)."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
