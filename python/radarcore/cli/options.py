"""Options that several commands have, and the values that they take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter, Token, validators

OPTIONS = Group("Options", sort_key=1)
"""Group of options of no other group."""


def whole_number(_: Any, tokens: Sequence[Token]) -> int:
    """Whole number of an option; a fraction is an error."""
    text = tokens[0].value
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"expected a whole number, got {text!r}") from None


Flag = Annotated[bool, Parameter(show_default=False)]
"""Option without a value."""

Number = Annotated[int, Parameter(metavar="N", converter=whole_number)]
Count = Annotated[int | None, Parameter(metavar="N", converter=whole_number)]
"""Whole number, or none."""

Seconds = Annotated[float | None, Parameter(metavar="S")]
Metres = Annotated[float | None, Parameter(metavar="M")]

Source = Annotated[Path, Parameter(metavar="SOURCE")]
"""Argument that is a file or folder."""

Output = Annotated[Path, Parameter(alias="-o")]
File = Annotated[Path | None, Parameter(metavar="FILE")]
OutputFile = Annotated[Path | None, Parameter(alias="-o", metavar="FILE")]
OutputFolder = Annotated[Path | None, Parameter(alias="-o", metavar="DIR")]

Overwrite = Annotated[bool, Parameter(show_default=False, help="replace an existing file")]

Json = Annotated[bool, Parameter(name="--json", show_default=False, help="print as JSON")]

Quiet = Annotated[
    bool,
    Parameter(name=("--quiet", "-q"), show_default=False, help="show no progress and no summary; warnings stay"),
]
"""`main` heeds it: commands name it ``_quiet``."""

SubtractMean = Annotated[
    bool | None,
    Parameter(
        negative="--keep-mean",
        allow_repeating=False,
        help="leave out what stands still throughout, or leave it in (default: out of recordings of sensors, with "
        "their leakage)",
    ),
]


@Parameter(name="*", group=OPTIONS)
@dataclass(frozen=True, kw_only=True)
class Detecting:
    """Settings of `detect`."""

    false_alarm_rate: Annotated[float | None, Parameter(metavar="P")] = None
    """detections per cell of noise (default: 1e-6; of `compare` 1e-4)"""

    min_range: Metres = None
    """nearest range of detections [m]"""

    max_range: Metres = None
    """farthest range of detections, and end of the range axis [m]"""

    @property
    def given(self) -> dict[str, Any]:
        """Settings that have a value."""
        return given(**vars(self))


AS_USUAL = Detecting()


def given(**options: Any) -> dict[str, Any]:
    """Options that have a value."""
    return {name: value for name, value in options.items() if value is not None}


def one_of_several() -> Group:
    """Group of mutually exclusive options."""
    return Group("", validator=_only_one)


def _only_one(arguments: Any) -> None:
    try:
        validators.mutually_exclusive(arguments)
    except ValueError:
        given = arguments.filter_by(value_set=True)
        raise ValueError(f"expected one of {' and '.join(one.name for one in given)}, got both") from None


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
