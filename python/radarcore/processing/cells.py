"""Range and velocity of what lies at a beat and a Doppler frequency."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from radarcore.radar.waveform import Waveform
from radarcore.units import SPEED_OF_LIGHT


@dataclass(frozen=True)
class Coordinates:
    """Range and velocity at the middle of a frame, from frequencies at the centre of its windows.

    The phase of a uniformly moving target is quadratic in fast and slow time and windows are symmetric, so the
    frequencies at the peak are those at the centre of the windows.

    Parameters
    ----------
    waveform : Waveform
    fast_centre, slow_centre : float
        Centres of the windows [samples, chirps].
    has_velocity : bool
        False for a single chirp, or chirps at unequal intervals: there is no Doppler frequency.
    """

    waveform: Waveform
    fast_centre: float
    slow_centre: float
    has_velocity: bool

    @cached_property
    def _middle_fast(self) -> float:
        """Time of the centre within its chirp [s]."""
        return self.waveform.adc_delay + self.fast_centre / self.waveform.sample_rate

    @cached_property
    def _lead(self) -> float:
        """Time from the centre of the windows to the middle of the frame [s]."""
        wf = self.waveform
        centre = wf.chirp_times[0] + self.slow_centre * wf.chirp_interval + self._middle_fast
        return float(wf.middle - centre)

    def at(self, beat: Any, doppler: Any) -> tuple[Any, Any]:
        """Range [m] and velocity [m/s], NaN for what is not told; `beat` has the sign of the slope [Hz]."""
        wf = self.waveform
        if not self.has_velocity:
            without = np.full(np.shape(doppler + beat), np.nan)
            return without if wf.is_cw else 0.5 * SPEED_OF_LIGHT * beat / wf.slope + 0.0 * doppler, without
        if wf.is_cw:
            velocity = 0.5 * SPEED_OF_LIGHT * doppler / wf.start_frequency + 0.0 * beat
            return np.full(np.shape(velocity), np.nan), velocity
        # d/dt and d/dT of eq. (1)'s phase: doppler = rate (f0 + slope (t - tau)), beat = slope tau + doppler.
        shift = beat - doppler
        velocity = 0.5 * SPEED_OF_LIGHT * doppler / (wf.start_frequency + wf.slope * self._middle_fast - shift)
        return 0.5 * SPEED_OF_LIGHT * shift / wf.slope + velocity * self._lead, velocity

    def slopes(self) -> Any:
        """Derivatives of range and velocity by beat and Doppler frequency, (2, 2).

        Without the little that the range changes the frequency of the Doppler shift: parts of 1e-3 where the band is
        a tenth of the frequency.
        """
        wf = self.waveform
        by_beat = np.nan if wf.is_cw else 0.5 * SPEED_OF_LIGHT / wf.slope
        if not self.has_velocity:
            return np.array([[by_beat, 0.0], [0.0, np.nan]])
        by_doppler = 0.5 * SPEED_OF_LIGHT / (wf.start_frequency + wf.slope * self._middle_fast)
        return np.array([[by_beat, self._lead * by_doppler - by_beat], [0.0, by_doppler]])
