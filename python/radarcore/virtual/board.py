"""A simulated scene or a recording as a sensor: behind the wire protocol of a real board."""

from __future__ import annotations

import math
from types import TracebackType

from radarcore import check
from radarcore.recording.recording import Recording
from radarcore.scenefile.simulation import Simulation
from radarcore.sensor.emulator.chip import Chip
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.emulator.faults import Faults
from radarcore.sensor.emulator.source import FrameSource, Playback
from radarcore.sensor.emulator.strata import CdcBoard, Controller
from radarcore.simulate.simulator import Simulator
from radarcore.virtual.source import Simulated

PROTOCOLS = ("strata", "comlib")


def virtual_board(
    source: Simulator | Simulation | Recording | FrameSource,
    *,
    protocol: str = "strata",
    speed: float | None = 1.0,
    threads: int | None = None,
    faults: Faults | None = None,
) -> VirtualBoard:
    """A board that measures a simulated scene, a recording or any frames, for a pty or an emulated USB bus.

    Parameters
    ----------
    source : Simulator, Simulation, Recording or FrameSource
        Source of the samples: a scene from its time 0, or from the start of a scene file's run. The client's registers
        say how: samples, chirps, bandwidth, times and gains.
    protocol : "strata" or "comlib"
    speed : float or None
        Seconds of the sensor per second of the host; None: as fast as the client reads. A scene that takes longer to
        simulate comes slower, with right time stamps.
    threads : int, optional
        Threads for a scene file's simulator; default: all cores.
    faults : Faults, optional
        Faults of a Strata board.
    """
    check.choice("protocol", protocol, PROTOCOLS)
    if speed is not None:
        speed = check.positive("speed", speed)
    frames: FrameSource
    if isinstance(source, Simulator):
        frames = Simulated(source)
    elif isinstance(source, Simulation):
        frames = Simulated(source.simulator(threads=threads), start=source.run.start)
    elif isinstance(source, Recording):
        frames = Playback(source)
    else:
        frames = source
    return VirtualBoard(frames, protocol, speed, faults)


class VirtualBoard:
    """A `StreamPeripheral` made by `virtual_board`; a context manager."""

    def __init__(self, source: FrameSource, protocol: str, speed: float | None, faults: Faults | None) -> None:
        self._controller: Controller | None = None
        self._board: CdcBoard | ComLibEmulator
        self._measures: Chip | ComLibEmulator
        self._counts: Controller | ComLibEmulator
        if protocol == "comlib":
            self._board = self._measures = self._counts = ComLibEmulator(source, speed=speed)
        else:
            self._controller = self._counts = Controller(source, speed=speed, faults=faults)
            self._board, self._measures = CdcBoard(self._controller), self._controller.chip
        self._told: set[str] = set()

    def receive(self, data: bytes) -> None:
        """Bytes from the client."""
        self._board.receive(data)

    def send(self, size: int, timeout: float) -> bytes:
        """Bytes for the client."""
        return self._board.send(size, timeout)

    def hang_up(self) -> None:
        """Tell the board that its client has gone."""
        self._board.hang_up()

    @property
    def num_frames(self) -> int:
        """Frames that clients have received, in all."""
        return math.floor(self._counts.num_frames + 1e-6)  # of slices, which add up to whole frames but for rounding

    @property
    def num_lost(self) -> int:
        """Frames that were measured and that clients did not take in time, in all."""
        return self._measures.num_lost

    def news(self) -> list[str]:
        """News for whoever runs the board, each once: registers that give no frames, a scene that is too slow."""
        found = {}
        if self._measures.failure is not None:
            found[str(self._measures.failure)] = f"the client's settings give no frames: {self._measures.failure}"
        if isinstance(self._measures, Chip) and self._measures.slowest < 0.95:
            pace = f"{self._measures.slowest:.2g} x the speed that was asked for"
            found["slow"] = f"the scene takes long to simulate and runs at {pace}; a lower run.ray_budget helps"
        news = [line for what, line in found.items() if what not in self._told]
        self._told.update(found)
        return news

    def close(self) -> None:
        """End measuring."""
        if self._controller is not None:
            self._controller.close()

    def __enter__(self) -> VirtualBoard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
