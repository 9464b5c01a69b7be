"""Constants and conversions of units, and texts of quantities."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

SPEED_OF_LIGHT = 299_792_458.0
"""Speed of light in vacuum [m/s]."""

BOLTZMANN = 1.380649e-23
"""Boltzmann constant [J/K]."""

NOISE_TEMPERATURE = 290.0
"""Reference temperature of noise figures [K] (IEEE)."""


def power_from_db(level_db: float) -> float:
    """Power ratio of a level in dB."""
    return float(10.0 ** (level_db / 10.0))


def power_from_dbm(level_dbm: float) -> float:
    """Power [W] of a level in dBm."""
    return 1e-3 * power_from_db(level_dbm)


def decibels(power: ArrayLike) -> NDArray[np.float64]:
    """Level of a power ratio in dB; -inf of none."""
    with np.errstate(divide="ignore"):
        return np.asarray(10.0 * np.log10(power))


def db_from_amplitude(amplitude: ArrayLike, floor_db: float = -400.0) -> NDArray[np.float64]:
    """Level in dB of an amplitude (20 log10), never below `floor_db`: zeros do not become -inf."""
    magnitude = np.abs(np.asarray(amplitude))
    level: NDArray[np.float64] = 20.0 * np.log10(np.maximum(magnitude, 10.0 ** (floor_db / 20.0)))
    return level


_STEPS: dict[str, tuple[tuple[float, str], ...]] = {
    "Hz": ((1e9, "GHz"), (1e6, "MHz"), (1e3, "kHz"), (1.0, "Hz")),
    "Hz/s": ((1e12, "MHz/us"), (1e9, "kHz/us"), (1.0, "Hz/s")),
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")),
    "m": ((1.0, "m"), (1e-2, "cm"), (1e-3, "mm")),
    "m/s": ((1.0, "m/s"), (1e-2, "cm/s"), (1e-3, "mm/s")),
}
"""Units in which people write numbers of SI units, and their size, the largest first."""

UNITS = tuple(_STEPS)
"""SI units that `quantity` writes in others."""


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A number of an SI unit as people write it: ``6e10`` Hz are "60 GHz".

    Parameters
    ----------
    value : float
        In `unit`.
    unit : str
        SI unit; of others than Hz, Hz/s, s, m and m/s it is taken as it is.
    digits : int
        Largest number of digits.
    """
    steps = _STEPS.get(unit, ((1.0, unit),))
    nearly = 1.0 - 0.5 * 10.0**-digits  # values rounded to 1 are written as 1
    fitting = (step for step in steps if abs(value) >= nearly * step[0])
    size, name = next(fitting, steps[-1]) if value else (1.0, unit)
    return f"{value / size:.{digits}g} {name}".rstrip()


def frequency_of(text: str) -> float:
    """Frequency [Hz] of a text such as "1.5 GHz", "500MHz" or "2e9 Hz"; ValueError without its unit."""
    sizes = {name.lower(): size for size, name in _STEPS["Hz"]}
    given = text.strip().lower()
    name = next((name for name in sizes if given.endswith(name)), None)
    try:
        if name is None:
            raise ValueError
        return float(given.removesuffix(name)) * sizes[name]
    except ValueError:
        raise ValueError(f"expected a frequency with its unit, as 1.5GHz or 500MHz, got {text!r}") from None


Facts = Mapping[str, Any]
"""Values by name; the SI unit of a number stands behind the name, as in ``"bandwidth [Hz]"``."""


def line(name: str, value: Any) -> tuple[str, str]:
    """Name and text of a fact: ``("bandwidth [Hz]", 1.5e9)`` is "bandwidth" and "1.5 GHz"."""
    label, _, unit = name.removesuffix("]").rpartition(" [")
    if isinstance(value, int | float) and unit in (*UNITS, "dB"):
        return label, quantity(value, unit, 6)
    return name, _text(value)


def html_table(title: str, facts: Facts) -> str:
    """Table of facts for notebooks."""
    rows = (
        f'<tr><td style="text-align:left">{escape(label)}</td><td style="text-align:left">{escape(text)}</td></tr>'
        for label, text in (line(name, value) for name, value in facts.items())
    )
    return f"<table><caption>{escape(title)}</caption>{''.join(rows)}</table>"


def _text(value: Any) -> str:
    if value is None or value == []:
        return "none"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    return json.dumps(value) if isinstance(value, dict) else str(value)
