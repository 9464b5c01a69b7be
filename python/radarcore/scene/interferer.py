"""Another FMCW radar in a scene, which transmits."""

from __future__ import annotations

from dataclasses import dataclass
from math import fmod

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.motion.protocol import AnyMotion, Motion, as_motion
from radarcore.radar.radar import Radar
from radarcore.records import sealed

START_PHASES = ("chirp", "frame")
"""Time for which the phase of an interferer's oscillator is known."""

_LARGEST_DRIFT = 1e4
"""Largest drift of a clock [ppm]: an oscillator without a crystal."""


@sealed
@dataclass(eq=False)
class Interferer:
    """Another FMCW radar, which is received over the direct path and returns no echo of its own.

    It has always been on: its frames follow each other without an end, before `start` too. It transmits during its
    ramps, from all of its transmitters, and nothing between them.

    Parameters
    ----------
    radar : Radar
        Its waveform, transmit antennas with patterns, power and polarisation; its receivers do not matter.
    motion : Pose, Linear, Trajectory, Attached or function of time
        Its sensor frame to the world.
    start : float
        Time at which one of its frames starts [s].
    rate : float, optional
        Frames per second of its clock [Hz]; default: one per `Waveform.frame_interval`.
    drift_ppm : float
        How much faster its clock runs than ours [ppm]: frequencies are higher, times between its chirps shorter.
    start_phase : "chirp" or "frame"
        Its oscillator runs freely: against ours it has a random phase anew at the start of every "chirp", as where
        ramps are not locked to a common clock, or only of every "frame", whose chirps all start in that phase. The
        phases belong to the seed of the simulator and to the numbers of frame and chirp. A CW radar keeps one phase.
    name : str, optional
        Name in tables and messages.

    Raises
    ------
    ValueError
        For more frames per second than fit, for a radar of several sub-sequences, and for one whose transmitters send
        at once by a schedule.

    See Also
    --------
    Scene : Takes it beside bodies.
    Radar : Its description.

    Examples
    --------
    >>> other = rc.Interferer(rc.bgt60tr13c(), rc.Pose.look_at([5.0, 0.0, 0.0], target=[0.0, 0.0, 0.0]), name="other")
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0]), other])
    >>> scene.interferer_names
    ('other',)
    """

    radar: Radar
    motion: Motion
    start: float
    rate: float
    drift_ppm: float
    start_phase: str
    name: str | None

    def __init__(
        self,
        radar: Radar,
        motion: AnyMotion,
        *,
        start: float = 0.0,
        rate: float | None = None,
        drift_ppm: float = 0.0,
        start_phase: str = "chirp",
        name: str | None = None,
    ) -> None:
        check.instance("radar", radar, Radar)
        if radar.more_waveforms:
            raise ValueError(f"radar: expected an interferer of one waveform, got {1 + len(radar.more_waveforms)}")
        if radar.schedule is not None and radar.schedule.is_sum:
            raise ValueError(f"radar: expected no schedule, or one of kind 'tdm', got {radar.schedule.kind!r}")
        self.radar = radar
        self.motion = as_motion("motion", motion)
        self.start = check.number("start", start, "s")
        wf = radar.waveform
        self.rate = 1.0 / wf.frame_interval if rate is None else check.positive("rate", rate, "Hz")
        self.drift_ppm = check.within("drift_ppm", drift_ppm, -_LARGEST_DRIFT, _LARGEST_DRIFT, "ppm")
        self.start_phase = check.choice("start_phase", start_phase, START_PHASES)
        self.name = name
        duration = float(wf.chirp_times[-1]) + self.ramp_duration
        if duration * self.rate > 1.0 + 1e-9:
            raise ValueError(
                f"rate: expected at most {1.0 / duration:g} frames of {1e3 * duration:g} ms per second [Hz], "
                f"got {self.rate:g}"
            )

    @property
    def ramp_duration(self) -> float:
        """Duration of a ramp, from its start to the end of its last sample [s of its clock]."""
        wf = self.radar.waveform
        sampled = wf.adc_delay + wf.num_samples / wf.sample_rate
        return float(np.diff(wf.chirp_times).min(initial=sampled))

    @property
    def clock(self) -> float:
        """Seconds of its clock in one of ours."""
        return 1.0 + 1e-6 * self.drift_ppm

    @property
    def _longest(self) -> float:
        """Time from the start of a chirp to the end of the last transmitter's ramp [s of its clock]."""
        return float(sent_after(self).max()) + self.ramp_duration


def sent_after(interferer: Interferer) -> NDArray[np.float64]:
    """Time from the start of a chirp to the start of every transmitter [s of its clock], (tx,)."""
    radar = interferer.radar
    offsets, num_tx, num_rx = radar.channel_offsets, len(radar.tx), len(radar.rx)
    # A radar whose transmitters send at once may have channels of its receivers alone.
    return offsets[::num_rx] if len(offsets) == num_tx * num_rx else np.zeros(num_tx)


def chirps_between(
    interferer: Interferer, begin: float, end: float, origin: float
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Starts of chirps that some transmitter sends between `begin` and `end` after `origin` [s].

    Returns
    -------
    starts : (sent,) float64
        After `origin`, increasing [s].
    frame, chirp : (sent,) int64
        Numbers of its frames, counted from `start`, and of chirps within the frame.
    """
    interval = 1.0 / (interferer.rate * interferer.clock)
    # A remainder is exact, a product of the number of frames since 1970 and the interval is not.
    elapsed = origin - interferer.start
    since = fmod(elapsed, interval)
    number = round((elapsed - since) / interval)
    low, high = int(np.floor((begin + since) / interval)) - 1, int(np.floor((end + since) / interval))
    frames = np.arange(low, high + 1)
    starts = (frames * interval - since)[:, None] + interferer.radar.waveform.chirp_times / interferer.clock
    frame, chirp = np.indices(starts.shape)
    kept = (starts.ravel() <= end) & (starts.ravel() + interferer._longest / interferer.clock >= begin)
    return starts.ravel()[kept], (frame.ravel() + (number + low))[kept], chirp.ravel()[kept]
