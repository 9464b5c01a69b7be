"""The commands `radarcore sensor record` and `view`."""

from __future__ import annotations

import errno
import re
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from radarcore import check
from radarcore.cli.options import OPTIONS, Count, Flag, Output, OutputFolder, one_of_several
from radarcore.cli.sensor.options import Port, Speed
from radarcore.cli.sensor.settings import (
    NOT_SET,
    BoardSettings,
    gains_of,
    radar_of,
    refuse_settings,
    sight,
    words_of_options,
)
from radarcore.cli.terminal import show
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.recording.writer import check_room
from radarcore.simulate.schedule import frame_times

if TYPE_CHECKING:
    from radarcore.scenefile.simulation import Simulation

_LENGTH = one_of_several()


def run_record(
    port: Port = None,
    /,
    *,
    output: Output,
    overwrite: Flag = False,
    duration: Annotated[float | None, Parameter(metavar="S", group=(OPTIONS, _LENGTH))] = None,
    frames: Annotated[Count, Parameter(group=(OPTIONS, _LENGTH))] = None,
    capture: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    settings: BoardSettings = NOT_SET,
) -> None:
    """Record from a board, until Ctrl-C or for a duration.

    Parameters
    ----------
    output : path
        recording: a new directory
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

    # What is wrong without a board is told without one.
    wanted = radar_of(settings)
    if frames is not None:
        check.count("--frames", frames)
    if duration is not None:
        check.positive("--duration", duration, "s")
    check_room(output, overwrite)
    with open_sensor(port, capture=capture) as sensor:
        with words_of_options():
            achieved = sensor.configure(wanted, **gains_of(settings))
        show(f"{sensor.info.port}: {sensor.info.chip}, firmware {sensor.info.firmware}")
        for line in (*_differences(wanted, achieved), *_gain(settings.gain, sensor.source())):
            show(f"  {line}")
        show(f"  {sight(achieved)}")
        began, before = time.perf_counter(), _written_at(output)
        try:
            recording = sensor.record(output, duration=duration, num_frames=frames, overwrite=overwrite)
        except KeyboardInterrupt:
            has_length = duration is not None or frames is not None
            if has_length or _written_at(output) == before:  # ended before it began
                raise
            recording = Recording.load(output)  # as long as was wanted
        elapsed = time.perf_counter() - began
        lost = sensor.num_lost
    show(f"{output}: {len(recording)} frames in {elapsed:.1f} s, {lost} lost")


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


def run_view(
    source: Annotated[str | None, Parameter(metavar="SOURCE")] = None,
    /,
    *,
    output: OutputFolder = None,
    overwrite: Flag = False,
    frames: Count = None,
    speed: Speed = 1.0,
    every: Annotated[float, Parameter(metavar="S")] = 1.0,
    remove_static: Annotated[bool | None, Parameter(negative=("--no-remove-static", "--keep-static"))] = None,
    settings: BoardSettings = NOT_SET,
) -> None:
    """Live view of a board, a recording or a scene.

    Parameters
    ----------
    source : str
        recording, scene file (TOML), or port of a board (default: the first board that responds)
    output : path
        write pictures to DIR, open no window
    overwrite : bool
        replace pictures of an earlier view
    frames : int
        end after N frames
    speed : float
        replay speed of a recording or scene: factor of real time, or max (default: 1)
    every : float
        seconds between pictures
    remove_static : bool
        subtract static clutter, or leave it in (default: out of sensors and their recordings)
    """
    from radarcore import plot

    plot.require()
    if frames is not None:
        check.count("--frames", frames)
    check.positive("--every", every, "s")
    with ExitStack() as stack:
        # Pictures need not wait for anybody.
        shown, title, is_sensor = _frames(source, None if output is not None else speed, settings, stack)
        plot.view(
            islice(shown, frames),
            output=output,
            overwrite=overwrite,
            every=every,
            title=title,
            max_range=settings.max_range,
            remove_static=remove_static,
            hold=not is_sensor,
            say=show,
        )


def _frames(
    source: str | None, speed: float | None, settings: BoardSettings, stack: ExitStack
) -> tuple[Iterator[Frame], str, bool]:
    """Frames of a source, its name, and true for a sensor."""
    if source is not None and not _is_port(source):
        path = Path(source)
        if path.suffix == ".toml":
            refuse_settings(settings, source)
            from radarcore.scenefile.load import load_scene  # takes longer to load than the rest

            return _paced(load_scene(path), speed), path.name, False
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, "no such recording, scene file or port", source)
        if not path.is_char_device():
            refuse_settings(settings, source)
            return Recording.load(path).replay(speed=speed), path.resolve().name, False
    from radarcore.sensor import open_sensor

    wanted = radar_of(settings)
    sensor = stack.enter_context(open_sensor(source))
    with words_of_options():
        achieved = sensor.configure(wanted, **gains_of(settings))
    show(f"{sensor.info.port}: {sensor.info.chip}, {sight(achieved)}")
    return sensor.frames(), f"{sensor.info.chip} on {sensor.info.port}", True


def _is_port(source: str) -> bool:
    """True for the name of a port or a ``capture:``; ``COM3`` is a port, ``COMPLETE`` a file."""
    return (
        source.startswith(("usb:", "/dev/", "capture:")) or re.fullmatch(r"COM\d+", source, re.IGNORECASE) is not None
    )


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
