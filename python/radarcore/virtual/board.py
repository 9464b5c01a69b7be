"""A simulated scene or a recording as a sensor: behind the wire protocol of a real board."""

from __future__ import annotations

import math
from types import TracebackType

from radarcore import check
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import Simulation
from radarcore.sensor.emulator.chip import PACE_TIME, Chip
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.emulator.faults import Faults
from radarcore.sensor.emulator.source import FrameSource, Playback
from radarcore.sensor.emulator.strata import LATENCY, CdcBoard, Controller
from radarcore.simulate.simulator import Simulator
from radarcore.virtual.source import RECEIVERS, Simulated

PROTOCOLS = ("strata", "comlib")

_KEEPS_UP = 0.95
"""Part of the speed that was asked for below which a scene is slow."""


def virtual_board(
    source: Simulator | Simulation | Recording | FrameSource,
    *,
    protocol: str = "strata",
    speed: float | None = 1.0,
    threads: int | None = None,
    receiver: str = "measured",
    latency: float = LATENCY,
    faults: Faults | None = None,
) -> VirtualBoard:
    """A board that measures a simulated scene, a recording or any frames; a `PtyPort` makes it a serial port.

    Parameters
    ----------
    source : Simulator, Simulation, Recording or FrameSource
        Source of the samples: a scene from its time 0, or from the start of a scene file's run. The client's registers
        say how: samples, ramps, times, receivers, gains and power.
    protocol : "strata" or "comlib"
    speed : float or None
        Seconds of the sensor per second of the host; None: as fast as the client reads. A scene that takes longer to
        simulate comes slower, with right time stamps.
    threads : int, optional
        Threads for a scene file's simulator; default: all cores.
    receiver : "measured" or "ideal"
        Receivers behind a simulated scene: those of a BGT60TR13C as measured, with leakage and offsets, or the gains
        and noise of the data sheet alone. A scene whose radar has a receiver with more than thermal noise keeps its own
        effects.
    latency : float
        Time from a request to its answer, at least [s].
    faults : Faults, optional
        Faults of a Strata board.

    See Also
    --------
    sensor.VirtualBoard : What comes back.
    open_sensor : Connects to it as to any board.
    Simulator.frames : The frames without a board in between.

    Examples
    --------
    >>> from radarcore.sensor.emulator.pty import PtyPort
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> simulator = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32))
    >>> with rc.sensor.virtual_board(simulator, receiver="ideal") as board, PtyPort(board) as port:
    ...     with rc.open_sensor(port.path, protocol="strata") as sensor:
    ...         radar = sensor.configure(simulator.radar)
    ...         (frame,) = sensor.frames(1)
    >>> print(f"{rc.strongest_peak(frame).range:.1f} m")
    2.0 m
    """
    check.choice("protocol", protocol, PROTOCOLS)
    check.choice("receiver", receiver, RECEIVERS)
    check.non_negative("latency", latency, "s")
    if speed is not None:
        speed = check.positive("speed", speed)
    frames: FrameSource
    if isinstance(source, Simulator):
        frames = Simulated(source, receiver=receiver)
    elif isinstance(source, Simulation):
        frames = Simulated(source.simulator(threads=threads), start=source.run.start, receiver=receiver)
    elif isinstance(source, Recording):
        frames = Playback(source)
    else:
        frames = source
    return VirtualBoard(frames, protocol, speed, latency, faults, is_own=frames is not source)


class VirtualBoard:
    """A `StreamPeripheral` made by `virtual_board`; a context manager.

    See Also
    --------
    sensor.virtual_board : Makes one.

    Examples
    --------
    >>> from radarcore.sensor.emulator.source import Noise
    >>> with rc.sensor.virtual_board(Noise()) as board:
    ...     print(board.num_frames, board.num_lost)
    0 0
    """

    def __init__(
        self,
        source: FrameSource,
        protocol: str,
        speed: float | None,
        latency: float,
        faults: Faults | None,
        *,
        is_own: bool,
    ) -> None:
        self._speed = speed
        self._simulated = source if is_own and isinstance(source, Simulated) else None
        self._controller: Controller | None = None
        self._board: CdcBoard | ComLibEmulator
        self._measures: Chip | ComLibEmulator
        self._counts: Controller | ComLibEmulator
        if protocol == "comlib":
            self._board = self._measures = self._counts = ComLibEmulator(source, speed=speed, latency=latency)
        else:
            self._controller = self._counts = Controller(source, speed=speed, latency=latency, faults=faults)
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
        """News for whoever runs the board: registers that give no frames, once; every ten seconds of a slow scene."""
        news = []
        failure = self._measures.failure
        if failure is not None and str(failure) not in self._told:
            self._told.add(str(failure))
            news.append(f"the client's settings give no frames: {failure}")
        if isinstance(self._measures, Chip) and self._speed is not None:
            while self._measures.paces:
                pace = self._measures.paces.popleft()
                if pace < _KEEPS_UP * self._speed:
                    asked = "" if self._speed == 1.0 else f" ({self._speed:g} asked for)"
                    news.append(
                        f"simulated at {pace:.2g} of real time{asked} over the last {PACE_TIME:g} s: the scene takes "
                        "long; a lower run.ray_budget helps"
                    )
        return news

    def close(self) -> None:
        """End measuring, without waiting for a frame that is being simulated; may be called twice."""
        if self._simulated is not None:
            self._simulated.close()
        if self._controller is not None:
            self._controller.close()

    def __enter__(self) -> VirtualBoard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
