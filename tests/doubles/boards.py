"""Emulated boards behind real transports, and distinguishable frames."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from doubles.usb_bus import EmulatedBus, cdc_device, vendor_device
from doubles.vendor_board import VendorBoard
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.sensor import Sensor, open_sensor
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.strata import CdcBoard, Controller
from radarcore.sensor.strata.packets import Request, Response

TRANSPORTS = ("cdc", "vendor", "pty")

SMALL = bgt60tr13c(num_samples=32, num_chirps=8, frame_interval=25e-3)
LARGE = bgt60tr13c(num_chirps=64, frame_interval=100e-3)
"""Two slices of 9216 bytes to a frame."""


CLI = "import sys\nfrom radarcore.cli.main import main\nsys.exit(main())"
"""Program that is the command `radarcore`."""


class _Process(subprocess.Popen[str]):
    """Process that does not outlive a test that fails."""

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        if kind is not None:
            self.kill()
        super().__exit__(kind, error, traceback)


def python(program: str, *arguments: object) -> subprocess.Popen[str]:
    """A process that Ctrl-C ends, also where the tests themselves run in the background of a shell."""
    interruptible = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    return _Process(
        [sys.executable, "-c", interruptible + program, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


_STEP = 131
"""Between the first codes of frames; odd, so that the number of a frame follows from its first code."""


class Numbered:
    """Frames whose codes tell their number, modulo 4096."""

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        wf = radar.waveform
        return numbered((radar.num_channels, wf.num_chirps, wf.num_samples), index)


def numbered(shape: tuple[int, ...], number: int) -> NDArray[np.uint16]:
    """Codes of a frame."""
    codes = (7 * np.arange(np.prod(shape)) + _STEP * number) % 4096
    return codes.astype(np.uint16).reshape(shape)


def number_of(codes: NDArray[np.uint16]) -> int:
    """Number of a frame, modulo 4096; fails if its codes match no frame."""
    number = int(codes.flat[0]) * pow(_STEP, -1, 4096) % 4096
    assert np.array_equal(codes, numbered(codes.shape, number)), f"codes of no frame; the first are of number {number}"
    return number


def change_answers(monkeypatch: pytest.MonkeyPatch, change: Callable[[Request, Response], Response]) -> None:
    """Let emulated boards answer with what a function makes of requests and their answers."""
    handle = Controller.handle
    monkeypatch.setattr(Controller, "handle", lambda self, request: change(request, handle(self, request)))


@contextmanager
def plugged(controller: Controller, transport: str) -> Iterator[tuple[dict[str, Any], Any]]:
    """Arguments that open an emulated board, and the board; `replug` of it puts it on the bus again."""
    if transport == "pty":
        board: Any = CdcBoard(controller)
        with PtyPort(board) as port:
            yield {"port": port.path}, board
    else:
        bus = EmulatedBus()
        kind, device_of = (VendorBoard, vendor_device) if transport == "vendor" else (CdcBoard, cdc_device)
        board: Any = kind(controller)
        bus.plug(device_of(board))
        board.replug = lambda: bus.plug(device_of(kind(controller)))
        yield {"usb_backend": bus}, board
    controller.close()


@contextmanager
def opened(
    controller: Controller, transport: str = "cdc", *, radar: Radar | None = None, **options: Any
) -> Iterator[Sensor]:
    """A sensor that is open, and configured if a radar is given; its queue is long enough for boards without a pace."""
    options.setdefault("queue_size", 10_000)
    with plugged(controller, transport) as (where, _), open_sensor(**where, **options) as sensor:
        if radar is not None:
            sensor.configure(radar)
        yield sensor


SWING = f"""
[radar]
preset = "bgt60tr13c"
# Without the leakage and the offsets of the board.
receiver = {{ output = "real", noise_figure_db = 12.0, high_pass = 8e4 }}

[run]
stop = 60.0
resolution = 48
field_of_view_deg = [20.0, 20.0]

[[body]]
name = "plate"
shape = {{ kind = "plate", width = 0.2, height = 0.2 }}
material = "metal"

[body.motion]
kind = "trajectory"
times = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0]
poses = [{", ".join(f"{{ position = [{x}, 0.0, 0.0] }}" for x in (1.5, 4.0, 1.5, 4.0, 1.5, 4.0, 1.5))}]
"""
