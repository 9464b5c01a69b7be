"""The commands `radarcore sensor list`, `info` and `report`: the boards that there are."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from radarcore.cli.sensor.options import add_port


def add_parsers(actions: Any) -> None:
    """Add `list`, `info` and `report` to the commands of `radarcore sensor`."""
    listing = actions.add_parser("list", help="list the boards that respond")
    listing.add_argument("--json", action="store_true", help="print as JSON")
    listing.set_defaults(run=_list)

    info = actions.add_parser("info", help="print type and temperature of a board")
    add_port(info)
    info.add_argument("--json", action="store_true", help="print as JSON")
    info.set_defaults(run=_info)

    report = actions.add_parser("report", help="collect the USB descriptors of the boards, for a bug report")
    report.add_argument("-o", "--output", type=Path, metavar="FILE", help="report file (default: print the report)")
    report.set_defaults(run=_report)


def _list(options: argparse.Namespace) -> int:
    from radarcore.sensor import list_sensors

    found = list_sensors()
    if options.json:
        print(json.dumps([vars(info) for info in found], indent=2))
        return 0
    for info in found:
        number = f", serial number {info.serial_number}" if info.serial_number else ""
        print(f"{info.port}: {info.name}, {info.chip}, firmware {info.firmware}{number}")
    if not found:
        print("no radar board answers; `radarcore sensor report` lists what is on USB", file=sys.stderr)
        return 1
    return 0


def _info(options: argparse.Namespace) -> int:
    from radarcore.sensor import open_sensor

    with open_sensor(options.port) as sensor:
        facts = {**vars(sensor.info), "temperature [deg C]": round(sensor.temperature(), 1)}
    if options.json:
        print(json.dumps(facts, indent=2))
    else:
        width = max(map(len, facts))
        for name, value in facts.items():
            print(f"{name.replace('_', ' '):<{width}}  {value}")
    return 0


def _report(options: argparse.Namespace) -> int:
    import platform

    from radarcore._core import __version__
    from radarcore.sensor import transport

    report = {
        "radarcore": __version__,
        "system": platform.platform(),
        "ports": [vars(port) for port in transport.find_ports()],
        "usb": transport.describe_usb(),
    }
    text = json.dumps(report, indent=2) + "\n"
    if options.output is None:
        print(text, end="")
    else:
        options.output.write_text(text)
        print(f"{options.output}: {len(report['usb'])} boards on USB, {len(report['ports'])} ports")
    return 0
