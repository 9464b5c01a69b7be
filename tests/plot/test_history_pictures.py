"""Pictures over time and from above: drawn objects and their places."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from picture_scenes import colour_bar_label, recording, room, texts, texts_apart
from radarcore import plot
from radarcore.geometry import shapes
from radarcore.geometry.pose import Pose
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.recording.recording import Recording
from radarcore.scene.body import Body, PointTarget
from radarcore.scene.scene import Scene

pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")


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
    alone: Any = plot.range_time(one, names=["arm"], subtract_mean=True, dynamic_range_db=40)
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


def test_spectrogram_of_single_chirps_ends_at_the_velocity_of_their_frames() -> None:
    wf = recording().radar.waveform.replace(num_chirps=1, frame_interval=1e-3)
    times = 1e-3 * np.arange(100)
    cube = np.random.default_rng(1).normal(size=(100, 1, 1, wf.num_samples)).astype(np.float32)
    single = Recording(cube, times, Radar(wf, receiver=Receiver(output="real")))
    ax: Any = plot.spectrogram(single)
    assert ax.get_ylim()[1] == pytest.approx(wf.wavelength / 4e-3)
    with pytest.raises(ValueError, match="recording: expected windows of several chirps, got"):
        plot.spectrogram(single[:1])
