"""Streams to emulated ComLib boards in the same process, and a radar that they can be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.emulator.pty import Unplugged
from radarcore.sensor.errors import SensorDisconnectedError


class Ramp:
    """Source whose codes tell frame, receiver, chirp and sample."""

    def __init__(self) -> None:
        self.calls: list[tuple[Radar, int, float]] = []

    def frame(self, radar: Radar, index: int, time: float) -> np.ndarray:
        self.calls.append((radar, index, time))
        shape = (len(radar.rx), radar.waveform.num_chirps, radar.waveform.num_samples)
        return (np.arange(np.prod(shape), dtype=np.uint16).reshape(shape) + 100 * index) % 4096


class Pipe:
    """Stream to an emulated board in the same process; `change` is applied to what comes from it."""

    name = "pipe"

    def __init__(self, emulator: ComLibEmulator, size: int = 16384) -> None:
        self.emulator = emulator
        self.size = size
        self.change: Callable[[bytes], bytes] = lambda data: data
        self.is_closed = False

    def read(self, size: int, timeout: float) -> bytes:
        try:
            return self.change(self.emulator.send(min(size, self.size), timeout))
        except Unplugged:
            raise SensorDisconnectedError(f"{self.name}: gone") from None

    def write(self, data: bytes, timeout: float) -> None:
        try:
            self.emulator.receive(data)
        except Unplugged:
            raise SensorDisconnectedError(f"{self.name}: gone") from None

    def close(self) -> None:
        self.is_closed = True


def radar(num_rx: int = 4, *, num_tx: int = 1, **waveform: Any) -> Radar:
    """A radar that the board can be, but for what is changed."""
    values = {
        "start_frequency": 57e9,
        "slope": 40e12,
        "sample_rate": 2e6,
        "num_samples": 64,
        "num_chirps": 16,
        "frame_interval": 0.05,
    }
    return Radar(
        Waveform(**(values | waveform)),
        tx=np.zeros((num_tx, 3)),
        rx=np.zeros((num_rx, 3)),
        receiver=Receiver(output="real", noise_figure_db=12.0),
    )


def board_with(emulator: ComLibEmulator, **options: Any) -> ComLibBoard:
    """Board with short time-outs; those of requests are hang guards."""
    return ComLibBoard(Pipe(emulator, **options), timeout=0.1, board_timeout=0.2)
