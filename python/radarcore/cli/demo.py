"""The command `radarcore demo`: the paper's experiment in small, compared with its truth.

A UR10 carries the radar at 250 mm/s towards a cylinder on a table while a person walks in and out; all of it is in
``experiment.toml``.
"""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from radarcore import check, plot
from radarcore.cli.options import Count, Flag, Json, Output, Quiet, Seconds, given
from radarcore.cli.terminal import show
from radarcore.comparison.targets import Errors, TargetErrors, estimates, found_in, target_errors, truth_of
from radarcore.models.robots.named import is_available
from radarcore.output import check_file, write_text
from radarcore.recording.native import check_room
from radarcore.scenefile.load import load_scene
from radarcore.table import Table, finite

TARGETS = {"cylinder": "cylinder", "person": "person/trunk"}
"""Compared targets, and the body with the velocity of each; ranges refer to the nearest visible point."""

_HEADER = (
    "",
    *("frames\nvisible", "\ntracked", "\npredicted"),
    *("range [bins]\nmedian", "\n95 %", "\nlargest"),
    *("velocity [bins]\nmedian", "\n95 %", "\nlargest"),
    *("below\n1/2 range bin", "below\n1 velocity bin"),
)
"""Columns of the errors, in colour."""


def run(
    *,
    output: Output = Path("out/demo"),
    duration: Seconds = None,
    ray_budget: Count = None,
    overwrite: Flag = False,
    robots: Annotated[bool | None, Parameter(negative="--no-robots")] = None,
    _quiet: Quiet = False,
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
    say: Callable[[str | Table], None] = (lambda _: None) if as_json else show
    if duration is not None:
        check.positive("duration", duration, "s")
    if ray_budget is not None:
        check.count("ray_budget", ray_budget)
    plot.require()
    with_robots = is_available() if robots is None else robots
    file, path, picture = (output / name for name in ("scene.toml", "recording", "experiment.png"))
    check_room(path, overwrite)
    check_file(picture, overwrite=overwrite)
    write_text(file, scene_text(with_robots), overwrite=overwrite)
    simulation = load_scene(file)
    stop = None if duration is None else simulation.run.start + duration
    run = simulation.run.model_copy(update=given(stop=stop, ray_budget=ray_budget))
    simulation = replace(simulation, run=run)
    waveform = simulation.radar.waveform

    say(
        f"BGT60TR13C: {simulation.radar.num_channels} channels x {waveform.num_chirps} chirps x "
        f"{waveform.num_samples} samples, range bin {100 * waveform.range_resolution:.1f} cm, "
        f"velocity bin {waveform.velocity_resolution:.3f} m/s"
    )
    extra = "real UR10 and human meshes" if with_robots else "analytic shapes (pip install radarcore[robots]: meshes)"
    say(f"{len(simulation.scene.bodies)} bodies, {simulation.scene.num_triangles} triangles, {extra}")

    # Simulate and record.
    began = time.perf_counter()
    with warnings.catch_warnings():
        # The feet of the person are faster than max_velocity for a few frames, as docs/demo.md says.
        warnings.filterwarnings("ignore", message=".*has a radial speed of")
        recording = simulation.record(path=path, overwrite=overwrite)
    elapsed = time.perf_counter() - began
    real_time_factor = len(recording) / run.rate / elapsed
    say(
        f"{len(recording)} frames in {elapsed:.1f} s: {1e3 * elapsed / len(recording):.0f} ms per frame, "
        f"{real_time_factor:.2f} x real time"
    )

    # Detect and track, and compare with the truth.
    began = time.perf_counter()
    assert recording.truth is not None  # the simulator always gives it
    found = estimates(found_in(recording, motion=simulation.radar_motion), recording.truth, TARGETS.values())
    elapsed_of_tracks = time.perf_counter() - began
    say(f"detected and tracked in {1e3 * elapsed_of_tracks / len(recording):.1f} ms per frame")
    bins = waveform.range_resolution, waveform.velocity_resolution
    known = {name: truth_of(recording.truth, body) for name, body in TARGETS.items()}
    errors = [target_errors(name, found[body], known[name], bins) for name, body in TARGETS.items()]
    say("")
    say(_table(errors))

    # One picture, with the ranges that count.
    ranges = recording.truth.range.copy()
    for name, body in TARGETS.items():
        ranges[:, recording.truth.names.index(body)] = known[name][0]
    plot.experiment(
        replace(recording, truth=replace(recording.truth, range=ranges)),
        simulation.scene,
        simulation.radar_motion,
        {body: asdict(one) for body, one in found.items()},
        field_of_view_deg=run.field_of_view_deg,
        max_range=6.0,
        path=picture,
        overwrite=overwrite,
    )
    say("")
    say(f"scene {file}, recording {path}, picture {picture}")
    if as_json:
        result = {
            "frames": len(recording),
            "seconds": elapsed,
            "real_time_factor": real_time_factor,
            "triangles": simulation.scene.num_triangles,
            "targets": [one.to_dict() for one in errors],
            "scene": str(file),
            "recording": str(path),
            "picture": str(picture),
        }
        print(json.dumps(finite(result), indent=2, allow_nan=False))


def scene_text(with_robots: bool) -> str:
    """The scene file of the experiment."""
    text = files("radarcore.cli").joinpath("experiment.toml").read_text(encoding="utf-8")
    return text.replace("meshes = false", "meshes = true") if with_robots else text


def _table(targets: Sequence[TargetErrors]) -> Table:
    """The errors of the targets."""
    rows = [
        (
            *(one.name, str(one.num_frames), str(one.num_tracked), str(one.num_predicted)),
            *_in_bins(one.range),
            *_in_bins(one.velocity),
            *(str(one.range.num_within), str(one.velocity.num_within)),
        )
        for one in targets
    ]
    return Table(_HEADER, rows)


def _in_bins(errors: Errors) -> tuple[str, ...]:
    """Median, 95 % and largest error."""
    return tuple(f"{v:.3f}" for v in (errors.median_bins, errors.percentile_95_bins, errors.largest_bins))
