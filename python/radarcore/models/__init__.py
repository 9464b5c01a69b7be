"""Models of robot arms and people.

Only the names here are public; the modules load scipy when they are used.
"""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
