"""Messages about words that are no command: expected, given, and near ones."""

from __future__ import annotations

from cyclopts import App, CycloptsError
from cyclopts.exceptions import (
    CoercionError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
    ValidationError,
)

from radarcore import check

_KINDS = {int: "a whole number", float: "a number"}


def lines(error: CycloptsError, app: App) -> list[str]:
    """The error on a line, and where help is on another."""
    words = list(error.command_chain or ())
    command = " ".join(["radarcore", *words])
    return [": ".join((*([" ".join(words)] if words else []), _text(error, app, words))), f"see `{command} --help`"]


def _text(error: CycloptsError, app: App, words: list[str]) -> str:
    match error:
        case UnknownCommandError():
            owner = app
            for word in words:
                owner = owner[word]
            got = (error.unused_tokens or [""])[0]
            known = list(owner)
            near = check.near(got, known) or [name for name in known if not name.startswith("-")]
            return f"expected a command, got {got!r}; {check.near_names(got, near)}"
        case UnknownOptionError():
            got = error.token.keyword or error.token.value
            known = [name for argument in error.argument_collection for name in argument.names if name.startswith("--")]
            meant = check.near(got, known)[:1]
            return f"unknown option {got}" + "".join(f"; did you mean {name}?" for name in meant)
        case CoercionError():
            return _unfit(error)
        case MissingArgumentError():
            return _missing(error)
        case UnusedCliTokensError():
            return f"expected no more arguments, got {' '.join(error.unused_tokens or ())!r}"
        case RepeatArgumentError():
            return f"{error.token.keyword}: expected once, and not beside its opposite"
        case ValidationError(exception_message=message) if message:
            return message
    return " ".join(str(error).split())


def _unfit(error: CoercionError) -> str:
    """Of a value that is none of the choices, or no number."""
    argument, token = error.argument, error.token
    name = (token.keyword if token is not None else None) or (argument.name if argument is not None else "")
    if token is None or argument is None:
        return " ".join(str(error).split())
    if choices := argument.get_choices():
        meant = check.near(token.value, choices)
        hint = f"; did you mean {' or '.join(map(repr, meant))}?" if meant else ""
        return f"{name}: expected {', '.join(choices)}, got {token.value!r}{hint}"
    if error.msg is not None:
        return f"{name}: {error.msg}"
    expected = next((text for kind, text in _KINDS.items() if error.target_type is kind), "another value")
    return f"{name}: expected {expected}, got {token.value!r}"


def _missing(error: MissingArgumentError) -> str:
    """Of an argument that was not given, or an option without its value."""
    argument = error.argument
    assert argument is not None
    if error.keyword is not None:
        count, _ = argument.token_count()
        values = "a value" if count == 1 else f"{count} values"
        got = len(error.tokens_so_far)
        return f"{error.keyword}: expected {values}, got {got or 'none'}"
    return f"expected {argument.name}, got none"
