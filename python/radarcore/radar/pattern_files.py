"""CSV files of antenna patterns."""

from __future__ import annotations

import numpy as np

_COLUMNS = ("azimuth_deg", "elevation_deg", "gain_db")
"""Columns of a file of a table."""


def _row(entries: list[str], names: list[str], line: int) -> list[float]:
    """The numbers of a line in the order of the columns."""
    if len(entries) != len(names):
        raise ValueError(f"line {line}: expected {len(names)} numbers, got {len(entries)}")
    row = []
    for column in _COLUMNS:
        text = entries[names.index(column)].strip()
        try:
            row.append(float(text))
        except ValueError:
            raise ValueError(f"line {line}: {column}: expected a number, got {text!r}") from None
        if not np.isfinite(row[-1]):
            raise ValueError(f"line {line}: {column}: expected a finite number, got {text}")
    return row
