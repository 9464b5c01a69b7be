"""The command `radarcore`."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

from radarcore import __version__


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0, 1 for bad input, 130 when interrupted."""
    options = _parser().parse_args(arguments)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            return int(options.run(options))
    except KeyboardInterrupt:
        print("radarcore: interrupted; what was recorded so far is readable", file=sys.stderr)
        return 130
    except (ValueError, OSError, ImportError) as error:
        print(f"radarcore: {_one_line(error)}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="radarcore", description="FMCW radar simulation for robotics.")
    parser.add_argument("--version", action="version", version=f"radarcore {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    demo = commands.add_parser("demo", help="simulate a small room for one second and compare with the truth")
    demo.add_argument("-o", "--output", type=Path, default=Path("out/demo"), help="directory (default: %(default)s)")
    demo.add_argument("--duration", type=float, default=1.0, metavar="S", help="seconds (default: %(default)s)")
    demo.add_argument("--resolution", type=int, default=256, metavar="N", help="rays across (default: %(default)s)")
    demo.add_argument(
        "--robots",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="UR10 and human meshes in the scene (default: if the extra `robots` is installed)",
    )
    demo.set_defaults(run=_demo)
    return parser


def _demo(options: argparse.Namespace) -> int:
    from radarcore import demo

    demo.run(options.output, duration=options.duration, resolution=options.resolution, with_robots=options.robots)
    return 0


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"radarcore: warning: {message}", file=sys.stderr)


def _one_line(error: Exception) -> str:
    """The message of an error; for the system's, file and reason without the number."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())
