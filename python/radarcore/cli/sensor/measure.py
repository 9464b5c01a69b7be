"""The commands `radarcore sensor record` and `view`."""

from __future__ import annotations

import argparse
import errno
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any

from radarcore import check
from radarcore.cli.sensor.options import add_port, factor_of_real_time
from radarcore.cli.sensor.settings import add_settings, gains_of, radar_of, refuse_settings, sight, words_of_options
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.recording.writer import check_room
from radarcore.scenefile.load import load_scene
from radarcore.scenefile.simulation import Simulation
from radarcore.simulate.times import frame_times


def add_parsers(actions: Any) -> None:
    """Add `record` and `view` to the commands of `radarcore sensor`."""
    record = actions.add_parser("record", help="record from a board, until Ctrl-C or for a duration")
    add_port(record)
    add_settings(record)
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
    add_settings(view)
    view.add_argument("-o", "--output", type=Path, metavar="DIR", help="write pictures to DIR, open no window")
    view.add_argument("--frames", type=int, metavar="N", help="end after N frames")
    view.add_argument(
        "--speed",
        type=factor_of_real_time,
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
    view.add_argument(
        "--keep-static", dest="remove_static", action="store_false", default=None, help="leave static clutter in"
    )
    view.set_defaults(run=_view)


def _record(options: argparse.Namespace) -> int:
    from radarcore.sensor import open_sensor

    # What is wrong without a board is told without one.
    wanted = radar_of(options)
    if options.frames is not None:
        check.count("--frames", options.frames)
    if options.duration is not None:
        check.positive("--duration", options.duration, "s")
    check_room(options.output, options.overwrite)
    with open_sensor(options.port, capture=options.capture) as sensor:
        with words_of_options():
            achieved = sensor.configure(wanted, **gains_of(options))
        print(f"{sensor.info.port}: {sensor.info.chip}, firmware {sensor.info.firmware}")
        for line in (*_differences(wanted, achieved), *_gain(options.gain, sensor.source())):
            print(f"  {line}")
        print(f"  {sight(achieved)}")
        began, before = time.perf_counter(), _written_at(options.output)
        try:
            recording = sensor.record(
                options.output, duration=options.duration, num_frames=options.frames, overwrite=options.overwrite
            )
        except KeyboardInterrupt:
            has_length = options.duration is not None or options.frames is not None
            if has_length or _written_at(options.output) == before:  # ended before it began
                raise
            recording = Recording.load(options.output)  # as long as was wanted
        elapsed = time.perf_counter() - began
        lost = sensor.num_lost
    print(f"{options.output}: {len(recording)} frames in {elapsed:.1f} s, {lost} lost")
    return 0


def _written_at(path: Path) -> int | None:
    """Time at which the description of a recording was written; None where there is none."""
    try:
        return (path / "meta.json").stat().st_mtime_ns
    except OSError:
        return None


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


def _gain(asked: int | None, source: Mapping[str, Any]) -> list[str]:
    """The gain that was asked for and its nearest step."""
    achieved = source.get("infineon", {}).get("if_gain_dB")
    if asked is None or achieved is None:
        return []
    return [f"{'IF gain':<19} {asked} dB asked, {achieved} dB achieved"]


def _view(options: argparse.Namespace) -> int:
    from radarcore import plot

    plot.require()
    if options.frames is not None:
        check.count("--frames", options.frames)
    check.positive("--every", options.every, "s")
    with ExitStack() as stack:
        frames, title, is_sensor = _frames(options, stack)
        plot.view(
            islice(frames, options.frames),
            output=options.output,
            every=options.every,
            title=title,
            max_range=options.max_range,
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
            refuse_settings(options, source)
            return _paced(load_scene(path), speed), source, False
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, "no such recording, scene file or port", source)
        if not path.is_char_device():
            refuse_settings(options, source)
            return Recording.load(path).replay(speed=speed), source, False
    from radarcore.sensor import open_sensor

    wanted = radar_of(options)
    sensor = stack.enter_context(open_sensor(source))
    with words_of_options():
        achieved = sensor.configure(wanted, **gains_of(options))
    print(f"{sensor.info.port}: {sensor.info.chip}, {sight(achieved)}")
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
