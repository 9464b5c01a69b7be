"""Datasets in other formats: HDF5, the tar files of WebDataset, and a sample as a ROS bag."""

from __future__ import annotations

import errno
import io
import json
import shutil
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.raw_frames import FrameWriter
from radarcore.dataset.layout import STATUS
from radarcore.radar.radar import Radar
from radarcore.recording.codes import adc_codes
from radarcore.recording.frame import TRUTH_FIELDS, Frame, Truth

_OF_CODES = ("scale_factor", "add_offset", "_FillValue")
"""Attributes of variables that are stored as codes, of which the samples of a dataset are numbers."""


class Samples(Protocol):
    """Source of an export: a `Dataset`, or an object with these parts of one."""

    attrs: dict[str, Any]
    """Variation that the dataset was made from."""
    names: tuple[str, ...]
    """Variables."""

    def __len__(self) -> int:
        """Number of samples."""
        ...

    def __getitem__(self, index: int) -> dict[str, NDArray[Any]]:
        """Variables of a sample, without the axis `sample`."""
        ...

    @property
    def num_shards(self) -> int:
        """Parts that are read together."""
        ...

    def of_shard(self, shard: int) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
        """The samples of a part that were made, with their indices."""
        ...

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        ...

    @property
    def radar(self) -> Radar:
        """Radar of the samples."""
        ...

    def values(self, name: str) -> NDArray[Any]:
        """A variable or coordinate as a whole."""
        ...

    def axes(self, name: str) -> tuple[str, ...]:
        """Names of the axes of a variable or coordinate."""
        ...

    def attributes(self, name: str) -> dict[str, Any]:
        """Unit and meaning of a variable or coordinate."""
        ...


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
        For a file that is there, unless it is to be replaced.
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
    samples = _opened(dataset)
    with _part(Path(out), overwrite=overwrite) as part, h5py.File(part, "w", track_order=True) as file:
        for name, value in samples.attrs.items():
            file.attrs[name] = _plain(value)
        coordinates = {name: _stored(h5py, file, samples, name) for name in samples.coordinates}
        for name in coordinates:
            if samples.axes(name) == (name,):
                file[name].make_scale(name)
        variables: dict[str, Any] = {}
        with notice.progress(None, "exporting", "sample", total=len(samples), shown=progress) as bar:
            for index, sample in _all(samples):
                for name, values in sample.items():
                    if name not in variables:
                        variables[name] = _new_variable(h5py, file, samples, name, values)
                    variables[name][index] = str(values[()]) if _is_text(values) else values
                bar.update()
        for name, variable in variables.items():
            for axis, label in enumerate(samples.axes(name)):
                variable.dims[axis].label = label
                if label in coordinates and samples.axes(label) == (label,) and label != name:
                    variable.dims[axis].attach_scale(file[label])


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
    text, ``00000007.json``. Beside the files ``000000.tar``, ``000001.tar``, ... is ``dataset.json``: attributes,
    coordinates, and axes and units of all variables. Samples that failed or are missing are left out. The same
    dataset gives the same bytes. The folder gets its name when it is complete.

    Parameters
    ----------
    dataset : Dataset or path
        As of `to_hdf5`.
    out : path
        Folder to be made.
    samples_per_tar : int
        Samples of every file but the last.
    overwrite, progress
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
    samples, folder = _opened(dataset), Path(out)
    with _part(folder, overwrite=overwrite) as part:
        part.mkdir()
        (part / "dataset.json").write_text(json.dumps(_described(samples), indent=1), encoding="utf-8")
        made, num_made = _those_made(samples), len(_made(samples))
        names = [f"{number:06d}.tar" for number in range(-(-num_made // size))]
        with notice.progress(None, "exporting", "sample", total=num_made, shown=progress) as bar:
            for name in names:
                with tarfile.open(part / name, "w", format=tarfile.USTAR_FORMAT) as tar:
                    for index, sample in islice(made, size):
                        for ending, content in _members(sample):
                            member = tarfile.TarInfo(f"{index:08d}.{ending}")
                            member.size = len(content)
                            tar.addfile(member, io.BytesIO(content))
                        bar.update()
    return [folder / name for name in names]


def to_mcap(
    dataset: Samples | str | PathLike[str],
    out: str | PathLike[str],
    *,
    sample: int,
    topic: str = "/radar",
    start_ns: int = 0,
    overwrite: bool = False,
) -> None:
    """Write the frames of a sample as an MCAP file of ROS 2, as recordings in bags are (extra `ros`: rosbags).

    Cube, times and radar, and the truth where it is among the labels: `adapters.ros.BagFrames` gives the frames as
    they were simulated, to the bit. The other labels are not in it.

    Parameters
    ----------
    dataset : Dataset or path
        As of `to_hdf5`.
    out : path
        File to be made, ``.mcap``.
    sample : int
        Its index.
    topic, start_ns
        As of `adapters.ros.FrameWriter`.
    overwrite : bool
        Replace a bag that is there.

    Raises
    ------
    ValueError
        For a sample that failed or is missing.
    ImportError
        When rosbags is missing.

    See Also
    --------
    adapters.ros.BagFrames : Reads it.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "position = [2.0, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", lines, fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1, progress=False)
    >>> rc.dataset.to_mcap(dataset, "one.mcap", sample=1)
    >>> with rc.adapters.ros.BagReader("one.mcap") as bag:
    ...     print(len(rc.adapters.ros.BagFrames(bag)))
    2
    """
    samples = _opened(dataset)
    index = check.index("sample", sample, len(samples))
    if index not in _made(samples):
        raise ValueError(f"sample: expected one that was made, got {index}, which failed or is missing")
    path = Path(out)
    if path.suffix != ".mcap":
        raise ValueError(f"out: expected a file .mcap, got {str(out)!r}")
    with BagWriter(path, "mcap", overwrite=overwrite) as bag:
        writer = FrameWriter(bag, samples.radar, source={"sample": index}, topic=topic, start_ns=start_ns)
        for frame in frames_of(samples, index):
            writer.append(frame)
        writer.close()


def frames_of(samples: Samples, index: int) -> Iterator[Frame]:
    """Frames of a sample, with their truth where it is among the labels."""
    radar, arrays = _radar_of(samples, index), samples[index]
    rows = [arrays[f"true_{name}"] for name in TRUTH_FIELDS if f"true_{name}" in arrays]
    has_truth = len(rows) == len(TRUTH_FIELDS)
    names = tuple(map(str, samples.values("body"))) if has_truth else ()
    for number, (cube, time) in enumerate(zip(arrays["cube"], arrays["time"], strict=True)):
        truth = Truth(names, *(row[number] for row in rows)) if has_truth else None
        yield Frame(cube, float(time), radar, truth, raw=adc_codes(cube, radar))


def _radar_of(samples: Samples, index: int) -> Radar:
    """Radar of a sample: the scene may vary it."""
    drawn = getattr(samples, "sample", None)
    if drawn is None:
        return samples.radar
    radar: Radar = drawn(index).simulation().radar
    return radar


def _opened(dataset: Samples | str | PathLike[str]) -> Samples:
    if isinstance(dataset, str | PathLike):
        from radarcore.dataset.opened import open_dataset  # needs zarr, which exporting alone does not

        opened: Samples = open_dataset(dataset)
        return opened
    if not hasattr(dataset, "coordinates"):
        raise TypeError(f"dataset: expected Dataset or its path, got {type(dataset).__name__}")
    return dataset


def _those_made(samples: Samples) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    """The samples that were made, with their indices: the labels of a shard are read at once."""
    for shard in range(samples.num_shards):
        yield from samples.of_shard(shard)


def _all(samples: Samples) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    """The samples that were made, and then the others."""
    yield from _those_made(samples)
    for index in np.setdiff1d(np.arange(len(samples)), _made(samples)).tolist():
        yield index, samples[index]


def _made(samples: Samples) -> NDArray[np.intp]:
    """Indices of the samples that were made, neither failed nor missing."""
    return np.flatnonzero(samples.values("status") == STATUS["made"])


def _is_text(values: NDArray[Any]) -> bool:
    return values.dtype.kind in "OUST"


def _attributes(samples: Samples, name: str) -> dict[str, Any]:
    """Attributes of a variable or coordinate that hold for its numbers."""
    return {key: value for key, value in samples.attributes(name).items() if key not in _OF_CODES}


def _plain(value: Any) -> Any:
    """A number or text as it is, JSON of anything else."""
    return value if isinstance(value, str | int | float | bool) else json.dumps(value)


@contextmanager
def _part(path: Path, *, overwrite: bool) -> Iterator[Path]:
    """A path beside another, which takes its name when the block ends without an error, and is removed otherwise."""
    if path.exists() and not overwrite:
        raise FileExistsError(errno.EEXIST, "expected no such path; overwrite=True replaces it", str(path))
    part = path.with_name(f"{path.name}.part")
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove(part)
    try:
        yield part
        _remove(path)
        part.replace(path)
    finally:
        _remove(part)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _h5py() -> Any:
    try:
        import h5py
    except ImportError as error:
        raise ImportError("HDF5 files need h5py: pip install radarcore[hdf5]") from error
    return h5py


def _stored(h5py: Any, file: Any, samples: Samples, name: str) -> Any:
    """A coordinate in a file."""
    values = samples.values(name)
    is_text = _is_text(values)
    made = file.create_dataset(name, data=values.astype(object) if is_text else values, dtype=_dtype(h5py, values))
    for key, value in _attributes(samples, name).items():
        made.attrs[key] = _plain(value)
    return made


def _new_variable(h5py: Any, file: Any, samples: Samples, name: str, values: NDArray[Any]) -> Any:
    """A variable without values, for the samples whose first one is given."""
    shape = (len(samples), *values.shape)
    made = file.create_dataset(name, shape, _dtype(h5py, values), chunks=(1, *values.shape) if values.size else None)
    for key, value in _attributes(samples, name).items():
        made.attrs[key] = _plain(value)
    return made


def _dtype(h5py: Any, values: NDArray[Any]) -> Any:
    return h5py.string_dtype() if _is_text(values) else values.dtype


def _described(samples: Samples) -> dict[str, Any]:
    """Attributes, coordinates and variables of a dataset, as JSON holds them."""
    return {
        "attrs": dict(samples.attrs),
        "coordinates": {
            name: {
                "dims": samples.axes(name),
                "values": samples.values(name).tolist(),
                "attrs": _attributes(samples, name),
            }
            for name in samples.coordinates
        },
        "variables": {
            name: {"dims": samples.axes(name)[1:], "attrs": _attributes(samples, name)} for name in samples.names
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
