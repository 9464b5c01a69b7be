"""Sources of samples for an emulated sensor: noise, or a recording."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.recording.frame import NUM_CODES
from radarcore.recording.recording import Recording

MIDDLE = 2047.5
"""Code without a signal: half of full scale."""

NO_POWER_DBM = -1000.0
"""Power of a transmitter that is off [dBm]."""


class FrameSource(Protocol):
    """Source of codes for any settings of an emulated sensor."""

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        """Codes of the ADC of one frame.

        Parameters
        ----------
        radar : Radar
            As the registers of the sensor have it: ramps, receivers in use, power of the transmitter (`NO_POWER_DBM`
            if it is off) and, in its receiver, the high-pass.
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
        self.deviation: float = check.non_negative("deviation", deviation, "codes")
        self.seed: int = check.count("seed", seed, 0)

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        """Noise of its own for every index."""
        del time, if_gain_db
        rng = np.random.default_rng((self.seed, index))
        return codes_of(self.deviation * rng.standard_normal(shape_of(radar), np.float32))


class Playback:
    """Frames of a recording in endless rounds; the settings of the sensor must be the recorded ones.

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
        """Recorded frame; other settings of the sensor are refused."""
        del time, if_gain_db  # as recorded
        if (expected := self.raw.shape[1:]) != (got := shape_of(radar)):
            raise ValueError(f"radar: expected {expected} [rx, chirp, sample] as recorded, got {got}")
        codes: NDArray[np.uint16] = self.raw[index % len(self.raw)]
        return codes


def shape_of(radar: Radar) -> tuple[int, int, int]:
    """Shape of a frame: (rx, chirp, sample)."""
    return radar.num_channels, radar.waveform.num_chirps, radar.waveform.num_samples


def codes_of(deviation: NDArray[np.floating]) -> NDArray[np.uint16]:
    """Codes from deviations from the middle; clipped at both ends."""
    levels: NDArray[np.uint16] = np.clip(np.rint(MIDDLE + deviation), 0, NUM_CODES - 1).astype(np.uint16)
    return levels
