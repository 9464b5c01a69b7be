"""Files of a shard, as Zarr defines them: written sample by sample, without a store that others would have to share.

A variable with large rows has a chunk per sample, in one file: chunk by chunk, then an index of (offset, size) of each
as little-endian 64-bit integers and its CRC-32C (Zarr v3, codec ``sharding_indexed``, index at the end). Any other
variable has a chunk per shard. What is written is moved to its place when it is whole.
"""

from __future__ import annotations

import hashlib
import re
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from radarcore.dataset.layout import TEXT, Layout, Variable

PARTIAL = ".partial"
"""Folder of a dataset with files that are being written."""

LEVEL = 1
"""Level of Zstandard: higher ones take longer, and make codes of an ADC hardly smaller."""

_NO_CHUNK = 2**64 - 1
"""Offset and size of a chunk that is not there."""

_PARTIAL_NAME = re.compile(r"\d+-[0-9a-f]{32}-\d+")
"""Names of the files in it."""


def clear_partial(path: Path) -> None:
    """Delete files of shards that were not finished."""
    with suppress(OSError):
        for file in (path / PARTIAL).iterdir():
            if _PARTIAL_NAME.fullmatch(file.name):
                file.unlink(missing_ok=True)
        (path / PARTIAL).rmdir()


class ShardFiles:
    """Files of the variables of one shard, written sample by sample.

    Use it in a ``with`` block: what was not finished is removed at its end.

    Parameters
    ----------
    path : Path
        The dataset.
    layout : Layout
    shard : int
        Its number.
    """

    def __init__(self, path: Path, layout: Layout, shard: int) -> None:
        self._path, self._layout, self._shard = path, layout, shard
        # Two workers may have the same shard where one was thought lost.
        self._prefix = path / PARTIAL / f"{shard}-{uuid.uuid4().hex}"
        self._wide = {
            name: _WideFile(
                self._partial(number), path / layout.file_of(name, shard), variable, layout.samples_per_shard
            )
            for number, (name, variable) in enumerate(layout.variables.items())
            if variable.is_wide
        }
        self._rows: dict[str, list[NDArray[Any]]] = {name: [] for name in layout.variables if name not in self._wide}

    def append(self, rows: Mapping[str, NDArray[Any]]) -> None:
        """Write the next sample: a row of every variable, as `Variable.row` makes it."""
        for name, file in self._wide.items():
            file.append(rows[name])
        for name, before in self._rows.items():
            before.append(rows[name])

    def finish(self) -> dict[str, tuple[int, str]]:
        """Move the files to their places; size [bytes] and SHA-256 of each, by its path relative to the dataset."""
        files = {}
        for number, (name, variable) in enumerate(self._layout.variables.items()):
            partial, final = self._partial(number), self._layout.file_of(name, self._shard)
            if name in self._wide:
                files[final] = self._wide[name].finish()
            else:
                data = _encoded(_filled_up(self._rows[name], variable, self._layout.samples_per_shard), variable)
                with _naming(self._path / final):
                    partial.write_bytes(data)
                files[final] = (len(data), hashlib.sha256(data).hexdigest())
            place = self._path / final
            with _naming(place):
                place.parent.mkdir(parents=True, exist_ok=True)
                partial.replace(place)
        return files

    def __enter__(self) -> ShardFiles:
        with _naming(self._prefix.parent):
            self._prefix.parent.mkdir(exist_ok=True)
        for file in self._wide.values():
            file.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for file in self._wide.values():
            file.close()
        for number in range(len(self._layout.variables)):
            self._partial(number).unlink(missing_ok=True)

    def _partial(self, number: int) -> Path:
        return self._prefix.with_name(f"{self._prefix.name}-{number}")


class _WideFile:
    """File with a chunk per sample and an index at its end, written at a path and meant for a place."""

    def __init__(self, path: Path, place: Path, variable: Variable, num_chunks: int) -> None:
        self._path, self._place, self._variable = path, place, variable
        self._index = np.full((num_chunks, 2), _NO_CHUNK, "<u8")
        self._num_written = self._size = 0
        self._sum = hashlib.sha256()
        self._file: BinaryIO | None = None

    def open(self) -> None:
        # Chunks are as large as a page and more: a buffer would copy them once more.
        with _naming(self._place):
            self._file = self._path.open("wb", buffering=0)

    def append(self, row: NDArray[Any]) -> None:
        data = _encoded(row, self._variable)
        self._index[self._num_written] = self._size, len(data)
        self._num_written += 1
        self._write(data)

    def finish(self) -> tuple[int, str]:
        from google_crc32c import value as crc32c

        index = self._index.tobytes()
        self._write(index + crc32c(index).to_bytes(4, "little"))
        self.close()
        return self._size, self._sum.hexdigest()

    def close(self) -> None:
        if self._file is not None:
            with suppress(OSError):  # of a full disk, which the write has told of
                self._file.close()
            self._file = None

    def _write(self, data: bytes | memoryview) -> None:
        assert self._file is not None
        self._sum.update(data)
        self._size += len(data)
        view = memoryview(data)
        with _naming(self._place):
            while view:  # a disk that runs full takes a part
                view = view[self._file.write(view) :]


@contextmanager
def _naming(place: Path) -> Iterator[None]:
    """Let errors of the system name the file that cannot be written by its place in the dataset."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(place)) from error


def _encoded(values: NDArray[Any], variable: Variable) -> bytes | memoryview:
    """Bytes of a chunk as the codecs of its variable make them; those of the array itself where there is no codec."""
    from numcodecs import VLenUTF8, Zstd

    data = bytes(VLenUTF8().encode(values)) if variable.dtype == TEXT else values.reshape(-1).view("u1").data
    return bytes(Zstd(LEVEL).encode(data)) if variable.compressed else data


def _filled_up(rows: list[NDArray[Any]], variable: Variable, num_rows: int) -> NDArray[Any]:
    """The rows of a shard, those beyond the last sample with the fill value: chunks are all of one size."""
    return np.stack(rows + [variable.row()] * (num_rows - len(rows)))
