"""Help as text in two columns, for pipes and for terminals without colours."""

from __future__ import annotations

import io
import textwrap
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cyclopts.help import HelpEntry, HelpPanel
    from rich.console import Console, ConsoleOptions

_COLUMN, _GAP = 26, 2
"""Width of the names, and space between them and what they do."""


class PlainHelp:
    """Prints the parts of a help page."""

    def __call__(self, console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:  # noqa: ARG002  # of cyclopts' protocol
        """Print a group of commands or options."""
        if not panel.entries:
            return
        lines = [f"{panel.title}:"]
        if about := _plain(panel.description):
            lines += textwrap.wrap(about, console.width, initial_indent="  ", subsequent_indent="  ")
        for entry in panel.entries:
            labels = entry.display_labels_with_metavar if panel.format == "parameter" else entry.display_labels
            lines += _entry(", ".join(labels), _told(entry), console.width)
        _print(console, lines)

    def render_usage(self, console: Console, options: ConsoleOptions, usage: Any) -> None:  # noqa: ARG002  # of cyclopts' protocol
        """Print how the command is called."""
        _print(console, [f"Usage: {_plain(usage)}"])

    def render_description(self, console: Console, options: ConsoleOptions, description: Any) -> None:  # noqa: ARG002  # of cyclopts' protocol
        """Print what the command does."""
        text = _plain(description).splitlines()
        _print(console, [part for line in text for part in textwrap.wrap(line, console.width) or [""]])


def _print(console: Console, lines: list[str]) -> None:
    """Print lines as they are, and an empty one."""
    console.print("\n".join(lines), "", sep="\n", highlight=False, markup=False, soft_wrap=True)


def _entry(name: str, told: str, width: int) -> list[str]:
    """Lines of a name and of what it does beside it, or below if the name is long."""
    indent = " " * _COLUMN
    wrapped = textwrap.wrap(told, max(width, 2 * _COLUMN) - 1, initial_indent=indent, subsequent_indent=indent)
    head = f"  {name}"
    if wrapped and len(head) + _GAP <= _COLUMN:
        return [head.ljust(_COLUMN) + wrapped[0].lstrip(), *wrapped[1:]]
    return [head, *wrapped]


def _told(entry: HelpEntry) -> str:
    parts = [_plain(entry.description)]
    parts += [f"[choices: {', '.join(entry.choices)}]"] if entry.choices else []
    parts += [f"[default: {entry.default}]"] if entry.default is not None else []
    parts += ["[required]"] if entry.required else []
    return " ".join(part for part in parts if part)


def _plain(text: Any) -> str:
    """Text of what rich would print."""
    from rich.console import Console

    if text is None:
        return ""
    out = io.StringIO()
    Console(file=out, width=10_000, no_color=True, highlight=False, markup=False).print(text)
    return out.getvalue().strip()
