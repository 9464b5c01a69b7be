"""Output of commands: in colour on a terminal, plain text elsewhere."""

from __future__ import annotations

import os
import sys
from typing import TextIO

from radarcore import notice
from radarcore.check import printable
from radarcore.table import Table

_STYLES = {"PASS": "bold green", "FAIL": "bold red", "SKIP": "yellow", "error": "bold red", "warning": "yellow"}


def is_coloured(stream: TextIO | None = None) -> bool:
    """True when a stream, by default the output, is a terminal with colours that the user wants."""
    chosen = sys.stdout if stream is None else stream
    kind = os.environ.get("TERM", "" if os.name == "posix" else "windows")
    return chosen.isatty() and not os.environ.get("NO_COLOR") and kind not in ("", "dumb")


def show(content: object) -> None:
    """Print a table, in colour on a terminal and never cut, or the text of anything else; nothing if it is quiet."""
    if notice.quiet.get():
        return
    if isinstance(content, Table) and is_coloured():
        from rich.console import Console

        Console(width=content.width, highlight=False).print(content.styled())
    else:
        print(_printable(str(content)), flush=True)


def show_result(result: str, text: str) -> None:
    """Print the line of a check that passed, failed or was skipped; only failures if it is quiet."""
    if notice.quiet.get() and result != "FAIL":
        return
    _show_styled(f"{result}  ", _STYLES[result], text, sys.stdout)


def complain(text: str, kind: str = "error") -> None:
    """Print a line of an error or a warning, to the stream of errors."""
    prefix = "radarcore: warning: " if kind == "warning" else "radarcore: "
    _show_styled(prefix, _STYLES[kind], text, sys.stderr)


def _show_styled(prefix: str, style: str, text: str, stream: TextIO) -> None:
    """Print a line whose first words have a colour on a terminal."""
    if not is_coloured(stream):
        print(f"{prefix}{_printable(text)}", file=stream, flush=True)
        return
    from rich.console import Console
    from rich.text import Text

    Console(file=stream).print(Text.assemble((prefix, style), _printable(text)), soft_wrap=True)


def _printable(text: str) -> str:
    """Text with escaped control characters: names of files, bodies, topics and boards may contain any."""
    return "\n".join(map(printable, text.split("\n")))
