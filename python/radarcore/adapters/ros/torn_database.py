"""SQLite files that are shorter than they should be, opened as far as they go.

SQLite refuses a file that has lost its end, or takes zeros for what is missing. Here missing pages are there by their
number, and an error when they are read: rows before them come out, rows that need them do not.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import quote

_NAME = "radarcore-torn"


def torn_database(path: Path, size: int) -> Any:
    """Connection to a database of `size` bytes, read-only; reading what is missing raises an `apsw.Error`."""
    import apsw

    class File(apsw.VFSFile):
        def __init__(self, _: str, name: Any, flags: list[int]) -> None:
            super().__init__("", name, flags)

        def xFileSize(self) -> int:  # noqa: N802  # SQLite's name
            return max(size, super().xFileSize())

        def xRead(self, amount: int, offset: int) -> bytes:  # noqa: N802  # SQLite's name
            data = super().xRead(amount, offset)
            if len(data) < amount or offset + amount > path.stat().st_size:
                raise apsw.IOError("the file ends before this page")
            return data

    class Files(apsw.VFS):
        def __init__(self) -> None:
            super().__init__(_NAME, "")

        def xOpen(self, name: Any, flags: list[int]) -> apsw.VFSFile:  # noqa: N802  # SQLite's name
            return File("", name, flags)

    files = Files()  # registers its name
    try:
        return apsw.Connection(
            f"file:{quote(str(path))}?immutable=1", flags=apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI, vfs=_NAME
        )
    finally:
        files.unregister()
