"""The loop: a physics simulation that steps on, and a radar frame at every instant of the radar's rate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import ceil
from typing import Any, Protocol

from radarcore import check
from radarcore.adapters.mujoco.library import mujoco_module
from radarcore.adapters.mujoco.live_model import LiveModel
from radarcore.motion.live import KEPT
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import frame_rate
from radarcore.recording.frame import Frame

_UPDATES_PER_FRAME = KEPT // 2
"""Most updates in a frame: all are kept until it is simulated."""

_ROUNDING = 1e-9
"""Of sums of time steps [s]."""


class FrameSource(Protocol):
    """Maker of frames at a time [s]: a `Simulator` of the model's scene."""

    @property
    def radar(self) -> Radar:
        """Radar whose frames these are."""
        ...

    def frame(self, time: float) -> Frame:
        """Frame that starts at a time [s]."""
        ...


def frames(
    simulator: FrameSource,
    live: LiveModel,
    data: Any,
    *,
    duration: float | None = None,
    rate: float | None = None,
    control: Callable[[Any], object] | None = None,
    follow: bool = False,
) -> Iterator[Frame]:
    """Step the physics and simulate a radar frame at every multiple of 1/`rate`.

    The last step before a frame is as short as it has to be to end where the frame starts.

    Parameters
    ----------
    simulator : Simulator
        Of the scene of `live`.
    live : LiveModel
    data : MjData
        State of the physics, which the loop steps on. The first frame starts at its time.
    duration : float, optional
        Time from the first frame on in which frames start [s]; default: without an end.
    rate : float, optional
        Frames per second [Hz]; default: the radar's own, as of `Simulator.frames`.
    control : callable, optional
        Called with `data` before every step: sets ``ctrl``, ``mocap_pos``.
    follow : bool
        False: a frame is simulated as soon as it starts, with the velocities that hold then, and `data` is that of its
        start. True: it is simulated when the physics has stepped past its end, as a sensor delivers it, and follows the
        positions step by step: for strong accelerations and contacts, at two to three times the run time.

    Yields
    ------
    frame : Frame
        In order; between them the program may read and change `data`.

    See Also
    --------
    adapters.mujoco.LiveModel : Poses and velocities of a model.
    Simulator.frames : Frames of motions that are known before.

    Examples
    --------
    >>> import mujoco
    >>> ball = '<body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
    >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
    >>> data = mujoco.MjData(model)
    >>> live = rc.adapters.mujoco.LiveModel(model)
    >>> simulator = rc.Simulator(live.scene, rc.bgt60tr13c(num_chirps=16))
    >>> [round(each.time, 3) for each in rc.adapters.mujoco.frames(simulator, live, data, duration=0.1, rate=40.0)]
    [0.0, 0.025, 0.05, 0.075]
    """
    period = 1.0 / (frame_rate(simulator.radar.waveform) if rate is None else check.positive("rate", rate, "Hz"))
    model, step = live.model, float(live.model.opt.timestep)
    mj_step = mujoco_module().mj_step
    start, frame_duration = float(data.time), simulator.radar.duration
    stride = max(1, ceil(frame_duration / step / _UPDATES_PER_FRAME))
    if duration is not None:
        duration = check.positive("duration", duration, "s")

    def advance(to: float, *, every: int = 0, exactly: bool = True) -> None:
        """Step until a time [s]; take poses after the last step, and after so many."""
        count = 0
        while (left := to - data.time) > _ROUNDING:
            if control is not None:
                control(data)
            model.opt.timestep = min(step, left) if exactly else step
            try:
                mj_step(model, data)
            finally:
                model.opt.timestep = step
            count += 1
            if to - data.time <= _ROUNDING or (every > 0 and count % every == 0):
                live.update(data, by_differences=follow or None)

    def stepped() -> Iterator[Frame]:
        live.update(data)
        number = 0
        while duration is None or number * period < duration - _ROUNDING:
            begin = start + number * period
            if follow:
                # Live motions need the poses before the start for their velocity.
                advance(begin - step, exactly=False)
            advance(begin)
            if follow:
                advance(begin + frame_duration, every=stride, exactly=False)
            yield simulator.frame(begin)
            number += 1

    return stepped()
