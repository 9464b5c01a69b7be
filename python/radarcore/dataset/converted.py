"""A recording as a dataset of one sample: of a simulation or a sensor, with no scene file behind it."""

from __future__ import annotations

import json
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.dataset.labels import Labels
from radarcore.dataset.store import (
    STATUS,
    Variable,
    attributes_of,
    coordinates_of,
    create,
    layout_of,
    writable,
    write_shard,
)
from radarcore.output import Lock, already_exists
from radarcore.recording.frame import FULL_SCALE, TRUTH_FIELDS, to_samples
from radarcore.recording.recording import Recording


def save_as_dataset(recording: Recording, path: str | PathLike[str]) -> None:
    """Write a recording as a dataset of one sample, which `Dataset.recording` gives back to the bit.

    Labels are its truth, if it has one. Codes of an ADC are stored as codes. The sample is one chunk, so all samples
    are in memory.

    Raises
    ------
    FileExistsError
        If `path` exists: datasets are not replaced.
    """
    if (target := Path(path)).exists():
        raise already_exists(target, "a place in use; datasets are not replaced: delete it, or choose another name")
    target, truth = target.absolute(), recording.truth
    names, labels = () if truth is None else truth.names, Labels(truth=truth is not None)
    codes, first = exact_codes(recording), recording[0]
    if codes is None and first.raw is not None:
        first = replace(first, raw=None, stats=first.stats | {"cube_unit": FULL_SCALE})
    layout = layout_of(None, names, labels, [first] * len(recording), 1, 1)
    attrs = attributes_of(None, layout, 0, labels, recording.radar)
    attrs |= {"source": json.dumps(recording.source)}
    values: dict[str, NDArray[Any]] = {"cube": recording.cube if codes is None else codes, "time": recording.time}
    if truth is not None:
        values |= {f"true_{name}": getattr(truth, name) for name in TRUTH_FIELDS}
    if recording.lost is not None:
        meaning = {"long_name": "frames lost just before"}
        layout.variables["lost_before"] = Variable(("frame",), (len(recording),), "int32", -1, meaning)
        values["lost_before"] = recording.lost
    layout.variables["status"] = layout.variables.pop("status")  # the last
    create(target, layout, coordinates_of(recording.radar, names, layout), attrs)
    with Lock(target):
        rows = layout.empty_rows(0)
        for name, value in (values | {"status": np.asarray(STATUS["made"])}).items():
            rows[name][0] = value
        write_shard(target, writable(target), layout, 0, rows)


def exact_codes(recording: Recording) -> NDArray[np.uint16] | None:
    """Codes of an ADC that give back every sample to the bit; None if there are none."""
    codes = recording.raw
    is_exact = codes is not None and recording.dtype == np.float32 and np.array_equal(to_samples(codes), recording.cube)
    return codes if is_exact else None
