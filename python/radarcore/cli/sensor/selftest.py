"""The command `radarcore sensor selftest`."""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarcore._core import __version__

if TYPE_CHECKING:
    from radarcore.sensor.checks import Check

_GROUPS = ("identity", "registers", "pattern", "noise", "frames")


def add_parsers(actions: Any) -> None:
    """Add `selftest` to the actions of `radarcore sensor`."""
    selftest = actions.add_parser(
        "selftest",
        help="check a board: identity, registers, test pattern, noise, frame rate",
        description="Check a board and print PASS, FAIL or SKIP for each thing, as measured and as expected. It takes "
        "less than 20 s; nothing should be within half a metre of the board. The exit status is 1 if a check failed.",
    )
    selftest.add_argument("port", nargs="?", metavar="PORT", help="port (default: the first board that responds)")
    selftest.add_argument(
        "--only", action="append", choices=_GROUPS, metavar="GROUP", help="%(choices)s (default: all); may be repeated"
    )
    selftest.add_argument(
        "--duration",
        type=float,
        default=2.5,
        metavar="S",
        help="seconds of the frame rate check (default: %(default)s)",
    )
    selftest.add_argument("--json", action="store_true", help="print as JSON")
    selftest.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="also write a report (JSON) with all USB descriptors"
    )
    selftest.add_argument(
        "--capture", type=Path, metavar="FILE", help="also log every byte of the conversation to FILE"
    )
    selftest.set_defaults(run=_selftest)


def _selftest(options: argparse.Namespace) -> int:
    from radarcore.sensor import SensorError, open_sensor
    from radarcore.sensor.checks import Check

    began = time.monotonic()
    checks: list[Check] = []
    board: dict[str, Any] | None = None

    def add(check: Check) -> None:
        checks.append(check)
        if not options.json:
            print(_line(check), flush=True)

    try:
        with open_sensor(options.port, capture=options.capture) as sensor:
            board = dict(vars(sensor.info))
            seconds = time.monotonic() - began
            add(
                Check(
                    "open", "PASS", f"{sensor.info.port} answers {sensor.info.protocol} in {seconds:.1f} s", "a board"
                )
            )
            for check in sensor.selftest(options.only or _GROUPS, duration=options.duration):
                add(check)
    except SensorError as error:
        add(Check("open" if board is None else "close", "FAIL", " ".join(str(error).split()), "a board that answers"))
    results = {
        "radarcore": __version__,
        "system": platform.platform(),
        "seconds": round(time.monotonic() - began, 2),
        "board": board,
        "checks": [vars(check) for check in checks],
    }
    has_failed = any(check.result == "FAIL" for check in checks)
    if options.json:
        print(json.dumps(results, indent=2))
    else:
        count = Counter(check.result for check in checks)
        took = f"in {results['seconds']:.1f} s"
        print(f"{count['PASS']} passed, {count['FAIL']} failed, {count['SKIP']} skipped {took}")
    if options.output is not None:
        options.output.write_text(json.dumps(results | _descriptors(), indent=2) + "\n")
    if not options.json and (has_failed or options.output is not None):
        print(_advice(options))
    return int(has_failed)


def _line(check: Check) -> str:
    expected = f" (expected {check.expected})" if check.expected else ""
    return f"{check.result}  {check.name:<22} {check.measured}{expected}"


def _advice(options: argparse.Namespace) -> str:
    if options.output is not None:
        return f"{options.output}: attach it to an issue of the project; it contains the board's serial number"
    port = f" {options.port}" if options.port else ""
    return (
        f"to report: `radarcore sensor selftest{port} -o report.json`, and attach that file to an issue of the project"
    )


def _descriptors() -> dict[str, Any]:
    """Ports and USB descriptors as in `radarcore sensor report`, or why there are none."""
    from radarcore.sensor import SensorError, transport

    found: dict[str, Any] = {}
    try:
        found["ports"] = [vars(port) for port in transport.find_ports()]
        found["usb"] = transport.describe_usb()
    except (SensorError, ImportError) as error:
        found["errors"] = [str(error)]
    return found
