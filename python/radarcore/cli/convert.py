"""The command `radarcore convert`: a recording in another format, equal to the bit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.frames import write_frames
from radarcore.cli.options import Overwrite, Quiet, Source
from radarcore.cli.sources import WHOLE, Reading, path_and_topic, start_ns_of
from radarcore.cli.terminal import show
from radarcore.dataset.converted import exact_codes, save_as_dataset
from radarcore.output import refuse_source

_BAGS, _DATASET = (".mcap", ".db3"), ".zarr"


def run(
    source: Source,
    output: Annotated[Path, Parameter(metavar="OUT")],
    /,
    *,
    format: Literal["infineon"] | None = None,
    overwrite: Overwrite = False,
    _quiet: Quiet = False,
    reading: Reading = WHOLE,
) -> None:
    """Write a recording in another format, by the suffix of OUT.

    Parameters
    ----------
    source : path
        recording, BAG:/TOPIC, or bare samples with --config
    output : path
        recording (no suffix, .npz), ROS bag (.mcap, .db3), or dataset of one sample (.zarr, never replaced)
    format : str
        write the folder of Infineon's tools: ADC codes and settings, without times and truth
    """
    suffix = output.suffix.lower()
    if suffix not in ("", ".npz", *_BAGS, _DATASET) and suffix[1].isalpha():  # dates and versions have dots, too
        known = f"a recording (no suffix, .npz), a bag ({', '.join(_BAGS)}) or a dataset ({_DATASET})"
        raise ValueError(f"{output}: expected {known}, got suffix {suffix!r}")
    if format is not None and suffix in (".npz", *_BAGS, _DATASET):
        raise ValueError(f"{output}: expected a folder for Infineon's tools (no suffix), got suffix {suffix!r}")
    refuse_source("OUT", output, path_and_topic(source)[0])
    recording = reading.load(source)
    if format is not None and recording.raw is not None and exact_codes(recording) is None:
        raise ValueError(f"{output}: expected codes of an ADC for Infineon's tools, got samples between them")
    if suffix not in (*_BAGS, _DATASET):
        recording.save(output, format, overwrite=overwrite)
    elif len(recording) == 0:
        raise ValueError(f"{output}: expected at least one frame for a {suffix} file, got none")
    elif suffix == _DATASET:
        save_as_dataset(recording, output)
    else:
        with BagWriter(output, overwrite=overwrite) as bag:
            write_frames(bag, recording, start_ns=start_ns_of(recording.source))
    shape = " x ".join(map(str, recording.shape[1:]))
    show(f"{output}: {len(recording)} frames of {shape} samples, {recording.dtype}")
