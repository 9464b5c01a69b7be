"""From samples to spectra, peaks and what they say over time."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)
