"""Datasets as HDF5."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from radarcore import notice
from radarcore.dataset.export import all_of, attributes_of, is_text, opened_samples, plain, refuse_dataset
from radarcore.dataset.samples import Samples
from radarcore.output import new_file


def to_hdf5(
    dataset: Samples | str | PathLike[str],
    out: str | PathLike[str],
    *,
    overwrite: bool = False,
    progress: bool = True,
) -> None:
    """Write a dataset into one HDF5 file (extra `hdf5`: h5py).

    Every variable is a dataset of HDF5 with the axis `sample` in front, in chunks of one sample; axes have names, and
    coordinates are their scales. Attributes are those of the dataset; lists and tables in them are JSON. Samples that
    failed or are missing have their fill values. Only one sample is in memory at a time; the file gets its name when
    it is complete.

    Parameters
    ----------
    dataset : Dataset or path
    out : path
        File to be made.
    overwrite : bool
        Replace a file that is there.
    progress : bool
        Show a progress bar when run in a terminal.

    Raises
    ------
    FileExistsError
        For an existing file, unless `overwrite` is True and it is an HDF5 file.
    ImportError
        When h5py is missing.

    See Also
    --------
    dataset.to_webdataset : For training.
    dataset.open_dataset : Opens a dataset.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "position = [2.0, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", lines, fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1, progress=False)
    >>> rc.dataset.to_hdf5(dataset, "out.h5")
    >>> import h5py
    >>> with h5py.File("out.h5") as file:
    ...     print(file["cube"].shape, file["cube"].dims[2].label)
    (2, 2, 3, 64, 128) channel
    """
    h5py = _h5py()
    samples = opened_samples(dataset)
    refuse_dataset(samples, Path(out))
    with new_file(Path(out), overwrite=overwrite, kind=".h5") as part, h5py.File(part, "w", track_order=True) as file:
        for name, value in samples.attrs.items():
            file.attrs[name] = plain(value)
        coordinates = {name: _stored(h5py, file, samples, name) for name in samples.coordinates}
        for name in coordinates:
            if samples.axes(name) == (name,):
                file[name].make_scale(name)
        variables: dict[str, Any] = {}
        with notice.progress(None, "exporting", "sample", total=len(samples), shown=progress) as bar:
            for index, sample in all_of(samples):
                for name, values in sample.items():
                    if name not in variables:
                        variables[name] = _new_variable(h5py, file, samples, name, values)
                    variables[name][index] = str(values[()]) if is_text(values) else values
                bar.update()
        for name, variable in variables.items():
            for axis, label in enumerate(samples.axes(name)):
                variable.dims[axis].label = label
                if label in coordinates and samples.axes(label) == (label,) and label != name:
                    variable.dims[axis].attach_scale(file[label])


def _h5py() -> Any:
    try:
        import h5py
    except ImportError as error:
        raise ImportError("HDF5 files need h5py: pip install radarcore[hdf5]") from error
    return h5py


def _stored(h5py: Any, file: Any, samples: Samples, name: str) -> Any:
    """A coordinate in a file."""
    values = samples.values(name)
    data = values.astype(object) if is_text(values) else values
    made = file.create_dataset(name, data=data, dtype=_dtype(h5py, values))
    for key, value in attributes_of(samples, name).items():
        made.attrs[key] = plain(value)
    return made


def _new_variable(h5py: Any, file: Any, samples: Samples, name: str, values: NDArray[Any]) -> Any:
    """A variable without values, for the samples whose first one is given."""
    shape = (len(samples), *values.shape)
    made = file.create_dataset(name, shape, _dtype(h5py, values), chunks=(1, *values.shape) if values.size else None)
    for key, value in attributes_of(samples, name).items():
        made.attrs[key] = plain(value)
    return made


def _dtype(h5py: Any, values: NDArray[Any]) -> Any:
    return h5py.string_dtype() if is_text(values) else values.dtype
