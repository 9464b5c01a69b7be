"""Samples of an emulated sensor from a simulated scene."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.recording.codes import FULL_SCALE_VOLT
from radarcore.sensor.emulator.source import MIDDLE, codes_of
from radarcore.simulate.simulator import Simulator
from radarcore.units import power_from_db

_IMPEDANCE = 50.0
"""Impedance of the receiver's input [ohm]."""

_CONVERSION_GAIN_DB = 14.0
"""Gain from the receiver's input to the voltage before the baseband [dB], typical value of the data sheet."""


class Simulated:
    """Frames of a simulated scene through the gains of the data sheet; the next frame is simulated ahead.

    The echo's power at the receiver's input goes through 50 ohm, the conversion gain of the mixer (14 dB), the gain
    behind it and an ADC of 12 bits that spans 1.21 V to either side. Filters, leakage and the offsets of a real
    receiver are left out.

    Parameters
    ----------
    simulator : Simulator
        Scene and settings; the radar is what the sensor is set to.
    start : float
        Time of the scene when the sensor starts to measure [s].
    """

    def __init__(self, simulator: Simulator, *, start: float = 0.0) -> None:
        self.start = check.number("start", start, "s")
        self._simulator = simulator
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="radarcore-simulate")
        self._ahead: tuple[Radar, int, Future[NDArray[np.float64]]] | None = None

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        """The frame that starts `time` after `start`."""
        ahead, self._ahead = self._ahead, None
        if ahead is not None and ahead[:2] == (radar, index):
            samples = ahead[2].result()
        else:
            samples = self._pool.submit(self._samples, radar, time).result()
        following = self._pool.submit(self._samples, radar, time + radar.waveform.frame_interval)
        self._ahead = (radar, index + 1, following)
        gain = np.sqrt(power_from_db(_CONVERSION_GAIN_DB + if_gain_db))
        # Samples are the real part of an amplitude whose square is the power; a tone has half its peak's square.
        volt = gain * np.sqrt(2.0 * _IMPEDANCE) * samples
        return codes_of(volt * (MIDDLE / FULL_SCALE_VOLT))

    def _samples(self, radar: Radar, time: float) -> NDArray[np.float64]:
        """Real samples [sqrt(W)]."""
        if self._simulator.radar != radar:
            self._simulator = self._simulator.with_radar(radar)
        samples: NDArray[np.float64] = self._simulator.frame(self.start + time).cube
        return samples
