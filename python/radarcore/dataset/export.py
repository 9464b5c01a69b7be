"""Exports of datasets: what all formats share."""

from __future__ import annotations

import json
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.dataset.layout import STATUS
from radarcore.dataset.samples import Samples
from radarcore.output import refuse_source

_OF_CODES = ("scale_factor", "add_offset", "_FillValue")
"""Attributes of variables that are stored as codes, of which the samples of a dataset are numbers."""


def opened_samples(dataset: Samples | str | PathLike[str]) -> Samples:
    """A dataset, or the one at a path."""
    if isinstance(dataset, str | PathLike):
        from radarcore.dataset.opened import open_dataset  # needs zarr, which exporting alone does not

        opened: Samples = open_dataset(dataset)
        return opened
    if not hasattr(dataset, "coordinates"):
        raise TypeError(f"dataset: expected Dataset or its path, got {type(dataset).__name__}")
    return dataset


def those_made(samples: Samples) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    """The samples that were made, with their indices: the labels of a shard are read at once."""
    for shard in range(samples.num_shards):
        yield from samples.of_shard(shard)


def all_of(samples: Samples) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    """The samples that were made, and then the others."""
    yield from those_made(samples)
    for index in np.setdiff1d(np.arange(len(samples)), made_of(samples)).tolist():
        yield index, samples[index]


def made_of(samples: Samples) -> NDArray[np.intp]:
    """Indices of the samples that were made, neither failed nor missing."""
    return np.flatnonzero(samples.values("status") == STATUS["made"])


def is_text(values: NDArray[Any]) -> bool:
    """True for texts, which have types of their own in other formats."""
    return values.dtype.kind in "OUST"


def attributes_of(samples: Samples, name: str) -> dict[str, Any]:
    """Attributes of a variable or coordinate that hold for its numbers."""
    return {key: value for key, value in samples.attributes(name).items() if key not in _OF_CODES}


def plain(value: Any) -> Any:
    """A number or text as it is, JSON of anything else."""
    return value if isinstance(value, str | int | float | bool) else json.dumps(value)


def refuse_dataset(samples: Samples, out: Path) -> None:
    """Refuse an export into its own dataset, or in place of a folder around it."""
    if (path := getattr(samples, "path", None)) is not None:
        refuse_source("out", out, Path(path))
