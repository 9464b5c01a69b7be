"""Processing of samples: spectra, peaks, and power over time."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
