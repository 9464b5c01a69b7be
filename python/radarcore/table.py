"""Tables as plain text and in colour, and values as JSON has them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from radarcore.check import printable

if TYPE_CHECKING:
    from rich.console import Group, RenderableType


@dataclass(frozen=True)
class Table:
    """A table; `str` gives the plain text.

    Parameters
    ----------
    header : sequence of str
        Names of the columns; may be empty.
    rows : sequence of sequences of str
    title, note : str
        Lines above and below the table.
    num_left : int
        Number of columns that are aligned to the left; the others are numbers, aligned to the right.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""
    note: str = ""
    num_left: int = 1

    width = 10_000
    """Number of characters in which every table fits without a line break."""

    def __str__(self) -> str:
        from rich.console import Console

        console = Console(width=self.width, color_system=None)
        with console.capture() as capture:
            console.print(self.styled())
        return "\n".join(line.rstrip() for line in capture.get().splitlines())

    def styled(self) -> Group:
        """The table as rich prints it, in colour where a console has any."""
        from rich.console import Group
        from rich.table import Table as Grid
        from rich.text import Text

        def text(content: str, style: str = "") -> Text:
            return Text("\n".join(map(printable, content.split("\n"))), style)

        grid = Grid(box=None, pad_edge=False, show_header=bool(self.header), header_style="cyan")
        for place in range(max(map(len, (self.header, *self.rows)))):
            side: Literal["left", "right"] = "left" if place < self.num_left else "right"
            name = self.header[place] if self.header else ""
            style = "" if self.header or place else "cyan"
            grid.add_column(text(name), justify=side, vertical="bottom", style=style, no_wrap=True)
        for row in self.rows:
            grid.add_row(*map(text, row))
        parts: list[RenderableType] = [text(self.title, "bold")] if self.title else []
        parts += [grid] if self.rows else []
        parts += [text(self.note, "dim")] if self.note else []
        return Group(*parts)


def finite(value: Any) -> Any:
    """Copy of a value for JSON, with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {name: finite(entry) for name, entry in value.items()}
    if isinstance(value, tuple | list):
        return [finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
