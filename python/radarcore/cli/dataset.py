"""The commands of `radarcore dataset`: datasets made and verified; and their summary."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from radarcore.cli.options import Count, Flag, Json, Number, OutputFolder, Quiet, whole_number
from radarcore.cli.sources import beside
from radarcore.cli.terminal import complain, show
from radarcore.dataset.labels import Labels
from radarcore.dataset.making import make
from radarcore.dataset.reading import open_dataset, verify
from radarcore.dataset.store import STATUS
from radarcore.table import Table

_SHOWN = 3
"""Most failed samples in a message; the dataset has the others."""

Scene = Annotated[Path, Parameter(metavar="SCENE")]
Folder = Annotated[Path, Parameter(metavar="DATASET")]


def run_make(
    scene: Scene,
    /,
    *,
    output: OutputFolder = None,
    count: Number,
    seed: Number = 1,
    workers: Count = None,
    resume: Flag = False,
    labels: Annotated[str, Parameter(metavar="NAME,...")] = "truth",
    samples_per_shard: Count = None,
    _quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Make a dataset, or go on with it; exit status 1 if no sample could be simulated.

    Parameters
    ----------
    scene : path
        scene file (TOML), in which values may be distributions
    output : path
        dataset: a new directory (default: NAME.zarr beside the scene file)
    count : int
        samples
    seed : int
        seed of all draws
    workers : int
        processes of this machine (default: one per core)
    resume : bool
        go on with a dataset that was interrupted
    labels : str
        truth, boxes, visibility, joints, cells; or none
    samples_per_shard : int
        samples of a file (default: up to 32 MB)
    """
    began, output = time.perf_counter(), output or beside(scene, ".zarr")
    dataset = make(
        scene,
        output,
        count=count,
        seed=seed,
        workers=workers,
        resume=resume,
        labels=labels_of_names(labels),
        samples_per_shard=samples_per_shard,
    )
    seconds = time.perf_counter() - began
    failed = dataset.failed
    for failure in failed[:_SHOWN]:
        complain(f"sample {failure.sample} of seed {failure.seed} failed: {failure.error}", "warning")
    if len(failed) > _SHOWN:
        complain(f"{len(failed) - _SHOWN} more failed, see radarcore info {output}", "warning")
    frames = len(dataset) * dataset.sizes["frame"]
    if as_json:
        result = {"dataset": str(output), "samples": len(dataset), "frames": frames, "failed": len(failed)}
        print(json.dumps(result | {"seconds": seconds}, indent=2))
    else:
        show(f"{output}: {len(dataset)} samples, {frames} frames, {len(failed)} failed; {seconds:.1f} s")
    return 1 if len(failed) == len(dataset) else 0


def run_verify(dataset: Folder, /, *, again: Number = 1, _quiet: Quiet = False, as_json: Json = False) -> int:
    """Verify a dataset; exit status 1 if something is wrong with it.

    Parameters
    ----------
    dataset : path
        dataset
    again : int
        samples to simulate once more, to the bit
    """
    found = verify(dataset, again=again)
    if as_json:
        print(json.dumps(asdict(found), indent=2))
    else:
        show(found)
    return 0 if found.is_good else 1


def show_dataset(dataset: Path, as_json: bool) -> None:
    """Summarise a dataset, for `radarcore info`."""
    opened = open_dataset(dataset)
    status, failed = opened.status, opened.failed
    facts: dict[str, Any] = {
        "samples": {name: int((status == value).sum()) for name, value in STATUS.items()},
        "axes": opened.sizes,
        "variables": {name: opened.attributes(name).get("units", "") for name in opened.names},
        "bodies": list(opened.body_names),
        "seed": opened.seed,
        "made by": f"radarcore {opened.attrs['radarcore']}",
        "failed": [asdict(failure) for failure in failed],
    }
    if as_json:
        print(json.dumps(facts, indent=2))
        return
    show(opened)
    texts = facts | {
        "samples": ", ".join(f"{number} {name}" for name, number in facts["samples"].items()),
        "axes": ", ".join(f"{name} {length}" for name, length in opened.sizes.items()),
        "variables": ", ".join(f"{name} [{unit}]" if unit else name for name, unit in facts["variables"].items()),
        "bodies": ", ".join(opened.body_names),
    }
    del texts["failed"]
    rows = [(name, str(text)) for name, text in texts.items()]
    rows += [("failed", f"sample {each.sample}: {each.error}") for each in failed]
    show(Table((), rows, num_left=2))


def run_scene(dataset: Folder, index: Annotated[int, Parameter(metavar="INDEX", converter=whole_number)], /) -> None:
    """Print the scene file of a sample.

    Parameters
    ----------
    dataset : path
        dataset
    index : int
        index of the sample
    """
    print(open_dataset(dataset).sample(index).text, end="")


def labels_of_names(names: str) -> Labels:
    """Labels by their names, separated by commas; ``none`` for none."""
    known = [field.name for field in fields(Labels)]
    chosen = [] if names == "none" else [name.strip() for name in names.split(",")]
    for name in chosen:
        if name not in known:
            raise ValueError(f"labels: expected {', '.join(known)} or none, got {name!r}")
    return Labels(**{name: name in chosen for name in known})
