"""Datasets as the tar files of WebDataset."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Iterator
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.dataset.export import attributes_of, made_of, opened_samples, refuse_dataset, those_made
from radarcore.dataset.samples import Samples
from radarcore.output import PartFolder, already_exists, check_folder_name, is_empty

_FORMAT = "radarcore webdataset"
"""Mark of the folders that are made here."""

_DESCRIPTION = "dataset.json"


def to_webdataset(
    dataset: Samples | str | PathLike[str],
    out: str | PathLike[str],
    *,
    samples_per_tar: int = 100,
    overwrite: bool = False,
    progress: bool = True,
) -> list[Path]:
    """Write a dataset as tar files that the package webdataset streams into training.

    Of every sample there is one member per array, ``00000007.cube.npy``, and one for all that is a single number or
    text, ``00000007.json``. Beside the files ``000000.tar``, ``000001.tar``, ... is ``dataset.json``: the names of the
    files, attributes, coordinates, and axes and units of all variables. Samples that failed or are missing are left
    out. The same dataset gives the same bytes. The folder gets its name when it is complete.

    Parameters
    ----------
    dataset : Dataset or path
        As of `to_hdf5`.
    out : path
        Folder to be made.
    samples_per_tar : int
        Samples of every file but the last.
    overwrite : bool
        Replace the files that the ``dataset.json`` of an older export lists.
    progress : bool
        As of `to_hdf5`.

    Returns
    -------
    paths : list of Path
        The tar files.

    See Also
    --------
    dataset.to_hdf5 : One file.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "position = [2.0, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", lines, fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=3, seed=1, workers=1, progress=False)
    >>> [path.name for path in rc.dataset.to_webdataset(dataset, "tars", samples_per_tar=2)]
    ['000000.tar', '000001.tar']
    """
    size = check.count("samples_per_tar", samples_per_tar)
    samples, folder = opened_samples(dataset), Path(out)
    refuse_dataset(samples, folder)
    check_folder_name(folder)
    replaced = _replaced(folder, overwrite)
    with PartFolder(folder) as part:
        target = part.folder / folder.name
        target.mkdir()
        made, num_made = those_made(samples), len(made_of(samples))
        names = [f"{number:06d}.tar" for number in range(-(-num_made // size))]
        described = {"format": _FORMAT, "files": names, **_described(samples)}
        (target / _DESCRIPTION).write_text(json.dumps(described, indent=1), encoding="utf-8")
        with notice.progress(None, "exporting", "sample", total=num_made, shown=progress) as bar:
            for name in names:
                with tarfile.open(target / name, "w", format=tarfile.USTAR_FORMAT) as tar:
                    for index, sample in islice(made, size):
                        for ending, content in _members(sample):
                            member = tarfile.TarInfo(f"{index:08d}.{ending}")
                            member.size = len(content)
                            tar.addfile(member, io.BytesIO(content))
                        bar.update()
        part.put(target, replaced)
    return [folder / name for name in names]


def _replaced(folder: Path, overwrite: bool) -> list[Path]:
    """Files of an older export that this one replaces; an error for anything else at this path."""
    if not folder.exists() or (folder.is_dir() and is_empty(folder)):
        return []
    try:
        described = json.loads((folder / _DESCRIPTION).read_bytes())
        names = [_DESCRIPTION, *described["files"]] if described["format"] == _FORMAT else []
    except (OSError, ValueError, TypeError, KeyError):
        names = []
    if not names:
        what = "a folder that is no such export" if folder.is_dir() else "a file"
        raise already_exists(folder, what)
    if not overwrite:
        raise already_exists(folder, "an export; overwrite=True replaces it")
    return [folder / Path(name).name for name in names]


def _described(samples: Samples) -> dict[str, Any]:
    """Attributes, coordinates and variables of a dataset, as JSON holds them."""
    return {
        "attrs": dict(samples.attrs),
        "coordinates": {
            name: {
                "dims": samples.axes(name),
                "values": samples.values(name).tolist(),
                "attrs": attributes_of(samples, name),
            }
            for name in samples.coordinates
        },
        "variables": {
            name: {"dims": samples.axes(name)[1:], "attrs": attributes_of(samples, name)} for name in samples.names
        },
    }


def _members(arrays: dict[str, NDArray[Any]]) -> Iterator[tuple[str, bytes]]:
    """Endings and contents of the members of a sample; what is a single value goes into one of JSON."""
    single = {}
    for name, values in arrays.items():
        if values.ndim == 0:
            single[name] = values.item()
            continue
        content = io.BytesIO()
        np.save(content, np.ascontiguousarray(values), allow_pickle=False)
        yield f"{name}.npy", content.getvalue()
    # Not a number is no JSON: what was not drawn is null.
    single = {name: None if isinstance(value, float) and np.isnan(value) else value for name, value in single.items()}
    yield "json", json.dumps(single).encode()
