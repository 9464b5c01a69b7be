"""The command `radarcore sensor selftest`."""

from __future__ import annotations

import json
import platform
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from cyclopts import Parameter

from radarcore._core import __version__
from radarcore.cli.options import Json, OutputFile, Overwrite
from radarcore.cli.sensor.options import Port
from radarcore.cli.terminal import show, show_result
from radarcore.output import check_file, write_text

if TYPE_CHECKING:
    from radarcore.sensor.checks import Check

_Group = Literal["identity", "registers", "pattern", "noise", "frames"]


def run(
    port: Port = None,
    /,
    *,
    only: Annotated[list[_Group] | None, Parameter(metavar="GROUP")] = None,
    duration: Annotated[float, Parameter(metavar="S")] = 2.5,
    as_json: Json = False,
    output: OutputFile = None,
    overwrite: Overwrite = False,
    capture: Annotated[Path | None, Parameter(metavar="FILE")] = None,
) -> int:
    """Check a board: identity, registers, test pattern, noise, frame rate; the status is 1 if a check failed.

    Parameters
    ----------
    only : list of str
        one group of checks (default: all); may be repeated
    duration : float
        seconds of the frame rate check
    output : path
        also write a report (JSON) with all USB descriptors
    capture : path
        also log every byte of the conversation to FILE
    """
    from radarcore.sensor import SensorError, open_sensor
    from radarcore.sensor.checks import Check

    if output is not None:
        check_file(output, overwrite=overwrite)
    began = time.monotonic()
    checks: list[Check] = []
    board: dict[str, Any] | None = None

    def add(check: Check) -> None:
        checks.append(check)
        if not as_json:
            show_result(check.result, _text(check))

    try:
        with open_sensor(port, capture=capture) as sensor:
            board = dict(vars(sensor.info))
            seconds = time.monotonic() - began
            add(
                Check(
                    "open", "PASS", f"{sensor.info.port} answers {sensor.info.protocol} in {seconds:.1f} s", "a board"
                )
            )
            for check in sensor.selftest(only or get_args(_Group), duration=duration):
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
    if as_json:
        print(json.dumps(results, indent=2))
    else:
        count = Counter(check.result for check in checks)
        took = f"in {results['seconds']:.1f} s"
        show(f"{count['PASS']} passed, {count['FAIL']} failed, {count['SKIP']} skipped {took}")
    if output is not None:
        write_text(output, json.dumps(results | _descriptors(), indent=2) + "\n", overwrite=overwrite)
    if not as_json and (has_failed or output is not None):
        show(_advice(port, output))
    return int(has_failed)


def _text(check: Check) -> str:
    expected = f" (expected {check.expected})" if check.expected else ""
    return f"{check.name:<22} {check.measured}{expected}"


def _advice(port: str | None, output: Path | None) -> str:
    if output is not None:
        return f"{output}: attach it to an issue of the project; it contains the board's serial number"
    words = f" {port}" if port else ""
    return (
        f"to report: `radarcore sensor selftest{words} -o report.json`, and attach that file to an issue of the project"
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
