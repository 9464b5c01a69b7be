"""Zarr groups of datasets: made before the first sample, so that all that comes later are files of chunks."""

from __future__ import annotations

import errno
import json
import warnings
from pathlib import Path
from typing import Any

from radarcore.dataset.files import keep
from radarcore.dataset.layout import TEXT, Layout, Variable
from radarcore.dataset.plan import FORMAT, VERSION, Plan
from radarcore.dataset.shardfile import LEVEL
from radarcore.output import PartFolder, already_exists, check_folder_name, is_empty

_ARRAYS, _ATTRIBUTES = ("cube", "status"), ("scene_path", "scene", "seed", "radar", "settings")
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


def create(path: Path, plan: Plan) -> None:
    """Make the group with all its variables, whole or not at all."""
    package = zarr()
    check_folder_name(path)
    with PartFolder(path) as part:
        if path.exists() and not (path.is_dir() and is_empty(path)):
            raise already_exists(path, "a dataset that another process has made meanwhile; resume=True goes on with it")
        partial = part.folder / path.name
        _write_group(package, partial, plan)
        part.put(partial)


def _write_group(package: Any, partial: Path, plan: Plan) -> None:
    group = package.create_group(partial, attributes=plan.attrs)
    layout = plan.layout
    for name, variable in layout.variables.items():
        _create_array(group, name, variable, layout)
    for name, coordinate in plan.coordinates.items():
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
        # That other libraries may not know it: they read each array's own, which is there as well.
        warnings.filterwarnings("ignore", message="Consolidated metadata")
        package.consolidate_metadata(partial)
    keep(Path(plan.attrs["scene_path"]), partial)


def _create_array(group: Any, name: str, variable: Variable, layout: Layout) -> None:
    from zarr.codecs import ZstdCodec

    rows = (layout.samples_per_shard, *variable.shape)
    group.create_array(
        name,
        shape=(layout.count, *variable.shape),
        chunks=(1, *variable.shape) if variable.is_wide else rows,
        shards=rows if variable.is_wide else None,
        dtype=str if variable.dtype == TEXT else variable.dtype,
        fill_value=variable.fill,
        compressors=ZstdCodec(level=LEVEL) if variable.compressed else None,
        dimension_names=("sample", *variable.dims),
        attributes=variable.attrs,
    )


def opened(path: Path) -> Any:
    """The Zarr group of a dataset; a ValueError for what is none."""
    package = zarr()
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, "expected a dataset, got no such path", str(path))
    attrs = attrs_of(path)
    if attrs is None:
        what = "a folder without one" if path.is_dir() else "a file, no folder"
        raise ValueError(f"{path}: expected a dataset, got {what}")
    if attrs["version"] > VERSION:
        raise ValueError(
            f"{path}: expected version {VERSION} (or older), got {attrs['version']!r}; a newer radarcore wrote it"
        )
    try:
        group = package.open_group(path, mode="r")
        arrays = dict(group.arrays())
    except Exception as error:  # zarr raises many kinds for damaged metadata
        text = " ".join(str(error).split())[:_LONGEST_REASON]
        raise ValueError(f"{path}: expected a dataset, got a damaged one ({text or type(error).__name__})") from error
    lacking = [name for name in _ARRAYS if name not in arrays] + [name for name in _ATTRIBUTES if name not in attrs]
    lacking += [f"axes of {name}" for name, array in arrays.items() if not array.metadata.dimension_names]
    if lacking:
        raise ValueError(f"{path}: expected a dataset, got a damaged one without {', '.join(lacking)}")
    return group


def attrs_of(path: Path) -> dict[str, Any] | None:
    """Attributes of the dataset at a path; None where there is none."""
    try:
        attrs = json.loads((path / "zarr.json").read_bytes())["attributes"]
        is_ours = attrs["format"] == FORMAT and isinstance(attrs["version"], int)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return dict(attrs) if is_ours else None
