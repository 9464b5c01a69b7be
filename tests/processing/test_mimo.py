"""Separation of Doppler-division multiplexing. With simulated frames: simulate/test_schedules.py."""

from __future__ import annotations

import numpy as np
import pytest

import radarcore as rc

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=15e12, sample_rate=2e6, num_samples=8, num_chirps=24, chirp_interval=200e-6
)


def radar_of(num_tx: int, schedule: rc.Schedule | None) -> rc.Radar:
    tx = [[0.0, 2e-3 * i, 0.0] for i in range(num_tx)]
    return rc.Radar(WAVEFORM, tx=tx, rx=[[0.0, 0.0, 0.0], [0.0, 1e-3, 0.0]], schedule=schedule)


@pytest.mark.parametrize(
    ("num_tx", "turns", "width"),
    [(1, None, 24), (2, None, 12), (3, None, 8), (4, None, 6), (3, [0.0, 0.25, 0.5], 6), (2, [1.75, 0.25], 12)],
)
def test_rows_of_every_transmitter_are_those_below_its_own_shift(
    num_tx: int, turns: list[float] | None, width: int
) -> None:
    """A map whose numbers are its rows: transmitter i has those `turns` of all below the rows around zero velocity."""
    radar = radar_of(num_tx, rc.Schedule.ddm(turns))
    maps = np.broadcast_to(np.arange(24.0)[:, None] + 0j, (2, 24, 5)) + 100.0 * np.arange(2)[:, None, None]
    found = rc.demultiplex(maps, radar)
    assert found.spectrum.shape == (2 * num_tx, width, 5)
    np.testing.assert_array_equal(found.velocity, WAVEFORM.velocity_axis()[12 - width // 2 : 12 - width // 2 + width])
    assert found.velocity[width // 2] == 0.0
    for tx in range(num_tx):
        shift = round(24 * ([i / num_tx for i in range(num_tx)] if turns is None else turns)[tx])
        rows = (12 - width // 2 + np.arange(width) - shift) % 24
        for rx in range(2):
            np.testing.assert_array_equal(found.spectrum[2 * tx + rx, :, 0], rows + 100.0 * rx)
    stacked = rc.demultiplex(np.stack([maps, 2.0 * maps]), radar).spectrum
    np.testing.assert_array_equal(stacked[1], 2.0 * found.spectrum)
