"""The command `radarcore dataset`: datasets made, verified, summarised and exported."""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from radarcore.dataset.labels import Labels
from radarcore.dataset.layout import STATUS
from radarcore.dataset.making import make
from radarcore.dataset.opened import open_dataset
from radarcore.dataset.verification import verify

FORMATS = ("hdf5", "webdataset", "mcap")

_SHOWN = 3
"""Failed samples that are told of; the others are in the dataset."""


def add_parser(commands: Any) -> None:
    """Add the command with its actions."""
    parser = commands.add_parser("dataset", help="make and check datasets of many labelled frames (extra `zarr`)")
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")

    making = actions.add_parser("make", help="simulate samples of a scene file that varies")
    making.add_argument("scene", type=Path, help="scene file (TOML), in which values may be distributions")
    making.add_argument("-o", "--output", type=Path, required=True, help="dataset: a new directory")
    making.add_argument("--count", type=int, required=True, metavar="N", help="samples")
    making.add_argument("--seed", type=int, default=1, metavar="N", help="seed of all draws (default: 1)")
    making.add_argument("--workers", type=int, metavar="N", help="processes of this machine (default: one per core)")
    making.add_argument("--scheduler", metavar="ADDRESS", help="scheduler of dask, tcp://HOST:8786, in their place")
    making.add_argument("--timeout", type=float, default=10.0, metavar="S", help="for it to answer [s] (default: 10)")
    making.add_argument("--resume", action="store_true", help="go on with a dataset that was interrupted")
    making.add_argument("--labels", default="truth", metavar="NAME,...", help=f"{_label_names()} (default: truth)")
    making.add_argument("--samples-per-shard", type=int, metavar="N", help="samples of a file (default: up to 64 MB)")
    making.add_argument("--json", action="store_true", help="print the summary as JSON")
    making.set_defaults(run=_make)

    checking = actions.add_parser("verify", help="check checksums and numbers, and simulate samples again")
    checking.add_argument("dataset", type=Path, help="dataset")
    checking.add_argument("--again", type=int, default=1, metavar="N", help="samples to simulate again (default: 1)")
    checking.add_argument("--json", action="store_true", help="print the result as JSON")
    checking.set_defaults(run=_verify)

    info = actions.add_parser("info", help="summarise a dataset")
    info.add_argument("dataset", type=Path, help="dataset")
    info.add_argument("--json", action="store_true", help="print as JSON")
    info.set_defaults(run=_info)

    scene = actions.add_parser("scene", help="print the scene file of a sample, which gives the same frames alone")
    scene.add_argument("dataset", type=Path, help="dataset")
    scene.add_argument("index", type=int, help="index of the sample")
    scene.set_defaults(run=_scene)

    export = actions.add_parser("export", help="write a dataset in another format")
    export.add_argument("dataset", type=Path, help="dataset")
    export.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="file, or folder of tar files")
    export.add_argument("--format", choices=FORMATS, required=True, help="%(choices)s")
    export.add_argument("--sample", type=int, default=0, metavar="N", help="index of the sample of mcap (default: 0)")
    export.set_defaults(run=_export)


def labels_of_names(names: str) -> Labels:
    """Labels by their names, separated by commas; ``none`` for none."""
    known = [field.name for field in fields(Labels)]
    chosen = [name.strip() for name in names.split(",") if name.strip() and names.strip() != "none"]
    for name in chosen:
        if name not in known:
            raise ValueError(f"labels: expected {_label_names()}, got {name!r}")
    return Labels(**{name: name in chosen for name in known})


def _label_names() -> str:
    return ", ".join(field.name for field in fields(Labels))


def _make(options: argparse.Namespace) -> int:
    began = time.perf_counter()
    dataset = make(
        options.scene,
        options.output,
        count=options.count,
        seed=options.seed,
        workers=options.workers,
        scheduler=options.scheduler,
        timeout=options.timeout,
        resume=options.resume,
        labels=labels_of_names(options.labels),
        samples_per_shard=options.samples_per_shard,
    )
    seconds = time.perf_counter() - began
    failed = dataset.failed
    for failure in failed[:_SHOWN]:
        print(f"radarcore: sample {failure.sample} of seed {failure.seed} failed: {failure.error}", file=sys.stderr)
    if len(failed) > _SHOWN:
        more = f"{len(failed) - _SHOWN} more failed: radarcore dataset info {options.output}"
        print(f"radarcore: {more}", file=sys.stderr)
    frames = len(dataset) * dataset.sizes["frame"]
    if options.json:
        summary = {
            **{"dataset": str(options.output), "samples": len(dataset), "frames": frames},
            **{"failed": len(failed), "seconds": seconds},
        }
        print(json.dumps(summary, indent=2))
    else:
        print(f"{options.output}: {len(dataset)} samples, {frames} frames in {seconds:.1f} s, {len(failed)} failed")
    return 1 if len(failed) == len(dataset) else 0


def _verify(options: argparse.Namespace) -> int:
    found = verify(options.dataset, again=options.again)
    print(json.dumps(asdict(found), indent=2) if options.json else found)
    return 0 if found.is_good else 1


def _info(options: argparse.Namespace) -> int:
    dataset = open_dataset(options.dataset)
    status = dataset.status
    facts = {
        "samples": len(dataset),
        **{name: int((status == value).sum()) for name, value in STATUS.items()},
        "sizes": dataset.sizes,
        "seed": dataset.seed,
        "bodies": list(dataset.body_names),
        "variables": {name: f"{dataset.attributes(name).get('units', '')}" for name in dataset.names},
        "varies": {parameter.path: parameter.kind for parameter in dataset.variation.parameters},
        "made by": dataset.attrs["radarcore"],
        "failures": [asdict(failed) for failed in dataset.failed],
    }
    if options.json:
        print(json.dumps(facts, indent=2))
        return 0
    print(dataset)
    for name in ("seed", "bodies", "varies", "variables", "made by"):
        value = facts[name]
        texts = [f"{key} [{each}]" if each else key for key, each in value.items()] if isinstance(value, dict) else value
        print(f"{name}: {', '.join(texts) if isinstance(texts, list) else texts}")
    if missing := int((status == STATUS["missing"]).sum()):
        print(f"missing: {missing} samples; radarcore dataset make ... --resume makes them")
    for failed in dataset.failed:
        print(f"failed: sample {failed.sample} of seed {failed.seed}: {failed.error}")
    return 0


def _scene(options: argparse.Namespace) -> int:
    print(open_dataset(options.dataset).sample(options.index).text, end="")
    return 0


def _export(options: argparse.Namespace) -> int:
    from radarcore.dataset import export

    if options.format == "hdf5":
        export.to_hdf5(options.dataset, options.output)
    elif options.format == "webdataset":
        export.to_webdataset(options.dataset, options.output)
    else:
        export.to_mcap(options.dataset, options.output, sample=options.sample)
    print(options.output)
    return 0
