"""Journal of complete shards: ``progress.jsonl``, a line per shard, written when its files are in place."""

from __future__ import annotations

import os
from pathlib import Path

from radarcore.dataset.shards import Done

NAME = "progress.jsonl"


class Journal:
    """The lines of ``progress.jsonl`` of a dataset.

    Parameters
    ----------
    path : Path
        The dataset.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._file = path, path / NAME

    def lines(self) -> dict[int, Done]:
        """Shards that have a line, by number; the last line of one counts. A line that is not whole is none."""
        shards = {}
        for line in self._text().splitlines():
            try:
                done = Done.from_line(line)
            except (ValueError, TypeError, KeyError, AttributeError):
                continue
            shards[done.shard] = done
        return dict(sorted(shards.items()))

    def complete(self) -> dict[int, Done]:
        """Shards whose files are there as well, of the size that they had; their content is for `verify`."""
        return {number: done for number, done in self.lines().items() if not self.damaged(done)}

    def damaged(self, done: Done) -> str | None:
        """A file of a shard that is missing or of another size."""
        for name, (size, _) in done.files.items():
            try:
                if (self._path / name).stat().st_size != size:
                    return name
            except OSError:
                return name
        return None

    def append(self, done: Done) -> None:
        """Write the line of a shard; behind a line that was cut off, on a line of its own."""
        try:
            with self._file.open("ab+") as file:
                if file.seek(0, os.SEEK_END):
                    file.seek(-1, os.SEEK_END)
                    if file.read(1) != b"\n":
                        file.write(b"\n")
                file.write(done.line().encode())
        except OSError as error:
            raise OSError(error.errno, os.strerror(error.errno or 0), str(self._file)) from error

    def _text(self) -> str:
        try:
            return self._file.read_text(encoding="utf-8", errors="replace")
        except FileNotFoundError:
            return ""
