"""Pictures of tracks: colours, names and errors over time, ways from above."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from radarcore import plot
from radarcore.processing.tracking.tracks import Track, Tracks
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.recording.frame import Truth
from radarcore.recording.recording import Recording

pytest.importorskip("matplotlib.figure", reason="needs the extra `plot`: pip install radarcore[plot]")

NUMBER = 20
RADAR = bgt60tr13c(num_samples=16, num_chirps=4)
TIMES = 0.1 * np.arange(NUMBER)
MIDDLES = TIMES + 0.5 * RADAR.waveform.duration


def tracks(*, dimensions: int = 2) -> Tracks:
    """One along x from 1 m on at 0.2 m/s, y = 0.5 m, without detections in frames 5 to 7."""
    place = np.stack([1.0 + 0.2 * MIDDLES, np.full(NUMBER, 0.5)], axis=1)[:, :dimensions]
    motion = np.broadcast_to([0.2, 0.0][:dimensions], place.shape)
    seen = np.ones(NUMBER, dtype=bool)
    seen[5:8] = False
    covariance = np.broadcast_to(1e-6 * np.eye(2 * dimensions), (NUMBER, 2 * dimensions, 2 * dimensions))
    state, nearest = np.concatenate([place, motion], axis=1), np.full((2, NUMBER), np.nan)
    sensor = np.broadcast_to(np.eye(3, 4), (NUMBER, 3, 4)), np.zeros((NUMBER, 3)), np.zeros(NUMBER)
    numbers = np.arange(NUMBER)
    flags = seen, seen, np.zeros(NUMBER, dtype=bool), np.ones(NUMBER, dtype=bool)
    return Tracks(MIDDLES, (Track(3, numbers, MIDDLES, state, covariance, *flags, *nearest, MIDDLES, *sensor),))


def recording(*, truth: bool = True) -> Recording:
    """The truth has the range of the track and half a bin, and another body."""
    x = 1.0 + 0.2 * MIDDLES
    along = np.hypot(x, 0.5) + 0.5 * RADAR.waveform.range_resolution
    ranges = np.stack([along, np.full(NUMBER, 3.0)], axis=1)
    azimuth = np.stack([np.arctan2(0.5, x), np.zeros(NUMBER)], axis=1)
    zeros = np.zeros((NUMBER, 2))
    known = Truth(("cart", "wall"), ranges, zeros, azimuth, zeros) if truth else None
    return Recording(np.zeros((NUMBER, 3, 4, 16), np.float32), TIMES, RADAR, known)


def lines(ax: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in ax.lines}


def test_tracks_are_named_for_their_bodies_with_errors_in_bins() -> None:
    ax: Any = plot.tracks(recording(), tracks())
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "truth",
        "track 3: cart: median 0.50, max 0.50 bins",
    ]
    assert {text.get_text() for text in ax.texts} == {"wall", "cart"}
    (wall,) = (line for line in ax.lines if line.get_ydata()[0] == 3.0)
    assert lines(ax)["truth"].get_linewidth() > 3.0 * wall.get_linewidth()
    dots = lines(ax)["track 3: cart: median 0.50, max 0.50 bins"]
    assert len(dots.get_xdata()) == NUMBER - 3
    (predicted,) = (line for line in ax.lines if line.get_marker() == "o")
    np.testing.assert_allclose(predicted.get_xdata(), MIDDLES[5:8])
    assert predicted.get_fillstyle() == "none"
    assert predicted.get_color() == dots.get_color()


def test_parts_of_a_thing_share_a_name_and_a_colour_and_tracks_of_one_colour_have_other_markers() -> None:
    rec = recording()
    assert rec.truth is not None
    parts = replace(rec, truth=replace(rec.truth, names=("person/trunk", "person/head")))
    ax: Any = plot.tracks(parts, {})
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["person"]
    assert len(ax.lines) == 2
    assert len({line.get_color() for line in ax.lines}) == 1
    (one,) = tracks()
    many = Tracks(MIDDLES, tuple(replace(one, id=number) for number in range(8)))
    crowded: Any = plot.tracks(parts, many)
    assert [text.get_text() for text in crowded.texts] == ["person"]
    dots = [line for line in crowded.lines if line.get_linestyle() == "None" and line.get_marker() != "o"]
    assert len({(line.get_color(), line.get_marker()) for line in dots}) == 8


def test_many_tracks_of_one_thing_share_an_entry_of_the_legend() -> None:
    rec = recording()
    assert rec.truth is not None
    parts = replace(rec, truth=replace(rec.truth, names=("person/trunk", "person/head")))
    (one,) = tracks()
    many = Tracks(MIDDLES, tuple(replace(one, id=number) for number in range(9)))
    ax: Any = plot.tracks(parts, many)
    truth, person = [text.get_text() for text in ax.get_legend().get_texts()]
    assert truth == "truth"
    assert person.startswith("person, 9 tracks: median ")


def test_tracks_without_truth_or_of_other_frames_have_numbers_alone() -> None:
    ax: Any = plot.tracks(recording(truth=False), tracks(), quantity="velocity")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["track 3"]
    assert ax.get_ylabel() == "Velocity [m/s]"
    other = Tracks(MIDDLES[:5], ())
    assert len(plot.tracks(recording(), other).lines) == 2
    blue: Any = plot.tracks(recording(truth=False), tracks(), colors={"track 3": "blue"})
    assert lines(blue)["track 3"].get_color() == "blue"


def test_ways_from_above_are_where_the_tracks_were() -> None:
    rec = recording()
    ax: Any = plot.tracks_from_above(tracks(), truth=rec.truth)
    drawn = [line for line in ax.lines if line.get_linestyle() == ":"]
    np.testing.assert_allclose(drawn[0].get_xdata(), 1.0 + 0.2 * MIDDLES)
    np.testing.assert_allclose(drawn[0].get_ydata(), 0.5)
    (solid,) = (line for line in ax.lines if line.get_linewidth() == 1.6)
    assert np.isnan(solid.get_xdata()[5:8]).all()
    (ellipse,) = ax.patches
    assert ellipse.get_width() == pytest.approx(4e-3)  # two deviations of a millimetre to each side
    np.testing.assert_allclose(ellipse.get_center(), [1.0 + 0.2 * MIDDLES[-1], 0.5])
    assert {text.get_text() for text in ax.texts} == {"radar", "cart", "wall", "track 3"}
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_aspect()) == ("x [m]", "y [m]", 1.0)


def test_tracks_of_a_moving_sensor_are_drawn_in_the_world() -> None:
    rec = recording()
    assert rec.truth is not None
    (one,) = tracks()
    poses = np.zeros((NUMBER, 3, 4))
    poses[:, [0, 1, 2], [1, 0, 2]] = [-1.0, 1.0, 1.0]  # turned to the left
    poses[:, 0, 3] = 0.1 * np.arange(NUMBER)
    long = np.broadcast_to(np.diag([0.04, 0.01, 1.0, 1.0]), (NUMBER, 4, 4))  # along x of the sensor
    moving = Tracks(MIDDLES, (replace(one, sensor_pose=poses, state_covariance=long),))
    ax: Any = plot.tracks_from_above(moving, truth=rec.truth)
    xy = [np.array(line.get_data()).T for line in ax.lines]
    places = moving[0].position[:, :2]
    np.testing.assert_allclose(places[-1], [1.9 - 0.5, 1.0 + 0.2 * MIDDLES[-1]])
    assert any(np.array_equal(one, places) for one in xy)
    assert any(np.array_equal(one, poses[:, :2, 3]) for one in xy)  # path of the sensor
    beyond = np.linalg.norm(xy[0] - places, axis=1)  # the true range of the cart is farther by half a bin
    np.testing.assert_allclose(beyond, 0.5 * RADAR.waveform.range_resolution)
    assert ax.texts[0].get_text() == "radar"
    (ellipse,) = ax.patches
    assert (ellipse.width, ellipse.height) == pytest.approx((0.4, 0.8))
    assert np.sin(np.deg2rad(ellipse.angle)) == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(ValueError, match="truth: expected the 20 frames of the tracks, got 19"):
        plot.tracks_from_above(moving, truth=rec.truth[:19])


def test_silly_input_is_refused() -> None:
    with pytest.raises(ValueError, match="tracks: expected tracks with positions, got some of ranges alone"):
        plot.tracks_from_above(tracks(dimensions=1))
    with pytest.raises(TypeError, match="truth: expected Truth, got dict"):
        plot.tracks_from_above(tracks(), truth={})  # type: ignore[arg-type]
    assert len(plot.tracks_from_above(Tracks(MIDDLES, ())).lines) == 1
