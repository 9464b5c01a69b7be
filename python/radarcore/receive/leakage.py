"""Leakage of the transmitter: slow tones and the step of turning on, the same in every chirp."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Leakage, Receiver
from radarcore.receive.filters import filter_gain


@lru_cache(maxsize=16)
def leakage_tones(leakage: Leakage, receiver: Receiver, radar: Radar) -> list[tuple[float, NDArray[np.complex64]]]:
    """Delays [s], and tones behind the filters (rx, sample) [sqrt(W)]: echoes of them, docs/theory.md eq. (1)."""
    waveform, tones = radar.waveform, []
    for level_db, delay, phase_deg in leakage.tones:
        beat = waveform.slope * delay
        phase = waveform.start_frequency * delay - 0.5 * waveform.slope * delay**2 + beat * waveform.sample_times
        level = filter_gain(receiver, beat) * _phasors(level_db, phase_deg, radar)[:, None]
        tones.append((delay, check.frozen((level * np.exp(2j * np.pi * phase)).astype(np.complex64))))
    return tones


@lru_cache(maxsize=16)
def leakage_step(leakage: Leakage, radar: Radar) -> NDArray[np.complex64]:
    """Step of turning on (rx, sample) [sqrt(W)], from the first sample on."""
    assert leakage.step_db is not None
    waveform = radar.waveform
    decay = np.exp(-np.arange(waveform.num_samples) / (waveform.sample_rate * leakage.step_time))
    step = _phasors(leakage.step_db, leakage.step_phase_deg, radar)[:, None] * decay
    return check.frozen(step.astype(np.complex64))


def _phasors(level_db: ArrayLike, phase_deg: ArrayLike, radar: Radar) -> NDArray[np.complex128]:
    """Amplitudes of a level over a transmitter's power, (rx,) [sqrt(W)]."""
    amplitude = np.sqrt(radar.tx_power * 10.0 ** (np.asarray(level_db, np.float64) / 10.0))
    phasors = amplitude * np.exp(1j * np.deg2rad(np.asarray(phase_deg, np.float64)))
    return np.broadcast_to(phasors, len(radar.rx))
