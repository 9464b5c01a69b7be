"""Range and Doppler transforms and the sub-bin peak, against tones on paper and the direct sum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from radarcore.processing.detection.peaks import Peak, strongest_peak
from radarcore.processing.spectra.spectra import range_doppler, range_profile
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame
from radarcore.units import SPEED_OF_LIGHT
from reference import beat_signal_reference

UP, DOWN = 1.0, -1.0

PEAK_ERROR = 1e-3
"""Error of a single target in bins, Hann windows. The log of their spectrum is -0.645 x^2 - 0.041 x^4; a parabola
through three points with spacing h = 1/4, the middle one d off, errs by 0.064 d (h^2 - 4 d^2), at most 2e-4. The mirror
image of a real tone, 8 bins off or more, adds 1 / (pi 8^3) of the amplitude, about as much again."""


def waveform(direction: float = UP, **changes: Any) -> Waveform:
    """1 GHz in 320 us: slow enough that range and velocity couple by 0.8 bins at the largest velocity."""
    settings: dict[str, Any] = {
        "sample_rate": 2e5,
        "num_samples": 64,
        "num_chirps": 32,
        "chirp_interval": 400e-6,
        "adc_delay": 5e-6,
    } | changes
    return Waveform.from_sweep(start_frequency=60e9, stop_frequency=60e9 + direction * 1e9, **settings)


def target(wf: Waveform, distance: float, velocity: float, *, real: bool = False, phase: float = 0.0) -> NDArray[Any]:
    """Cube (1, chirp, sample) of a point that is at `distance` [m] in the middle of the frame."""
    delay = 2.0 * (distance - velocity * wf.duration / 2.0) / SPEED_OF_LIGHT
    rate = 2.0 * velocity / SPEED_OF_LIGHT
    cube = beat_signal_reference([delay], [np.exp(1j * phase)], wf, delay_rate=[rate])
    return cube.real if real else cube


@pytest.mark.parametrize("direction", [UP, DOWN])
@pytest.mark.parametrize("real", [False, True])
def test_target_in_the_middle_of_a_bin_peaks_there_with_the_sum_of_the_window(direction: float, real: bool) -> None:
    wf = waveform(direction, num_chirps=1)
    profile = range_profile(target(wf, 10 * wf.range_resolution, 0.0, real=real), wf)[0, 0]
    assert profile.shape == (33 if real else 64,)
    assert np.argmax(abs(profile)) == 10
    # The periodic Hann window sums to num_samples / 2. A real tone splits in halves, and its mirror image lies 20
    # bins off, where a Hann window on whole bins is zero.
    assert abs(profile[10]) == pytest.approx(32 * (0.5 if real else 1.0), rel=1e-9)


def test_profile_is_the_discrete_fourier_sum_it_says() -> None:
    rng = np.random.default_rng(1)
    for direction in (UP, DOWN):
        wf = waveform(direction)
        cube = rng.standard_normal((2, 32, 64)) + 1j * rng.standard_normal((2, 32, 64))
        kernel = np.exp(-2j * np.pi * direction * np.outer(np.arange(80), np.arange(64)) / 80)
        profile = range_profile(cube, wf, window=None, num_bins=80)
        np.testing.assert_allclose(profile, cube @ kernel.T, rtol=0, atol=1e-12 * 64)  # rounding of 64 terms
        half = range_profile(cube.real, wf, window=None, num_bins=80)
        np.testing.assert_allclose(half, (cube.real @ kernel.T)[..., :41], rtol=0, atol=1e-12 * 64)


@pytest.mark.parametrize(
    ("given", "returned"),
    [("float32", "complex64"), ("complex64", "complex64"), ("float64", "complex128"), ("complex128", "complex128")],
)
def test_precision_of_the_cube_is_kept(given: str, returned: str) -> None:
    wf = waveform()
    cube = target(wf, 3.0, 0.0).astype(given) if "complex" in given else target(wf, 3.0, 0.0).real.astype(given)
    assert range_profile(cube, wf).dtype == returned
    assert range_doppler(cube, wf).dtype == returned
    assert range_profile(cube.astype(cube.dtype.newbyteorder(">")), wf).dtype == returned


def test_transforms_leave_the_cube_alone_and_take_any_layout_and_leading_axes() -> None:
    wf = waveform()
    cube = np.random.default_rng(2).standard_normal((3, 2, 32, 64))
    before = cube.copy()
    spectrum = range_doppler(cube, wf, num_range_bins=100, num_velocity_bins=40)
    assert spectrum.shape == (3, 2, 40, 51)
    assert (cube == before).all()
    transposed = np.asfortranarray(cube)
    np.testing.assert_array_equal(range_doppler(transposed, wf, num_range_bins=100, num_velocity_bins=40), spectrum)
    assert range_doppler(cube[:0], wf).shape == (0, 2, 32, 33)


@pytest.mark.parametrize("direction", [UP, DOWN])
@pytest.mark.parametrize("real", [False, True])
@pytest.mark.parametrize("bins", [-9, 9])
def test_receding_target_has_positive_velocity(direction: float, real: bool, bins: int) -> None:
    wf = waveform(direction)
    for num_velocity_bins in (32, 45):
        spectrum = range_doppler(
            target(wf, 2.4, bins * wf.velocity_resolution, real=real), wf, num_velocity_bins=num_velocity_bins
        )[0]
        row, _ = np.unravel_index(np.argmax(abs(spectrum)), spectrum.shape)
        found = wf.velocity_axis(num_velocity_bins)[row]
        assert abs(found - bins * wf.velocity_resolution) <= 0.5 * wf.velocity_resolution  # the nearest bin


@pytest.mark.parametrize("direction", [UP, DOWN])
@pytest.mark.parametrize("real", [False, True])
def test_peak_of_a_moving_target_is_within_a_thousandth_of_a_bin(direction: float, real: bool) -> None:
    # Uncorrected, the coupling alone would be up to 0.8 bins of range here, and the half chirp between the centre
    # of a periodic window and the middle of the frame up to 0.004.
    for seed in range(10):
        rng = np.random.default_rng(seed)
        wf = waveform(direction, num_samples=int(rng.integers(40, 70)), num_chirps=int(rng.integers(16, 40)))
        last_bin = wf.num_samples // (2 if real else 1)
        distance = rng.uniform(4.0, last_bin - 4.0) * wf.range_resolution
        velocity = rng.uniform(-1.0, 1.0) * (wf.num_chirps / 2 - 1.0) * wf.velocity_resolution
        cube = target(wf, distance, velocity, real=real, phase=rng.uniform(0.0, 6.0))
        peak = strongest_peak(cube.astype("float32" if real else "complex64"), wf)
        assert abs(peak.range - distance) <= PEAK_ERROR * wf.range_resolution, f"seed {seed}"
        assert abs(peak.velocity - velocity) <= PEAK_ERROR * wf.velocity_resolution, f"seed {seed}"


@pytest.mark.parametrize("velocity", [-1.9, 1.3])
def test_peak_of_a_target_that_crosses_several_range_bins_is_where_it_is_mid_frame(velocity: float) -> None:
    wf = Waveform.from_sweep(
        start_frequency=58e9,
        stop_frequency=63e9,
        sample_rate=2e6,
        num_samples=64,
        num_chirps=64,
        chirp_interval=591e-6,
        adc_delay=3.1e-6,
    )
    assert abs(velocity) * wf.duration > 1.5 * wf.range_resolution
    peak = strongest_peak(target(wf, 0.6, velocity, real=True), wf)
    assert abs(peak.range - 0.6) <= PEAK_ERROR * wf.range_resolution
    assert abs(peak.velocity - velocity) <= PEAK_ERROR * wf.velocity_resolution


@pytest.mark.parametrize(("window", "bins"), [(None, 0.02), ("blackman", 0.02), (("kaiser", 8.0), 0.02)])
def test_peak_takes_other_windows(window: Any, bins: float) -> None:
    wf = waveform()
    peak = strongest_peak(target(wf, 4.03, 1.07), wf, window=window, doppler_window=window)
    assert abs(peak.range - 4.03) <= bins * wf.range_resolution
    assert abs(peak.velocity - 1.07) <= bins * wf.velocity_resolution


def test_peak_power_adds_channels_and_indices_point_into_the_map() -> None:
    wf = waveform(num_chirps=31)
    cube = np.concatenate([target(wf, 4.03, 1.07), 2j * target(wf, 4.03, 1.07)])
    peak = strongest_peak(cube, wf)
    # Sums of both Hann windows, powers 1 and 4; the parabola's height errs by less than 1e-3 on the fine grid, the
    # smear of the moving target by (0.45 bins of migration)^2 / 24.
    assert peak.power == pytest.approx(5.0 * (32.0 * 15.5) ** 2, rel=1e-2)
    power = (abs(range_doppler(cube, wf)) ** 2).sum(axis=0)
    assert power[peak.velocity_index, peak.range_index] == power.max()


def test_limits_pick_the_weaker_echo_and_the_flank_of_a_stronger_one_is_no_peak() -> None:
    wf = waveform()
    near, far = target(wf, 1.0, 0.0), 0.1 * target(wf, 5.0, -1.5)
    assert abs(strongest_peak(near + far, wf).range - 1.0) <= 1e-3 * wf.range_resolution
    # At 1.15 m, one bin off the strong echo, the flank is still 6 dB below it, 14 dB above the weak echo.
    several: tuple[dict[str, Any], ...] = (
        {"min_range": 1.15},
        {"max_velocity": -0.5},
        {"min_range": 3.0, "max_range": 6.0},
    )
    for limits in several:
        assert abs(strongest_peak(near + far, wf, **limits).range - 5.0) <= 1e-3 * wf.range_resolution, limits
    assert strongest_peak(near, wf, min_velocity=-0.05, max_velocity=0.05, max_range=2.0).velocity == pytest.approx(
        0.0, abs=0.02 * wf.velocity_resolution
    )


def test_single_chirp_gives_range_without_velocity() -> None:
    wf = waveform(num_chirps=1)
    peak = strongest_peak(target(wf, 4.03, 0.0), wf)
    assert abs(peak.range - 4.03) <= 1e-3 * wf.range_resolution
    assert np.isnan(peak.velocity)
    # The periodic Hann window of two chirps is (0, 1): nothing to tell a velocity by. Without it there is.
    wf = waveform(num_chirps=2)
    assert np.isnan(strongest_peak(target(wf, 4.03, 1.0), wf).velocity)
    assert strongest_peak(target(wf, 4.03, 1.0), wf, doppler_window=None).velocity == pytest.approx(
        1.0, abs=0.02 * wf.velocity_resolution
    )


def test_one_sample_has_no_range() -> None:
    wf = Waveform(start_frequency=60e9, slope=1e12, sample_rate=1e6, num_samples=1, num_chirps=16, chirp_interval=1e-4)
    assert range_doppler(np.ones((1, 16, 1)), wf).shape == (1, 16, 1)
    peak = strongest_peak(np.ones((1, 16, 1)), wf)
    assert np.isnan(peak.range)
    assert peak.velocity == 0.0


def test_silence_no_channels_and_noise_have_no_peak() -> None:
    wf = waveform()
    for cube in (np.zeros((2, 32, 64)), np.zeros((2, 32, 64), np.complex64), np.zeros((0, 32, 64))):
        assert strongest_peak(cube, wf) is None
    rng = np.random.default_rng(7)
    for num_channels in (1, 3):
        for short in (wf, waveform(num_chirps=1), waveform(num_chirps=8, num_samples=12)):
            shape = (num_channels, short.num_chirps, short.num_samples)
            # 120 frames of a rate of 1e-6 each.
            assert all(strongest_peak(rng.standard_normal(shape), short) is None for _ in range(20))
    noise = rng.standard_normal((1, 32, 64))
    assert isinstance(strongest_peak(noise, wf, min_range=0.0, min_snr_db=0.0), Peak)


def test_snr_is_the_power_over_that_of_the_noise_in_a_cell() -> None:
    wf = waveform()
    rng = np.random.default_rng(8)
    amplitude, num_channels, snr_db = 0.5, 2, []
    for _ in range(30):
        noise = rng.standard_normal((2, num_channels, 32, 64))
        cube = amplitude * target(wf, 4.03, 1.07) + noise[0] + 1j * noise[1]
        snr_db.append(strongest_peak(cube, wf).snr_db)
    # Windows of Hann: sums of half of the samples, squares of 3/8; the noise in the peak's own cell is in it. The mean
    # of 30 has a standard deviation of 0.12 dB: amplitudes scatter by 0.07 of themselves, 0.6 dB.
    expected = amplitude**2 / 2.0 * (32.0 * 64.0 / 16.0) / (3.0 / 8.0) ** 2
    assert np.mean(snr_db) == pytest.approx(10.0 * np.log10(expected + 1.0), abs=0.5)


def test_a_frame_has_its_radar_and_a_least_snr_can_be_set() -> None:
    wf = waveform()
    cube = target(wf, 4.03, 1.07) + 0.1 * np.random.default_rng(9).standard_normal((1, 32, 64))
    peak = strongest_peak(cube, wf)
    assert strongest_peak(Frame(cube, 0.0, Radar(wf))) == strongest_peak(cube, Radar(wf)) == peak
    assert strongest_peak(cube, wf, min_snr_db=peak.snr_db - 0.1) == peak
    assert strongest_peak(cube, wf, min_snr_db=peak.snr_db + 0.1) is None


def test_nan_passes_through_transforms_and_is_refused_by_the_peak() -> None:
    wf = waveform()
    cube = target(wf, 3.0, 0.0)
    cube[0, 3, 7] = np.nan
    assert np.isnan(range_profile(cube, wf)[0, 3]).all()
    assert np.isfinite(range_profile(cube, wf)[0, 4]).all()
    with pytest.raises(ValueError, match=r"cube: expected finite numbers, got .nan.0j. at index \(0, 3, 7\)"):
        strongest_peak(cube, wf)
