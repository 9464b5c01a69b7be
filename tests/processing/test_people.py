"""Tracks of people, each with many synthetic detections: one track for each person, whatever is beside the path."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.tracking.tracker import Tracker, track
from radarcore.processing.tracking.tracks import Tracks

RATE = 40.0
DEVIATIONS = np.array([0.02, 0.05, 0.02])
"""Standard deviations of range [m], velocity [m/s] and azimuth [rad]."""

POST = np.array([[3.0, 0.35, 0.0, 43.0]])
"""A post: x, y [m], speed along x [m/s], level [dB]."""

Array = NDArray[np.float64]


def body(x: float, y: float, speed: float, time: float) -> Array:
    """Echoes of a walker along x, (4, 4): trunk, two legs (one at rest at a time), an arm. Rows as in `POST`."""
    swing = np.sin(2.0 * np.pi * 0.9 * time)
    leg, arm = speed * (1.0 + swing), speed * (1.0 - 0.5 * swing)
    return np.array(
        [
            [x, y, speed, 30.0],
            [x + 0.25 * swing, y + 0.1, leg, 22.0],
            [x - 0.25 * swing, y - 0.1, 2.0 * speed - leg, 22.0],
            [x + 0.2 * swing, y + 0.25, arm, 18.0],
        ]
    )


def seen(echoes: Array, time: float) -> Detections:
    """Detections of echoes, whose rows are as in `POST`."""
    x, y, speed, level = echoes.T
    ranges, nothing = np.hypot(x, y), np.full(len(echoes), np.nan)
    covariance = np.full((len(echoes), 4, 4), np.nan)
    covariance[:, :3, :3] = np.diag(np.square(DEVIATIONS))
    return Detections(ranges, speed * x / ranges, np.arctan2(y, x), nothing, level, covariance, time)


def walk(start: float, speeds: Array, y: float = 0.0) -> list[Array]:
    """Echoes of a walker in every frame, from x = `start` on with the speed of each frame."""
    places = start + np.cumsum(speeds) / RATE
    return [body(x, y, v, k / RATE) for k, (x, v) in enumerate(zip(places, speeds, strict=True))]


def people_in(frames: list[Array]) -> Tracks:
    return track((seen(echoes, k / RATE) for k, echoes in enumerate(frames)), targets="people")


def test_trunk_legs_and_arm_are_one_track_with_the_nearest_echo_of_each_frame() -> None:
    frames = walk(4.0, np.full(80, -0.8))
    assert len(track(seen(echoes, k / RATE) for k, echoes in enumerate(frames))) > 1
    (one,) = people_in(frames)
    assert one.frame.tolist() == list(range(80))
    trunk = np.array([echoes[0, 0] for echoes in frames])
    np.testing.assert_allclose(one.range, trunk, rtol=0, atol=0.1)
    np.testing.assert_allclose(one.nearest, [np.hypot(*echoes[:, :2].T).min() for echoes in frames], rtol=1e-12)
    np.testing.assert_allclose(one.nearest_deviation, DEVIATIONS[0], rtol=1e-12)


def test_post_beside_the_path_begins_no_track_and_pulls_none() -> None:
    frames = walk(4.2, np.full(100, -0.9))
    (alone,) = people_in(frames)
    (one,) = people_in([np.concatenate([echoes, POST]) for echoes in frames])
    np.testing.assert_allclose(one.position[:, 0], alone.position[:, 0], rtol=0, atol=0.02)


@pytest.mark.parametrize("side", [0.3, 0.0])
def test_people_who_cross_keep_their_tracks(side: float) -> None:
    coming, leaving = walk(4.0, np.full(100, -0.8), side), walk(2.0, np.full(100, 0.8), -side)
    tracks = people_in([np.concatenate(both) for both in zip(coming, leaving, strict=True)])
    assert len(tracks) == 2
    ends = sorted((one.position[0, 0].round(0), one.position[-1, 0].round(0)) for one in tracks)
    assert ends == [(2.0, 4.0), (4.0, 2.0)]
    assert all(len(one) == 100 for one in tracks)


def test_person_who_stops_stays_a_track_and_goes_on() -> None:
    pause = np.zeros(120)
    speeds = np.concatenate([np.full(40, -0.8), np.linspace(-0.8, 0.0, 20), pause, np.full(40, -0.8)])
    frames = walk(4.0, speeds)
    wall = np.array([[4.5, 0.0, 0.0, 45.0]])
    (one,) = people_in([np.concatenate([echoes, wall]) for echoes in frames])
    assert len(one) == len(frames)
    assert one.is_detected.all()
    assert one.range[150] == pytest.approx(frames[150][0, 0], abs=0.05)
    assert one.range[-1] == pytest.approx(frames[-1][0, 0], abs=0.15)


def test_hidden_person_is_coasted_without_a_nearest_echo() -> None:
    frames = walk(4.0, np.full(60, -0.8))
    frames[30:36] = [np.zeros((0, 4))] * 6
    (one,) = people_in(frames)
    assert np.flatnonzero(~one.is_detected).tolist() == list(range(30, 36))
    for values in (one.nearest, one.nearest_deviation):
        assert np.flatnonzero(np.isnan(values)).tolist() == list(range(30, 36))
    assert one.range[35] == pytest.approx(4.0 - 0.8 * 36 / RATE, abs=0.1)


def test_things_at_rest_are_no_people() -> None:
    assert len(people_in([POST] * 40)) == 0
    assert Tracker(targets="people").update(seen(POST, 0.0)) == []


def test_person_who_walks_across_the_line_of_sight_begins_a_track() -> None:
    """Only the trunk gives echoes, at up to 0.14 m/s."""
    places = np.stack([np.full(40, 2.5), np.linspace(-0.45, 0.45, 40)], axis=1)
    rates = 0.8 * places[:, 1] / np.hypot(*places.T)
    along_x = rates * np.hypot(*places.T) / places[:, 0]
    frames = [np.array([[x, y, speed, 30.0]]) for (x, y), speed in zip(places, along_x, strict=True)]
    (one,) = people_in(frames)
    np.testing.assert_allclose(one.position[-1, 1], 0.45, rtol=0, atol=0.1)


def test_older_track_takes_all_echoes_of_a_body() -> None:
    """A foot beyond the body's extent in the first frame begins a second track, which gets no more detections."""
    frames = walk(4.0, np.full(40, -0.8))
    for k, echoes in enumerate(frames):
        foot = echoes[0] + [0.95 if k == 0 else 0.55, 0.0, 0.0, -10.0]
        frames[k] = np.array([echoes[0], foot])
    assert len(people_in(frames)) == 1


def test_people_are_tracked_by_ranges_and_velocities_alone() -> None:
    frames = [seen(echoes, k / RATE) for k, echoes in enumerate(walk(4.0, np.full(60, -0.8)))]
    (one,) = track(frames, targets="people", num_dimensions=1)
    assert one.range[-1] == pytest.approx(4.0 - 0.8 * 60 / RATE, abs=0.15)


def test_points_have_the_nearest_detection_of_their_cluster() -> None:
    echoes = np.array([[2.0, 0.0, 0.0, 20.0], [2.1, 0.0, 0.0, 30.0]])
    (state,) = Tracker().update(seen(echoes, 0.0))
    assert (state.nearest, state.nearest_deviation) == pytest.approx((2.0, DEVIATIONS[0]))
    assert state.range > 2.05


def test_other_targets_are_refused() -> None:
    with pytest.raises(ValueError, match="targets: expected one of 'points', 'people', got 'cars'"):
        Tracker(targets="cars")


def test_frame_with_fewer_echoes_than_tracks_is_a_frame_of_the_tracks_that_have_them() -> None:
    """Three people, and in the last frame one echo, of the person whose track began last."""
    ways = [walk(x, np.full(20, -0.8), y) for x, y in ((2.0, -0.8), (3.0, 0.0), (4.0, 1.0))]
    frames = [np.concatenate(echoes) for echoes in zip(*ways, strict=True)]
    tracker = Tracker(targets="people")
    for k, echoes in enumerate(frames):
        states = tracker.update(seen(echoes, k / RATE))
    last = max(states, key=lambda state: state.id)
    values = [[*last.position[:2], -0.8, 30.0]]
    states = tracker.update(seen(np.array(values), len(frames) / RATE))
    assert [state.is_detected for state in states] == [state.id == last.id for state in states]
    assert len(states) == 3
