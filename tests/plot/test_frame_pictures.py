"""Pictures of images and frames: drawn objects and their places."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from picture_scenes import colour_bar_label, frame, image, recording, texts
from radarcore import plot
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.spectra.time_frequency import range_time, spectrogram
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording

pytest.importorskip("matplotlib.figure", reason="needs the extra `plot`: pip install radarcore[plot]")


def test_depth_image_has_azimuth_to_the_left_elevation_up_and_grey_misses() -> None:
    ax: Any = plot.depth_image(image())
    left, right = ax.get_xlim()
    assert left == pytest.approx(np.tan(np.deg2rad(30.0)))
    assert right == -left
    assert ax.get_ylim()[1] == pytest.approx(np.tan(np.deg2rad(23.0)))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Azimuth [°]", "Elevation [°]")
    assert colour_bar_label(ax) == "Distance [m]"
    drawn = ax.images[0]
    assert drawn.get_array().mask[:, :20].all()
    assert not drawn.get_array().mask[:, 20:].any()
    assert drawn.get_clim() == (1.9, 2.4)
    red, green, blue, alpha = drawn.cmap(np.ma.masked)
    assert red == green == blue < 1.0
    assert alpha == 1.0
    # Ticks lie where their angles are on the image plane.
    for position, label in zip(ax.get_xticks(), ax.get_xticklabels(), strict=True):
        assert np.rad2deg(np.arctan(position)) == pytest.approx(float(label.get_text().replace("\N{MINUS SIGN}", "-")))


def test_reflectance_image_starts_at_zero() -> None:
    ax: Any = plot.reflectance_image(image())
    assert ax.images[0].get_clim() == (0.0, 0.4)
    assert colour_bar_label(ax) == "Reflectance"


@pytest.mark.parametrize("draw", [plot.depth_image, plot.reflectance_image])
def test_image_of_nothing_is_all_grey(draw: Any) -> None:
    ax = draw(image(hit=False))
    assert ax.images[0].get_array().mask.all()
    low, high = ax.images[0].get_clim()
    assert low < high


def test_chirp_is_drawn_over_microseconds_in_powers_of_a_thousand() -> None:
    one = frame(adc_delay=3e-6)
    ax: Any = plot.chirp(one, chirp=-1)
    (line,) = ax.get_lines()
    np.testing.assert_allclose(line.get_xdata(), 3.0 + 0.5 * np.arange(128))
    np.testing.assert_allclose(line.get_ydata(), 1e6 * one.cube[0, -1], rtol=1e-6)
    assert ax.get_xlabel() == "Time since start of ramp [µs]"
    assert "10^{-6}" in ax.get_ylabel()
    labels = {line.get_label() for line in plot.chirp(frame(real=False)).get_lines()}
    assert labels == {"I", "Q"}


@pytest.mark.parametrize("real", [True, False])
def test_map_is_brightest_where_the_crosses_are(real: bool) -> None:
    one = frame(real=real)
    ax: Any = plot.range_doppler_map(one)
    wf = one.radar.waveform
    drawn = ax.images[0]
    level, (left, right, bottom, top) = drawn.get_array(), drawn.get_extent()
    row, column = np.unravel_index(np.argmax(level), level.shape)
    velocity = left + (column + 0.5) * (right - left) / level.shape[1]
    distance = bottom + (row + 0.5) * (top - bottom) / level.shape[0]
    assert abs(velocity - 0.0) <= 0.25 * wf.velocity_resolution  # half a cell of the padded grid is 1/8
    assert abs(distance - 1.9) <= 0.25 * wf.range_resolution
    crosses = [(line.get_xdata()[0], line.get_ydata()[0]) for line in ax.get_lines()]
    assert crosses == [(0.0, 1.9), (-0.8, 0.9)]
    assert set(texts(ax)) == {"wall", "arm"}  # the hidden one is NaN, the fourth beyond the range
    # Cut to the echoes, whose main lobes are two bins to either side, and a fifth more.
    (_, farthest), (slowest, fastest) = ax.get_ylim(), ax.get_xlim()
    assert 1.9 + 2.0 * wf.range_resolution <= farthest / 1.2 <= 1.9 + 3.0 * wf.range_resolution
    assert 0.8 + wf.velocity_resolution <= fastest / 1.2 <= 0.8 + 4.0 * wf.velocity_resolution
    assert slowest == -fastest
    assert (level.min(), level.max()) == (pytest.approx(-60.0), pytest.approx(0.0))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Velocity [m/s, receding positive]", "Range [m]")
    assert colour_bar_label(ax) == "Power [dB re maximum, floor −60]"
    assert ax.get_title() == "Range and velocity at 0.125 s"


def test_map_of_known_noise_is_in_decibels_over_it_and_noise_alone_is_dark() -> None:
    one = frame(truth=False)
    receiver = Receiver(output="real", noise_figure_db=12.0)
    radar = Radar(one.radar.waveform, receiver=receiver)
    deviation = receiver.noise_variance(2e6) ** 0.5
    noise = deviation * np.random.default_rng(1).standard_normal(one.cube.shape)
    ax: Any = plot.range_doppler_map(Frame(noise, 0.0, radar))
    level = ax.images[0].get_array()
    assert colour_bar_label(ax) == "Power [dB over noise]"
    assert ax.images[0].get_clim() == (0.0, 30.0)
    # Exponentially distributed powers: the median is 1.6 dB below the mean, 1 / e of the cells are above it.
    assert 0.33 < np.mean(level > 0.0) < 0.41
    assert level.max() < 15.0
    assert ax.get_xlim() == pytest.approx((-radar.waveform.max_velocity, radar.waveform.max_velocity))
    # A tone of amplitude a in the middle of a bin: a^2 / 4 (64 x 16)^2 over the noise, 1 / 2 of it with the windows.
    tone = deviation * np.cos(2.0 * np.pi * 0.25 * np.arange(128)) + np.zeros((1, 32, 1))
    lone: Any = plot.range_doppler_map(Frame(tone, 0.0, radar))
    expected = 10.0 * np.log10(0.25 * (64 * 16) ** 2 / (48.0 * 12.0))
    assert lone.images[0].get_array().max() == pytest.approx(expected, abs=0.1)
    profile: Any = plot.range_profile(Frame(noise, 0.0, radar))
    assert profile.get_ylabel() == "Power [dB over noise]"
    assert profile.get_ylim() == (-10.0, 33.0)
    assert np.mean(profile.get_lines()[0].get_ydata() < 0.0) > 0.3  # noise goes above its mean and below
    assert np.mean(10.0 ** (profile.get_lines()[0].get_ydata() / 10.0)) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("factor", [1.0, 300.0])
def test_noise_of_codes_is_their_median_in_any_unit(factor: float) -> None:
    one = frame(truth=False)
    noise = factor * np.random.default_rng(4).standard_normal(one.cube.shape)
    ax: Any = plot.range_doppler_map(Frame(noise, 0.0, one.radar, stats={"cube_unit": "counts"}))
    assert colour_bar_label(ax) == "Power [dB over noise]"
    assert ax.images[0].get_clim() == (0.0, 30.0)
    assert np.mean(ax.images[0].get_array() > 0.0) == pytest.approx(0.5, abs=0.01)


def test_known_noise_of_recordings_is_the_mean_of_their_pictures() -> None:
    one = recording(truth=False)
    receiver = Receiver(noise_figure_db=12.0)
    parts = np.random.default_rng(2).standard_normal((2, *one.cube.shape))
    noise = (0.5 * receiver.noise_variance(2e6)) ** 0.5 * (parts[0] + 1j * parts[1])
    alone = Recording(noise, one.time, Radar(one.radar.waveform, receiver=receiver))
    for draw in (plot.range_time, plot.spectrogram):
        ax: Any = draw(alone)
        assert colour_bar_label(ax) == "Power [dB over noise]"
    for found in (range_time(alone), spectrogram(alone, max_range=2.0)):
        assert found.power.mean() == pytest.approx(found.noise, rel=0.03)  # of 12 x 32 x 128 samples: 0.5 %
    # Codes of an ADC are not in the unit of the noise figure.
    scaled = Recording(one.cube, one.time, alone.radar, source={"cube_unit": "full scale"})
    assert range_time(scaled).noise is None


def test_detections_are_rings() -> None:
    one = frame(truth=False)
    found = Detections([0.9, 1.9], [-0.8, 0.0], [np.nan] * 2, [np.nan] * 2, [20.0, 30.0])
    ax: Any = plot.range_doppler_map(one, detections=found)
    rings = ax.get_lines()[-1]
    np.testing.assert_array_equal(rings.get_xydata(), [[-0.8, 0.9], [0.0, 1.9]])
    assert ax.get_xlim() == plot.range_doppler_map(one).get_xlim()


def test_axes_hold_all_detections_and_without_a_truth_all_that_the_radar_sees() -> None:
    wf = frame().radar.waveform
    far = Detections([0.9 * wf.max_range], [-0.9 * wf.max_velocity], [np.nan], [np.nan], [12.0])
    for one, found in ((frame(truth=False), None), (frame(), far)):
        ax: Any = plot.range_doppler_map(one, detections=found)
        assert ax.get_ylim()[1] >= 0.9 * wf.max_range
        assert ax.get_xlim()[1] >= 0.9 * wf.max_velocity
    for real, end in ((True, wf.max_range), (False, 2.0 * wf.max_range)):
        assert plot.range_profile(frame(truth=False, real=real)).get_xlim()[1] == pytest.approx(end)
    near: Any = plot.range_doppler_map(frame(num_samples=512))
    assert near.get_ylim()[1] < 0.5 * frame(num_samples=512).radar.waveform.max_range, "known pixels are large"


def test_map_takes_one_channel_a_dynamic_range_and_a_farthest_range() -> None:
    ax: Any = plot.range_doppler_map(frame(), channel=-1, dynamic_range_db=40, max_range=1.5)
    assert ax.images[0].get_clim() == (-40.0, 0.0)
    assert ax.get_ylim() == (0.0, 1.5)
    assert set(texts(ax)) == {"arm"}


def test_map_of_silence_and_of_nan_is_drawn_without_a_warning() -> None:
    one = frame(truth=False)
    silent = Frame(np.zeros_like(one.cube), 0.0, one.radar)
    ax: Any = plot.range_doppler_map(silent)
    assert (ax.images[0].get_array() == -60.0).all()
    damaged = Frame(np.full_like(one.cube, np.nan), 0.0, one.radar)
    figure = plot.overview(damaged, image(hit=False))
    figure.draw_without_rendering()
