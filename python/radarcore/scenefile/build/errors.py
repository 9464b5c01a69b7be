"""Places in the file in front of the messages of errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from radarcore import check


@contextmanager
def located(prefix: str) -> Iterator[None]:
    """Put a place in the file in front of the messages of errors."""
    try:
        yield
    except OSError as error:
        text = str(error) if error.filename is None else f"{error.strerror}: {error.filename}"
        raise type(error)(prefix + check.printable(text)) from error
    except (ValueError, TypeError, KeyError, ImportError) as error:
        text = str(error.args[0]) if isinstance(error, KeyError) else str(error)
        kind = ImportError if isinstance(error, ImportError) else ValueError
        raise kind(prefix + check.printable(" ".join(text.split()))) from error
