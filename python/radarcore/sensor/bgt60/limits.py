"""Limits of the chip, reported with the nearest possible value."""

from __future__ import annotations


class LimitError(ValueError):
    """Error for a value beyond the chip's limits; `argument` and `text` apart, as radars have other names for some."""

    def __init__(self, argument: str, text: str) -> None:
        super().__init__(argument, text)
        self.argument = argument
        self.text = text

    def __str__(self) -> str:
        return f"{self.argument}: {self.text}"


def within(name: str, value: int, low: int, high: int, unit: str = "") -> None:
    """Refuse a value outside of its limits."""
    if not low <= value <= high:
        raise LimitError(name, out_of_range(value, low, high, unit))


def out_of_range(value: float, low: float, high: float, unit: str = "") -> str:
    """Text about a value outside of its limits."""
    nearest = text_of(low if value < low else high, unit)
    return (
        f"expected {text_of(low, unit)} to {text_of(high, unit)}, got {text_of(value, unit)}; the nearest is {nearest}"
    )


_PREFIXES = {
    "Hz": ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, "")),
    "s": ((1.0, ""), (1e-3, "m"), (1e-6, "u")),
}


def text_of(value: float, unit: str) -> str:
    """A number with its unit; times of whole cycles and whole Hz are exact."""
    if unit not in _PREFIXES:
        return f"{value} {unit}".rstrip()
    prefixes = _PREFIXES[unit]
    scale, prefix = next((pair for pair in prefixes if abs(value) >= pair[0]), prefixes[-1])
    return f"{value / scale:.12g} {prefix}{unit}"
