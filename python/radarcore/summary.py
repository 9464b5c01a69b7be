"""Summaries of objects: facts by name with unit, in the units in which people write them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from typing import Any

from radarcore.units import UNITS, quantity

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
