"""The command `radarcore sensor`, with a file per group of its own commands."""

from __future__ import annotations

from typing import Any

from radarcore.cli.sensor import boards, measure, selftest, serve


def add_parser(commands: Any) -> None:
    """Add `sensor` with its own commands to those of `radarcore`."""
    sensor = commands.add_parser("sensor", help="real sensors, and virtual sensors of simulated scenes")
    actions = sensor.add_subparsers(dest="action", required=True, metavar="ACTION")
    for group in (boards, measure, serve, selftest):
        group.add_parsers(actions)
