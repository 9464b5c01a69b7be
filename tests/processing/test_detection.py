"""Detections: false alarms at the rate set, errors at the bound, covariances that hold, no sidelobes, all radars."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.processing.detection.map import Coordinates
from radarcore.processing.detection.tone import axes_of, fit
from radarcore.processing.spectra.windows import independent_share, window_weights
from radarcore.units import SPEED_OF_LIGHT
from reference import beat_signal_reference

UP, DOWN = 1.0, -1.0


def radar(direction: float = UP, *, num_channels: int = 1, real: bool = False, **changes: Any) -> rc.Radar:
    """1 GHz in 32 us; bins of 0.15 m, and of 0.19 m/s with 32 chirps."""
    settings: dict[str, Any] = {"num_samples": 64, "num_chirps": 32, "chirp_interval": 400e-6, "adc_delay": 5e-6}
    wf = rc.Waveform.from_sweep(
        start_frequency=60e9, stop_frequency=60e9 + direction * 1e9, sample_rate=2e6, **(settings | changes)
    )
    rx = [[0.0, 2.4e-3 * i, 0.0] for i in range(num_channels)]
    return rc.Radar(wf, rx=rx, receiver=rc.Receiver(output="real") if real else None)


def target(of: rc.Radar, distance: float, velocity: float, amplitude: float = 1.0) -> NDArray[Any]:
    """Cube of a point in front that is at `distance` [m] in the middle of the frame."""
    wf = of.waveform
    start, rate = distance - velocity * wf.duration / 2.0, 2.0 * velocity / SPEED_OF_LIGHT
    cube = amplitude * beat_signal_reference([2.0 * start / SPEED_OF_LIGHT], [1.0], wf, delay_rate=[rate])
    cube = np.repeat(cube, of.num_channels, axis=0)
    return cube.real if of.is_real else cube


def noise(of: rc.Radar, rng: np.random.Generator) -> NDArray[Any]:
    """White noise, of variance 1 per sample."""
    shape = (of.num_channels, of.waveform.num_chirps, of.waveform.num_samples)
    if of.is_real:
        return rng.standard_normal(shape)
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)


def num_tested(of: rc.Radar) -> int:
    """Cells that `detect` tests: all but two range bins next to the radar, and the last from real samples."""
    wf = of.waveform
    ranges = wf.num_samples // 2 + 1 - 3 if of.is_real else wf.num_samples - 4
    return wf.num_chirps * ranges


@pytest.mark.parametrize("subtract_mean", [False, True])
@pytest.mark.parametrize(("num_channels", "real"), [(1, False), (3, True)])
def test_noise_is_detected_as_often_as_set(num_channels: int, real: bool, subtract_mean: bool) -> None:
    of = radar(num_channels=num_channels, real=real)
    rng = np.random.default_rng(num_channels)
    rate, num_frames = 5e-3, 60
    options: dict[str, Any] = {"false_alarm_rate": rate, "subtract_mean": subtract_mean}
    found = sum(len(rc.detect(noise(of, rng), of, **options)) for _ in range(num_frames))
    expected = rate * num_frames * num_tested(of)
    # The threshold is up to 0.3 dB too high: exp(-0.07 ln(1 / rate)) of the rate; 4 standard deviations of the count.
    assert 0.66 - 4.0 / np.sqrt(expected) <= found / expected <= 1.1 + 4.0 / np.sqrt(expected)


@pytest.mark.parametrize("filtered", ["slow", "fast", "pulses"])
def test_noise_that_filters_left_is_detected_no_more_often_than_set(filtered: str) -> None:
    of = radar(num_chirps=64, num_samples=32)
    rng = np.random.default_rng(8)
    rate, num_frames, found = 2e-3, 50, 0
    for _ in range(num_frames):
        frame = rc.Frame(noise(of, rng), 0.0, of)
        if filtered == "pulses":
            left = rc.cancel_pulses(frame)
        else:
            left = rc.remove_static(frame, [0.0, {"slow": 0.2, "fast": 0.8}[filtered], 0.0])
        found += len(rc.detect(left, false_alarm_rate=rate))
    expected = rate * num_frames * num_tested(of)
    # As without filters, and a quarter more at the ends of the band, where cells train with fewer; 4 deviations.
    assert found / expected <= 1.1 + 0.25 + 4.0 / np.sqrt(expected)


@pytest.mark.parametrize(
    "changes", [{"num_chirps": 1}, {"chirp_times": [0.0, 1e-4, 3e-4, 4e-4]}], ids=["one", "uneven"]
)
def test_noise_of_profiles_is_detected_as_often_as_set(changes: dict[str, Any]) -> None:
    of = radar(**({"num_chirps": 4, "num_samples": 128} | changes))
    rng = np.random.default_rng(4)
    found = sum(len(rc.detect(noise(of, rng), of, false_alarm_rate=5e-3)) for _ in range(300))
    expected = 5e-3 * 300 * (128 - 4)
    assert 0.66 - 4.0 / np.sqrt(expected) <= found / expected <= 1.1 + 4.0 / np.sqrt(expected)


def least_variance(of: rc.Radar, snr: float) -> tuple[float, float]:
    """Cramer-Rao bounds of range and velocity from all samples: a tone of unknown phase in each channel.

    The variance of a frequency is ``6 / (snr N^2 (2 pi)^2)`` bins^2 times N^2 / (N^2 - 1), with the SNR of all samples
    of all channels together.
    """
    wf = of.waveform
    beat, doppler = (6.0 / (snr * (2.0 * np.pi) ** 2) * n**2 / (n**2 - 1.0) for n in (wf.num_samples, wf.num_chirps))
    coupling = wf.velocity_resolution * wf.center_frequency / wf.slope
    return beat * wf.range_resolution**2 + doppler * coupling**2, doppler * wf.velocity_resolution**2


@pytest.mark.parametrize(("direction", "real", "snr_db"), [(UP, True, 20.0), (DOWN, False, 40.0)])
def test_errors_are_near_the_bound_and_as_the_covariance_says(direction: float, real: bool, snr_db: float) -> None:
    of = radar(direction, num_channels=2, real=real)
    wf = of.waveform
    rng = np.random.default_rng(int(snr_db))
    snr = 10.0 ** (
        snr_db / 10.0
    )  # of all samples of a channel: a real tone has half of the power, in half of the cells
    amplitude = np.sqrt(snr * (4.0 if real else 1.0) / (wf.num_samples * wf.num_chirps))
    errors, covariances, snr_in_cell = [], [], []
    for _ in range(150):
        distance, velocity = rng.uniform(1.0, 3.8), rng.uniform(-2.5, 2.5)
        found = rc.detect(target(of, distance, velocity, amplitude) + noise(of, rng), of)
        best = found[int(np.argmax(found.snr_db))]
        errors.append([best.range[0] - distance, best.velocity[0] - velocity])
        covariances.append(best.covariance[0, :2, :2])
        snr_in_cell.append(best.snr_db[0])
    errors_, covariances_ = np.array(errors), np.array(covariances)

    # The bound of 9 cells of Hann windows is 1.26 to 1.34 times the bound of all samples; a mean square of 150 errors
    # scatters by 12 %, its root by 6 %.
    rms = np.sqrt(np.mean(errors_**2, axis=0))
    bound = np.sqrt(least_variance(of, 2.0 * snr))
    assert (rms <= 1.5 * bound * (1.0 + 4.0 * 0.06)).all()
    assert (rms >= bound * (1.0 - 4.0 * 0.06)).all()
    # Squares of errors over their covariance are chi-squared with 2 degrees of freedom: mean 2, variance 4.
    squares = np.einsum("ni,nij,nj->n", errors_, np.linalg.inv(covariances_), errors_)
    assert squares.mean() == pytest.approx(2.0, abs=4.0 * 2.0 / np.sqrt(150) + 0.1)
    # In a cell the Hann windows lose 3.5 dB; the mean of the median of so many cells and of the fit is good to 0.3 dB.
    assert np.mean(snr_in_cell) == pytest.approx(snr_db - 20.0 * np.log10(1.5), abs=0.3)


def test_errors_of_all_four_coordinates_are_as_their_covariance_says() -> None:
    lines = radar(real=True, num_chirps=16)
    of = rc.Radar(lines.waveform, rx=[[0.0, 2.4e-3, 0.0], [0.0, 0.0, 2.4e-3], [0.0, 0.0, 0.0]], receiver=lines.receiver)
    rng = np.random.default_rng(6)
    echo = target(of, 2.5, 0.7, 0.6)  # straight ahead: the same in all channels
    squares = []
    for _ in range(150):
        found = rc.detect(echo + noise(of, rng), of)
        best = found[int(np.argmax(found.snr_db))]
        error = [best.range[0] - 2.5, best.velocity[0] - 0.7, best.azimuth[0], best.elevation[0]]
        squares.append(error @ np.linalg.solve(best.covariance[0], error))
    # Chi-squared with 4 degrees of freedom: mean 4, variance 8; 2.5 % for the SNR, which is measured too.
    assert np.mean(squares) == pytest.approx(4.0, abs=4.0 * np.sqrt(8.0 / 150) + 0.1)


def test_bound_of_the_cells_is_that_of_all_samples_if_all_cells_are_used() -> None:
    # All cells of a transform without a window are all samples: the information is the sum of squared phase slopes
    # (2 pi n / N)^2 about their mean, (pi^2 / 3) (1 - 1 / N^2) of a tone of length 1.
    offsets = np.array([[0.0, 0.1], [0.3, 0.0], [-0.5, 0.2]])
    n = np.arange(8)
    slow, fast = (np.exp(2j * np.pi * np.multiply.outer(offset, n) / 8) for offset in offsets.T)
    cells = np.fft.fftshift(np.fft.fft2(slow[:, :, None] * fast[:, None, :]), axes=(1, 2))[:, None]
    window = np.ones(8)
    middle, axes = np.full((1, 2), 4), axes_of((window, window), (8, 8))
    for some, offset in zip(cells, offsets, strict=True):
        found = fit(some, middle, offset[None], axes, is_cyclic=True)
        np.testing.assert_allclose(found.information, [2 * [np.pi**2 / 3.0 * (1.0 - 1.0 / 64.0)]], rtol=1e-9)
        np.testing.assert_allclose(found.offset, [offset], atol=1e-12)
        np.testing.assert_allclose(np.abs(found.amplitude), 1.0, rtol=1e-12)


def test_training_cells_of_a_window_count_as_its_correlations_say() -> None:
    # Squared Hann weights are 3/8 - cos / 2 + cos 2 / 8: -2/3 and 1/6 of the mean beside it, nothing farther.
    share = independent_share(window_weights("window", "hann", 32))
    assert share == pytest.approx(1.0 / (1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0)))


def test_slopes_of_the_coordinates_are_their_derivatives() -> None:
    wf = radar(DOWN).waveform
    coordinates = Coordinates(wf, 32.0, 16.0, has_velocity=True)
    beat, doppler = -3e5, 200.0
    steps = np.array([[1.0, 0.0], [0.0, 1.0]])
    differences = [
        (np.array(coordinates.at(beat + b, doppler + d)) - coordinates.at(beat - b, doppler - d)) / 2.0
        for b, d in steps
    ]
    # The shift of the frequency by the target's delay is left out: 3e5 / 60e9 of the velocity, times the coupling.
    np.testing.assert_allclose(np.transpose(differences), coordinates.slopes(), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize(("window", "level_db"), [("hann", 30.0), ("hann", 110.0), (None, 60.0), ("hamming", 60.0)])
def test_sidelobes_of_a_strong_echo_are_not_reported(window: Any, level_db: float) -> None:
    of = radar(num_channels=2)
    rng = np.random.default_rng(6)
    amplitude = np.sqrt(10.0 ** (level_db / 10.0) / (64 * 32))
    options: dict[str, Any] = {"window": window, "doppler_window": window}
    for _ in range(10):
        cube = target(of, rng.uniform(1.0, 8.0), rng.uniform(-2.5, 2.5), amplitude) + noise(of, rng)
        assert len(rc.detect(cube, of, **options)) == 1


def test_an_echo_near_a_wall_is_found_as_often_as_alone() -> None:
    of, rng = radar(num_channels=3), np.random.default_rng(20)
    bin_, unit = of.waveform.range_resolution, 1.5 / np.sqrt(64 * 32)  # amplitude of 0 dB in a cell of Hann windows
    walls = [target(of, 3.0 + step * bin_, 0.0, unit * 10.0**2.2) for step in (6.0, 7.1, 5.4)]
    found = np.zeros(2)
    for _ in range(100):
        # Swerling 1, 24 dB in the mean, walks 1 m in front of a wall of 44 dB.
        velocity = rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.2)
        person = target(of, 3.0, velocity, unit * np.sqrt(rng.exponential(10.0**2.4)))
        added = noise(of, rng)
        for k, cube in enumerate((person + added, person + sum(walls) + added)):
            found[k] += (np.abs(rc.detect(cube, of).range - 3.0) < bin_).any()
    # Alone it is exp(-threshold / mean) of the frames: a threshold of 9 dB in each channel gives 97 %.
    assert found.min() >= 94


@pytest.mark.parametrize(
    ("real", "direction", "wall", "least"), [(True, UP, 3.0, 3.5), (True, DOWN, 3.0, 3.5), (False, UP, 9.1, 5.5)]
)
def test_an_echo_beside_a_stronger_one_has_its_own_direction(
    real: bool, direction: float, wall: float, least: float
) -> None:
    """Some bins behind another of 30 dB more, where the lobes of both meet; of I/Q samples across the last bin."""
    of, rng, squares = radar(direction, num_channels=3, real=real), np.random.default_rng(4), []
    y = np.array(of.rx)[:, 1:2]
    for _ in range(60):
        distance = wall + rng.uniform(least, least + 2.0) * of.waveform.range_resolution
        azimuth = rng.uniform(-0.6, 0.6, 2)
        delay = (2.0 * np.array([wall, distance]) - y * np.sin(azimuth)) / SPEED_OF_LIGHT
        cube = beat_signal_reference(delay, np.broadcast_to([20.0, 0.6], delay.shape), of.waveform) + noise(of, rng)
        found = rc.detect(cube.real if real else cube, of)
        expected = distance % (64 * of.waveform.range_resolution)
        best = found[int(np.abs(found.range - expected).argmin())]
        assert best.range[0] == pytest.approx(expected, abs=0.02)
        squares.append((best.azimuth[0] - azimuth[1]) ** 2 / best.covariance[0, 2, 2])
    # Chi-squared with 1 degree of freedom: mean 1, variance 2; 30 % for the error of the stronger one.
    assert np.mean(squares) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 60) + 0.3)


def test_weak_echoes_above_the_sidelobes_of_a_strong_one_are_found() -> None:
    of = radar(num_channels=2)
    rng = np.random.default_rng(7)
    bin_, step = of.waveform.range_resolution, of.waveform.velocity_resolution
    for _ in range(10):
        # 40 dB below, six bins away: the sidelobes of the Hann window are 59 dB down there.
        cube = target(of, 3.0, 0.3) + target(of, 3.0 + 6.3 * bin_, 0.3 + 2.0 * step, 0.01) + 1e-3 * noise(of, rng)
        found = rc.detect(cube, of)
        assert found.range == pytest.approx([3.0, 3.0 + 6.3 * bin_], abs=0.1 * bin_)
        # At a distance of 3.5 bins, equally strong: two echoes, not one.
        cube = target(of, 3.0, 0.3) + target(of, 3.0 + 3.5 * bin_, 0.3) + 1e-2 * noise(of, rng)
        assert len(rc.detect(cube, of)) == 2


@pytest.mark.parametrize("real", [False, True])
@pytest.mark.parametrize("direction", [UP, DOWN])
@pytest.mark.parametrize(
    "changes",
    [{}, {"num_chirps": 5}, {"num_chirps": 3}, {"num_samples": 12}, {"num_chirps": 200, "num_samples": 16}],
    ids=str,
)
def test_target_is_where_it_is(real: bool, direction: float, changes: dict[str, Any]) -> None:
    of = radar(direction, real=real, **changes)
    wf = of.waveform
    for velocity in (-0.8 * wf.max_velocity, 0.0, 0.999 * wf.max_velocity):  # the last between the highest and lowest
        distance = 3.3 * wf.range_resolution
        cube = target(of, distance, velocity) + 1e-2 * noise(of, np.random.default_rng(8))
        best = rc.detect(cube, of)
        assert len(best) == 1
        assert abs(best.range[0] - distance) <= 0.05 * wf.range_resolution
        off = (best.velocity[0] - velocity + wf.max_velocity) % (2.0 * wf.max_velocity) - wf.max_velocity
        assert abs(off) <= 0.05 * wf.velocity_resolution


@pytest.mark.parametrize("changes", [{"num_chirps": 1}, {"num_chirps": 2}, {"chirp_times": [0.0, 1e-4, 3e-4, 4e-4]}])
def test_frames_without_a_velocity_have_ranges(changes: dict[str, Any]) -> None:
    of = radar(num_channels=2, **({"num_chirps": 4} | changes))
    found = rc.detect(target(of, 2.03, 0.0) + 0.05 * noise(of, np.random.default_rng(9)), of)
    assert len(found) == 1
    assert abs(found.range[0] - 2.03) <= 5.0 * np.sqrt(found.covariance[0, 0, 0])
    assert np.isnan(found.velocity[0])
    assert np.isnan(found.covariance[0, 1]).all()
    assert abs(found.azimuth[0]) <= 5.0 * np.sqrt(found.covariance[0, 2, 2])  # in front


def test_cw_radar_has_velocities_and_no_ranges() -> None:
    wf = rc.Waveform(
        start_frequency=24e9, slope=0.0, sample_rate=1e6, num_samples=32, num_chirps=64, chirp_interval=200e-6
    )
    of = rc.Radar(wf)
    found = rc.detect(target(of, 20.0, 3.0) + 0.5 * noise(of, np.random.default_rng(10)), of)
    assert abs(found.velocity[0] - 3.0) <= 5.0 * np.sqrt(found.covariance[0, 1, 1])
    assert np.isnan([found.range[0], found.covariance[0, 0, 0], found.covariance[0, 0, 1]]).all()


def test_simulated_point_is_found_with_its_direction_at_the_middle_of_the_frame() -> None:
    of = rc.bgt60tr13c(num_chirps=32)
    scene = rc.Scene([rc.PointTarget([0.7, 0.2, 0.1], rcs=0.1, velocity=[-0.6, 0.3, 0.0])])
    frame = rc.Simulator(scene, of, resolution=8).frame(0.5)
    assert frame.truth is not None
    found = rc.detect(frame)
    assert found.time == pytest.approx(0.5 + of.waveform.duration / 2.0)
    best = found[int(np.argmax(found.snr_db))]
    for name, scale in (("range", 0.02 * of.waveform.range_resolution), ("velocity", 0.02), ("azimuth", 0.02)):
        assert abs(getattr(best, name)[0] - getattr(frame.truth, name)[0]) <= scale, name
    same = rc.detect(frame.cube, of)
    assert same.time == pytest.approx(of.waveform.duration / 2.0)
    np.testing.assert_array_equal(same.range, found.range)


@pytest.mark.parametrize("window", ["hann", "blackman", ("kaiser", 8.0)])
@pytest.mark.parametrize("delay", [0.0, 5e-3])
def test_velocity_of_what_accelerates_is_that_of_the_middle_of_the_frame(delay: float, window: Any) -> None:
    of = rc.Radar(radar(num_chirps=64, adc_delay=0.0).waveform.delayed(delay))
    acceleration, velocity, wf = 5.0, 0.5, of.waveform
    middle = delay + 0.5 * (wf.duration - delay)
    # At the start of the frame: 2 m and 0.5 m/s in its middle.
    distance = 2.0 - velocity * middle + 0.5 * acceleration * middle**2
    there, rate, change = 2.0 / SPEED_OF_LIGHT * np.array([[distance], [velocity - acceleration * middle], [5.0]])
    cube = rc.beat_signal(there, [1.0], wf, delay_rate=rate, delay_acceleration=change, tolerance=1e-7)
    found, peak = rc.detect(cube, of, doppler_window=window), rc.strongest_peak(cube, of, doppler_window=window)
    assert peak is not None
    assert found.time == pytest.approx(middle)
    # Half a chirp is 1 mm/s. The rest of the error comes from the velocity, which crosses 1.3 bins.
    assert [found.velocity[0], peak.velocity] == pytest.approx([velocity, velocity], abs=0.45e-3)


@pytest.mark.parametrize(("distance", "azimuth_deg"), [(0.3, 20.0), (0.3, 40.0), (0.5, 0.0)])
def test_bearing_and_range_of_near_targets_of_a_real_array_are_those_of_the_truth(
    distance: float, azimuth_deg: float
) -> None:
    """2 and 3 range bins away: spheres over the antennas, and mirror images of real tones."""
    azimuth = np.deg2rad(azimuth_deg)
    point = rc.PointTarget([distance * np.cos(azimuth), distance * np.sin(azimuth), 0.05])
    frame = rc.Simulator(rc.Scene([point]), rc.bgt60tr13c(num_chirps=32), tolerance=1e-5).frame()
    found = rc.detect(frame, min_range=0.1)
    best, truth = found[int(np.argmax(found.snr_db))], frame.truth
    assert truth is not None
    assert best.is_resolved.all()
    for row, name in ((2, "azimuth"), (3, "elevation")):
        error = getattr(best, name)[0] - getattr(truth, name)[0]
        assert abs(error) <= 5.0 * np.sqrt(best.covariance[0, row, row])
        assert abs(error) <= np.deg2rad(0.05)
    assert abs(best.range[0] - truth.range[0]) <= 0.05e-3


def test_time_of_detections_is_that_of_all_transmitters_in_turn() -> None:
    wf = radar(num_chirps=64).waveform.replace(chirp_interval=3e-3)
    tdm = rc.Radar(wf, tx=np.zeros((3, 3)), schedule=rc.Schedule.tdm(1e-3))
    point = rc.PointTarget([3.0, 0.0, 0.0], velocity=[0.3, 0.0, 0.0])
    frame = rc.Simulator(rc.Scene([point]), tdm, resolution=8).frame(0.5)
    found = rc.detect(frame)
    assert frame.truth is not None
    assert found.time == pytest.approx(0.5 + 0.5 * tdm.duration)
    assert abs(found.range[0] - (3.0 + 0.3 * found.time)) <= 0.05e-3  # a turn takes 0.3 mm
    assert abs(found.range[0] - frame.truth.range[0]) <= 0.05e-3
    estimate = rc.doppler_velocity(frame)
    assert abs(estimate.range - (3.0 + 0.3 * found.time)) <= 0.05e-3


def test_static_echoes_are_removed_and_moving_ones_stay() -> None:
    of = radar(num_channels=2)
    cube = 100.0 * target(of, 1.5, 0.0) + target(of, 3.0, 1.1) + 0.3 * noise(of, np.random.default_rng(11))
    (velocity,) = rc.detect(cube, of, subtract_mean=True).velocity
    assert velocity == pytest.approx(1.1, abs=0.01)
    assert len(rc.detect(cube, of)) == 2


def test_limits_of_range_and_the_first_bins() -> None:
    of = radar()
    cube = target(of, 1.5, 0.5) + target(of, 3.0, -1.0) + 0.1 * noise(of, np.random.default_rng(12))
    assert rc.detect(cube, of).range == pytest.approx([1.5, 3.0], abs=0.01)
    assert rc.detect(cube, of, min_range=2.0).range == pytest.approx([3.0], abs=0.01)
    assert rc.detect(cube, of, max_range=2.0).range == pytest.approx([1.5], abs=0.01)
    near = 100.0 * target(of, 0.1, 0.0) + 0.1 * noise(of, np.random.default_rng(13))  # leakage
    assert len(rc.detect(near, of)) == 0
    assert len(rc.detect(near, of, min_range=0.0)) == 1


@pytest.mark.parametrize("real", [False, True])
@pytest.mark.parametrize("changes", [{"num_samples": 1}, {"num_samples": 2}, {"num_samples": 3, "num_chirps": 2}, {}])
def test_silence_and_tiny_frames_have_no_detections(real: bool, changes: dict[str, Any]) -> None:
    of = radar(real=real, **changes)
    for cube in (0.0 * noise(of, np.random.default_rng(14)), noise(of, np.random.default_rng(15))):
        assert len(rc.detect(cube, of)) == 0
        assert len(rc.detect(cube.astype(np.float32 if real else np.complex64), of)) == 0


def pair(
    of: rc.Radar, beams: float, rng: np.random.Generator, snr_db: tuple[float, float]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Cube of two targets in one cell, in noise, and their sines; SNR in a cell of one channel."""
    places, wf = of.virtual_array[:, 1] / of.waveform.wavelength, of.waveform
    sines = 0.886 / (len(places) * 0.4839) * np.array([-0.5, 0.5]) * beams + rng.uniform(-0.2, 0.2)
    level = 10.0 ** (np.array(snr_db) / 20.0) * np.exp(2j * np.pi * rng.uniform(size=2))
    channels = np.exp(-2j * np.pi * np.outer(places, sines)) @ level
    scale = np.sqrt(wf.num_samples * wf.num_chirps / 1.5**2)  # gain of Hann windows over the noise
    return channels[:, None, None] / scale * target(of, 4.03, 0.7)[:1] + noise(of, rng), sines


def test_pairs_in_one_cell_are_two_detections_from_one_and_a_half_beam_widths_on() -> None:
    of, rng, num_found, squared = radar(num_channels=8), np.random.default_rng(3), [], []
    for beams in np.linspace(1.5, 3.0, 40):
        cube, sines = pair(of, beams, rng, (25.0, 20.0))
        found, one = rc.detect(cube, of, max_directions=2), rc.detect(cube, of)
        assert len(one) == 1
        assert not one.is_resolved[0]
        num_found.append(len(found))
        if len(found) == 2:
            left, right = np.argsort(found.azimuth)
            errors = found.azimuth[[left, right]] - np.arcsin(sines)
            squared += list(errors**2 / found.covariance[[left, right], 2, 2])
            assert abs(found.snr_db[left] - found.snr_db[right] - 5.0) < 2.5
            np.testing.assert_array_equal(found.range, one.range[[0, 0]])
    assert np.mean(np.equal(num_found, 2)) >= 0.95
    assert 0.8 <= np.sqrt(np.mean(squared)) <= 1.3


def test_single_target_stays_one_detection_of_two_directions() -> None:
    of, rng = radar(num_channels=8), np.random.default_rng(4)
    found = [rc.detect(pair(of, 1.0, rng, (25.0, -200.0))[0], of, max_directions=2) for _ in range(40)]
    assert all(len(each) == 1 for each in found)
