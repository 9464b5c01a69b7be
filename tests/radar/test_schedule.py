"""Schedules and sub-sequences as descriptions: times, weights, refusals. Their frames: simulate/test_schedules.py."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import radarcore as rc

WAVEFORM = rc.Waveform(
    start_frequency=77e9, slope=20e12, sample_rate=5e6, num_samples=100, num_chirps=8, chirp_interval=60e-6
)
TX = [[0.0, 0.0, 0.0], [0.0, 4e-3, 0.0]]
RX = [[0.0, 0.0, 0.0], [0.0, 2e-3, 0.0], [0.0, 4e-3, 0.0]]


def radar_of(schedule: Any = None, waveform: Any = WAVEFORM) -> rc.Radar:
    return rc.Radar(waveform, tx=TX, rx=RX, schedule=schedule)


def test_transmitters_in_turn_share_the_chirp_interval() -> None:
    radar = radar_of(rc.Schedule.tdm())
    np.testing.assert_allclose(radar.channel_offsets, [0, 0, 0, 30e-6, 30e-6, 30e-6], rtol=1e-12, atol=0)
    np.testing.assert_allclose(radar_of(rc.Schedule.tdm(order=[1, 0])).channel_offsets[:1], [30e-6], rtol=1e-12)
    np.testing.assert_allclose(radar_of(rc.Schedule.tdm(25e-6)).channel_offsets[3:], 3 * [25e-6], rtol=1e-12)
    assert (radar.num_channels, radar.num_chirps) == (6, 8)
    # Seven intervals, one turn, and 99 sample times.
    assert radar.duration == pytest.approx(7 * 60e-6 + 30e-6 + 99 / 5e6, rel=1e-12)
    np.testing.assert_array_equal(radar.virtual_array, radar_of().virtual_array)


@pytest.mark.parametrize("schedule", [rc.Schedule.ddm(), rc.Schedule.steered([1.0, 1j])])
def test_channels_of_transmitters_at_once_are_the_receivers(schedule: rc.Schedule) -> None:
    radar = radar_of(schedule)
    assert radar.num_channels == 3
    np.testing.assert_allclose(radar.virtual_array[:, 1], [-2e-3, 0.0, 2e-3], rtol=0, atol=1e-18)
    assert radar.channel_offsets.tolist() == [0.0, 0.0, 0.0]


def test_unambiguous_velocity_is_divided_among_transmitters_by_ddm_alone() -> None:
    for schedule, divisor in (
        (None, 1),
        (rc.Schedule.tdm(), 1),
        (rc.Schedule.ddm(), 2),
        (rc.Schedule.steered([1, 1]), 1),
    ):
        assert radar_of(schedule).max_velocity == WAVEFORM.max_velocity / divisor


def test_ddm_weights_turn_by_their_share_from_chirp_to_chirp() -> None:
    weights = rc.Schedule.ddm().tx_weights(np.zeros((4, 3)), 4e-3, 5)
    np.testing.assert_allclose(weights[1], [1, 1j, -1, -1j], rtol=0, atol=1e-15)
    np.testing.assert_allclose(weights[4], np.ones(4), rtol=0, atol=1e-15)


def test_weights_of_angles_are_those_of_the_textbook() -> None:
    """Two antennas with half-wavelength spacing: pi sin(azimuth) between them, the nearer one behind."""
    wavelength = 4e-3
    tx = np.array([[0.0, 0.0, 0.0], [0.0, 2e-3, 0.0]])
    weights = rc.Schedule.steered(azimuth=np.deg2rad(30.0)).tx_weights(tx, wavelength, 3)
    assert np.angle(weights[:, 1] / weights[:, 0]) == pytest.approx(3 * [-0.5 * np.pi], abs=1e-12)
    np.testing.assert_allclose(np.abs(weights), 1.0, rtol=1e-15)
    up = rc.Schedule.steered(elevation=0.3).tx_weights(tx, wavelength, 3)
    np.testing.assert_allclose(up, 1.0, rtol=0, atol=1e-15)


def test_alternating_chirps_share_the_band_and_the_times() -> None:
    waveform = replace(WAVEFORM, adc_delay=3e-6)
    up, down = waveform.alternating()
    np.testing.assert_allclose(up.chirp_times, 120e-6 * np.arange(4), rtol=0, atol=1e-18)
    np.testing.assert_allclose(down.chirp_times, 60e-6 + 120e-6 * np.arange(4), rtol=0, atol=1e-18)
    assert (up.slope, down.slope) == (20e12, -20e12)
    assert down.center_frequency == pytest.approx(up.center_frequency, rel=1e-15)
    first, last = (down.start_frequency + down.slope * (3e-6 + t) for t in (0.0, 100 / 5e6))
    assert first == pytest.approx(77e9 + 20e12 * (3e-6 + 20e-6), rel=1e-15)
    assert last == pytest.approx(77e9 + 20e12 * 3e-6, rel=1e-15)
    assert (up.frame_interval, down.frame_interval) == 2 * (waveform.frame_interval,)
    assert up.max_velocity == pytest.approx(waveform.max_velocity / 2.0, rel=1e-3)
    radar = rc.Radar((up, down))
    assert (radar.waveform, radar.waveforms, radar.num_chirps) == (up, (up, down), 8)
    # In turn with the transmitters: a quarter of the interval of each.
    first_tx, second_tx = rc.Radar((up, down), tx=TX, schedule=rc.Schedule.tdm()).channel_offsets
    assert (first_tx, second_tx) == (0.0, pytest.approx(30e-6, rel=1e-9))


def test_radars_of_sub_sequences_have_the_times_of_the_whole() -> None:
    radar = radar_of(rc.Schedule.tdm(), WAVEFORM.alternating())
    for part, waveform in zip(radar.sequences(), radar.waveforms, strict=True):
        assert part.waveforms == (waveform,)
        np.testing.assert_array_equal(part.channel_offsets, radar.channel_offsets)
    alone = radar_of(rc.Schedule.tdm())
    assert alone.sequences() == (alone,)


def test_weights_cannot_be_changed() -> None:
    weights = np.array([1.0, 1.0])
    schedule = rc.Schedule.steered(weights)
    weights[0] = 0.0
    assert schedule.weights is not None
    assert schedule.weights.tolist() == [1.0, 1.0]
    with pytest.raises(ValueError, match="read-only"):
        schedule.weights[0] = 0.0


def test_turns_of_one_transmitter_are_chirps() -> None:
    radar = rc.Radar(WAVEFORM, rx=RX, schedule=rc.Schedule.tdm())
    assert radar.channel_offsets.tolist() == [0.0, 0.0, 0.0]
