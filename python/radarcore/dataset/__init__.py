"""Datasets: many labelled frames of scenes that vary."""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)
