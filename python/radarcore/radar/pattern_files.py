"""CSV files of antenna patterns."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_COLUMNS = ("azimuth_deg", "elevation_deg", "gain_db")
"""Columns of a file of a table."""

_LONGEST_TEXT = 200
"""Characters of a file that a message shows."""


def read_table(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Azimuths and elevations [degrees], and gains [dB], (azimuth, elevation), of a file."""
    if path.exists() and not (path.is_file() or path.is_dir()):  # a device may never end
        raise ValueError("expected a file, got a device or a pipe")
    with path.open(newline="", encoding="utf-8-sig") as file:
        lines = csv.reader(file, skipinitialspace=True)
        names = [name.strip() for name in next(lines, [])]
        if sorted(names) != sorted(_COLUMNS):
            got = ", ".join(name if name.isprintable() else repr(name) for name in names)
            got = got if len(got) <= _LONGEST_TEXT else f"{got[:_LONGEST_TEXT]}..."
            raise ValueError(f"expected the columns {', '.join(_COLUMNS)}, got {got or 'none'}")
        rows = [_row(entries, names, lines.line_num) for entries in lines if any(map(str.strip, entries))]
    if not rows:
        raise ValueError("expected lines of numbers, got none")
    azimuth, elevation, gain = np.array(rows).T
    azimuths, i = np.unique(azimuth, return_inverse=True)
    elevations, j = np.unique(elevation, return_inverse=True)
    count = np.zeros((len(azimuths), len(elevations)), dtype=np.int64)
    np.add.at(count, (i, j), 1)
    if (count != 1).any():
        first = np.argwhere(count != 1)[0]
        pair = f"azimuth {azimuths[first[0]]:g} and elevation {elevations[first[1]]:g} degrees"
        raise ValueError(f"expected one line for every azimuth and elevation, got {count[tuple(first)]} for {pair}")
    gains = np.zeros(count.shape)
    gains[i, j] = gain
    return azimuths, elevations, gains


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
