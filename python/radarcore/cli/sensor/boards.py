"""The commands `radarcore sensor list`, `info` and `report`: the boards that there are."""

from __future__ import annotations

import json
import sys

from radarcore.cli.options import Json, OutputFile, Overwrite
from radarcore.cli.sensor.options import Port
from radarcore.cli.terminal import Table, show, show_facts
from radarcore.output import write_text


def run_list(*, as_json: Json = False) -> int:
    """List the boards that respond; the status is 1 if there is none."""
    from radarcore.sensor import list_sensors

    found = list_sensors()
    if as_json:
        print(json.dumps([vars(info) for info in found], indent=2))
        return 0
    if not found:
        print("no radar board answers; `radarcore sensor report` lists what is on USB", file=sys.stderr)
        return 1
    lines = []
    for info in found:
        number = f", serial number {info.serial_number}" if info.serial_number else ""
        lines.append(f"{info.port}: {info.name}, {info.chip}, firmware {info.firmware}{number}")
    header = ("port", "board", "chip", "firmware", "serial number")
    rows = [(info.port, info.name, info.chip, info.firmware, info.serial_number) for info in found]
    show(Table(header, rows, lines, num_left=len(header)))
    return 0


def run_info(port: Port = None, /, *, as_json: Json = False) -> None:
    """Print type and temperature of a board."""
    from radarcore.sensor import open_sensor

    with open_sensor(port) as sensor:
        facts = {**vars(sensor.info), "temperature [deg C]": round(sensor.temperature(), 1)}
    if as_json:
        print(json.dumps(facts, indent=2))
    else:
        texts = [(name.replace("_", " "), str(value)) for name, value in facts.items()]
        show_facts(texts, max(map(len, facts)))


def run_report(*, output: OutputFile = None, overwrite: Overwrite = False) -> None:
    """Collect the USB descriptors of the boards, for a bug report.

    Parameters
    ----------
    output : path
        report file (default: print the report)
    """
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
    if output is None:
        print(text, end="")
    else:
        write_text(output, text, overwrite=overwrite)
        print(f"{output}: {len(report['usb'])} boards on USB, {len(report['ports'])} ports")
