"""The commands `radarcore sensor`: boards, recordings of them, the live view, virtual boards and the self-test."""

from __future__ import annotations

import json
import math
import platform
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from cyclopts import Parameter

from radarcore import check
from radarcore._core import __version__
from radarcore.cli.board_settings import NOT_SET, BoardSettings, gains_of, radar_of, sight
from radarcore.cli.options import (
    OPTIONS,
    Count,
    Flag,
    Json,
    OutputFile,
    OutputFolder,
    Overwrite,
    Port,
    Quiet,
    Seconds,
    Source,
    Speed,
    one_of_several,
)
from radarcore.cli.terminal import complain, show, show_result
from radarcore.output import check_file, write_text
from radarcore.radar.radar import Radar
from radarcore.recording.native import check_room
from radarcore.recording.recording import Recording
from radarcore.table import Table

if TYPE_CHECKING:
    from radarcore.scenefile.load import Simulation
    from radarcore.sensor.checks import Check

_LENGTH = one_of_several()

_Group = Literal["identity", "registers", "pattern", "noise", "frames"]


def run_list(*, as_json: Json = False) -> int:
    """List the boards that respond; the status is 1 if there is none."""
    from radarcore.sensor import list_sensors

    found = list_sensors()
    if as_json:
        print(json.dumps([vars(info) for info in found], indent=2))
        return 0
    if not found:
        complain("no radar board answers; `radarcore sensor selftest -o FILE` writes down what is on USB")
        return 1
    header = ("port", "board", "chip", "firmware", "serial number")
    rows = [(info.port, info.name, info.chip, info.firmware, info.serial_number) for info in found]
    show(Table(header, rows, num_left=len(header)))
    return 0


def show_board(port: str, as_json: bool) -> None:
    """Print type and temperature of a board, for `radarcore info`."""
    from radarcore.sensor import open_sensor

    with open_sensor(port) as sensor:
        facts = {**vars(sensor.info), "temperature [deg C]": round(sensor.temperature(), 1)}
    if as_json:
        print(json.dumps(facts, indent=2))
    else:
        show(Table((), [(name.replace("_", " "), str(value)) for name, value in facts.items()], num_left=2))


def run_record(
    port: Port = None,
    /,
    *,
    output: OutputFolder = None,
    overwrite: Flag = False,
    duration: Annotated[float | None, Parameter(metavar="S", group=(OPTIONS, _LENGTH))] = None,
    frames: Annotated[Count, Parameter(group=(OPTIONS, _LENGTH))] = None,
    capture: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    _quiet: Quiet = False,
    settings: BoardSettings = NOT_SET,
) -> None:
    """Record from a board, until Ctrl-C or for a duration.

    Parameters
    ----------
    output : path
        recording: a new directory (default: recording-DATE-TIME)
    overwrite : bool
        replace an existing recording
    duration : float
        seconds
    frames : int
        frames
    capture : path
        also log every byte of the conversation to FILE
    """
    from radarcore.sensor import open_sensor

    # Faults that need no board are reported before one is opened.
    wanted = radar_of(settings)
    if frames is not None:
        check.count("frames", frames)
    if duration is not None:
        check.positive("duration", duration, "s")
    output = output or Path(f"recording-{datetime.now():%Y%m%d-%H%M%S}")
    check_room(output, overwrite)
    with open_sensor(port, capture=capture) as sensor:
        achieved = sensor.configure(wanted, **gains_of(settings))
        show(f"{sensor.info.port}: {sensor.info.chip}, firmware {sensor.info.firmware}")
        gain = sensor.source().get("infineon", {}).get("if_gain_dB")
        asked = [] if None in (settings.if_gain_db, gain) else [("IF gain", settings.if_gain_db, gain, "dB")]
        for text, want, got, unit in [*_waveforms(wanted, achieved), *asked]:
            show(f"  {text:<19} {want:.9g} {unit} asked, {got:.9g} {unit} achieved")
        show(f"  {sight(achieved)}")
        began, before = time.perf_counter(), _written_at(output)
        try:
            recording = sensor.record(output, duration=duration, num_frames=frames, overwrite=overwrite)
        except KeyboardInterrupt:
            has_length = duration is not None or frames is not None
            if has_length or _written_at(output) == before:  # it had not begun
                raise
            recording = Recording.load(output)
        elapsed = time.perf_counter() - began
        show(f"{output}: {len(recording)} frames in {elapsed:.1f} s, {sensor.num_lost} lost")


def _written_at(path: Path) -> int | None:
    """Time at which the description of a recording was written; None where there is none."""
    try:
        return (path / "meta.json").stat().st_mtime_ns
    except OSError:
        return None


def _waveforms(wanted: Radar, achieved: Radar) -> Iterator[tuple[str, float, float, str]]:
    """Requested and achieved numbers of the waveform, with their unit."""
    for name, text, scale, unit in (
        ("center_frequency", "centre of the band", 1e-9, "GHz"),
        ("bandwidth", "sampled bandwidth", 1e-6, "MHz"),
        ("sample_rate", "sample rate", 1e-3, "kHz"),
        ("chirp_interval", "chirp interval", 1e6, "us"),
        ("frame_interval", "frame interval", 1e3, "ms"),
    ):
        yield text, scale * getattr(wanted.waveform, name), scale * getattr(achieved.waveform, name), unit


def run_selftest(
    port: Port = None,
    /,
    *,
    only: Annotated[list[_Group] | None, Parameter(metavar="GROUP")] = None,
    duration: Annotated[float, Parameter(metavar="S")] = 2.5,
    as_json: Json = False,
    _quiet: Quiet = False,
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
    results: list[Check] = []
    board: dict[str, Any] | None = None

    def add(result: Check) -> None:
        results.append(result)
        if not as_json:
            expected = f" (expected {result.expected})" if result.expected else ""
            show_result(result.result, f"{result.name:<22} {result.measured}{expected}")

    try:
        with open_sensor(port, capture=capture) as sensor:
            board = dict(vars(sensor.info))
            seconds = time.monotonic() - began
            text = f"{sensor.info.port} answers {sensor.info.protocol} in {seconds:.1f} s"
            add(Check("open", "PASS", text, "a board"))
            for result in sensor.selftest(only or get_args(_Group), duration=duration):
                add(result)
    except SensorError as error:
        add(Check("open" if board is None else "close", "FAIL", " ".join(str(error).split()), "a board that answers"))
    report = {
        "radarcore": __version__,
        "system": platform.platform(),
        "seconds": round(time.monotonic() - began, 2),
        "board": board,
        "checks": [vars(result) for result in results],
    }
    has_failed = any(result.result == "FAIL" for result in results)
    if as_json:
        print(json.dumps(report, indent=2))
    else:
        count = Counter(result.result for result in results)
        took = f"in {report['seconds']:.1f} s"
        show(f"{count['PASS']} passed, {count['FAIL']} failed, {count['SKIP']} skipped {took}")
    if output is not None:
        write_text(output, json.dumps(report | _descriptors(), indent=2) + "\n", overwrite=overwrite)
        if not as_json:
            show(f"{output}: attach it to an issue of the project; it contains the board's serial number")
    elif has_failed and not as_json:
        call = " ".join(["radarcore sensor selftest", *([port] if port else []), "-o report.json"])
        show(f"to report: `{call}`, and attach that file to an issue of the project")
    return int(has_failed)


def _descriptors() -> dict[str, Any]:
    """Ports and USB descriptors, or why there are none."""
    from radarcore.sensor import SensorError
    from radarcore.sensor.transport import ports

    found: dict[str, Any] = {}
    try:
        found["ports"] = [vars(replace(port, device=None)) for port in ports.find_ports()]
        found["usb"] = ports.describe_usb()
    except (SensorError, ImportError) as error:
        found["errors"] = [str(error)]
    return found


def run_serve(
    source: Source,
    /,
    *,
    link: Annotated[Path | None, Parameter(metavar="PATH")] = None,
    force: Flag = False,
    speed: Speed = 1.0,
    latency: Annotated[float, Parameter(metavar="S")] = 1e-3,
    receiver: Literal["measured", "ideal"] = "measured",
    duration: Seconds = None,
    threads: Count = None,
    _quiet: Quiet = False,
) -> None:
    """Serve a simulated scene or a recording by a board's protocol.

    Parameters
    ----------
    source : path
        scene file (TOML), or recording with ADC codes
    link : path
        also make a symbolic link to the port
    force : bool
        replace a symbolic link of that name, as a killed server leaves one behind
    speed : float
        factor of real time, or max: as fast as the client reads (default: 1)
    latency : float
        seconds from a request to its answer
    receiver : str
        receivers behind a scene: with leakage and offsets of the chip as measured, or by the data sheet alone
    duration : float
        end after S seconds
    threads : int
        threads of the simulator (default: all cores)
    """
    from radarcore.sensor.emulator.pty import PtyPort
    from radarcore.virtual.board import virtual_board

    if duration is not None:
        check.positive("duration", duration, "s")
    frames, settings = _served(source)
    with (
        virtual_board(frames, latency=latency, speed=speed, threads=threads, receiver=receiver) as board,
        PtyPort(board, link=link, replace_link=force) as port,
    ):
        try:
            name = link or port.path
            show(f"listening on {name}")
            show(f"{source} as a BGT60TR13C, protocol Strata; {settings}")
            show(f"connect by `radarcore view {name}`; Ctrl-C ends the server")
            deadline = math.inf if duration is None else time.monotonic() + duration
            while time.monotonic() < deadline:
                time.sleep(0.2)
                for line in board.news():
                    print(line, file=sys.stderr, flush=True)
        except KeyboardInterrupt:
            print("stopped", file=sys.stderr)
    show(f"{board.num_frames} frames delivered, {board.num_lost} lost")


def _served(path: Path) -> tuple[Simulation | Recording, str]:
    """Source of the frames, and what settings a client may have."""
    if path.suffix == ".toml":
        from radarcore.scenefile.load import load_scene  # takes longer to load than the rest

        return load_scene(path), "the client sets samples, chirps and rate"
    recording = Recording.load(path)
    if (raw := recording.raw) is None or len(raw) == 0:
        raise ValueError(
            f"{path}: expected at least one frame with codes of an ADC, got none; of a simulated recording, serve the "
            "scene file"
        )
    num_rx, num_chirps, num_samples = raw.shape[1:]
    rate = 1.0 / recording.radar.waveform.frame_interval
    shape = f"{num_rx} receivers, {num_chirps} chirps and {num_samples} samples"
    return recording, f"{len(raw)} frames over and over, recorded at {rate:.4g} Hz; the client must set {shape}"
