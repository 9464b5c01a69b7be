"""The command `radarcore simulate`: a scene file, or depth images of a bag, into a recording."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from radarcore.cli import bag
from radarcore.cli.bag_options import NO_BAG, BagOptions
from radarcore.cli.options import Count, Flag, Json, Output
from radarcore.cli.terminal import show
from radarcore.scenefile.load import load_scene


def run(
    scene: Annotated[Path | None, Parameter(metavar="SCENE")] = None,
    /,
    *,
    output: Output,
    overwrite: Flag = False,
    threads: Count = None,
    as_json: Json = False,
    from_bag: BagOptions = NO_BAG,
) -> None:
    """Simulate a scene file, or depth images of a bag, into a recording.

    Parameters
    ----------
    scene : path
        scene file (TOML)
    output : path
        recording: a new directory
    overwrite : bool
        replace an existing recording
    threads : int
        threads (default: all cores)
    """
    from_bag.check(scene)
    if from_bag.bag is not None:
        began = time.perf_counter()
        recording, rate = bag.simulated(scene, from_bag, output, overwrite=overwrite, threads=threads)
    else:
        assert scene is not None  # or `check` would have refused
        simulation = load_scene(scene)
        began = time.perf_counter()
        recording, rate = simulation.record(output, overwrite=overwrite, threads=threads), simulation.run.rate
    elapsed = time.perf_counter() - began
    ratio = len(recording) / rate / elapsed
    if as_json:
        summary = {
            "recording": str(output),
            "frames": len(recording),
            "cube_shape": list(recording.cube.shape),
            "seconds": elapsed,
            "real_time_factor": ratio,
        }
        print(json.dumps(summary, indent=2))
    else:
        shape = " x ".join(map(str, recording.cube.shape[1:]))
        show(f"{output}: {len(recording)} frames of {shape} samples in {elapsed:.1f} s, {ratio:.2f} x real time")
