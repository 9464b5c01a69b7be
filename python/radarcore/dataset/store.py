"""Zarr groups of datasets: created once, then written shard by shard.

A shard is some consecutive samples, with one file per variable. Its `status` is written last: a shard that has all of
its files is complete. Every file is written beside its place and renamed, so none is ever half there.
"""

from __future__ import annotations

import errno
import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.dataset.files import keep
from radarcore.dataset.variables import FORMAT, TEXT, VERSION, Coordinate, Layout, Variable
from radarcore.output import PartFolder, already_exists, check_folder_name, is_empty, naming

Rows = dict[str, NDArray[Any]]
"""A row of every variable: one sample."""

_LEVEL = 1
"""Level of Zstandard: higher ones take longer, and compress ADC codes hardly better."""

_PARTIAL = re.compile(r".*\.[0-9a-f]{32}\.partial")
"""Names of the files that Zarr is writing."""

_ARRAYS, _ATTRIBUTES = ("cube", "status", "error"), ("scene_path", "scene", "seed", "radar", "settings")
"""Arrays and attributes of every dataset."""

_LONGEST_REASON = 200
"""Characters of another library's message."""


def zarr() -> Any:
    """The package, or an ImportError that names the extra."""
    try:
        import zarr as package
    except ImportError as error:
        raise ImportError("datasets need zarr and xarray: pip install radarcore[zarr]") from error
    return package


def create(path: Path, layout: Layout, coordinates: dict[str, Coordinate], attrs: dict[str, Any]) -> None:
    """Make the group with all its variables, whole or not at all."""
    check_folder_name(path)
    with PartFolder(path) as part:
        if path.exists() and not (path.is_dir() and is_empty(path)):
            raise already_exists(path, "a dataset that another process has made meanwhile; resume=True goes on with it")
        partial = part.folder / path.name
        group = zarr().create_group(partial, attributes=attrs)
        for name, variable in layout.variables.items():
            _create_variable(group, name, variable, layout)
        for name, coordinate in coordinates.items():
            array = group.create_array(
                name,
                shape=coordinate.values.shape,
                dtype=str if coordinate.values.dtype.kind == "T" else coordinate.values.dtype,
                dimension_names=coordinate.dims,
                attributes=coordinate.attrs,
                compressors=None,
            )
            array[...] = coordinate.values
        with warnings.catch_warnings():
            # Zarr warns that other libraries may not know consolidated metadata; they read the metadata of each array.
            warnings.filterwarnings("ignore", message="Consolidated metadata")
            zarr().consolidate_metadata(partial)
        keep(Path(attrs["scene_path"]), partial)
        part.put(partial)


def _create_variable(group: Any, name: str, variable: Variable, layout: Layout) -> None:
    from zarr.codecs import Crc32cCodec, ZstdCodec

    rows = (layout.samples_per_shard, *variable.shape)
    group.create_array(
        name,
        shape=(layout.count, *variable.shape),
        chunks=(1, *variable.shape) if variable.is_large else rows,
        shards=rows if variable.is_large else None,
        dtype=str if variable.dtype == TEXT else variable.dtype,
        fill_value=variable.fill,
        compressors=[ZstdCodec(level=_LEVEL), Crc32cCodec()] if variable.compressed else [Crc32cCodec()],
        dimension_names=("sample", *variable.dims),
        attributes=variable.attrs,
    )


def write_shard(path: Path, layout: Layout, shard: int, rows: list[Rows]) -> None:
    """Write the samples of a shard, `status` last; an OSError names the file that cannot be written."""
    group, samples = zarr().open_group(path, mode="r+"), layout.samples_of(shard)
    for name, file in layout.files_of(shard).items():
        # A shard of fill values has a file as well: that tells it from one that is missing.
        array = group[name].with_config({"write_empty_chunks": True})
        with naming(path / file):
            array[samples.start : samples.stop] = np.stack([row[name] for row in rows])


def missing_file(path: Path, layout: Layout, shard: int) -> Path | None:
    """The first file of a shard that is not there; None if the shard is complete."""
    files = [path / file for file in layout.files_of(shard).values()]
    return next((file for file in files if not file.is_file()), None)


def clear_partial(path: Path, layout: Layout) -> None:
    """Delete the unfinished files of writers that were killed."""
    for name in layout.variables:
        for file in (path / name / "c").rglob("*.partial"):
            if _PARTIAL.fullmatch(file.name):
                file.unlink(missing_ok=True)


def opened(path: Path) -> Any:
    """The Zarr group of a dataset; a ValueError if it is none."""
    package = zarr()
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, "expected a dataset, got no such path", str(path))
    attrs = attrs_of(path)
    if attrs is None:
        what = "a folder without one" if path.is_dir() else "a file, no folder"
        raise ValueError(f"{path}: expected a dataset, got {what}")
    if attrs["version"] != VERSION:
        raise ValueError(f"{path}: expected version {VERSION} of datasets, got {attrs['version']!r}")
    try:
        group = package.open_group(path, mode="r")
        arrays = dict(group.arrays())
    except Exception as error:  # zarr raises many kinds for damaged metadata
        text = " ".join(str(error).split())[:_LONGEST_REASON]
        raise ValueError(f"{path}: expected a dataset, got a damaged one ({text or type(error).__name__})") from error
    missing = [name for name in _ARRAYS if name not in arrays] + [name for name in _ATTRIBUTES if name not in attrs]
    missing += [f"axes of {name}" for name, array in arrays.items() if not array.metadata.dimension_names]
    if missing:
        raise ValueError(f"{path}: expected a dataset, got a damaged one without {', '.join(missing)}")
    return group


def attrs_of(path: Path) -> dict[str, Any] | None:
    """Attributes of the dataset at a path; None if there is none."""
    try:
        attrs = json.loads((path / "zarr.json").read_bytes())["attributes"]
        is_ours = attrs["format"] == FORMAT and isinstance(attrs["version"], int)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return dict(attrs) if is_ours else None
