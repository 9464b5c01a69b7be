"""The command `radarcore simulate`: a scene file into a recording."""

from __future__ import annotations

import json
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from radarcore import notice
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.motions import BagMotions
from radarcore.cli.options import Count, Flag, Json, OutputFolder, Quiet
from radarcore.cli.sources import beside
from radarcore.cli.terminal import show
from radarcore.scenefile.load import simulation as simulation_of
from radarcore.scenefile.read import change, tables_of, values_of


def run(
    scene: Annotated[Path, Parameter(metavar="SCENE")],
    /,
    *,
    output: OutputFolder = None,
    changes: Annotated[list[str] | None, Parameter(name="--set", metavar="KEY=VALUE")] = None,
    seed: Count = None,
    overwrite: Flag = False,
    threads: Count = None,
    bag: Annotated[Path | None, Parameter(metavar="BAG")] = None,
    _quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Simulate a scene file into a recording.

    Parameters
    ----------
    scene : path
        scene file (TOML)
    output : path
        recording: a new directory (default: the scene file's name without .toml, beside it)
    changes : list of str
        change a value, in TOML: run.stop=2, point.ball.rcs=0.1; may be repeated
    seed : int
        the same as --set run.seed=N
    overwrite : bool
        replace an existing recording
    threads : int
        threads (default: all cores)
    bag : path
        ROS bag with the motions of kind "bag"
    """
    with nullcontext() if bag is None else BagReader(bag) as reader:
        recorded = None if reader is None else BagMotions(reader)
        values, changes = values_of(scene), [*(changes or ()), *([] if seed is None else [f"run.seed={seed}"])]
        for text in changes:
            change(values, text)
        simulation = simulation_of(tables_of(values, scene), scene, recorded)
        source: dict[str, Any] = {"set": changes} if changes else {}
        if recorded is not None:
            if recorded.span is None:
                notice.warn(f"{scene}: expected a motion or joints of kind 'bag', got none: the bag is not used")
            source["bag"] = {"path": str(bag), "start_ns": recorded.start_ns}
        began = time.perf_counter()
        output = output or beside(scene)
        recording = simulation.record(output, overwrite=overwrite, threads=threads, source=source)
    rate = simulation.run.rate
    elapsed = time.perf_counter() - began
    ratio = len(recording) / rate / elapsed
    if as_json:
        summary = {
            "recording": str(output),
            "frames": len(recording),
            "cube_shape": list(recording.shape),
            "seconds": elapsed,
            "real_time_factor": ratio,
        }
        print(json.dumps(summary, indent=2))
    else:
        shape = " x ".join(map(str, recording.shape[1:]))
        show(f"{output}: {len(recording)} frames of {shape} samples in {elapsed:.1f} s, {ratio:.2f} x real time")
