"""Data of other programs: pure functions of what they deliver, importing none of them."""

from radarcore.adapters import images

__all__ = ["images"]
