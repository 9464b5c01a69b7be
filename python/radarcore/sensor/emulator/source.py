"""Where the samples of an emulated sensor come from: noise, a recording, a simulated scene."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.recording.codes import FULL_SCALE_VOLT, NUM_CODES
from radarcore.recording.recording import Recording
from radarcore.simulate.simulator import Simulator
from radarcore.units import power_from_db

_IMPEDANCE = 50.0
"""Of the receiver's input [ohm]."""

_CONVERSION_GAIN_DB = 14.0
"""From the power at the receiver's input to volts before the baseband [dB], typical value of the data sheet."""

_MIDDLE = 2047.5
"""Code without a signal: half of full scale."""


class FrameSource(Protocol):
    """Gives the codes of any frame that an emulated sensor is set to."""

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        """Codes of the ADC of one frame.

        Parameters
        ----------
        radar : Radar
            As the registers of the sensor have it.
        index : int
            Number of the frame since the start.
        time : float
            Start of its first chirp since the start [s].
        if_gain_db : float
            Gain behind the mixer [dB].

        Returns
        -------
        codes : (rx, chirp, sample) uint16
            From 0 to 4095.
        """


class Noise:
    """White noise about the middle of the range.

    Parameters
    ----------
    deviation : float
        Standard deviation [codes].
    seed : int
    """

    def __init__(self, deviation: float = 20.0, seed: int = 0) -> None:
        self.deviation = check.non_negative("deviation", deviation, "codes")
        self.seed = check.count("seed", seed, 0)

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        """Noise of its own for every index."""
        del time, if_gain_db
        rng = np.random.default_rng((self.seed, index))
        return _codes(self.deviation * rng.standard_normal(_shape(radar), np.float32))


class Playback:
    """The frames of a recording, over and over; whatever the sensor is set to has to be what was recorded.

    Parameters
    ----------
    recording : Recording
        With codes of an ADC, see `Recording.raw`.
    """

    def __init__(self, recording: Recording) -> None:
        raw = recording.raw
        if raw is None or len(raw) == 0:
            raise ValueError("recording: expected at least one frame with codes of an ADC, got none")
        self.raw = raw

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        """The recorded frame; a sensor that is set otherwise is refused."""
        del time, if_gain_db  # as recorded
        if (expected := self.raw.shape[1:]) != (got := _shape(radar)):
            raise ValueError(f"radar: expected {expected} [rx, chirp, sample] as recorded, got {got}")
        codes: NDArray[np.uint16] = self.raw[index % len(self.raw)]
        return codes


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
        return _codes(volt * (_MIDDLE / FULL_SCALE_VOLT))

    def _samples(self, radar: Radar, time: float) -> NDArray[np.float64]:
        """Real samples [sqrt(W)]."""
        if self._simulator.radar != radar:
            self._simulator = self._simulator.with_radar(radar)
        samples: NDArray[np.float64] = self._simulator.frame(self.start + time).cube
        return samples


def _shape(radar: Radar) -> tuple[int, int, int]:
    return radar.num_channels, radar.waveform.num_chirps, radar.waveform.num_samples


def _codes(deviation: NDArray[np.floating]) -> NDArray[np.uint16]:
    """Codes from deviations from the middle; clipped at both ends."""
    levels: NDArray[np.uint16] = np.clip(np.rint(_MIDDLE + deviation), 0, NUM_CODES - 1).astype(np.uint16)
    return levels
