"""Bands of Doppler-division multiplex: channels of every transmitter, and true velocities from the empty bands."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.inputs import has_doppler_division, require_transmitters_apart, require_uniform_chirps
from radarcore.radar.radar import Radar
from radarcore.radar.schedule import Schedule


@dataclass(frozen=True, eq=False)
class Bands:
    """Transmitters in Doppler-division multiplex."""

    radar: Radar
    """The radar with a channel per pair of antennas."""
    shifts: NDArray[np.intp]
    """Rows from the true velocity down to each transmitter's echo, (tx,)."""
    num_bands: int

    def separated(self, cells: NDArray[Any]) -> NDArray[Any]:
        """Map of every pair of antennas (tx * num_rx + rx, row, column), with echoes at their true velocity."""
        return np.concatenate([np.roll(cells, shift, axis=1) for shift in self.shifts])

    def are_true(self, power: NDArray[np.float64], peaks: NDArray[np.int64]) -> NDArray[np.bool_]:
        """True for peaks (peak, 2) that exceed the power (row, column) at all distances of whole bands.

        At the true velocity all transmitters add up. A whole band away, an empty band replaces at least one of them.
        """
        num_rows = len(power)
        others = (peaks[:, :1] + num_rows // self.num_bands * np.arange(1, self.num_bands)) % num_rows
        return np.asarray((power[others, peaks[:, 1:]] < power[*peaks.T][:, None]).all(axis=1))


def bands_of(radar: Radar) -> Bands | None:
    """Bands of a radar; None without Doppler division. Raises ValueError without empty bands."""
    if radar.schedule is None or not has_doppler_division(radar):
        return None
    return _bands(radar, radar.schedule)


@lru_cache(maxsize=16)
def _bands(radar: Radar, schedule: Schedule) -> Bands | None:
    require_uniform_chirps(radar.waveform)
    num_tx, num_rows = len(radar.tx), radar.waveform.num_chirps
    used = schedule.bands(num_tx, num_rows)
    if used is None:
        require_transmitters_apart(np.empty(0), radar)
        return None
    if num_rows % len(used):
        raise ValueError(f"radar: expected a multiple of {len(used)} chirps, the bands of its schedule, got {num_rows}")
    values = radar.to_dict() | {"schedule": None}
    if radar.channel_weights is not None:
        weights = np.tile(radar.channel_weights, num_tx)
        values["channel_weights"] = np.stack([weights.real, weights.imag], axis=-1)
    shifts = np.rint(schedule.tx_turns(num_tx) * num_rows).astype(int)
    return Bands(Radar.from_dict(values), shifts, len(used))
