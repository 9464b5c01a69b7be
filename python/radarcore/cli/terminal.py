"""Output of commands: in colour on a terminal, plain text elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TextIO

from radarcore.check import printable

if TYPE_CHECKING:
    from rich.console import RenderableType

_STYLES = {"PASS": "bold green", "FAIL": "bold red", "SKIP": "yellow", "error": "bold red", "warning": "yellow"}
_LABEL, _TITLE, _NOTE = "cyan", "bold", "dim"

_WIDEST = 10_000
"""Columns of characters that no table has."""


@dataclass(frozen=True)
class Table:
    """A table; `str` of it is the plain text.

    Parameters
    ----------
    header : sequence of str
        Names of the columns; of numbers but for the first.
    rows : sequence of sequences of str
    lines : sequence of str
        All of it as plain text.
    title, note : str
        Above and below it, in colour.
    num_left : int
        Columns of text, at the left of their column; the first ones.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    lines: Sequence[str]
    title: str = ""
    note: str = ""
    num_left: int = 1

    def __str__(self) -> str:
        return "\n".join(self.lines)


def is_coloured(stream: TextIO | None = None) -> bool:
    """True when a stream, by default the output, is a terminal with colours that the user wants."""
    chosen = sys.stdout if stream is None else stream
    kind = os.environ.get("TERM", "" if os.name == "posix" else "windows")
    return chosen.isatty() and not os.environ.get("NO_COLOR") and kind not in ("", "dumb")


def show(content: object) -> None:
    """Print a table, or the text of anything else."""
    if isinstance(content, Table) and is_coloured():
        _print(*_parts(content))
    else:
        print(_printable(str(content)))


def show_facts(facts: Iterable[tuple[str, str]], width: int) -> None:
    """Print names, padded to a width, and values, one a line; a name that is indented is an entry of the one above."""
    facts = [(_printable(label), _printable(text)) for label, text in facts]
    if not is_coloured():
        for label, text in facts:
            print(f"{label}  {text}" if label.startswith(" ") else f"{label:<{width}}  {text}")
        return
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid.grid(padding=(0, 2))
    grid.add_column(style=_LABEL, no_wrap=True)
    grid.add_column(overflow="fold")
    for label, text in facts:
        grid.add_row(Text(label), Text(text))
    _print(grid)


def show_result(result: str, text: str) -> None:
    """Print the line of a check that passed, failed or was skipped, at once."""
    text = _printable(text)
    if is_coloured():
        from rich.text import Text

        _print(Text.assemble((result, _STYLES[result]), f"  {text}"))
    else:
        print(f"{result}  {text}")
    sys.stdout.flush()


def complain(text: str, kind: str = "error") -> None:
    """Print a line of an error or a warning, to the stream of errors."""
    prefix, text = "radarcore: warning:" if kind == "warning" else "radarcore:", _printable(text)
    if not is_coloured(sys.stderr):
        print(f"{prefix} {text}", file=sys.stderr)
        return
    from rich.console import Console
    from rich.text import Text

    Console(stderr=True).print(Text.assemble((prefix, _STYLES[kind]), f" {text}"), soft_wrap=True)


def _parts(table: Table) -> Iterable[RenderableType]:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table as Grid
    from rich.text import Text

    if table.title:
        yield Text(_printable(table.title), style=_TITLE)
    if table.rows:
        grid = Grid(box=SIMPLE_HEAD, header_style=_LABEL, pad_edge=False, show_edge=False)
        for place, name in enumerate(table.header):
            side: Literal["left", "right"] = "left" if place < table.num_left else "right"
            grid.add_column(Text(_printable(name)), justify=side, vertical="bottom", no_wrap=True)
        for row in table.rows:
            grid.add_row(*(Text(_printable(cell)) for cell in row))
        yield grid
    if table.note:
        yield Text(_printable(table.note), style=_NOTE)


def _printable(text: str) -> str:
    """Text with escaped control characters: names of files, bodies, topics and boards may contain any."""
    return "\n".join(map(printable, text.split("\n")))


def _print(*parts: RenderableType) -> None:
    """Print, tables wider than the terminal rather than with cut numbers."""
    from rich.console import Console
    from rich.measure import Measurement
    from rich.table import Table as Grid

    console = Console(highlight=False)
    for part in parts:
        if isinstance(part, Grid) and part.box is not None:
            whole = Measurement.get(console, console.options.update(max_width=_WIDEST), part).maximum
            Console(highlight=False, width=max(whole, console.width)).print(part)
        else:
            console.print(part, soft_wrap=not isinstance(part, Grid))
