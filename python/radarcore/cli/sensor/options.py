"""Options that several commands of `radarcore sensor` have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import Parameter, Token


def factor_of_real_time(_: Any, tokens: Sequence[Token]) -> float | None:
    """Factor of real time, None for as fast as it goes."""
    text = tokens[0].value
    try:
        return None if text == "max" else float(text)
    except ValueError:
        raise ValueError(f"expected a number or max, got {text!r}") from None


Port = Annotated[
    str | None,
    Parameter(
        metavar="PORT",
        help="/dev/ttyACM0, COM3, usb:BUS-ADDRESS or usb:VENDOR:PRODUCT (default: the first board that responds)",
    ),
]

Speed = Annotated[float | None, Parameter(metavar="X", converter=factor_of_real_time, show_default=False)]
"""Factor of real time, or max."""
