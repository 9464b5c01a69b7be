"""Patterns of arrays: against the array factor on paper, Dolph's side lobes, and simulated targets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc

WAVEFORM = rc.Waveform(start_frequency=76.5e9, slope=20e12, sample_rate=4e6, num_samples=64)
WAVELENGTH = WAVEFORM.wavelength
AZIMUTH = np.deg2rad(np.arange(-90.0, 90.01, 0.1))


def row(number: int, spacing: float = 0.5, axis: int = 1) -> NDArray[np.float64]:
    """Positions along an axis; spacing in wavelengths."""
    return WAVELENGTH * spacing * np.arange(number)[:, None] * np.eye(3)[axis]


def array_factor(number: int, psi: Any) -> NDArray[np.float64]:
    """``|sin(N psi / 2) / (N sin(psi / 2))|^2``."""
    half = 0.5 * np.asarray(psi)
    whole = np.abs(np.sin(half)) < 1e-7
    return np.where(whole, 1.0, (np.sin(number * half) / (number * np.sin(np.where(whole, 1.0, half)))) ** 2)


@pytest.mark.parametrize("steer_deg", [0.0, 30.0, -50.0])
@pytest.mark.parametrize("spacing", [0.4, 0.5, 0.9])
def test_uniform_row_has_the_array_factor_about_where_it_is_steered(spacing: float, steer_deg: float) -> None:
    radar = rc.Radar(WAVEFORM, tx=row(3, 4.0), rx=row(8, spacing)[::-1])
    to = np.deg2rad(steer_deg)
    pattern = rc.array_pattern(radar, AZIMUTH, steer=to)
    for level, number, step in ((pattern.receive_db, 8, spacing), (pattern.transmit_db, 3, 4.0)):
        psi = 2.0 * np.pi * step * (np.sin(AZIMUTH) - np.sin(to))
        np.testing.assert_allclose(10.0 ** (0.1 * level), number * array_factor(number, psi), atol=1e-9)
    np.testing.assert_array_equal(pattern.two_way_db, pattern.transmit_db + pattern.receive_db)


def test_plane_is_the_product_of_its_rows_and_steers_in_both_angles() -> None:
    places = (row(4)[:, None] + row(3, axis=2)).reshape(-1, 3)
    azimuth, elevation = AZIMUTH[::50, None], AZIMUTH[::60]
    to = np.deg2rad([20.0, -15.0])
    both = rc.array_pattern(rc.Radar(WAVEFORM, tx=places), azimuth, elevation, steer=to).transmit_db
    across = np.sin(azimuth) * np.cos(elevation) - np.sin(to[0]) * np.cos(to[1])
    up = np.sin(elevation) - np.sin(to[1])
    expected = 12.0 * array_factor(4, np.pi * across) * array_factor(3, np.pi * up)
    np.testing.assert_allclose(10.0 ** (0.1 * both), expected, atol=1e-9)


def test_elements_multiply_the_array_factor() -> None:
    narrow, wide = rc.GaussianPattern(10.0, 40.0, 40.0), rc.IsotropicPattern(2.0)
    radar = rc.Radar(WAVEFORM, tx=row(4), rx=row(2), tx_patterns=[narrow] * 4, rx_patterns=[wide, narrow])
    plain = rc.array_pattern(rc.Radar(WAVEFORM, tx=row(4), rx=row(2)), AZIMUTH)
    pattern = rc.array_pattern(radar, AZIMUTH)
    expected = 10.0 ** (0.1 * plain.transmit_db) * narrow.gain(AZIMUTH, 0.0)
    np.testing.assert_allclose(10.0 ** (0.1 * pattern.transmit_db), expected, atol=1e-9)
    ahead = rc.array_pattern(radar, 0.0).receive_db
    fields = 10.0 ** (0.05 * 2.0) + 10.0 ** (0.05 * 10.0)  # of different elements fields add
    assert float(ahead) == pytest.approx(20.0 * np.log10(fields) - 10.0 * np.log10(2.0))


@pytest.mark.parametrize("attenuation", [30.0, 50.0])
def test_chebyshev_window_has_all_side_lobes_at_its_level(attenuation: float) -> None:
    radar = rc.Radar(WAVEFORM, rx=row(16)[::-1])
    level = rc.array_pattern(radar, AZIMUTH, rx_window=("chebwin", attenuation)).receive_db
    below = level - level.max()
    is_peak = (below[1:-1] > below[:-2]) & (below[1:-1] > below[2:])
    side_lobes = np.sort(below[1:-1][is_peak])[:-1]
    assert len(side_lobes) == 14
    np.testing.assert_allclose(side_lobes, -attenuation, atol=0.1)  # the grid of 0.1 degrees misses peaks by less


def test_weights_are_used_as_given_and_their_scale_does_not_matter() -> None:
    radar = rc.Radar(WAVEFORM, rx=row(4), tx=row(4))
    weights = rc.processing.steering_weights(radar.rx, WAVELENGTH, 0.3)
    steered = rc.array_pattern(radar, AZIMUTH, steer=0.3)
    given = rc.array_pattern(radar, AZIMUTH, rx_weights=5.0j * weights)
    np.testing.assert_allclose(10 ** (0.1 * given.receive_db), 10 ** (0.1 * steered.receive_db), atol=1e-9)
    only_first = rc.array_pattern(radar, AZIMUTH, tx_weights=[1.0, 0.0, 0.0, 0.0], steer=(0.3, 0.0))
    np.testing.assert_allclose(only_first.transmit_db, 0.0, atol=1e-9)


def test_steering_weights_undo_the_phases_of_a_target_there() -> None:
    places = np.random.default_rng(5).uniform(-0.01, 0.01, (6, 3))
    azimuth, elevation = np.array([0.3, -0.8]), np.array([0.1, 0.4])
    weights = rc.processing.steering_weights(places, WAVELENGTH, azimuth, elevation)
    assert weights.shape == (2, 6)
    far = 1e5 * np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    paths = np.linalg.norm(far.T[:, None] - places, axis=-1) - 1e5
    np.testing.assert_allclose(weights * np.exp(2j * np.pi * paths / WAVELENGTH), 1.0, atol=1e-5)


def test_weighted_channels_of_simulated_targets_follow_the_two_way_pattern() -> None:
    radar = rc.Radar(WAVEFORM, tx=row(4, 1.0), rx=row(3), pattern=rc.GaussianPattern(8.0, 70.0, 60.0))
    to = np.deg2rad(15.0)
    weights = np.kron(*(rc.processing.steering_weights(places, WAVELENGTH, to) for places in (radar.tx, radar.rx)))
    angles = np.deg2rad([-40.0, -22.0, -8.0, 3.0, 15.0, 28.0, 44.0])
    expected = rc.array_pattern(radar, angles, steer=to).two_way_db
    found = []
    for angle in angles:
        # Far: over 20 m the wave front of a target bends by (1.5 wavelengths)^2 / (8 R), 1e-4 turns.
        scene = rc.Scene([rc.PointTarget([20.0 * np.cos(angle), 20.0 * np.sin(angle), 0.0])])
        cube = rc.Simulator(scene, radar, field_of_view_deg=(120.0, 30.0)).frame(0.0).cube
        beam = np.abs(np.tensordot(weights, cube, 1)).mean()
        found.append(20.0 * np.log10(beam))
    np.testing.assert_allclose(np.array(found) - found[4], expected - expected[4], atol=0.1)
