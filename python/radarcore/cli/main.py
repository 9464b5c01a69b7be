"""The command `radarcore`."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence

from cyclopts import CycloptsError

from radarcore.cli.commands import application, lacks_command, parse
from radarcore.cli.ending import exit_status, interrupted_by_signals
from radarcore.cli.terminal import complain

_WRITERS = (["demo"], ["simulate"], ["process"], ["view"], ["sensor", "record"], ["dataset", "make"])
"""Commands whose results are written as they come."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Returns
    -------
    status : int
        Exit status: 0, 1 for bad input, 2 for words that are no command, 130 when interrupted, 143 when told to end.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with interrupted_by_signals(), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            status = _run(words)
            sys.stdout.flush()
            return status
    except KeyboardInterrupt as interrupt:
        hint = "; what was written so far is readable" if any(words[: len(w)] == w for w in _WRITERS) else ""
        complain(f"{str(interrupt) or 'interrupted'}{hint}")
        return exit_status(interrupt)
    except BrokenPipeError:  # whoever reads our output has had enough: `radarcore schema | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ValueError, TypeError, OSError, ImportError, MemoryError) as error:
        for line in _lines(error):
            complain(line)
        return 1


def _run(words: list[str]) -> int:
    app = application()
    if lacks_command(words):
        app.help_print(words, console=app.error_console)
        complain("expected a command")
        return 2
    try:
        function, bound = parse(app, words)
    except CycloptsError as error:
        from radarcore.cli import usage  # takes longer to load than the rest

        for line in usage.lines(error, app):
            complain(line)
        return 2
    return int(function(*bound.args, **bound.kwargs) or 0)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    complain(str(message), "warning")


def _lines(error: BaseException) -> list[str]:
    """The message of an error, a line per fault; for the system's, file and reason without the number."""
    text = str(error)
    if isinstance(error, OSError):
        if error.filename is not None:
            text = f"{error.filename}: {error.strerror}"
        # Python's keyword is an option here.
        text = text.replace("overwrite=True", "--overwrite").replace("resume=True", "--resume")
    return text.splitlines() or [type(error).__name__]
