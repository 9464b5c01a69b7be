"""The command `radarcore sensor`."""

from __future__ import annotations

import argparse
import errno
import json
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any

from radarcore import check
from radarcore.cli import sensor_selftest
from radarcore.radar.presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import load_scene
from radarcore.scenefile.simulation import Simulation
from radarcore.simulate.times import frame_times


def add_parser(commands: Any) -> None:
    """Add `sensor` with its own commands to those of `radarcore`."""
    sensor = commands.add_parser("sensor", help="real sensors, and virtual sensors of simulated scenes")
    actions = sensor.add_subparsers(dest="action", required=True, metavar="ACTION")

    listing = actions.add_parser("list", help="list the boards that respond")
    listing.add_argument("--json", action="store_true", help="print as JSON")
    listing.set_defaults(run=_list)

    info = actions.add_parser("info", help="print type and temperature of a board")
    _add_port(info)
    info.add_argument("--json", action="store_true", help="print as JSON")
    info.set_defaults(run=_info)

    record = actions.add_parser("record", help="record from a board, until Ctrl-C or for a duration")
    _add_port(record)
    _add_settings(record)
    record.add_argument("-o", "--output", type=Path, required=True, help="recording: a new directory")
    record.add_argument("--overwrite", action="store_true", help="replace an existing recording")
    length = record.add_mutually_exclusive_group()
    length.add_argument("--duration", type=float, metavar="S", help="seconds")
    length.add_argument("--frames", type=int, metavar="N", help="frames")
    record.add_argument("--capture", type=Path, metavar="FILE", help="also log every byte of the conversation to FILE")
    record.set_defaults(run=_record)

    view = actions.add_parser("view", help="live view of a board, a recording or a scene")
    view.add_argument(
        "source",
        nargs="?",
        metavar="SOURCE",
        help="recording, scene file (TOML), or port of a board (default: the first board that responds)",
    )
    _add_settings(view)
    view.add_argument("-o", "--output", type=Path, metavar="DIR", help="write pictures to DIR, open no window")
    view.add_argument("--frames", type=int, metavar="N", help="end after N frames")
    view.add_argument(
        "--speed",
        type=_speed,
        default=1.0,
        metavar="X",
        help="replay speed of a recording or scene: factor of real time, or max (default: 1)",
    )
    view.add_argument("--every", type=float, default=1.0, metavar="S", help="seconds between pictures (default: 1)")
    view.add_argument(
        "--remove-static",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="subtract static clutter (default: for sensors and their recordings)",
    )
    view.set_defaults(run=_view)

    serve = actions.add_parser("serve", help="serve a simulated scene or a recording by a board's protocol")
    serve.add_argument("source", type=Path, metavar="SOURCE", help="scene file (TOML), or recording with ADC codes")
    serve.add_argument("--protocol", choices=("strata", "comlib"), default="strata", help="default: %(default)s")
    serve.add_argument("--link", type=Path, metavar="PATH", help="also make a symbolic link to the port")
    serve.add_argument(
        "--speed",
        type=_speed,
        default=1.0,
        metavar="X",
        help="factor of real time, or max: as fast as the client reads (default: 1)",
    )
    serve.add_argument("--duration", type=float, metavar="S", help="end after S seconds")
    serve.add_argument("--threads", type=int, metavar="N", help="threads of the simulator (default: all cores)")
    serve.set_defaults(run=_serve)

    report = actions.add_parser("report", help="collect the USB descriptors of the boards, for a bug report")
    report.add_argument("-o", "--output", type=Path, metavar="FILE", help="report file (default: print the report)")
    report.set_defaults(run=_report)

    sensor_selftest.add_parser(actions)


def _speed(text: str) -> float | None:
    """Factor of real time, None for as fast as it goes."""
    return None if text == "max" else float(text)


def _add_port(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "port",
        nargs="?",
        metavar="PORT",
        help="/dev/ttyACM0, COM3, usb:BUS-ADDRESS or usb:VENDOR:PRODUCT (default: the first board that responds)",
    )


def _add_settings(parser: argparse.ArgumentParser) -> None:
    settings = parser.add_argument_group("settings of a board")
    settings.add_argument("--radar", type=Path, metavar="SCENE", help="take the radar of a scene file (TOML)")
    settings.add_argument("--rate", type=float, metavar="HZ", help="frames per second")
    settings.add_argument("--chirps", type=int, metavar="N", help="chirps per frame")
    settings.add_argument("--samples", type=int, metavar="N", help="samples per chirp")
    settings.add_argument("--gain", type=int, metavar="DB", help="IF gain, 18 to 60 dB")
    settings.add_argument("--power", type=int, metavar="LEVEL", help="transmit power, 0 to 31")


def _radar(options: argparse.Namespace) -> Radar:
    """Radar from the options."""
    given = {"num_chirps": options.chirps, "num_samples": options.samples}
    changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if options.rate is not None:
        if not options.rate > 0.0:
            raise ValueError(f"--rate: expected a positive number of frames per second, got {options.rate:g}")
        changes["frame_interval"] = 1.0 / options.rate
    if options.radar is None:
        return bgt60tr13c(**changes)
    radar = load_scene(options.radar).radar
    if not changes:
        return radar
    values = radar.to_dict()
    values["waveform"] = radar.waveform.replace(**changes).to_dict()
    return Radar.from_dict(values)


def _gains(options: argparse.Namespace) -> dict[str, Any]:
    given = {"if_gain_db": options.gain, "tx_power_level": options.power}
    return {name: value for name, value in given.items() if value is not None}


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


def _record(options: argparse.Namespace) -> int:
    from radarcore.sensor import open_sensor

    with open_sensor(options.port, capture=options.capture) as sensor:
        wanted = _radar(options)
        achieved = sensor.configure(wanted, **_gains(options))
        print(f"{sensor.info.port}: {sensor.info.chip}, firmware {sensor.info.firmware}")
        for line in _differences(wanted, achieved):
            print(f"  {line}")
        began = time.perf_counter()
        try:
            recording = sensor.record(
                options.output, duration=options.duration, num_frames=options.frames, overwrite=options.overwrite
            )
        except KeyboardInterrupt:
            if options.duration is not None or options.frames is not None:
                raise
            recording = Recording.load(options.output)  # as long as was wanted
        elapsed = time.perf_counter() - began
        lost = sensor.num_lost
    print(f"{options.output}: {len(recording)} frames in {elapsed:.1f} s, {lost} lost")
    return 0


def _differences(wanted: Radar, achieved: Radar) -> list[str]:
    """Numbers of the waveform as asked for and as achieved."""
    names = {
        "center_frequency": ("centre of the band", 1e-9, "GHz"),
        "bandwidth": ("sampled bandwidth", 1e-6, "MHz"),
        "sample_rate": ("sample rate", 1e-3, "kHz"),
        "chirp_interval": ("chirp interval", 1e6, "us"),
        "frame_interval": ("frame interval", 1e3, "ms"),
    }
    lines = []
    for name, (text, scale, unit) in names.items():
        asked, got = (scale * getattr(radar.waveform, name) for radar in (wanted, achieved))
        lines.append(f"{text:<19} {asked:.9g} {unit} asked, {got:.9g} {unit} achieved")
    return lines


def _view(options: argparse.Namespace) -> int:
    from radarcore import plot

    plot.require()
    with ExitStack() as stack:
        frames, title, is_sensor = _frames(options, stack)
        plot.view(
            islice(frames, options.frames),
            output=options.output,
            every=options.every,
            title=title,
            remove_static=options.remove_static,
            hold=not is_sensor,
            say=print,
        )
    return 0


def _frames(options: argparse.Namespace, stack: ExitStack) -> tuple[Iterator[Frame], str, bool]:
    """Frames of a source, its name, and true for a sensor."""
    source = options.source
    # Pictures need not wait for anybody.
    speed = None if options.output is not None else options.speed
    if source is not None and not source.startswith(("usb:", "/dev/", "COM")):
        path = Path(source)
        if path.suffix == ".toml":
            return _paced(load_scene(path), speed), source, False
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, "no such recording, scene file or port", source)
        if not path.is_char_device():
            return Recording.load(path).replay(speed=speed), source, False
    from radarcore.sensor import open_sensor

    sensor = stack.enter_context(open_sensor(source))
    sensor.configure(_radar(options), **_gains(options))
    return sensor.frames(), f"{sensor.info.chip} on {sensor.info.port}", True


def _paced(simulation: Simulation, speed: float | None) -> Iterator[Frame]:
    """Frames of a scene when they are due, or later."""
    speed = None if speed is None else check.positive("--speed", speed)
    run = simulation.run
    simulator = simulation.simulator()
    began = time.monotonic()
    for at in frame_times(run.start, run.stop, run.rate):
        frame = simulator.frame(at)
        if speed is not None:
            time.sleep(max(0.0, began + (at - run.start) / speed - time.monotonic()))
        yield frame


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
