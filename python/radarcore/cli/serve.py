"""The command `radarcore sensor serve`: a simulated scene or a recording as a board."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from radarcore import check
from radarcore.cli.options import Count, Flag, Seconds, Source, Speed
from radarcore.recording.recording import Recording

if TYPE_CHECKING:
    from radarcore.scenefile.load import Simulation

_BOARDS = {"strata": ("BGT60TR13C", "Strata"), "comlib": ("BGT60TR24B", "ComLib")}
"""Chip and protocol of the boards."""


def run(
    source: Source,
    /,
    *,
    protocol: Literal["strata", "comlib"] = "strata",
    link: Annotated[Path | None, Parameter(metavar="PATH")] = None,
    force: Flag = False,
    speed: Speed = 1.0,
    latency: Annotated[float, Parameter(metavar="S")] = 1e-3,
    receiver: Literal["measured", "ideal"] = "measured",
    duration: Seconds = None,
    threads: Count = None,
) -> None:
    """Serve a simulated scene or a recording by a board's protocol.

    Parameters
    ----------
    source : path
        scene file (TOML), or recording with ADC codes
    protocol : str
        of the board
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
    frames, settings = _source(source)
    chip, language = _BOARDS[protocol]
    with (
        virtual_board(
            frames,
            protocol=protocol,
            speed=speed,
            threads=threads,
            receiver=receiver,
            latency=latency,
        ) as board,
        PtyPort(board, link=link, replace_link=force) as port,
    ):
        try:
            name = link or port.path
            print(f"listening on {name}")
            print(f"{source} as a {chip}, protocol {language}; {settings}")
            print(f"connect by `radarcore sensor view {name}`; Ctrl-C ends the server", flush=True)
            _wait(duration, board.news)
        except KeyboardInterrupt:
            print("stopped", file=sys.stderr)
        finally:
            board.close()  # before the port, which waits for answers and thus for a frame that is being simulated
    print(f"{board.num_frames} frames delivered, {board.num_lost} lost")


def _wait(duration: float | None, news: Callable[[], list[str]]) -> None:
    """Print news as they come, for a duration or until an interrupt."""
    deadline = math.inf if duration is None else time.monotonic() + duration
    while time.monotonic() < deadline:
        time.sleep(0.2)
        for line in news():
            print(line, file=sys.stderr, flush=True)


def _source(path: Path) -> tuple[Simulation | Recording, str]:
    """Source of the frames, and what settings a client may have."""
    if path.suffix == ".toml":
        from radarcore.scenefile.load import load_scene  # takes longer to load than the rest

        return load_scene(path), "the client sets samples, chirps and rate"
    recording = Recording.load(path)
    raw = recording.raw
    if raw is None or len(raw) == 0:
        raise ValueError(
            f"{path}: expected at least one frame with codes of an ADC, got none; of a simulated recording, serve the "
            "scene file"
        )
    num_rx, num_chirps, num_samples = raw.shape[1:]
    rate = 1.0 / recording.radar.waveform.frame_interval
    shape = f"{num_rx} receivers, {num_chirps} chirps and {num_samples} samples"
    return recording, f"{len(raw)} frames over and over, recorded at {rate:.4g} Hz; the client must set {shape}"
