"""Levels in decibels that numbers can hold as powers."""

from __future__ import annotations

from radarcore import check

LARGEST_DB = 1000.0
"""Levels and gains are within this [dB]: the powers of a few of them together are still numbers."""


def non_positive_level(name: str, value: object, unit: str = "dB") -> float:
    """A level from -1000 to 0 dB, of a ratio up to 1."""
    result = level(name, value, unit)
    if result > 0.0:
        raise ValueError(f"{name}: expected at most 0 [{unit}], got {result:g}")
    return result


def level(name: str, value: object, unit: str = "dB") -> float:
    """A level from -1000 to 1000 dB, or a ValueError (TypeError for what is no number at all)."""
    result = check.number(name, value, unit)
    if abs(result) > LARGEST_DB:
        raise ValueError(f"{name}: expected {-LARGEST_DB:g} to {LARGEST_DB:g} [{unit}], got {result:g}")
    return result
