"""Layout of a dataset: variables with their axes, and samples over shards."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check

TEXT = "str"
"""Type of a variable of texts."""

_WIDE = 4096
"""Smallest size of a variable's row that is a chunk of its own [bytes]: smaller ones share the chunk of a shard."""

_SHARD_BYTES = 1 << 26
"""Size that a shard has at most, of more than one sample [bytes]."""

_SHARDS, _MAX_SAMPLES = 64, 1024
"""Shards that even a small dataset is cut into, as far as there are samples, and samples of a shard at most."""

STATUS = {"missing": 0, "made": 1, "failed": 2}
"""Values of the variable `status`."""


@dataclass(frozen=True)
class Variable:
    """A variable of a dataset.

    Parameters
    ----------
    dims : tuple of str
        Names of its axes after `sample`.
    shape : tuple of int
        Their lengths.
    dtype : str
        As NumPy names it, or ``"str"``.
    fill : number or str
        In place of what is not there: samples that failed or are still to be made.
    attrs : dict
        Unit and meaning, as JSON holds them.
    compressed : bool
        By Zstandard: whatever is not mostly noise.
    """

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: str
    fill: Any
    attrs: dict[str, Any] = field(default_factory=dict)
    compressed: bool = False

    @property
    def is_wide(self) -> bool:
        """True where every sample is a chunk of its own, in the file of its shard."""
        return self.dtype != TEXT and self.row_bytes >= _WIDE

    @property
    def row_bytes(self) -> int:
        """Size of a sample, before compression [bytes]."""
        return math.prod(self.shape) * (16 if self.dtype == TEXT else np.dtype(self.dtype).itemsize)

    def row(self, value: Any = None) -> NDArray[Any]:
        """A sample's values as an array of shape and type; None: the fill value throughout."""
        dtype = object if self.dtype == TEXT else np.dtype(self.dtype).newbyteorder("<")
        if value is None:
            return np.full(self.shape, self.fill, dtype)
        row = np.asarray(value, dtype, order="C")
        if row.shape != self.shape:
            raise ValueError(f"expected shape {self.shape} {list(self.dims)} as in the first sample, got {row.shape}")
        return row


@dataclass(frozen=True)
class Layout:
    """Variables of a dataset, and its samples in shards.

    Parameters
    ----------
    count : int
        Samples.
    samples_per_shard : int
        Consecutive samples of a shard; the last one may have fewer.
    variables : dict
        By their names.
    """

    count: int
    samples_per_shard: int
    variables: dict[str, Variable]

    @property
    def num_shards(self) -> int:
        """Number of shards."""
        return -(-self.count // self.samples_per_shard)

    def samples_of(self, shard: int) -> range:
        """Indices of the samples of a shard."""
        start = shard * self.samples_per_shard
        return range(start, min(self.count, start + self.samples_per_shard))

    def file_of(self, name: str, shard: int) -> str:
        """File of a variable and shard, relative to the dataset, as Zarr names its chunks."""
        return "/".join([name, "c", str(shard), *("0" for _ in self.variables[name].shape)])


def samples_per_shard(count: int, sample_bytes: int, given: int | None) -> int:
    """Samples of a shard: as given, or so that there are many shards and none is large.

    It does not depend on who works, as results do not.
    """
    if given is not None:
        return check.count("samples_per_shard", given)
    return max(1, min(_SHARD_BYTES // max(1, sample_bytes), -(-count // _SHARDS), _MAX_SAMPLES))
