"""Directions of detections: against far targets on paper, the Cramer-Rao bound and its closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.direction import unit_vectors
from radarcore.units import SPEED_OF_LIGHT

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=32, num_chirps=16, chirp_interval=60e-6
)
WAVELENGTH = WAVEFORM.wavelength
RNG = np.random.default_rng(20)

EXACT = 1e-6
"""Error without noise [rad]: targets at 1e5 m have phases curved by 1e-7 turns over a few wavelengths, and the phases
of 4e7 turns are rounded to 1e-8."""


def row(number: int, spacing: float, axis: int = 1) -> NDArray[np.float64]:
    """Positions along an axis; spacing in wavelengths."""
    return WAVELENGTH * spacing * np.arange(number)[:, None] * np.eye(3)[axis]


ONE = np.zeros((1, 3))
ARRAYS = {
    "pair": (ONE, row(2, 0.5), (True, False)),
    "row of 3 x 4": (row(3, 2.0), row(4, 0.5), (True, False)),
    "column": (ONE, row(4, 0.5, axis=2), (False, True)),
    "plane of 3 x 4": (row(3, 0.5, axis=2), row(4, 0.5), (True, True)),
    "L of 3": (ONE, WAVELENGTH * np.array([[0, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]), (True, True)),
    "bent plane": (row(3, 0.5, axis=2), WAVELENGTH * np.array([[0, 0, 0], [0.2, 0.5, 0], [0.1, 1, 0]]), (True, True)),
    "oblique line": (ONE, WAVELENGTH * np.array([[0, 0, 0], [0, 0.5, 0.5], [0, 1, 1]]), (False, False)),
    "along x": (ONE, row(3, 0.5, axis=0), (False, False)),
    "single": (ONE, ONE, (False, False)),
}


def echoes(radar: rc.Radar, azimuth: Any, elevation: Any, velocity: Any = 0.0) -> NDArray[np.complex128]:
    """Cells (n, channel) of far targets, from their distances to every antenna."""
    far = 1e5 * unit_vectors(azimuth, elevation)
    lengths = [np.linalg.norm(far[:, None] - antennas, axis=-1) for antennas in (radar.tx, radar.rx)]
    total = (lengths[0][:, :, None] + lengths[1][:, None, :]).reshape(len(far), -1)
    total = total + 2.0 * np.multiply.outer(velocity * np.ones(len(far)), radar.channel_offsets)
    return np.exp(2j * np.pi * WAVEFORM.center_frequency / SPEED_OF_LIGHT * total)


def angles(told: tuple[bool, bool], largest: float = 1.2) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return tuple(RNG.uniform(-largest, largest, 60) * is_told for is_told in told)  # type: ignore[return-value]


@pytest.mark.parametrize(("tx", "rx", "told"), ARRAYS.values(), ids=ARRAYS)
def test_single_target_has_its_direction_or_nan_where_the_array_tells_none(
    tx: Any, rx: Any, told: tuple[bool, bool]
) -> None:
    azimuth, elevation = angles(told, largest=1.0 if np.ptp(rx[:, 0]) > 0.0 else 1.2)
    radar = rc.Radar(WAVEFORM, tx=tx, rx=rx)
    found = rc.directions(echoes(radar, azimuth, elevation), radar)
    assert len(found) == 60
    for estimate, truth, is_told in zip((found.azimuth, found.elevation), (azimuth, elevation), told, strict=True):
        if is_told:
            np.testing.assert_allclose(estimate, truth, atol=4 * EXACT)  # angles by sines: 1 / cos(1.2) = 2.8
        else:
            assert np.isnan(estimate).all()
    assert np.isnan(found.covariance).all()


@pytest.mark.parametrize("spacing", [0.7, 1.0, 2.0])
def test_of_ambiguous_directions_the_one_nearest_to_the_front_is_taken(spacing: float) -> None:
    # Sines that differ by 1 / spacing give the same phases: sines within half of it of the front stay unchanged.
    warned = pytest.warns(UserWarning, match=f"ambiguous beyond {np.rad2deg(np.arcsin(0.5 / spacing)):.0f} deg")
    radar = rc.Radar(WAVEFORM, rx=row(6, spacing), tx=row(2, spacing, axis=2))
    sines = RNG.uniform(-0.45, 0.45, (50, 2)) / spacing
    for shift in ((0, 0), (1 / spacing, 0), (0, -1 / spacing), (1 / spacing, 1 / spacing)):
        shifted = sines + shift
        visible = np.linalg.norm(shifted, axis=1) < 0.9
        if not visible.any():
            continue
        el = np.arcsin(shifted[visible, 1])
        az = np.arcsin(shifted[visible, 0] / np.cos(el))
        with warned:
            found = rc.directions(echoes(radar, az, el), radar)
        assert np.sin(found.ambiguous_beyond) == pytest.approx(0.5 / spacing)
        np.testing.assert_allclose(np.sin(found.elevation), sines[visible, 1], atol=EXACT)
        np.testing.assert_allclose(np.sin(found.azimuth) * np.cos(found.elevation), sines[visible, 0], atol=EXACT)
        # The true direction is among all with these phases.
        nearest = np.stack([found.azimuth, found.elevation], axis=1)
        candidates = np.concatenate([nearest[:, None], found.alternatives], axis=1)
        distance = np.linalg.norm(candidates - np.stack([az, el], axis=1)[:, None], axis=2)
        assert np.nanmin(distance, axis=1).max() < 5 * EXACT


@pytest.mark.filterwarnings("ignore:radar. expected a channel spacing below")
@pytest.mark.parametrize("positions", [[[0, 0, 0], [0, 1.1, 0], [0, 0.3, 0.9]], [[0, 0, 0], [0, 1.7, 0]]])
def test_of_few_channels_too_the_direction_nearest_to_the_front_is_taken(positions: Any) -> None:
    # So few channels always add up in phase somewhere: in the given direction, and in all that turns add to it.
    radar = rc.Radar(WAVEFORM, rx=WAVELENGTH * np.array(positions))
    told = np.array(positions)[1:, 1 : len(positions)]
    sines = np.zeros((200, 2))
    sines[:, : len(told)] = RNG.uniform(-0.65, 0.65, (200, len(told)))
    el = np.arcsin(sines[:, 1])
    found = rc.directions(echoes(radar, np.arcsin(sines[:, 0] / np.cos(el)), el), radar)
    turns = np.stack(np.meshgrid(*len(told) * [np.arange(-5, 6)]), axis=-1).reshape(-1, len(told))
    candidates = sines[:, None, : len(told)] + turns @ np.linalg.inv(told).T
    nearest = candidates[np.arange(200), np.square(candidates).sum(axis=2).argmin(axis=1)]
    elevation = found.elevation if len(told) > 1 else np.zeros(200)
    np.testing.assert_allclose(np.sin(found.azimuth) * np.cos(elevation), nearest[:, 0], atol=4 * EXACT)
    if len(told) > 1:
        np.testing.assert_allclose(np.sin(elevation), nearest[:, 1], atol=4 * EXACT)


def test_ambiguity_outside_of_the_field_of_view_raises_no_warning() -> None:
    narrow = rc.GaussianPattern(12.0, 20.0, 20.0)  # two ways 20 dB down at 18 degrees
    for rx, pattern, limit in ((row(4, 1.0), narrow, np.pi / 6), (row(4, 0.5), None, np.pi / 2)):
        radar = rc.Radar(WAVEFORM, rx=rx, pattern=pattern)
        assert rc.directions(np.ones((1, 4)), radar).ambiguous_beyond == pytest.approx(limit)


@pytest.mark.parametrize("name", ["row of 3 x 4", "L of 3", "plane of 3 x 4", "bent plane"])
def test_targets_nearby_have_their_directions_with_their_distances(name: str) -> None:
    tx, rx, told = ARRAYS[name]
    azimuth, elevation = angles(told, largest=0.8)
    radar = rc.Radar(WAVEFORM, tx=tx, rx=rx)
    size = np.ptp(np.concatenate([tx, rx]), axis=0).max() + WAVELENGTH
    distance = np.linspace(6.0, 60.0, 60) * size
    places = distance[:, None] * unit_vectors(azimuth, elevation) + radar.array_center
    to_tx, to_rx = (np.linalg.norm(places[:, None] - antennas, axis=-1) for antennas in (radar.tx, radar.rx))
    both = (to_tx[:, :, None] + to_rx[:, None]).reshape(60, -1)
    cells = np.exp(2j * np.pi / WAVELENGTH * both) / (to_tx[:, :, None] * to_rx[:, None]).reshape(60, -1)
    found = rc.directions(cells, radar, range=distance, snr_db=np.full(60, 60.0))
    plane = rc.directions(cells, radar, snr_db=np.full(60, 60.0))
    for axis, truth in (("azimuth", azimuth), ("elevation", elevation)):
        if np.isfinite(getattr(found, axis)).all():
            assert np.abs(getattr(found, axis) - truth).max() <= 2e-3
            assert np.abs(getattr(plane, axis) - truth).max() >= 1e-2
    assert found.is_resolved.all()


def white_noise(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.complex128]:
    """Noise of power 1 per channel."""
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) * np.sqrt(0.5)


def test_most_wrong_directions_of_three_channels_are_flagged() -> None:
    # Any three phases fit a plane wave: the amplitudes of two waves differ between channels.
    radar, number, rng = rc.bgt60tr13c(), 4000, np.random.default_rng(8)
    azimuth, elevation = rng.uniform(-0.8, 0.8, (2, 2, number))
    amplitude = 10.0 ** (rng.uniform([[22], [12]], [[32], [22]], (2, number)) / 20)
    waves = [
        level[:, None] * rc.processing.steering_weights(radar.virtual_array, radar.waveform.wavelength, az, el).conj()
        for level, az, el in zip(amplitude, azimuth, elevation, strict=True)
    ]
    both = waves[0] + waves[1] * np.exp(2j * np.pi * rng.uniform(size=(number, 1)))
    found, alone = (
        rc.directions(cells, radar, snr_db=10 * np.log10(np.square(np.abs(cells)).mean(axis=1) - 1))
        for cells in (wave + white_noise(rng, both.shape) for wave in (both, waves[0]))
    )
    truth = unit_vectors(azimuth, elevation)
    error = np.linalg.norm(unit_vectors(found.azimuth, found.elevation) - truth, axis=-1).min(axis=0)
    is_wrong = error > 0.3  # a third of the beam of two channels with half-wavelength spacing
    assert is_wrong.mean() > 0.1
    assert (~found.is_resolved[is_wrong]).mean() >= 0.9
    assert alone.is_resolved.mean() >= 0.988  # false alarms: 1 %
    # Of all flagged directions the errors are at most what the covariance says, and not far below.
    errors = np.stack([found.azimuth - azimuth, found.elevation - elevation], axis=-1)[:, ~found.is_resolved]
    squared = np.einsum("wni,nij,wnj->wn", errors, np.linalg.inv(found.covariance[~found.is_resolved]), errors)
    assert 0.5 <= np.sqrt(squared.min(axis=0).mean() / 2) <= 1.3


def two_wave_bound(places: NDArray[np.float64], sines: Any, amplitudes: Any) -> NDArray[np.float64]:
    """Cramer-Rao bound of both sines at noise of 1 per channel: the inverse of the information of all six numbers."""
    waves = np.exp(-2j * np.pi * np.outer(places, sines))
    by_sines = -2j * np.pi * places[:, None] * waves * amplitudes
    jacobian = np.concatenate([by_sines, waves, 1j * waves], axis=1)
    return np.linalg.inv(2.0 * (jacobian.conj().T @ jacobian).real)[:2, :2]


def test_errors_of_the_stronger_of_two_waves_have_the_bound_of_both() -> None:
    radar, number, rng = rc.Radar(WAVEFORM, rx=row(8, 0.5)), 200, np.random.default_rng(2)
    places, beam = radar.virtual_array[:, 1] / WAVELENGTH, 0.886 / 4.0
    apart = beam * rng.uniform(1.0, 3.0, number)
    sines = rng.uniform(-0.3, 0.3, number)[:, None] + apart[:, None] * [-0.5, 0.5]
    amplitudes = np.sqrt([1000.0, 200.0]) * np.exp(2j * np.pi * rng.uniform(size=(number, 2)))
    waves = np.exp(-2j * np.pi * sines[:, None] * places[:, None]) @ amplitudes[..., None]
    cells = waves[..., 0] + white_noise(rng, (number, 8))
    snr_db = 10.0 * np.log10(np.square(np.abs(cells)).mean(axis=1) - 1.0)
    found = rc.directions(cells, radar, snr_db=snr_db)
    assert not found.is_resolved.any()
    bound = np.array([two_wave_bound(places, *each)[0, 0] for each in zip(sines, amplitudes, strict=True)])
    deviation = np.sqrt(found.covariance[:, 0, 0]) * np.cos(found.azimuth)
    np.testing.assert_allclose(deviation, np.sqrt(bound), rtol=0.5)
    error = np.sin(found.azimuth) - sines[:, 0]
    for variance in (bound, deviation**2):
        assert 0.8 <= np.sqrt(np.mean(error**2 / variance)) <= 1.3


def test_second_wave_that_unequal_receivers_may_cause_is_in_the_covariance() -> None:
    # Half a beam width from a wave 9 dB stronger, near opposite phases: a residual of up to 0.5 % of the power.
    radar, number, rng = rc.Radar(WAVEFORM, rx=row(8, 0.5)), 3000, np.random.default_rng(5)
    sines = 0.5 * 0.886 / 4.0 * np.array([-0.5, 0.5])
    amplitudes = np.sqrt([1000.0, 125.0]) * np.exp(2j * np.pi * rng.uniform(size=(number, 2)))
    waves = amplitudes @ np.exp(-2j * np.pi * np.outer(sines, radar.virtual_array[:, 1] / WAVELENGTH))
    cells = waves + white_noise(rng, waves.shape)
    found = rc.directions(cells, radar, snr_db=10.0 * np.log10(np.square(np.abs(cells)).mean(axis=1) - 1.0))
    assert 0.05 < found.is_resolved.mean() < 0.2
    error = np.abs(np.sin(found.azimuth)[:, None] - sines).min(axis=1)[found.is_resolved]
    deviation = np.sqrt(found.covariance[found.is_resolved, 0, 0])
    assert 0.8 <= np.sqrt(np.mean((error / deviation) ** 2)) <= 1.3


def test_target_beyond_the_horizon_of_a_dense_array_is_put_at_the_horizon() -> None:
    radar = rc.Radar(WAVEFORM, rx=row(4, 0.4))
    phases = np.exp(-2j * np.pi * 1.1 * 0.4 * np.arange(4))  # of a sine of 1.1, as noise may give
    assert rc.directions([phases], radar).azimuth == pytest.approx(np.pi / 2)


def test_movement_between_the_turns_of_transmitters_is_taken_off() -> None:
    radar = rc.Radar(WAVEFORM, tx=row(3, 2.0), rx=row(4, 0.5), schedule=rc.Schedule.tdm(interval=20e-6))
    azimuth = np.deg2rad([-40.0, 0.0, 25.0])
    snapshots = echoes(radar, azimuth, 0.0, velocity=8.0)
    np.testing.assert_allclose(rc.directions(snapshots, radar, velocity=np.full(3, 8.0)).azimuth, azimuth, atol=EXACT)
    # 8 m/s turns the next transmitter's channels by 2 pi 2 v dt / wavelength = 0.40 rad: in the sine by 0.40 / (2 pi 2)
    # = 1.8 degrees at the front, where the blocks of four hold the estimate only weakly.
    without = rc.directions(snapshots, radar).azimuth
    assert (np.abs(without - azimuth) > np.deg2rad(1.5)).all()
    nothing = rc.directions(snapshots, radar, velocity=[np.nan] * 3).azimuth
    np.testing.assert_array_equal(nothing, without)


def test_phases_of_channels_are_taken_off() -> None:
    radar = rc.Radar(WAVEFORM, rx=row(4, 0.5), tx=row(2, 0.5, axis=2))
    azimuth, elevation = angles((True, True))
    phase = RNG.uniform(-3.0, 3.0, 8)
    found = rc.directions(echoes(radar, azimuth, elevation) * np.exp(1j * phase), radar, channel_phase=phase)
    np.testing.assert_allclose(found.azimuth, azimuth, atol=4 * EXACT)
    np.testing.assert_allclose(found.elevation, elevation, atol=4 * EXACT)


def test_scale_and_phase_of_a_cell_do_not_matter_and_cells_without_a_wave_are_nan() -> None:
    radar = rc.Radar(WAVEFORM, rx=row(4, 0.5))
    snapshots = echoes(radar, np.full(6, 0.3), 0.0) * np.array([[1e-150], [1e150j], [0.0], [np.nan], [np.inf], [-2.0]])
    found = rc.directions(snapshots, radar, snr_db=np.full(6, 20.0))
    is_nan = [False, False, True, True, True, False]
    np.testing.assert_allclose(found.azimuth, np.where(is_nan, np.nan, 0.3), atol=EXACT)
    assert (np.isnan(found.covariance[:, 0, 0]) == is_nan).all()
    assert len(rc.directions(np.empty((0, 4)), radar)) == 0


@pytest.mark.parametrize("number", [2, 8])
@pytest.mark.parametrize("azimuth", [0.0, 0.8])
def test_variance_of_a_row_is_its_closed_form(number: int, azimuth: float) -> None:
    # 1 / (2 snr (2 pi d / wavelength)^2 cos^2 S), where S = N (N^2 - 1) / 12 sums the squared places about their mean.
    radar = rc.Radar(WAVEFORM, rx=row(number, 0.5))
    found = rc.directions(echoes(radar, [azimuth], 0.0), radar, snr_db=[13.0])
    expected = 6.0 / (10**1.3 * number * (number**2 - 1) * np.pi**2 * np.cos(azimuth) ** 2)
    assert found.covariance[0, 0, 0] == pytest.approx(expected, rel=1e-4)  # the azimuth is good to EXACT
    assert np.isnan(found.covariance[0, [0, 1, 1], [1, 0, 1]]).all()


@pytest.mark.parametrize("name", ["row of 3 x 4", "column", "plane of 3 x 4", "bent plane"])
def test_spread_of_estimates_in_noise_is_their_covariance(name: str) -> None:
    tx, rx, told = ARRAYS[name]
    radar = rc.Radar(WAVEFORM, tx=tx, rx=rx)
    number = 3000
    truth = np.array([0.5, -0.3]) * told
    waves = np.repeat(echoes(radar, truth[:1], truth[1:]), number, axis=0)
    noise = RNG.standard_normal((*waves.shape, 2)) @ [1.0, 1.0j] * np.sqrt(0.5 * 10**-2.5)
    found = rc.directions(waves + noise, radar, snr_db=np.full(number, 25.0))
    assert found.is_resolved.mean() >= 0.985  # but for one in a hundred
    errors = (np.stack([found.azimuth, found.elevation], axis=1) - truth)[found.is_resolved][:, told]
    bound = found.covariance[found.is_resolved].mean(axis=0)[np.ix_(told, told)]
    # Whitened by the bound, the errors have unit variance, to 4 sigma of 3000 draws, sqrt(2 / 3000) each.
    whitened = np.linalg.solve(np.linalg.cholesky(bound), errors.T)
    np.testing.assert_allclose(whitened @ whitened.T / len(errors), np.eye(sum(told)), atol=4 * np.sqrt(2 / number))
