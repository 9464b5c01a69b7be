"""The command `radarcore`."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from radarcore._core import __version__
from radarcore.cli import sensor, source, static
from radarcore.cli.bag_options import add_options, check_options
from radarcore.cli.ending import exit_status, interrupted_by_signals

_WRITERS = ("demo", "simulate", "process", "view")
"""Commands whose results are written as they come."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0, 1 for bad input, 130 when interrupted, 143 when told to end."""
    options = _parser().parse_args(arguments)
    try:
        with interrupted_by_signals(), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            status = int(options.run(options))
            sys.stdout.flush()
            return status
    except KeyboardInterrupt as interrupt:
        is_recording = options.command in _WRITERS or getattr(options, "action", None) == "record"
        hint = "; what was written so far is readable" if is_recording else ""
        print(f"radarcore: {str(interrupt) or 'interrupted'}{hint}", file=sys.stderr)
        return exit_status(interrupt)
    except BrokenPipeError:  # whoever reads our output has had enough: `radarcore schema | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ValueError, TypeError, OSError, ImportError, MemoryError) as error:
        for line in _lines(error):
            print(f"radarcore: {line}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="radarcore", description="FMCW radar simulation for robotics.")
    parser.add_argument("--version", action="version", version=f"radarcore {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    demo = commands.add_parser("demo", help="simulate the experiment and compare it with the truth")
    demo.add_argument("-o", "--output", type=Path, default=Path("out/demo"), help="directory (default: %(default)s)")
    demo.add_argument("--duration", type=float, metavar="S", help="seconds (default: 5)")
    demo.add_argument("--ray-budget", type=int, metavar="N", help="largest number of rays per cast (default: 400000)")
    demo.add_argument(
        "--robots",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="real UR10 and human meshes (default: if the extra `robots` is installed)",
    )
    demo.add_argument("--json", action="store_true", help="print the results as JSON")
    demo.set_defaults(run=_demo)

    simulate = commands.add_parser("simulate", help="simulate a scene file, or depth images of a bag, into a recording")
    simulate.add_argument("scene", type=Path, nargs="?", help="scene file (TOML)")
    simulate.add_argument("-o", "--output", type=Path, required=True, help="recording: a new directory")
    simulate.add_argument("--overwrite", action="store_true", help="replace an existing recording")
    simulate.add_argument("--threads", type=int, metavar="N", help="threads (default: all cores)")
    simulate.add_argument("--json", action="store_true", help="print the summary as JSON")
    add_options(simulate)
    simulate.set_defaults(run=_simulate)

    plot = commands.add_parser("plot", help="draw a recording or a scene file")
    plot.add_argument("source", type=Path, help="recording, BAG:/TOPIC, or scene file (TOML)")
    plot.add_argument("-o", "--output", type=Path, required=True, help="picture: .png, .pdf, .svg")
    plot.add_argument(
        "--kind",
        choices=(
            *("overview", "chirp", "range-profile", "map", "detections", "range-angle"),
            *("range-time", "spectrogram", "tracks"),
            *("depth", "reflectance", "above", "experiment"),
        ),
        default="overview",
        metavar="KIND",
        help="%(choices)s (default: %(default)s); the last four need a scene file",
    )
    plot.add_argument("--frame", type=int, metavar="N", help="index of the frame (default: the middle one)")
    plot.add_argument(
        "--sequence", type=int, default=0, metavar="N", help="index of the sub-sequence, of several (default: 0)"
    )
    plot.add_argument("--channel", type=int, metavar="N", help="one channel (default: the powers of all, added)")
    plot.add_argument("--min-range", type=float, metavar="M", help="start of the range gate [m]")
    plot.add_argument("--max-range", type=float, metavar="M", help="end of the range axis, or of the range gate [m]")
    plot.add_argument("--max-velocity", type=float, metavar="V", help="end of the velocity axis to either side [m/s]")
    static.add_static(plot)
    source.add_config(plot)
    plot.set_defaults(run=_plot)

    view = commands.add_parser("view", help="show a scene file or a recording in the viewer Rerun (extra `rerun`)")
    view.add_argument("source", type=Path, help="recording, BAG:/TOPIC, or scene file (TOML), which is simulated")
    view.add_argument("-o", "--output", type=Path, metavar="FILE", help="write an .rrd file in place of opening it")
    static.add_static(view)
    source.add_config(view)
    view.set_defaults(run=_view)

    info = commands.add_parser("info", help="summarise a recording, a scene file or a bag, or report on a mesh")
    info.add_argument("source", type=Path, help="recording, scene file (TOML), ROS bag, or mesh (OBJ, STL, PLY, ...)")
    source.add_config(info)
    info.add_argument("--scale", type=float, default=1.0, metavar="M", help="metres per unit of a mesh (default: 1)")
    info.add_argument("--json", action="store_true", help="print as JSON")
    info.set_defaults(run=_info)

    schema = commands.add_parser("schema", help="list every key of a scene file with unit and default")
    schema.add_argument("--json", action="store_true", help="print the JSON schema, for editors")
    schema.set_defaults(run=_schema)

    process = commands.add_parser("process", help="find detections and tracks in a recording of any length")
    process.add_argument("source", type=Path, help="recording, bag with one, BAG:/TOPIC, or bare samples with --config")
    process.add_argument("-o", "--output", type=Path, metavar="DIR", help="write detections.csv and tracks.csv there")
    process.add_argument(
        "--bag", type=Path, metavar="BAG", help="write detections and range-velocity maps into a ROS bag"
    )
    process.add_argument("--samples", action="store_true", help="put the samples into that bag as well")
    process.add_argument("--overwrite", action="store_true", help="replace the results that are there")
    source.add_config(process)
    process.add_argument(
        "--sequence", type=int, default=0, metavar="N", help="sub-sequence of radars with several (default: the first)"
    )
    process.add_argument(
        "--false-alarm-rate", type=float, metavar="P", help="detections per cell of noise (default: 1e-6)"
    )
    process.add_argument("--method", choices=("ca", "os"), help="cell averaging or ordered statistic (default: ca)")
    process.add_argument("--min-range", type=float, metavar="M", help="nearest range of detections [m]")
    process.add_argument("--max-range", type=float, metavar="M", help="farthest range of detections [m]")
    static.add_static(process)
    process.add_argument("--range-only", action="store_true", help="track ranges and velocities, without angles")
    process.add_argument("--json", action="store_true", help="print the summary as JSON")
    process.set_defaults(run=_process)

    _add_compare(commands)
    sensor.add_parser(commands)
    return parser


def _add_compare(commands: Any) -> None:
    """Add the command `compare`."""
    parser = commands.add_parser("compare", help="compare recordings with each other and with the truth")
    parser.add_argument("a", metavar="A", help="recording, or BAG:/TOPIC; its clock, or the truth's, is the time base")
    parser.add_argument("b", metavar="B", nargs="?", help="recording, or BAG:/TOPIC, to compare with A")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="report (.html), or picture (.png, .pdf, .svg)"
    )
    parser.add_argument(
        "--truth",
        type=Path,
        metavar="FILE",
        help="motion capture (Motive's .csv, poses in a bag), or recording with truth (default: the recordings' own)",
    )
    parser.add_argument("--radar", metavar="NAME", help="body of motion capture that is the radar (default: radar)")
    parser.add_argument(
        "--radius",
        metavar="NAME=M,...",
        help="distance of the surfaces of bodies of motion capture before their origins [m]",
    )
    parser.add_argument(
        "--offset",
        metavar="S",
        help="added to the times of the last recording it gives those of the time base [s], or auto (default: 0); "
        "S,S for both",
    )
    parser.add_argument("--max-offset", type=float, metavar="S", help="largest offset that auto looks for [s]")
    parser.add_argument(
        "--targets",
        metavar="NAME,...",
        help="targets to compare; NAME=BODY names one anew (default: all that are seen)",
    )
    parser.add_argument(
        "--method", choices=("ca", "os"), help="detection by cell averaging or ordered statistic (default: ca)"
    )
    parser.add_argument("--names", metavar="NAME,NAME", help="names of the recordings (default: those of their files)")
    parser.add_argument("--min-range", type=float, metavar="M", help="nearest range of detections [m]")
    parser.add_argument(
        "--max-range", type=float, metavar="M", help="farthest range of detections, and of pictures [m]"
    )
    parser.add_argument(
        "--range-only", action="store_true", help="leave out angles, of radars whose receivers are not calibrated"
    )
    parser.add_argument("--time", type=float, metavar="S", help="time of the maps (default: the middle)")
    parser.add_argument("--json", action="store_true", help="print the tables as JSON")
    parser.set_defaults(run=_compare)


def _demo(options: argparse.Namespace) -> int:
    from radarcore.cli.demo import experiment

    result = experiment.run(
        options.output,
        duration=options.duration,
        ray_budget=options.ray_budget,
        with_robots=options.robots,
        say=_silent if options.json else print,
    )
    if options.json:
        print(json.dumps(_finite(result), indent=2, allow_nan=False))
    return 0


def _simulate(options: argparse.Namespace) -> int:
    check_options(options)
    if options.bag is not None:
        from radarcore.cli import bag

        began = time.perf_counter()
        recording, rate = bag.simulated(options)
    else:
        from radarcore.scenefile.load import load_scene

        simulation = load_scene(options.scene)
        began = time.perf_counter()
        recording, rate = (
            simulation.record(options.output, overwrite=options.overwrite, threads=options.threads),
            simulation.run.rate,
        )
    elapsed = time.perf_counter() - began
    ratio = len(recording) / rate / elapsed
    if options.json:
        summary = {
            "recording": str(options.output),
            "frames": len(recording),
            "cube_shape": list(recording.cube.shape),
            "seconds": elapsed,
            "real_time_factor": ratio,
        }
        print(json.dumps(summary, indent=2))
    else:
        print(
            f"{options.output}: {len(recording)} frames of {_by(recording.cube.shape[1:])} samples "
            f"in {elapsed:.1f} s, {ratio:.2f} x real time"
        )
    return 0


def _plot(options: argparse.Namespace) -> int:
    from radarcore.cli import plot as draw

    names = ("channel", "min_range", "max_range", "max_velocity", "remove_static")
    view = {name: getattr(options, name) for name in names}
    draw.draw(
        options.source,
        options.output,
        kind=options.kind,
        frame=options.frame,
        sequence=options.sequence,
        config=options.config,
        **view,
    )
    print(options.output)
    return 0


def _view(options: argparse.Namespace) -> int:
    from radarcore.cli import view

    return view.run(options)


def _info(options: argparse.Namespace) -> int:
    from radarcore.cli import info

    return info.run(options)


def _process(options: argparse.Namespace) -> int:
    from radarcore.cli import process

    return process.run(options)


def _compare(options: argparse.Namespace) -> int:
    from radarcore.cli import compare

    return compare.run(options)


def _schema(options: argparse.Namespace) -> int:
    from radarcore.scenefile import schema

    print(json.dumps(schema.json_schema(), indent=2) if options.json else schema.text())
    return 0


def _finite(value: Any) -> Any:
    """Copy of a value with null for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _silent(_: str) -> None:
    pass


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"radarcore: warning: {message}", file=sys.stderr)


def _by(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))


def _lines(error: BaseException) -> list[str]:
    """The message of an error, a line per fault; for the system's, file and reason without the number."""
    if isinstance(error, OSError) and error.filename is not None:
        # Python's keyword is an option here.
        reason = str(error.strerror).replace("overwrite=True", "--overwrite")
        return [f"{error.filename}: {reason}"]
    return str(error).splitlines() or [type(error).__name__]
