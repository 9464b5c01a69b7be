"""Range-angle maps: against beams on paper, targets at known angles, and each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.direction import unit_vectors
from radarcore.processing.angles.beamforming import shortest_description
from radarcore.units import SPEED_OF_LIGHT
from reference import beat_signal_reference

WAVEFORM = rc.Waveform(
    start_frequency=76.5e9, slope=30e12, sample_rate=4e6, num_samples=64, num_chirps=32, chirp_interval=60e-6
)
WAVELENGTH = WAVEFORM.wavelength
BIN = 20
FINE = np.deg2rad(np.arange(-90.0, 90.1, 0.25))
METHODS = ("bartlett", "capon", "music", "fft")
GAIN = WAVEFORM.num_samples / 1.5
"""Power of a tone over noise, added by the range transform with a Hann window (mean square over mean)."""


def row(number: int, spacing: float = 0.5, axis: int = 1) -> NDArray[np.float64]:
    """Positions along an axis; spacing in wavelengths."""
    return WAVELENGTH * spacing * np.arange(number)[:, None] * np.eye(3)[axis]


EIGHT = rc.Radar(WAVEFORM, rx=row(8))
UNEVEN = rc.Radar(WAVEFORM, rx=row(8) * np.array([1.0, 1.0, 1.0, 1.1, 1.0, 1.0, 1.0, 1.0])[:, None])
PLANE = rc.Radar(WAVEFORM, tx=row(4, axis=2), rx=row(5))
TURNS = rc.Radar(WAVEFORM, tx=row(3, 2.0), rx=row(4), schedule=rc.Schedule.tdm())  # a turn every 20 us


def cube(
    radar: rc.Radar,
    azimuth_deg: list[float],
    elevation_deg: float = 0.0,
    velocity: Any = 0.0,
    snr_db: float | None = None,
) -> NDArray[np.complex64]:
    """Far targets of equal strength in range bin 20, of random phases; the SNR is that of a range bin of a chirp."""
    rng = np.random.default_rng(0)
    distance = BIN * WAVEFORM.range_axis()[1]
    rates = 2.0 * velocity * np.ones(len(azimuth_deg)) / SPEED_OF_LIGHT
    to_antennas = radar.virtual_array @ unit_vectors(np.deg2rad(azimuth_deg), np.deg2rad(elevation_deg)).T
    delays = (2.0 * distance - to_antennas) / SPEED_OF_LIGHT + rates * radar.channel_offsets[:, None]
    amplitudes = np.exp(2j * np.pi * rng.uniform(size=len(azimuth_deg)))
    samples = beat_signal_reference(delays, amplitudes, WAVEFORM, delay_rate=rates)
    if snr_db is not None:
        noise = rng.standard_normal((*samples.shape, 2)) @ [1.0, 1.0j]
        samples = samples + noise * np.sqrt(0.5 * GAIN) * 10.0 ** (-0.05 * snr_db)
    return samples.astype(np.complex64)


def peaks(power: NDArray[Any], number: int) -> NDArray[np.float64]:
    """The angles of the highest local maxima, in order [degrees]."""
    places = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] > power[2:])) + 1
    return np.sort(np.rad2deg(FINE[places[np.argsort(power[places])[::-1][:number]]]))


def array_factor(number: int, sines: Any) -> NDArray[np.float64]:
    """``|sum of the phases / N|^2`` of a row of half a wavelength against differences of sines."""
    half = 0.5 * np.pi * np.where(np.abs(sines) < 1e-9, 1e-9, sines)
    return (np.sin(number * half) / (number * np.sin(half))) ** 2


@pytest.mark.parametrize("method", ["bartlett", "fft"])
def test_bartlett_of_one_target_is_the_array_factor_times_the_power_of_a_channel(method: str) -> None:
    samples = cube(EIGHT, [25.0])
    power = rc.range_angle(samples, EIGHT, method=method, azimuth=FINE)[BIN]
    expected = array_factor(8, np.sin(FINE) - np.sin(np.deg2rad(25.0)))
    of_channel = (np.abs(rc.range_profile(samples, EIGHT)[:, :, BIN]) ** 2).mean()
    # The beat frequency follows each channel's own delay: sines are scaled within 0.1 % by the centre of the band.
    np.testing.assert_allclose(power / of_channel, expected, atol=2e-3)


def test_capon_of_one_target_without_noise_is_its_closed_form() -> None:
    # Sherman and Morrison: (a0 a0^H + d I)^-1 = (I - a0 a0^H / (d + N)) / d; a row of 8 has subarrays of N = 6.
    samples = cube(EIGHT, [-10.0])
    of_channel = (np.abs(rc.range_profile(samples, EIGHT)[:, :, BIN]) ** 2).mean()
    overlap = 36.0 * array_factor(6, np.sin(FINE) - np.sin(np.deg2rad(-10.0)))
    expected = 0.02 / (6.0 - overlap / 6.02)
    power = rc.range_angle(samples, EIGHT, method="capon", azimuth=FINE, loading=0.02)[BIN] / of_channel
    np.testing.assert_allclose(power, expected, rtol=2e-3)  # sines right to 1e-4 at flanks of 1 / 0.06 per sine
    assert power.max() == pytest.approx(6.02 / 6.0, rel=1e-5)  # sines right to 1e-4, squared, and samples to 1e-7


def test_music_of_one_target_without_noise_is_its_closed_form() -> None:
    overlap = array_factor(6, np.sin(FINE) - np.sin(np.deg2rad(33.1)))  # between angles of the grid
    spectrum = rc.range_angle(cube(EIGHT, [33.1]), EIGHT, method="music", azimuth=FINE, num_sources=1)[BIN]
    np.testing.assert_allclose(1.0 / spectrum, 1.0 - overlap, atol=2e-3)
    assert abs(np.rad2deg(FINE[spectrum.argmax()]) - 33.1) <= 0.125 + 1e-9  # the nearest of the grid


@pytest.mark.parametrize("method", METHODS)
def test_sources_at_minus_20_and_15_degrees_are_within_a_degree(method: str) -> None:
    power = rc.range_angle(cube(EIGHT, [-20.0, 15.0], snr_db=20.0), EIGHT, method=method, azimuth=FINE)
    np.testing.assert_allclose(peaks(power[BIN], 2), [-20.0, 15.0], atol=1.0)


@pytest.mark.parametrize("velocity", [0.0, np.array([0.0, 3.0])], ids=["at rest", "moving"])
def test_music_parts_two_sources_half_a_beam_width_apart(velocity: Any) -> None:
    # A row of 8 has a half-power beam width of 0.886 * 2 / 8 rad = 12.7 degrees.
    samples = cube(EIGHT, [-3.2, 3.2], velocity=velocity, snr_db=40.0)
    for num_sources in (None, 2):
        spectrum = rc.range_angle(samples, EIGHT, method="music", azimuth=FINE, num_sources=num_sources)[BIN]
        np.testing.assert_allclose(peaks(spectrum, 2), [-3.2, 3.2], atol=0.5)
    assert abs(peaks(rc.range_angle(samples, EIGHT, azimuth=FINE)[BIN], 1)) < 2.0  # one peak, in the middle


def test_uneven_arrays_part_sources_of_different_velocity() -> None:
    samples = cube(UNEVEN, [-20.0, 15.0], velocity=np.array([0.0, 3.0]), snr_db=20.0)
    for method in ("bartlett", "capon", "music"):
        power = rc.range_angle(samples, UNEVEN, method=method, azimuth=FINE)[BIN]
        np.testing.assert_allclose(peaks(power, 2), [-20.0, 15.0], atol=1.0)


@pytest.mark.parametrize("method", METHODS)
def test_moving_target_of_a_multiplexed_array_is_within_a_degree_and_wrong_without_compensation(method: str) -> None:
    ahead = unit_vectors(np.deg2rad(20.0))
    target = rc.PointTarget(BIN * WAVEFORM.range_axis()[1] * ahead, rcs=1.0, velocity=8.0 * ahead)
    radar = rc.Radar(
        WAVEFORM, tx=TURNS.tx, rx=TURNS.rx, schedule=TURNS.schedule, receiver=rc.Receiver(noise_figure_db=12.0)
    )
    frame = rc.Simulator(rc.Scene([target]), radar, field_of_view_deg=(90.0, 20.0)).frame()
    without = rc.Radar(WAVEFORM, tx=TURNS.tx, rx=TURNS.rx)
    right = rc.range_angle(frame, method=method, azimuth=FINE)[BIN]
    wrong = rc.range_angle(frame.cube, without, method=method, azimuth=FINE)[BIN]
    assert abs(peaks(right, 1)[0] - 20.0) < 1.0
    # 2 pi 2 v dt / wavelength = 0.51 rad per two wavelengths: 0.51 / (4 pi) = 0.041 in the sine, 2.5 degrees.
    assert 1.5 < abs(peaks(wrong, 1)[0] - 20.0) < 4.0


def test_power_is_that_of_a_channel_with_transmitters_in_turn_too() -> None:
    samples = cube(TURNS, [20.0], velocity=3.0)
    of_channel = (np.abs(rc.range_profile(samples, TURNS)[:, :, BIN]) ** 2).mean()
    power = rc.range_angle(samples, TURNS, azimuth=np.deg2rad([20.0]))[BIN, 0]
    # Cells of the Hann window beside the middle are compensated for velocities up to two cells off: by
    # 2 pi / 3 / 32 rad per cell and turn; weights of 1/6, 2/3, 1/6 leave 1 - (1/3) (0.065^2) (2/3), within 0.1 %.
    assert power == pytest.approx(of_channel, rel=5e-3)


def test_azimuth_and_elevation_are_found_by_a_plane() -> None:
    azimuth, elevation = np.deg2rad(np.arange(-60.0, 61.0, 2.0)), np.deg2rad(np.arange(-40.0, 41.0, 2.0))
    samples = cube(PLANE, [24.0], elevation_deg=-12.0, snr_db=30.0)
    for method in ("bartlett", "capon", "music"):
        power = rc.processing.azimuth_elevation(
            samples, PLANE, at_range=WAVEFORM.range_axis()[BIN], azimuth=azimuth, elevation=elevation, method=method
        )
        assert power.shape == (61, 41)
        place = np.unravel_index(power.argmax(), power.shape)
        assert np.rad2deg([azimuth[place[0]], elevation[place[1]]]) == pytest.approx([24.0, -12.0])
        cut = rc.range_angle(samples, PLANE, azimuth=azimuth, elevation=elevation[5], method=method)[BIN]
        np.testing.assert_allclose(power[:, 5], cut, rtol=1e-5)  # float32


def test_column_has_its_beams_over_elevation() -> None:
    column = rc.Radar(WAVEFORM, tx=row(6, axis=2))
    samples = cube(column, [0.0], elevation_deg=17.0)
    for method in METHODS:
        power = rc.range_angle(samples, column, azimuth=0.0, elevation=FINE, method=method)[BIN]
        assert abs(peaks(power, 1)[0] - 17.0) < 0.5


def test_fft_beams_do_not_depend_on_the_order_of_channels_and_are_those_of_bartlett() -> None:
    mixed = rc.Radar(WAVEFORM, rx=row(8, 0.7)[[3, 0, 7, 1, 2, 6, 5, 4]])
    samples = cube(mixed, [-50.0, 12.0], snr_db=20.0)
    expected = rc.range_angle(samples, mixed, azimuth=FINE)
    beams = rc.range_angle(samples, mixed, azimuth=FINE, method="fft")
    np.testing.assert_allclose(beams, expected, atol=3e-4 * expected.max())  # (2 pi / 64)^2 / 48 of peaks


def test_phases_of_channels_are_taken_off() -> None:
    phase = np.random.default_rng(3).uniform(-3.0, 3.0, 12)
    samples = cube(TURNS, [20.0], velocity=8.0)
    turned = samples * np.exp(1j * phase)[:, None, None].astype(np.complex64)
    for radar in (TURNS, rc.Radar(WAVEFORM, tx=TURNS.tx, rx=TURNS.rx)):
        expected = rc.range_angle(samples, radar)
        np.testing.assert_allclose(
            rc.range_angle(turned, radar, channel_phase=phase), expected, atol=1e-5 * expected.max()
        )


@pytest.mark.parametrize("method", METHODS)
def test_frame_recording_and_cubes_of_any_leading_axes_give_the_same(method: str) -> None:
    rng = np.random.default_rng(4)
    samples = rng.standard_normal((2, 3, 8, 32, 64)).astype(np.float32)
    power = rc.range_angle(samples, EIGHT, method=method)
    assert power.shape == (2, 3, 33, 181)
    assert power.dtype == np.float32
    expected = rc.range_angle(samples[1, 2], EIGHT, method=method)
    np.testing.assert_array_equal(power[1, 2], expected)
    np.testing.assert_array_equal(rc.range_angle(rc.Frame(samples[1, 2], 0.0, EIGHT), method=method), expected)
    recording = rc.Recording(samples[1], np.arange(3.0), EIGHT)
    np.testing.assert_array_equal(rc.range_angle(recording, method=method)[2], expected)
    at = WAVEFORM.range_axis()[BIN]
    maps = rc.processing.azimuth_elevation(recording, at_range=at, elevation=[0.0], method=method)
    np.testing.assert_allclose(maps[2, :, 0], expected[BIN], rtol=1e-6)
    padded = rc.range_angle(samples[0].astype(np.complex128), EIGHT, num_range_bins=100, azimuth=0.3, method=method)
    assert padded.shape == (3, 100, 1)
    assert padded.dtype == np.float64
    assert rc.range_angle(samples[:0], EIGHT, method=method).shape == (0, 3, 33, 181)


def test_nothing_has_no_power_and_nan_passes_through() -> None:
    nothing = np.zeros((8, 32, 64), np.complex64)
    for method in METHODS:
        assert (rc.range_angle(nothing, EIGHT, method=method) == (1.0 if method == "music" else 0.0)).all()
        assert np.isnan(rc.range_angle(nothing + np.float32(np.nan), EIGHT, method=method)).all()


def test_single_channel_has_the_same_power_in_all_directions() -> None:
    radar = rc.Radar(WAVEFORM)
    samples = cube(radar, [10.0])
    expected = (np.abs(rc.range_profile(samples, radar)[0]) ** 2).mean(axis=0)[:, None]
    np.testing.assert_allclose(rc.range_angle(samples, radar), expected * np.ones(181), rtol=1e-5)
    np.testing.assert_allclose(rc.range_angle(samples, radar, method="capon"), expected * np.full(181, 1.01), rtol=1e-5)


def test_number_of_sources_is_that_of_the_shortest_description() -> None:
    # Eigenvalues of noise about 1, to 1 / sqrt(200), and of sources far above.
    noise = 1.0 + 0.05 * np.linspace(-1.0, 1.0, 6)
    for number in range(6):
        values = np.sort(np.concatenate([noise[: 6 - number], 10.0 + np.arange(number)]))
        assert shortest_description(values, 200) == number
    assert shortest_description(np.zeros(6), 200) == 0
    assert shortest_description(np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 1.0]]), 200).tolist() == [1, 0]


def test_degrees_are_warned_of() -> None:
    with pytest.warns(UserWarning, match=r"azimuth: expected radians, got -90; degrees\?"):
        rc.range_angle(cube(EIGHT, [0.0]), EIGHT, azimuth=[-90.0, 0.0])
