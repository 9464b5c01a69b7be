"""Pictures: what is drawn where, that labels stay apart, and that importing and drawing touch nothing global."""

from __future__ import annotations

import io
import itertools
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from radarcore import plot
from radarcore.geometry import shapes
from radarcore.geometry.pose import Pose
from radarcore.motion.linear import Linear
from radarcore.plot import canvas
from radarcore.processing.point_cloud import Detections
from radarcore.processing.time_frequency import range_time, spectrogram
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording
from radarcore.scene.body import Body, PointTarget
from radarcore.scene.scene import Scene
from radarcore.units import SPEED_OF_LIGHT
from reference import beat_signal_reference

matplotlib = pytest.importorskip("matplotlib")
figure_module = pytest.importorskip("matplotlib.figure")
imread = pytest.importorskip("matplotlib.image").imread

NAMES = ("wall", "arm", "hidden", "behind")
RANGE = np.array([1.9, 0.9, np.nan, 50.0])
VELOCITY = np.array([0.0, -0.8, np.nan, 0.0])
AZIMUTH = np.deg2rad([-20.0, 5.0, np.nan, 80.0])
ELEVATION = np.deg2rad([12.0, -3.0, np.nan, 0.0])


def frame(*, real: bool = True, truth: bool = True, **changes: Any) -> Frame:
    """Two targets before a radar, a third hidden and a fourth out of view."""
    settings: dict[str, Any] = {"num_samples": 128, "num_chirps": 32, "chirp_interval": 400e-6} | changes
    wf = Waveform.from_sweep(start_frequency=58e9, stop_frequency=62e9, sample_rate=2e6, **settings)
    radar = Radar(wf, receiver=Receiver(output="real") if real else None)
    start = RANGE[:2] - VELOCITY[:2] * wf.duration / 2.0
    cube = beat_signal_reference(
        2.0 * start / SPEED_OF_LIGHT, [3e-5, 1e-5], wf, delay_rate=2.0 * VELOCITY[:2] / SPEED_OF_LIGHT
    )
    known = Truth(NAMES, RANGE, VELOCITY, AZIMUTH, ELEVATION) if truth else None
    return Frame(cube.real.astype(np.float32) if real else cube.astype(np.complex64), 0.125, radar, known)


def recording(times: Any = tuple(0.025 * i for i in range(12)), *, truth: bool = True) -> Recording:
    """A wall at rest at 1.9 m and an arm that comes nearer at 0.8 m/s, from 1.5 m at 0 s; a third is never visible."""
    wf = frame().radar.waveform
    times = np.asarray(times)
    middles = times + 0.5 * wf.duration
    distance = np.stack([np.full(len(times), 1.9), 1.5 - 0.8 * middles, np.full(len(times), np.nan)], axis=1)
    velocity = np.where(np.isnan(distance), np.nan, VELOCITY[:3])
    starts = distance[:, :2] - 0.5 * wf.duration * VELOCITY[:2]
    rates = 2.0 * VELOCITY[:2] / SPEED_OF_LIGHT
    cube = [beat_signal_reference(2.0 * r / SPEED_OF_LIGHT, [3e-5, 1e-5], wf, delay_rate=rates).real for r in starts]
    radar = Radar(wf, receiver=Receiver(output="real"))
    angles = np.zeros_like(distance)
    known = Truth(NAMES[:3], distance, velocity, angles, angles) if truth else None
    return Recording(np.array(cube, dtype=np.float32).reshape(-1, 1, 32, 128), times, radar, known)


def room() -> Scene:
    """A room with a wall, a moving arm and a point in it."""
    return Scene(
        [
            Body(shapes.box((4.0, 3.0, 2.5)), motion=Pose([1.0, 0.0, 0.25]), name="room"),
            Body(shapes.box((0.2, 1.0, 1.0)), motion=Pose([2.0, 0.0, 0.0]), name="wall"),
            Body(
                shapes.box((0.3, 0.1, 0.1)),
                motion=Linear(Pose([1.5, -0.6, 0.0]), velocity=[-0.8, 0.0, 0.0]),
                name="arm",
            ),
            PointTarget([0.5, 1.0, 0.0], name="point"),
        ]
    )


def image(hit: bool = True) -> Any:
    """A wall over the right half of the view, nothing on the left."""
    distance = np.full((30, 40), np.inf)
    if hit:
        distance[:, 20:] = np.linspace(1.9, 2.4, 20)
    reflectance = np.where(np.isfinite(distance), 0.4, 0.0)
    return SimpleNamespace(distance=distance, reflectance=reflectance, field_of_view_deg=(60.0, 46.0))


def texts(ax: Any) -> dict[str, Any]:
    return {label.get_text(): label for label in ax.texts}


def colour_bar_label(ax: Any) -> str:
    return str(ax.child_axes[0].get_ylabel())


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


def test_pictures_go_into_given_axes() -> None:
    panels = figure_module.Figure().subplots(5)
    one = frame()
    for draw, ax in zip(
        (
            lambda ax: plot.depth_image(image(), ax),
            lambda ax: plot.reflectance_image(image(), ax=ax),
            lambda ax: plot.chirp(one, ax=ax),
            lambda ax: plot.range_profile(one, ax=ax),
            lambda ax: plot.range_doppler_map(one, ax=ax),
        ),
        panels,
        strict=True,
    ):
        assert draw(ax) is ax  # type: ignore[no-untyped-call]
        assert ax.has_data()


def boxes(figure: Any) -> Iterator[tuple[str, Any]]:
    """Everything written in a figure, with its place in pixels."""
    from matplotlib.text import Text

    figure.draw_without_rendering()
    not_drawn = []  # labels of ticks beyond the limits
    for ax in itertools.chain(figure.axes, *(ax.child_axes for ax in figure.axes)):
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            beyond = [tick for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]
            not_drawn += [id(label) for tick in beyond for label in (tick.label1, tick.label2)]
    for text in figure.findobj(lambda artist: isinstance(artist, Text) and artist.get_visible()):
        box = text.get_window_extent()
        if id(text) not in not_drawn and text.get_text().strip() and box.width > 0.0:
            yield text.get_text(), box


def texts_apart(figure: Any) -> set[str]:
    """Everything written in a figure, none over another and all of it on the figure."""
    written = list(boxes(figure))
    for (text, box), (other, other_box) in itertools.combinations(written, 2):
        assert not box.overlaps(other_box), f"{text!r} over {other!r}"
    for text, box in written:
        assert figure.bbox.x0 <= box.x0, text
        assert box.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= box.y0, text
        assert box.y1 <= figure.bbox.y1, text
    return {text for text, _ in written}


@pytest.mark.parametrize("options", [{}, {"real": False}, {"num_chirps": 1}])
def test_overview_writes_nothing_over_anything_else(options: Any, tmp_path: Path) -> None:
    path = tmp_path / "new" / "overview.png" if options == {} else None
    figure = plot.overview(frame(**options), image(), path)
    assert path is None or path.read_bytes()[:4] == b"\x89PNG"
    assert figure.dpi == 100  # as of one that was not written
    assert [ax.get_title() for ax in figure.axes[:3]] == ["Depth", "Reflectance", "First chirp, channel 0"]
    assert {"wall", "arm"} <= texts_apart(figure)


def test_names_of_many_bodies_in_one_place_stay_apart() -> None:
    one = frame()
    n = 12
    names = tuple(f"body ${i}" for i in range(n))  # a dollar sign is no formula
    truth = Truth(names, np.linspace(1.0, 1.1, n), np.zeros(n), np.zeros(n), np.zeros(n))
    ax: Any = plot.range_doppler_map(Frame(one.cube, 0.0, one.radar, truth))
    assert len(ax.get_lines()) == n
    extents = [label.get_window_extent() for label in ax.texts]
    assert len(extents) >= 4  # right, left, above and below at least
    assert not any(a.overlaps(b) for a, b in itertools.combinations(extents, 2))


def test_overview_of_a_measured_frame_goes_without_images() -> None:
    figure = plot.overview(frame(truth=False), None)
    assert [ax.get_title() for ax in figure.axes[:2]] == ["First chirp, channel 0", "Range and velocity"]


def test_chirps_at_unequal_intervals_show_range_alone() -> None:
    one = frame(truth=False)
    wf = one.radar.waveform.replace(chirp_times=400e-6 * np.arange(32) + 50e-6 * (np.arange(32) % 2))
    figure = plot.overview(Frame(one.cube, 0.0, Radar(wf, receiver=one.radar.receiver)), None)
    assert figure.axes[1].get_title() == "Range"
    assert figure.axes[1].get_xlabel() == "Range [m]"


def level_at(ax: Any, x: float, y: float) -> float:
    """Level [dB] of the picture in some axes at a point of the data; NaN where it is grey."""
    (drawn,) = ax.images
    values = np.ma.filled(drawn.get_array(), np.nan)
    left, right, bottom, top = drawn.get_extent()
    x_edges = getattr(drawn, "_Ax", np.linspace(left, right, values.shape[1] + 1))
    y_edges = getattr(drawn, "_Ay", np.linspace(bottom, top, values.shape[0] + 1))
    return float(values[np.searchsorted(y_edges, y) - 1, np.searchsorted(x_edges, x) - 1])


def test_ranges_over_time_are_brightest_on_the_lines_of_the_truth() -> None:
    one = recording()
    ax: Any = plot.range_time(one, max_range=2.2)
    _, arm = ax.get_lines()  # the third was never visible
    middles = one.time + 0.5 * one.radar.waveform.duration
    np.testing.assert_allclose(arm.get_xdata(), middles)
    np.testing.assert_allclose(arm.get_ydata(), 1.5 - 0.8 * middles)
    for time in middles:
        assert level_at(ax, time, 1.9) > -0.5
        assert level_at(ax, time, 1.5 - 0.8 * time) == pytest.approx(-9.5, abs=1.0)  # a third of the amplitude
        assert level_at(ax, time, 2.15) < -30.0
    assert set(texts(ax)) == {"wall", "arm"}
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Time [s]", "Range [m]")
    assert colour_bar_label(ax).startswith("Power [dB re maximum, floor −")
    assert ax.get_ylim() == (0.0, 2.2)
    assert {"wall", "arm"} <= texts_apart(ax.figure)
    alone: Any = plot.range_time(one, names=["arm"], remove_static=True, dynamic_range_db=40)
    assert len(alone.get_lines()) == 1
    assert alone.images[0].get_clim() == (-40.0, 0.0)
    assert level_at(alone, middles[6], 1.9) < level_at(ax, middles[6], 1.9) - 10.0


def test_spectrogram_is_brightest_at_the_velocities() -> None:
    one = recording()
    wf = one.radar.waveform
    ax: Any = plot.spectrogram(one, names=["arm"], dynamic_range_db=60)
    for time in one.time + 0.5 * wf.duration:
        assert level_at(ax, time, 0.0) > -0.5
        assert level_at(ax, time, -0.8) == pytest.approx(-9.5, abs=1.0)
        assert level_at(ax, time, 1.5) < -30.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Time [s]", "Velocity [m/s, receding positive]")
    _, fastest = ax.get_ylim()
    assert 0.8 < fastest < wf.max_velocity
    assert plot.spectrogram(one, max_velocity=1.0).get_ylim() == (-1.0, 1.0)
    bottom, top = ax.images[0].get_extent()[2:]
    assert (bottom, top) == pytest.approx((-wf.max_velocity, wf.max_velocity))  # no empty strip at either end
    assert set(texts(ax)) == {"arm"}
    gated: Any = plot.spectrogram(one, max_range=1.6, window_length=16)
    assert level_at(gated, 0.1, -0.8) > -0.5
    assert gated.images[0].get_array().shape[1] == 3 * 12


def test_a_pause_is_grey_and_its_neighbours_keep_their_width() -> None:
    times = 0.025 * np.array([0, 1, 2, 3, 20, 21, 22])
    ax: Any = plot.range_time(recording(times))
    columns = {time: level_at(ax, time, 1.9) for time in (0.0, 0.09, 0.1, 0.3, 0.48, 0.5, 0.56)}
    assert {time for time, level in columns.items() if np.isnan(level)} == {0.1, 0.3, 0.48}


def test_tracks_have_the_errors_in_bins_in_the_legend() -> None:
    one = recording()
    wf = one.radar.waveform
    middles = one.time + 0.5 * wf.duration
    errors = wf.range_resolution * np.array([0.0, 0.1, 0.1, 0.1, -0.1, 0.1, 0.2, 0.1, -0.5, 0.1, 0.1, np.nan])
    arm = SimpleNamespace(time=middles, range=1.5 - 0.8 * middles + errors, velocity=np.full(12, -0.8))
    wall = {
        "time": middles[::2] + 0.01,
        "range": np.full(6, 1.9),
        "velocity": np.full(6, 0.25 * wf.velocity_resolution),
    }
    other = {"time": [0.1], "range": [1.0], "velocity": [1.0]}
    estimates = {"arm": arm, "wall": wall, "_other $": other}
    ax: Any = plot.tracks(one, estimates)
    entries = [text.get_text() for text in ax.get_legend().get_texts()]
    assert entries[:2] == ["arm: median 0.10, max 0.50 bins", "wall: median 0.00, max 0.00 bins"]
    assert entries[2].lstrip("\u200b") == r"_other \$"  # shown as it is
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Time [s]", "Range [m]")
    lines = ax.get_lines()
    assert len(lines) == 5
    assert lines[0].get_color() == lines[1].get_color() != lines[2].get_color()
    np.testing.assert_allclose(lines[0].get_ydata(), 1.5 - 0.8 * middles)
    assert len(lines[1].get_xdata()) == 11  # the last is NaN
    # The legend covers nothing.
    texts_apart(ax.figure)
    top = ax.transData.inverted().transform(ax.get_legend().get_window_extent())[0, 1]
    assert max(np.nanmax(line.get_ydata()) for line in lines) < top
    speeds: Any = plot.tracks(one, estimates, quantity="velocity")
    assert speeds.get_legend().get_texts()[1].get_text() == "wall: median 0.25, max 0.25 bins"
    assert speeds.get_ylabel() == "Velocity [m/s]"


def test_tracks_without_estimates_are_those_of_the_truth_and_without_truth_dots() -> None:
    ax: Any = plot.tracks(recording(), {})
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["wall", "arm"]
    alone: Any = plot.tracks(recording(truth=False), {"arm": {"time": [0.1], "range": [1.0], "velocity": [0.0]}})
    assert [text.get_text() for text in alone.get_legend().get_texts()] == ["arm"]
    assert plot.tracks(recording(truth=False), {}).get_legend() is None


def test_scene_from_above_has_outlines_trails_and_the_field_of_view() -> None:
    sensor = Pose.from_rpy([0.0, 0.2, 1.0], [0.0, 0.0, np.deg2rad(10.0)])
    ax: Any = plot.scene_from_above(room(), sensor, [0.0, 1.0], field_of_view_deg=(60.0, 40.0))
    filled = [np.asarray(patch.get_xy()) for patch in ax.patches if patch.get_fill()]
    extents = {tuple(np.round([*xy.min(axis=0), *xy.max(axis=0)], 6)) for xy in filled if len(xy) > 4}
    assert {(1.9, -0.5, 2.1, 0.5), (1.35, -0.65, 1.65, -0.55), (0.55, -0.65, 0.85, -0.55)} <= extents
    lines = [np.asarray(line.get_xydata()) for line in ax.get_lines()]
    assert any(np.allclose(line[[0, -1]], [[1.5, -0.6], [0.7, -0.6]]) for line in lines)  # trail of the arm
    outlines = {tuple(np.round([*xy.min(axis=0), *xy.max(axis=0)], 6)) for xy in lines}
    assert (-1.0, -1.5, 3.0, 1.5) in outlines  # the room is a line
    assert (0.0, 0.2, 0.0, 0.2) in outlines
    borders = [np.asarray(artist.get_xy()) for artist in ax.artists + ax.patches if len(artist.get_xy()) == 3]
    ((left, origin, right),) = borders
    np.testing.assert_allclose(origin, [0.0, 0.2])
    azimuths = [np.rad2deg(np.arctan2(*(end - origin)[::-1])) for end in (left, right)]
    np.testing.assert_allclose(azimuths, [40.0, -20.0])
    assert set(texts(ax)) == {"room", "wall", "arm", "point", "radar"}
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")
    assert {"room", "wall", "arm", "point", "radar"} <= texts_apart(ax.figure)
    # Metres are equal and everything is in view.
    (x0, x1), (y0, y1), box = ax.get_xlim(), ax.get_ylim(), ax.get_window_extent()
    assert box.width / (x1 - x0) == pytest.approx(box.height / (y1 - y0))
    assert x0 < -1.0 < 3.0 < x1
    assert y0 < -1.5 < 1.5 < y1


def test_what_moves_has_a_colour_and_what_stands_still_is_grey() -> None:
    colours = {name: label.get_color() for name, label in texts(plot.scene_from_above(room(), None, [0, 1])).items()}
    assert colours["wall"] == colours["room"] == colours["point"] != colours["arm"]
    ax = plot.scene_from_above(room(), None, [0, 1], colors={"wall": "tab:red"})
    assert texts(ax)["wall"].get_color() == "tab:red"


@pytest.mark.parametrize(
    "scene",
    [
        Scene(),
        Scene([Body(shapes.plate(1.0, 1.0), motion=Pose([2.0, 0.0, 0.0]))]),
        Scene([PointTarget([0.0, 0.0, -1.0])]),
    ],
)
def test_scene_of_next_to_nothing_is_still_two_metres_wide(scene: Scene) -> None:
    down = Pose.look_at([0.0, 0.0, 2.0], [0.0, 0.0, 0.0], up=(1.0, 0.0, 0.0))
    ax = plot.scene_from_above(scene, down, field_of_view_deg=None)
    assert max(np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())) >= 2.0


@pytest.mark.parametrize("with_estimates", [True, False])
def test_experiment_writes_nothing_over_anything_else(
    with_estimates: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    one = recording()
    middles = one.time + 0.5 * one.radar.waveform.duration
    arm = {"time": middles, "range": 1.5 - 0.8 * middles, "velocity": np.full(12, -0.8)}
    path = tmp_path / "new" / "experiment.png" if with_estimates else None
    estimates = {"arm": arm} if with_estimates else None
    figure = plot.experiment(one, room(), Pose(), estimates, max_range=3.0, path=path)
    assert path is None or path.read_bytes()[:4] == b"\x89PNG"
    assert figure.dpi == 100
    titles = [ax.get_title() for ax in figure.axes[:5]]
    tracks = "Truth (lines) and estimates (dots)" if with_estimates else "Truth"
    assert titles == ["Scene from above", "Range and velocity at 0.15 s", "Spectrogram", tracks, ""]
    assert {"room", "wall", "arm", "point", "radar", "x [m]", "Range [m]", "Velocity [m/s]"} <= texts_apart(figure)
    for ax in figure.axes[2:5]:
        assert ax.get_xlim() == figure.axes[2].get_xlim()
    assert not caplog.records  # matplotlib logs what it could not do


def test_experiment_of_one_measured_frame_and_an_empty_scene() -> None:
    figure = plot.experiment(recording([0.0], truth=False), Scene())
    assert any(text.startswith("1 frame, ") for text in texts_apart(figure))


def test_box_that_reaches_into_view_has_its_name_there_and_one_out_of_view_none() -> None:
    ax = canvas.new_axes()
    ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    sizes = (0.4, 0.2)
    canvas.place_names(ax, [canvas.Name(-0.1, 0.5, "wall", "k", sizes), canvas.Name(3.0, 0.5, "far", "k", sizes)])
    (name,) = ax.texts
    assert name.get_text() == "wall"
    box = name.get_window_extent()
    assert 10.0 < box.width < 100.0
    assert ax.get_window_extent().contains(box.x0, box.y0)


def test_titles_of_panels_are_where_matplotlib_has_them() -> None:
    figure = plot.experiment(recording(), room())
    titled = [ax for ax in figure.axes if ax.get_title()]
    assert len(titled) == 4
    figure.draw_without_rendering()
    ours = [ax.title.get_window_extent().get_points() for ax in titled]
    for ax in titled:
        ax.set_title(ax.get_title())
    figure.draw_without_rendering()
    np.testing.assert_allclose([ax.title.get_window_extent().get_points() for ax in titled], ours, atol=1e-6)


@pytest.mark.parametrize("is_given", [False, True])
def test_titles_make_way_for_an_axis_on_top(is_given: bool) -> None:
    given = figure_module.Figure().subplots() if is_given else None
    above = given.twiny() if given is not None else None
    ax = plot.range_doppler_map(frame(truth=False), ax=given)
    top = ax.secondary_xaxis("top") if above is None else above
    ax.figure.draw_without_rendering()
    beside = top.xaxis.get_tightbbox()
    assert beside is not None
    assert ax.title.get_window_extent().y0 >= beside.y1 - 1e-6


@pytest.mark.parametrize("autolayout", [False, True])
def test_a_written_picture_is_that_of_savefig_and_leaves_the_figure_as_it_was(
    autolayout: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(matplotlib.rcParams, "figure.autolayout", autolayout)
    figure, another = (plot.range_doppler_map(frame()).figure for _ in range(2))
    engine, written, saved = figure.get_layout_engine(), io.BytesIO(), io.BytesIO()
    canvas.write(figure, written, dpi=80)
    assert (figure.get_layout_engine(), figure.dpi) == (engine, 100)
    another.savefig(saved, dpi=80)
    pictures = [imread(io.BytesIO(file.getvalue())) for file in (written, saved)]
    np.testing.assert_array_equal(*pictures)


def test_missing_matplotlib_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"pip install radarcore\[plot\]"):
        plot.depth_image(image())
    with pytest.raises(ImportError, match=r"pip install radarcore\[plot\]"):
        plot.overview(frame(), image())
    one = recording([0.0])
    for draw in (
        lambda: plot.range_time(one),
        lambda: plot.spectrogram(one),
        lambda: plot.tracks(one, {}),
        lambda: plot.scene_from_above(room()),
        lambda: plot.experiment(one, room()),
    ):
        with pytest.raises(ImportError, match=r"pip install radarcore\[plot\]"):
            draw()  # type: ignore[no-untyped-call]


def test_importing_needs_no_matplotlib_and_drawing_no_pyplot_and_both_touch_nothing_global() -> None:
    code = (
        "import sys, radarcore.plot; assert not any(n.startswith(('matplotlib', 'scipy')) for n in sys.modules)\n"
        f"sys.path[:0] = {[str(folder) for folder in Path(__file__).parents[:2]]!r}\n"
        "import matplotlib, test_plot; from radarcore import plot\n"
        "settings = lambda: {k: matplotlib.rcParams[k] for k in matplotlib.rcParams if k != 'backend'}\n"
        "before = settings()\n"
        "plot.experiment(test_plot.recording(), test_plot.room())\n"
        "plot.range_time(test_plot.recording())\n"
        "plot.depth_image(test_plot.image())\n"
        "assert settings() == before and 'matplotlib.pyplot' not in sys.modules"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize(
    ("draw", "error", "message"),
    [
        (lambda: plot.chirp(frame(), channel=1), ValueError, "channel: expected an index below 1, got 1"),
        (lambda: plot.chirp(frame(), chirp=-33), ValueError, "chirp: expected at least -32, got -33"),
        (lambda: plot.chirp(frame(), chirp=0.5), TypeError, "chirp: expected an integer"),  # type: ignore[arg-type]
        (lambda: plot.range_doppler_map(frame(), channel=2), ValueError, "channel: expected an index below 1"),
        (lambda: plot.range_doppler_map(frame(), dynamic_range_db=0), ValueError, "dynamic_range_db: expected a posi"),
        (lambda: plot.range_profile(frame(), max_range=-1), ValueError, "max_range: expected a positive"),
        (
            lambda: plot.depth_image(SimpleNamespace(distance=np.ones(3), field_of_view_deg=(60, 60))),
            ValueError,
            r"image: expected arrays of shape \(row, column\), got \(3,\)",
        ),
        (
            lambda: plot.depth_image(SimpleNamespace(distance=np.ones((3, 3)), field_of_view_deg=(180, 60))),
            ValueError,
            "field_of_view_deg: expected two angles between 0 and 180",
        ),
        (lambda: plot.range_time(frame()), TypeError, "recording: expected Recording, got Frame"),  # type: ignore[arg-type]
        (lambda: plot.range_time(recording([])), ValueError, "recording: expected at least one frame, got none"),
        (lambda: plot.range_time(recording(), names=["leg"]), KeyError, "no truth of 'leg'; there is wall, arm"),
        (
            lambda: plot.range_time(recording(truth=False), names=["arm"]),
            ValueError,
            "names: expected none, because the recording has no truth",
        ),
        (lambda: plot.range_time(recording(), dynamic_range_db=0), ValueError, "dynamic_range_db: expected a posi"),
        (lambda: plot.range_time(recording(), max_range=-1), ValueError, "max_range: expected a positive"),
        (lambda: plot.spectrogram(recording(), window_length=33), ValueError, "window_length: expected at most 32"),
        (lambda: plot.spectrogram(recording(), channel=1), ValueError, "channel: expected an index below 1, got 1"),
        (lambda: plot.tracks(recording(), [1.0]), TypeError, "estimates: expected a dict of tracks by name, got list"),  # type: ignore[arg-type]
        (lambda: plot.tracks(recording(), {}, quantity="angle"), ValueError, "quantity: expected one of 'range', 'vel"),
        (
            lambda: plot.tracks(recording(), {"arm": {"time": [0.0]}}),
            TypeError,
            r"estimates\['arm'\]: expected a dict or an object with time and range, got one without range",
        ),
        (
            lambda: plot.tracks(recording(), {"arm": {"time": [0.0], "range": [1.0, 2.0]}}),
            ValueError,
            r"estimates\['arm'\]: expected time and range of one shape \(n,\), got \(1,\) and \(2,\)",
        ),
        (
            lambda: plot.tracks(recording(), {"arm": {"time": [0.0], "range": ["far"]}}),
            TypeError,
            r"estimates\['arm'\]: expected numbers in range, got \['far'\]",
        ),
        (lambda: plot.scene_from_above([]), TypeError, "scene: expected Scene, got list"),  # type: ignore[arg-type]
        (lambda: plot.scene_from_above(room(), 3), TypeError, "radar_motion: expected Pose"),  # type: ignore[arg-type]
        (lambda: plot.scene_from_above(room(), None, []), ValueError, "times: expected at least one time"),
        (lambda: plot.scene_from_above(room(), None, [np.nan]), ValueError, "times: expected finite numbers"),
        (
            lambda: plot.scene_from_above(room(), field_of_view_deg=(180, 60)),
            ValueError,
            "field_of_view_deg: expected two angles between 0 and 180",
        ),
        (lambda: plot.experiment(recording([]), room()), ValueError, "recording: expected at least one frame"),
        (lambda: plot.experiment(recording(), None), TypeError, "scene: expected Scene, got NoneType"),  # type: ignore[arg-type]
    ],
)
def test_silly_input_is_refused_by_name(draw: Any, error: Any, message: str) -> None:
    with pytest.raises(error, match=message):
        draw()


def test_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        plot.overview(frame(), None, tmp_path / "file" / "overview.png")
