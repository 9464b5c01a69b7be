"""Radars, their antennas and the presets of real sensors."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

import radarcore as rc
from chip_settings import power_up

C = 299_792_458.0  # [m/s]

WAVEFORM = rc.Waveform(start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=64, num_chirps=4)
SLOW = WAVEFORM.replace(chirp_interval=100e-6)
TX = [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]
RX = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.05], [0.02, 0.0, 0.0]]


def test_virtual_array_has_the_phases_of_far_echoes() -> None:
    radar = rc.Radar(WAVEFORM, tx=TX, rx=RX)
    away = np.array([0.8, 0.36, -0.48])  # a unit vector
    target = radar.array_center + 1e6 * away
    delay = rc.Simulator(rc.Scene([rc.PointTarget(target)]), radar, resolution=2).paths().delay[:, 0]
    # Curvature leaves 0.1^2 m^2 over 1e6 m, rounding 1e6 m times 1e-16: both a hundred times less.
    np.testing.assert_allclose(C * delay - 2e6, -radar.virtual_array @ away, atol=1e-8, rtol=0.0)
    assert (radar.channel_offsets == np.zeros(6)).all()


def test_default_radar_is_one_isotropic_watt_into_an_ideal_receiver() -> None:
    radar = rc.Radar(WAVEFORM)
    assert (radar.num_channels, radar.tx_power, radar.receiver, radar.is_real) == (1, 1.0, None, False)
    assert radar.pattern == rc.IsotropicPattern()
    assert radar.pattern.gain(0.3, -1.0) == 1.0
    assert rc.Radar(WAVEFORM, tx_power_dbm=4.0).tx_power == pytest.approx(2.511886e-3, rel=2e-7)


def test_gaussian_beam_has_its_gain_on_boresight_and_half_at_half_the_full_width() -> None:
    pattern = rc.GaussianPattern(6.0, beamwidth_azimuth_deg=60.0, beamwidth_elevation_deg=40.0)
    peak = 10.0**0.6
    assert pattern.gain(0.0, 0.0) == pytest.approx(peak, rel=1e-14)
    for sign in (-1.0, 1.0):
        assert pattern.gain(sign * np.deg2rad(30.0), 0.0) == pytest.approx(peak / 2.0, rel=1e-14)
        assert pattern.gain(0.0, sign * np.deg2rad(20.0)) == pytest.approx(peak / 2.0, rel=1e-14)
    # Gaussian: a quarter where both are half, a sixteenth at the full width.
    assert pattern.gain(np.deg2rad(30.0), np.deg2rad(20.0)) == pytest.approx(peak / 4.0, rel=1e-14)
    assert pattern.gain(np.deg2rad(60.0), 0.0) == pytest.approx(peak / 16.0, rel=1e-14)


def test_gain_takes_arrays_that_broadcast() -> None:
    azimuth, elevation = np.linspace(-1.0, 1.0, 5), np.linspace(-0.5, 0.5, 3)[:, None]
    for pattern in (rc.GaussianPattern(6.0, 60.0, 40.0), rc.IsotropicPattern(3.0)):
        gain = pattern.gain(azimuth, elevation)
        assert gain.shape == (3, 5)
        assert gain[1, 2] == gain.max() == pytest.approx(10.0 ** (pattern.gain_db / 10.0), rel=1e-14)
        assert gain[2, 0] == pattern.gain(-1.0, 0.5)


def test_bgt60tr13c_sees_ten_metres_at_40_hz() -> None:
    radar = rc.bgt60tr13c()
    wf = radar.waveform
    assert (wf.sample_rate, wf.num_samples, wf.num_chirps) == (2e6, 128, 64)
    assert (wf.adc_delay, wf.chirp_interval, wf.frame_interval) == (3.1125e-6, 300e-6, 25e-3)
    # 60 to 61 GHz in 3.1125 + 64 us, 64 us sampled: 954 MHz, c / (2 B) = 0.1572 m, 64 bins of it.
    assert wf.start_frequency == 60e9
    assert wf.start_frequency + wf.slope * (wf.adc_delay + 64e-6) == pytest.approx(61e9, rel=1e-15)
    assert radar.max_unambiguous_range == pytest.approx(10.06, abs=0.005)
    # 4.955 mm at 60.52 GHz over four times 300 us.
    assert wf.max_velocity == pytest.approx(4.128, abs=1e-3)


def test_largest_range_is_half_the_range_axis_of_real_samples_and_all_of_it_of_iq() -> None:
    wf = rc.bgt60tr13c().waveform
    axis = wf.range_axis()
    real, iq = (rc.Radar(wf, receiver=rc.Receiver(output=output)) for output in ("real", "iq"))
    assert real.max_unambiguous_range == wf.max_range == pytest.approx(axis[len(axis) // 2], rel=1e-12)
    assert (
        iq.max_unambiguous_range == rc.Radar(wf).max_unambiguous_range == pytest.approx(axis[-1] + axis[1], rel=1e-12)
    )
    # Requirements hold for real samples.
    designed = rc.Waveform.design(max_range=5.0, range_resolution=0.1)
    assert designed.max_range == pytest.approx(5.0)
    assert rc.Radar(designed).max_unambiguous_range == pytest.approx(10.0)


def test_bgt60tr13c_has_a_gigahertz_where_one_end_is_given() -> None:
    for given, (start, stop) in (
        ({"start_frequency": 58.5e9}, (58.5e9, 59.5e9)),
        ({"stop_frequency": 62e9}, (61e9, 62e9)),
        ({"start_frequency": 63.5e9}, (63.5e9, 64e9)),
        ({"stop_frequency": 57.5e9}, (57e9, 57.5e9)),
    ):
        wf = rc.bgt60tr13c(**given).waveform
        assert wf.start_frequency == start
        assert wf.start_frequency + wf.slope * (wf.adc_delay + 64e-6) == pytest.approx(stop, rel=1e-15)


def test_bgt60tr13c_takes_times_that_requirements_leave_free() -> None:
    wf = rc.bgt60tr13c(max_range=5.0, chirp_interval=500e-6, num_chirps=100).waveform
    assert (wf.chirp_interval, wf.num_chirps) == (500e-6, 100)
    assert wf.frame_interval >= 100 * 500e-6
    assert rc.bgt60tr13c(max_velocity=5.0, frame_interval=0.1).waveform.frame_interval == 0.1
    with pytest.raises(ValueError, match="chirp_interval: expected none beside max_velocity, which decide it"):
        rc.bgt60tr13c(max_velocity=5.0, chirp_interval=500e-6)
    with pytest.raises(ValueError, match="num_samples: expected at most 0 in a band of 100000 Hz at 2 MHz, got 1"):
        rc.bgt60tr13c(rate=40.0, start_frequency=63.4999e9)


def test_bgt60tr13c_samples_5_ghz_of_its_sweep_at_power_up() -> None:
    radar = power_up()
    wf = radar.waveform
    # 58 to 63.5 GHz in 3.1125 + 32 us, 32 us sampled: 5.5 GHz * 32 / 35.1125, table value 5.0125 GHz.
    assert abs(wf.bandwidth - 5.0125e9) <= 0.5e5
    assert wf.start_frequency + wf.slope * (wf.adc_delay + 64 / 2e6) == pytest.approx(63.5e9, rel=1e-15)
    assert (wf.start_frequency, wf.sample_rate, wf.num_samples, wf.num_chirps) == (58e9, 2e6, 64, 64)
    assert (wf.adc_delay, wf.chirp_interval) == (3.1125e-6, 591.125e-6)
    assert wf.range_resolution == pytest.approx(0.029905, abs=5e-7)  # 3 cm


def test_bgt60tr13c_has_one_tx_and_three_rx_in_an_l_with_real_samples() -> None:
    radar = rc.bgt60tr13c()
    assert (radar.tx.shape, radar.rx.shape, radar.num_channels) == ((1, 3), (3, 3), 3)
    assert radar.is_real
    rx1, rx2, rx3 = radar.rx
    np.testing.assert_allclose(abs(rx1 - rx3), [0.0, 2.5e-3, 0.0], rtol=0, atol=1e-15)  # azimuth pair
    np.testing.assert_allclose(abs(rx2 - rx3), [0.0, 0.0, 2.5e-3], rtol=0, atol=1e-15)  # elevation pair
    # About half a wavelength: 2.47 mm at 60.75 GHz.
    assert 0.4 < 2.5e-3 / radar.waveform.wavelength < 0.6
    assert (radar.receiver.output, radar.receiver.noise_figure_db) == ("real", 12.0)
    assert (radar.pattern.gain_db, radar.tx_power_dbm) == (3.5, 4.0)


def test_bgt60tr13c_takes_keywords_of_the_waveform() -> None:
    wf = rc.bgt60tr13c(num_chirps=16, num_samples=128, chirp_interval=400e-6, stop_frequency=62e9).waveform
    assert (wf.num_chirps, wf.num_samples, wf.chirp_interval) == (16, 128, 400e-6)
    assert wf.start_frequency + wf.slope * (wf.adc_delay + 128 / 2e6) == pytest.approx(62e9, rel=1e-15)
    assert rc.bgt60tr13c(slope=-50e12, start_frequency=63e9).waveform.slope == -50e12
    assert rc.bgt60tr13c(tx_power_dbm=0.0).tx_power == pytest.approx(1e-3, rel=1e-15)
    wide = rc.IsotropicPattern(2.0)
    assert rc.bgt60tr13c(pattern=wide).rx_patterns == (wide,) * 3
    staggered = rc.bgt60tr13c(num_chirps=3, chirp_times=[0.0, 1e-3, 3e-3]).waveform
    assert staggered.chirp_times.tolist() == [0.0, 1e-3, 3e-3]
    assert rc.bgt60tr13c(num_chirps=512).waveform.frame_interval >= 512 * 300e-6


RADARS = [
    rc.Radar(WAVEFORM),
    rc.Radar(WAVEFORM, tx=TX, rx=RX, pattern=rc.GaussianPattern(5.0, 60.0, 30.0), tx_power_dbm=0.1 + 0.2),
    rc.Radar(WAVEFORM, pattern=rc.IsotropicPattern(3.0), receiver=rc.Receiver(noise_figure_db=12.0)),
    rc.bgt60tr13c(),
    rc.bgt60tr13c(num_chirps=2, chirp_times=[1e-4, 7e-4]),
    rc.Radar(WAVEFORM, polarization="vertical"),
    rc.Radar(WAVEFORM, polarization="horizontal"),
    rc.Radar(WAVEFORM, polarization=[0.1, 0.0, np.sqrt(0.99)]),
    rc.Radar(WAVEFORM, pattern=rc.TabulatedPattern([-1.0, 1.0], [-0.1, 0.1, 0.3], [[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]])),
    rc.Radar(WAVEFORM, tx=TX, tx_patterns=[rc.IsotropicPattern(), rc.GaussianPattern(5.0, 60.0, 30.0)]),
    rc.Radar(WAVEFORM, tx=TX, rx=TX, rx_patterns=[rc.IsotropicPattern(), rc.GaussianPattern(5.0, 60.0, 30.0)]),
    rc.Radar([SLOW, SLOW.replace(slope=-50e12, start_frequency=62e9).delayed(4e-3)], tx=TX),
    rc.Radar(SLOW.alternating(), tx=TX, schedule=rc.Schedule.tdm(), channel_weights=[0.9 + 0.1j, 1.0]),
    *(
        rc.Radar(SLOW, tx=TX, schedule=schedule)
        for schedule in (
            rc.Schedule.tdm(),
            rc.Schedule.tdm(40e-6),
            rc.Schedule.tdm(order=[1, 0]),
            rc.Schedule.ddm(),
            rc.Schedule.ddm([0.0, 1.0 / 3.0]),
            rc.Schedule.steered([1.0, 0.1 + 0.2j]),
            rc.Schedule.steered(np.exp(1j * np.arange(16.0)).reshape(4, 4)[:, :2]),
            rc.Schedule.steered(azimuth=0.3),
            rc.Schedule.steered(azimuth=np.linspace(-0.3, 0.3, 4), elevation=0.1),
        )
    ),
]


@pytest.mark.parametrize("radar", RADARS)
def test_dict_makes_the_round_trip_through_json(radar: rc.Radar) -> None:
    back = rc.Radar.from_dict(json.loads(json.dumps(radar.to_dict())))
    assert back == radar
    assert hash(back) == hash(radar)
    np.testing.assert_array_equal(back.rx, radar.rx)
    assert (back.pattern, back.receiver, back.tx_power_dbm) == (radar.pattern, radar.receiver, radar.tx_power_dbm)
    assert (back.tx_patterns, back.rx_patterns) == (radar.tx_patterns, radar.rx_patterns)
    assert back.polarization_vector == radar.polarization_vector
    assert (back.schedule, back.waveforms) == (radar.schedule, radar.waveforms)
    np.testing.assert_array_equal(back.channel_corrections, radar.channel_corrections)
    assert hash(back.schedule) == hash(radar.schedule)
    assert pickle.loads(pickle.dumps(radar)) == radar
    assert replace(radar, tx_power_dbm=1.0).waveforms == radar.waveforms
    for part in radar.sequences():
        np.testing.assert_array_equal(part.channel_corrections, radar.channel_corrections)


def test_polarization_is_a_word_or_a_unit_vector() -> None:
    vectors = {"vertical": (0.0, 0.0, 1.0), "horizontal": (0.0, 1.0, 0.0), None: None}
    for word, vector in vectors.items():
        assert rc.Radar(WAVEFORM, polarization=word).polarization_vector == vector
    slanted = rc.Radar(WAVEFORM, polarization=[0.0, 0.7071, 0.7071]).polarization_vector
    assert slanted == pytest.approx((0.0, np.sqrt(0.5), np.sqrt(0.5)), rel=1e-15)


def test_radars_are_equal_when_their_numbers_are() -> None:
    for i, one in enumerate(RADARS):
        for j, other in enumerate(RADARS):
            assert (one == other) == (i == j)
    assert RADARS[0] != "radar"


def test_antenna_positions_are_copies_that_cannot_be_changed() -> None:
    rx = np.array(RX)
    radar = rc.Radar(WAVEFORM, rx=rx)
    rx[0] = 7.0
    assert radar.rx.tolist() == RX
    with pytest.raises(ValueError, match="read-only"):
        radar.rx[0, 0] = 1.0
