"""The command `radarcore sensor serve`: a simulated scene or a recording as a board."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from radarcore.cli.sensor.options import factor_of_real_time
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import load_scene


def add_parsers(actions: Any) -> None:
    """Add `serve` to the commands of `radarcore sensor`."""
    serve = actions.add_parser("serve", help="serve a simulated scene or a recording by a board's protocol")
    serve.add_argument("source", type=Path, metavar="SOURCE", help="scene file (TOML), or recording with ADC codes")
    serve.add_argument("--protocol", choices=("strata", "comlib"), default="strata", help="default: %(default)s")
    serve.add_argument("--link", type=Path, metavar="PATH", help="also make a symbolic link to the port")
    serve.add_argument(
        "--speed",
        type=factor_of_real_time,
        default=1.0,
        metavar="X",
        help="factor of real time, or max: as fast as the client reads (default: 1)",
    )
    serve.add_argument("--duration", type=float, metavar="S", help="end after S seconds")
    serve.add_argument("--threads", type=int, metavar="N", help="threads of the simulator (default: all cores)")
    serve.set_defaults(run=_serve)


def _serve(options: argparse.Namespace) -> int:
    from radarcore.sensor.emulator.pty import PtyPort
    from radarcore.virtual.board import virtual_board

    if options.source.suffix == ".toml":
        served: Any = load_scene(options.source)
    else:
        served = Recording.load(options.source)
    with (
        virtual_board(served, protocol=options.protocol, speed=options.speed, threads=options.threads) as board,
        PtyPort(board, link=options.link) as port,
    ):
        print(f"listening on {options.link or port.path}", flush=True)
        deadline = None if options.duration is None else time.monotonic() + options.duration
        try:
            while deadline is None or time.monotonic() < deadline:
                time.sleep(0.2)
                for line in board.news():
                    print(line, file=sys.stderr, flush=True)
        except KeyboardInterrupt:
            print("stopped", file=sys.stderr)
    return 0
