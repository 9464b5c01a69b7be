"""Pictures of frames, recordings and scenes: one call each, into given axes or a new figure.

Figures are made without pyplot, so no window opens and no backend changes: save one with
``ax.figure.savefig(path)``, or show it in a notebook by its name (after ``%matplotlib inline``).
"""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
