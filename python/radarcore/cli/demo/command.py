"""The command `radarcore demo`."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from radarcore.cli import terminal
from radarcore.cli.demo import experiment
from radarcore.cli.options import Count, Flag, Json, Output, Seconds


def run(
    *,
    output: Output = Path("out/demo"),
    duration: Seconds = None,
    ray_budget: Count = None,
    overwrite: Flag = False,
    robots: Annotated[bool | None, Parameter(negative="--no-robots")] = None,
    as_json: Json = False,
) -> None:
    """Simulate the experiment and compare it with the truth.

    Parameters
    ----------
    output : path
        directory
    overwrite : bool
        replace scene, recording and picture of an earlier run
    duration : float
        seconds (default: 5)
    ray_budget : int
        largest number of rays per cast (default: 400000)
    robots : bool
        real UR10 and human meshes, or shapes (default: meshes if the extra `robots` is installed)
    """
    result = experiment.run(
        output,
        duration=duration,
        ray_budget=ray_budget,
        with_robots=robots,
        overwrite=overwrite,
        say=_silent if as_json else terminal.show,
    )
    if as_json:
        print(json.dumps(_finite(result), indent=2, allow_nan=False))


def _finite(value: Any) -> Any:
    """Copy of a value with null for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _silent(_: str | terminal.Table) -> None:
    pass
