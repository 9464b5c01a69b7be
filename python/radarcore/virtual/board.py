"""A simulated scene or a recording as a sensor: behind the wire protocol of a real board."""

from __future__ import annotations

import math
from types import TracebackType

from radarcore import check
from radarcore.recording.recording import Recording
from radarcore.scenefile.load import Simulation
from radarcore.sensor.emulator.chip import PACE_TIME
from radarcore.sensor.emulator.faults import Faults
from radarcore.sensor.emulator.source import FrameSource, Playback
from radarcore.sensor.emulator.strata import LATENCY, CdcBoard, Controller
from radarcore.simulate.simulator import Simulator
from radarcore.virtual.source import RECEIVERS, Simulated

_KEEPS_UP = 0.95
"""Share of the requested speed below which a scene is slow."""


def virtual_board(
    source: Simulator | Simulation | Recording | FrameSource,
    *,
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
    speed : float or None
        Seconds of the sensor per second of the host; None: as fast as the client reads. A scene that takes longer to
        simulate comes slower, with right time stamps.
    threads : int, optional
        Threads for a scene file's simulator; default: all cores.
    receiver : "measured" or "ideal"
        Receivers behind a simulated scene: a measured BGT60TR13C with leakage and offsets, or only the gains and noise
        of the data sheet. A scene whose radar has a receiver with more than thermal noise keeps its own effects.
    latency : float
        Time from a request to its answer, at least [s].
    faults : Faults, optional
        Faults of the board and its link.

    See Also
    --------
    sensor.VirtualBoard : The result.
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
    check.choice("receiver", receiver, RECEIVERS)
    if speed is not None:
        speed = check.positive("speed", speed)
    frames: FrameSource
    simulated: Simulated | None = None
    if isinstance(source, Simulator):
        frames = simulated = Simulated(source, receiver=receiver)
    elif isinstance(source, Simulation):
        frames = simulated = Simulated(source.simulator(threads=threads), start=source.run.start, receiver=receiver)
    elif isinstance(source, Recording):
        frames = Playback(source)
    else:
        frames = source
    return VirtualBoard(Controller(frames, speed=speed, latency=latency, faults=faults), simulated)


class VirtualBoard(CdcBoard):
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

    def __init__(self, controller: Controller, simulated: Simulated | None) -> None:
        super().__init__(controller)
        self._simulated = simulated
        self._reported: set[str] = set()

    @property
    def num_frames(self) -> int:
        """Frames that clients have received, in all."""
        return math.floor(self.controller.num_frames + 1e-6)  # of slices, which add up to whole frames but for rounding

    @property
    def num_lost(self) -> int:
        """Frames that were measured and that clients did not take in time, in all."""
        return self.controller.chip.num_lost

    def news(self) -> list[str]:
        """News for the user of the board: registers that give no frames, once; every ten seconds of a slow scene."""
        chip, news = self.controller.chip, []
        if chip.failure is not None and str(chip.failure) not in self._reported:
            self._reported.add(str(chip.failure))
            news.append(f"the client's settings give no frames: {chip.failure}")
        while chip.speed is not None and chip.paces:
            pace = chip.paces.popleft()
            if pace < _KEEPS_UP * chip.speed:
                asked = "" if chip.speed == 1.0 else f" ({chip.speed:g} asked for)"
                news.append(
                    f"simulated at {pace:.2g} of real time{asked} over the last {PACE_TIME:g} s: the scene takes "
                    "long; a lower run.ray_budget helps"
                )
        return news

    def close(self) -> None:
        """End measuring, without waiting for a frame that is being simulated; may be called twice."""
        if self._simulated is not None:
            self._simulated.close()
        self.controller.close()

    def __enter__(self) -> VirtualBoard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
