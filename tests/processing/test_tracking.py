"""Tracker: births and deaths, identities, gaps, false tracks and consistency, of synthetic detections."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.tracking.cluster import periods_of, wrapped
from radarcore.processing.tracking.kalman import assign, begin, expect, gate_limits, predict, update, white_acceleration
from radarcore.processing.tracking.tracker import Tracker, TrackerKeywords, TrackerSettings, track
from radarcore.processing.tracking.tracks import Track, assign_to_truth
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording

NAN = np.nan
RATE = 40.0
ERRORS = np.array([0.02, 0.1, 0.03, 0.03])
"""Standard deviations of synthetic range [m], velocity [m/s], azimuth and elevation [rad]."""

POINTS: dict[str, Any] = {"extent": 0.0, "velocity_extent": 0.0, "cluster_distance": None, "cluster_velocity": None}
"""Settings for targets that are points, of one detection each."""


def detections(values: Any, time: float, errors: Any = ERRORS) -> Detections:
    """Detections of (target, 2 to 4) values with their errors; no detection of a row whose range is NaN."""
    values = np.reshape(np.asarray(values, dtype=np.float64), (-1, np.shape(values)[-1]))
    values = values[~np.isnan(values[:, 0])]
    told = values.shape[1]
    padded = np.full((len(values), 4), NAN)
    padded[:, :told] = values
    covariance = np.full((len(values), 4, 4), NAN)
    covariance[:, :told, :told] = np.diag(np.square(errors[:told]))
    return Detections(*padded.T, np.full(len(values), 20.0), covariance, time)


def stream(values: Any, *, noise: bool = True, seed: int = 0, times: Any = None) -> list[Detections]:
    """Frames of (frame, target, coordinate) values, with errors, at 40 Hz."""
    values = np.asarray(values, dtype=np.float64)
    if noise:
        values = values + ERRORS[: values.shape[2]] * np.random.default_rng(seed).standard_normal(values.shape)
    times = np.arange(len(values)) / RATE if times is None else times
    return [detections(rows, time) for rows, time in zip(values, times, strict=True)]


def moving(start: float, velocity: float, number: int) -> NDArray[np.float64]:
    """Range and velocity of a target over frames, (frame, 2)."""
    return np.stack([start + velocity * np.arange(number) / RATE, np.full(number, velocity)], axis=1)


def frames_of(tracks: Iterable[Track]) -> list[tuple[int, int]]:
    return [(int(one.frame[0]), int(one.frame[-1])) for one in tracks]


def test_tracks_begin_and_end_at_the_frames_that_are_set() -> None:
    values = moving(2.0, 0.5, 60)[:, None]
    values[:10] = values[30:] = NAN
    frames = stream(values, noise=False)
    (one,) = track(frames, max_missed=4, **POINTS)
    assert frames_of([one]) == [(10, 29)]
    assert one.is_confirmed.tolist() == [False, False] + [True] * 18
    assert one.is_detected.all()
    np.testing.assert_allclose(one.range, values[10:30, 0, 0], atol=1e-12)  # no noise: the model holds exactly
    np.testing.assert_allclose(one.velocity, 0.5, atol=1e-12)
    np.testing.assert_allclose(one.time, np.arange(10, 30) / RATE)
    tracker = Tracker(max_missed=4, **POINTS)
    states = [tracker.update(frame) for frame in frames]
    assert [k for k, some in enumerate(states) if some] == list(range(10, 34))  # the fifth miss in a row ends it
    assert [k for k, some in enumerate(states) if some and some[0].is_confirmed] == list(range(12, 34))
    assert [some[0].is_detected for some in states[28:34]] == [True, True, False, False, False, False]
    assert states[33][0].num_hits == 20
    # Predictions without detections are less and less certain.
    assert (np.diff([some[0].covariance[0, 0] for some in states[29:34]]) > 0.0).all()


@pytest.mark.parametrize(
    ("hits", "confirmed"), [([1, 1, 1, 0, 0], True), ([1, 0, 1, 0, 1], True), ([1, 0, 0, 1, 0, 1], False), ([1], False)]
)
def test_three_detections_within_five_frames_confirm(hits: list[int], confirmed: bool) -> None:
    values = moving(2.0, 0.0, 20)[:, None]
    seen = np.zeros(20, dtype=bool)
    seen[4 : 4 + len(hits)] = hits
    values[~seen] = NAN
    frames = stream(values, noise=False)
    assert len(track(frames, confirm_hits=3, confirm_frames=5, **POINTS)) == int(confirmed)
    tracker = Tracker(confirm_hits=3, confirm_frames=5, **POINTS)
    lives = [bool(tracker.update(frame)) for frame in frames]
    if hits == [1]:  # after three misses two detections are left at most
        assert lives == [4 <= k < 7 for k in range(20)]


def test_one_detection_is_enough_where_one_is_asked_for() -> None:
    (one,) = track(stream(moving(2.0, 0.0, 1)[:, None]), confirm_hits=1, confirm_frames=1, **POINTS)
    assert one.is_confirmed.tolist() == [True]


@pytest.mark.parametrize(("max_missed", "spans"), [(10, [(0, 59)]), (9, [(0, 24), (35, 59)])])
def test_gap_of_ten_frames_is_bridged_or_ends_the_track(max_missed: int, spans: list[tuple[int, int]]) -> None:
    values = moving(2.0, 0.8, 60)[:, None]
    values[25:35] = NAN
    tracks = track(stream(values), max_missed=max_missed, **POINTS)
    assert frames_of(tracks) == spans
    assert tracks[0].longest_gap == (10 if max_missed == 10 else 0)
    assert tracks[0].num_hits == (50 if max_missed == 10 else 25)


@pytest.mark.parametrize(("max_gap", "number"), [(None, 1), (0.3, 1), (0.25, 2)])
def test_lost_frames_are_bridged_for_a_time(max_gap: float | None, number: int) -> None:
    """Ten frames never come: 275 ms between detections, no frame without one."""
    values = np.delete(moving(2.0, 0.8, 60), slice(25, 35), axis=0)[:, None]
    times = np.delete(np.arange(60), slice(25, 35)) / RATE
    tracks = track(stream(values, times=times), max_missed=3, max_gap=max_gap, **POINTS)
    assert len(tracks) == number
    assert all(one.is_detected.all() for one in tracks)
    assert tracks[-1].time[-1] == times[-1]


@pytest.mark.parametrize("seed", range(2))
def test_crossing_targets_keep_their_identity(seed: int) -> None:
    """They meet at 3 m in the middle with a difference of 2 m/s; the detections are in order of range, not of
    target."""
    number = 160
    values = np.stack([moving(1.0, 1.0, number), moving(5.0, -1.0, number)], axis=1)
    values += ERRORS[:2] * np.random.default_rng(seed).standard_normal(values.shape)
    values = np.take_along_axis(values, np.argsort(values[:, :, :1], axis=1), axis=1)
    tracks = track(stream(values, noise=False), **POINTS)
    assert frames_of(tracks) == [(0, number - 1)] * 2
    signs = [np.sign(one.velocity) for one in tracks]
    np.testing.assert_array_equal(np.abs(np.sum(signs, axis=1)), number)  # each keeps its own
    for one in tracks:
        assert abs(one.range[-1] - (5.0 if one.velocity[-1] > 0.0 else 1.0)) < 0.1


def test_late_target_gets_a_track_of_its_own() -> None:
    values = np.stack([moving(2.0, 0.0, 80), moving(4.0, -0.5, 80)], axis=1)
    values[:50, 1] = NAN
    tracks = track(stream(values), **POINTS)
    assert frames_of(tracks) == [(0, 79), (50, 79)]
    assert [one.id for one in tracks] == [0, 1]
    assert len(tracks.at(49)) == 1
    assert [state.id for state in tracks.at(50)] == [0, 1]


@pytest.mark.parametrize("dimensions", [2, 3])
def test_targets_at_one_range_are_told_apart_by_their_angles(dimensions: int) -> None:
    """Both at 3 m and at rest with a difference of 30 degrees: in azimuth, or in elevation."""
    first, second = np.deg2rad([-15.0, 15.0])
    rows = [[3.0, *[0.0] * (dimensions - 1), angle] for angle in (first, second)]
    tracks = track(stream(np.broadcast_to(rows, (60, 2, dimensions + 1))))
    assert frames_of(tracks) == [(0, 59)] * 2
    for one in tracks:
        angle = one.azimuth if dimensions == 2 else one.elevation
        assert abs(abs(angle[-1]) - second) < 0.03  # the error of one detection
        assert np.ptp(np.sign(angle)) == 0.0
    # Without angles they are one.
    assert len(track(stream(np.broadcast_to([[3.0, 0.0]] * 2, (60, 2, 2))))) == 1


def test_target_that_passes_by_is_tracked_in_the_plane() -> None:
    """Along y at x = 2 m, 1 m/s: the range rate goes through zero, the velocity stays."""
    times = np.arange(160) / RATE
    place = np.stack([np.full(160, 2.0), -2.0 + times], axis=1)
    distance = np.hypot(*place.T)
    values = np.stack([distance, place[:, 1] / distance, np.arctan2(*place.T[::-1])], axis=1)[:, None]
    (one,) = track(stream(values), acceleration_density=0.1, **POINTS)
    assert (np.linalg.norm(one.position[20:, :2] - place[20:], axis=1) < 0.15).all()  # 0.03 rad at 2.8 m, twice
    assert (np.abs(one.motion[40:] - [0.0, 1.0, 0.0]) < 0.4).all()
    assert (one.position[:, 2] == 0.0).all()
    assert np.isnan(one.elevation).all()


def test_angles_are_tracked_around_the_back() -> None:
    """Around the sensor at 2 m: azimuth goes from pi to -pi on the way."""
    times = np.arange(240) / RATE
    angle = wrapped(2.0 + 0.5 * times, np.array(2.0 * np.pi))
    values = np.stack([np.full(240, 2.0), np.zeros(240), angle], axis=1)[:, None]
    (one,) = track(stream(values), **POINTS)
    assert one.is_detected.all()
    assert (np.abs(wrapped(one.azimuth - angle, np.array(2.0 * np.pi))) < 0.12).all()  # four errors of a detection


def test_velocity_is_unwrapped_to_the_one_that_is_expected() -> None:
    """A target at 3 m/s before a radar that knows velocities modulo 4 m/s: it measures -1."""
    values = moving(2.0, 3.0, 80)
    values[:, 1] = wrapped(values[:, 1], np.array(4.0))
    assert (values[:, 1] == -1.0).all()
    (fast,) = track(stream(values[:, None]), velocity_ambiguity=4.0, max_speed=4.0, **POINTS)
    assert abs(fast.velocity[-1] - 3.0) < 0.4  # four errors of a detection
    assert fast.is_detected.all()
    # One that speeds up slowly is followed through the end of the axis, from a known period on.
    speed = np.linspace(0.0, 3.0, 240)
    distance = 2.0 + np.cumsum(speed) / RATE
    values = np.stack([distance, wrapped(speed, np.array(4.0))], axis=1)[:, None]
    (rising,) = track(stream(values), velocity_ambiguity=4.0, **POINTS)
    assert np.abs(rising.velocity - speed).max() < 0.4  # four errors of a detection


def test_no_track_begins_faster_than_targets_are() -> None:
    values = moving(2.0, 2.5, 40)[:, None]
    assert len(track(stream(values), max_speed=2.0, **POINTS)) == 0
    assert len(track(stream(values), max_speed=3.0, **POINTS)) == 1


def test_ranges_alone_are_enough() -> None:
    """A single chirp tells no velocity: it follows from the ranges."""
    values = moving(2.0, 0.7, 120)[:, None]
    values[:, :, 1] = NAN
    (one,) = track(stream(values), acceleration_density=0.05, **POINTS)
    assert abs(one.velocity[-1] - 0.7) < 0.2
    assert one.deviation[-1, 1] < 0.1


def test_detections_that_lack_a_coordinate_continue_a_track_but_begin_none() -> None:
    rows = np.broadcast_to([[3.0, 0.0, 0.2]], (40, 1, 3)).copy()
    rows[20:, :, 2] = NAN
    tracks = track(stream(rows), **POINTS)
    assert frames_of(tracks) == [(0, 39)]
    assert tracks[0].is_detected.all()
    rows[:] = [3.0, 0.0, NAN]
    assert len(track(stream(rows), num_dimensions=2, **POINTS)) == 0
    assert len(track(stream(rows), **POINTS)) == 1  # range alone, then


@pytest.mark.parametrize("clusters", [{}, POINTS])
def test_angles_at_the_horizon_say_nothing_and_end_no_track(clusters: dict[str, Any]) -> None:
    # There an array's bounds are as good as infinite, and a matrix with them is singular to rounding.
    tracker = Tracker(num_dimensions=3, **clusters)
    huge = np.diag(np.square(ERRORS))
    huge[2:, 2:] = [[1e32, 1e31], [1e31, 1e30]]
    for k in range(12):
        one = detections([[2.0, 0.0, 0.3, 0.1]], k / RATE)
        if k > 5:
            one = Detections([2.0, 2.5], [0.0, 0.0], [1.5, -1.5], [0.4, 0.4], [20.0, 20.0], [huge, huge], k / RATE)
        (state,) = tracker.update(one)
        assert state.is_detected
        assert state.azimuth == pytest.approx(0.3, abs=1e-9)
    assert state.id == 0


def test_person_of_many_detections_is_one_track() -> None:
    """Twelve detections within 0.2 m and 0.5 m/s: one cluster, whose spread makes its centroid less certain."""
    rng = np.random.default_rng(5)
    parts = rng.uniform(-1.0, 1.0, (100, 12, 2)) * [0.1, 0.4]
    values = moving(2.0, 0.6, 100)[:, None] + parts
    tracks = track(stream(values), cluster_distance=0.3)
    assert frames_of(tracks) == [(0, 99)]
    assert np.abs(tracks[0].range - moving(2.0, 0.6, 100)[:, 0]).max() < 0.07  # four errors of a mean of 12
    assert len(track(stream(values), cluster_distance=None, cluster_velocity=None)) > 4


def test_extents_are_deviations_that_detections_have_as_well() -> None:
    """Extent adds to the uncertainty of detections: positions on the target, seen 2 m away, and velocities of parts."""
    extents = {"extent": 0.3, "velocity_extent": 0.25}
    larger = np.hypot(ERRORS, [0.3, 0.25, 0.15, 0.15])
    values, times = np.array([2.0, 0.0, 0.2, -0.1]), np.arange(10) / RATE
    (one,) = track([detections(values, time) for time in times], **POINTS | extents)
    (other,) = track([detections(values, time, larger) for time in times], **POINTS)
    np.testing.assert_allclose(one.state_covariance, other.state_covariance, rtol=0.0, atol=1e-12)


def pairs_of(tracks: Any, variances: Any, measured: Any) -> list[tuple[int, int]]:
    """Pairs of tracks (track, 2) of a variance each and of detections (detection, 2) of variance 1/2."""
    covariance = np.multiply.outer(np.array(variances), np.eye(2))
    noise = np.broadcast_to(0.5 * np.eye(2), (len(measured), 2, 2))
    found = assign(np.array(measured) - np.array(tracks)[:, None], covariance, noise, 0.99)
    return list(zip(*(indices.tolist() for indices in found), strict=True))


def test_assignment_is_the_best_of_all_not_the_nearest_first() -> None:
    """Tracks at 0 and 1, detections at 0.9 and 2.2: nearest first would leave 0 with 2.2, at 4.84 of 6.25 squared."""
    found = pairs_of([[0.0, 0.0], [1.0, 0.0]], [0.5, 0.5], [[0.9, NAN], [2.2, NAN]])
    assert found == [(0, 0), (1, 1)]


def test_nothing_is_assigned_beyond_the_gate() -> None:
    """Variance 1 in each of two coordinates: the gate of 99 % is a circle of radius sqrt(-2 ln 0.01)."""
    radius = np.sqrt(-2.0 * np.log(0.01))
    assert gate_limits(0.99)[2] == pytest.approx(radius**2)
    for scale, number in ((0.999, 1), (1.001, 0)):
        assert len(pairs_of([[0.0, 0.0]], [0.5], scale * radius * np.array([[np.sqrt(0.5), np.sqrt(0.5)]]))) == number
    # Unmeasured values belong to no track.
    assert pairs_of([[0.0, 0.0]], [0.5], [[NAN, NAN]]) == []


def test_well_known_track_keeps_its_detection_from_one_that_is_hardly_known() -> None:
    """A detection 1 sigma from a track of variance 1, and at 0.5 sigma of one of variance 100 (log determinant 4.6)."""
    assert pairs_of([[0.0, 0.0], [-4.0, 0.0]], [0.5, 99.5], [[1.0, NAN]]) == [(0, 0)]


def test_clutter_confirms_no_more_tracks_than_predicted() -> None:
    """Three false detections a frame, even in 10 m and 6 m/s: every one may begin a track, which is confirmed by two
    more in its gate within four frames. The number in a gate of volume V is Poisson's, of mean density x V; the gate
    is largest after four frames without one."""
    rng = np.random.default_rng(1)
    interval, settings = 0.1, {"acceleration_density": 0.3, "gate": 0.99}
    tracker = Tracker(**settings, **POINTS, max_speed=4.0, confirm_hits=3, confirm_frames=5, max_missed=0)
    confirmed: set[int] = set()
    for frame in range(800):
        number = rng.poisson(3.0)
        values = np.stack([rng.uniform(0.5, 10.5, number), rng.uniform(-3.0, 3.0, number)], axis=1)
        states = tracker.update(detections(values, interval * frame))
        confirmed |= {state.id for state in states if state.is_confirmed}

    noise = np.diag(np.square(ERRORS[:2]))
    volumes = []
    for misses in range(1, 5):
        transition, disturbance = white_acceleration(misses * interval, settings["acceleration_density"], 1)
        spread = transition @ noise @ transition.T + disturbance + noise
        volumes.append(np.pi * gate_limits(settings["gate"])[2] * np.sqrt(np.linalg.det(spread)))
    at_most, at_least = (1.0 - np.exp(-3.0 / 60.0 * volumes[k]) for k in (-1, 0))

    def chance(hit: float) -> float:
        """Of two or more hits in four frames."""
        return float(1.0 - (1.0 - hit) ** 4 - 4.0 * hit * (1.0 - hit) ** 3)

    predicted = tracker.num_begun * chance(at_most)
    assert len(confirmed) <= predicted + 4.0 * np.sqrt(predicted)
    assert len(confirmed) >= 0.1 * tracker.num_begun * chance(at_least)  # and the prediction is not idle


@pytest.mark.parametrize("dimensions", [2, 3])
def test_innovations_and_errors_of_the_extended_filter_are_consistent(dimensions: int) -> None:
    """NIS and NEES of 500 targets about 3 m ahead: chi-square, with the second order of the range rate."""
    rng = np.random.default_rng(4)
    number, told, density, interval = 500, dimensions + 1, 0.3, 0.1
    errors = ERRORS[:told]
    noise = np.broadcast_to(np.diag(np.square(errors)), (number, told, told))
    place = np.array([3.0, 0.0, 0.0])[:dimensions] + rng.uniform(-0.7, 0.7, (number, dimensions))
    truth = np.concatenate([place, rng.standard_normal((number, dimensions))], axis=1)  # speeds as the prior has them
    measured = expect(truth, np.zeros((number, 2 * dimensions, 2 * dimensions))).value
    state, covariance = begin(measured + errors * rng.standard_normal(measured.shape), noise, 1.0)
    transition, disturbance = white_acceleration(interval, density, dimensions)
    for step in range(12):
        truth = truth @ transition.T + rng.multivariate_normal(np.zeros(2 * dimensions), disturbance, number)
        state, covariance = predict(state, covariance, transition, disturbance)
        expected = expect(state, covariance)
        exact = expect(truth, np.zeros_like(covariance)).value
        measured = exact + errors * rng.standard_normal(exact.shape)
        innovation = wrapped(measured - expected.value, periods_of(None)[:told])
        total = expected.spread + noise
        squares = np.einsum("ni,nij,nj->n", innovation, np.linalg.inv(total), innovation)
        state, covariance = update(state, covariance, innovation, expected.jacobian, noise + expected.second_order)
        wrong = state - truth
        nees = np.einsum("ni,nij,nj->n", wrong, np.linalg.inv(covariance), wrong)
        for found, degrees in ((squares, told * number), (nees, 2 * dimensions * number)):
            # 4.5 standard deviations; errors of angles of 0.03 rad leave 2 % to the orders beyond the second.
            wanted = pytest.approx(degrees, rel=0.02 + 4.5 * np.sqrt(2.0 / degrees))
            assert found.sum() == wanted, (step, found.sum() / degrees)


def test_smoothed_track_is_the_least_squares_of_all_detections() -> None:
    """Normal equations of all detections and of the motion between them, at once, at uneven times; ten frames have no
    detection."""
    number, density = 30, 0.5
    times = np.random.default_rng(3).uniform(0.02, 0.1, number).cumsum()
    values = np.stack([2.0 + 0.8 * times, np.full(number, 0.8)], axis=1)
    frames = stream(values[:, None], seed=3, times=times)
    seen = np.delete(np.arange(number), slice(12, 22))
    some = [frame if k in seen else detections(np.zeros((0, 2)), frame.time) for k, frame in enumerate(frames)]
    (found,) = track(some, smooth=True, acceleration_density=density, **POINTS)

    known = np.diag(ERRORS[:2] ** -2.0)
    information, score = np.zeros((number, 2, number, 2)), np.zeros((number, 2))
    for k in seen:
        information[k, :, k] += known
        score[k] += known @ [frames[k].range[0], frames[k].velocity[0]]
    for k in range(number - 1):
        transition, disturbance = white_acceleration(times[k + 1] - times[k], density, 1)
        step = np.zeros((2, number, 2))  # the state less what the one before is expected to become
        step[:, k + 1], step[:, k] = np.eye(2), -transition
        information += np.einsum("iab,ij,jcd->abcd", step, np.linalg.inv(disturbance), step)
    covariance = np.linalg.inv(information.reshape(2 * number, -1))
    state = (covariance @ score.ravel()).reshape(number, 2)
    np.testing.assert_allclose(found.state, state, rtol=1e-8)
    covariances = covariance.reshape(number, 2, number, 2)[np.arange(number), :, np.arange(number)]
    np.testing.assert_allclose(found.state_covariance, covariances, rtol=1e-6, atol=1e-10)


def test_smoothing_bridges_a_turn_that_was_not_seen() -> None:
    """A target comes and turns round while it is behind something: predictions go on, smoothed states turn with it."""
    time = np.arange(60) / RATE
    values = np.stack([2.0 + 0.5 * (time - 0.75) ** 2, time - 0.75], axis=1)[:, None]
    hidden = slice(24, 36)
    seen = values.copy()
    seen[hidden] = NAN
    frames = stream(seen, noise=False)
    plain, smooth = (track(frames, smooth=value, max_missed=12, **POINTS)[0] for value in (False, True))
    assert (plain.id, plain.num_hits) == (smooth.id, smooth.num_hits)
    np.testing.assert_array_equal(plain.is_detected, smooth.is_detected)
    errors = [np.abs(one.velocity - values[:, 0, 1])[hidden].max() for one in (plain, smooth)]
    assert errors[0] > 0.2  # 12 frames at 1 m/s^2
    # Between exact points the smoothed track is a cubic, as is the turn.
    assert errors[1] < 1e-5
    assert (smooth.deviation[hidden, 0] < plain.deviation[hidden, 0]).all()
    np.testing.assert_array_equal(smooth.state[-1], plain.state[-1])  # there is nothing later


def test_stream_and_recording_give_the_same_tracks() -> None:
    frames = stream(np.stack([moving(2.0, 0.3, 40), moving(4.0, -0.3, 40)], axis=1))
    tracks, tracker = track(iter(frames), **POINTS), Tracker(**POINTS)
    for index, frame in enumerate(frames):
        for live, kept in zip(tracker.update(frame), tracks.at(index), strict=True):
            assert (live.id, live.time, live.range, live.num_hits) == (kept.id, kept.time, kept.range, kept.num_hits)
            np.testing.assert_array_equal(live.covariance, kept.covariance)
            np.testing.assert_array_equal(live.position, kept.position)


def recording(number: int, truth: Truth | None = None) -> Recording:
    radar = bgt60tr13c(num_samples=16, num_chirps=4)
    return Recording(np.zeros((number, 3, 4, 16), np.float32), np.arange(number) / RATE, radar, truth)


def test_recording_is_tracked_by_a_detector_of_its_frames() -> None:
    """Velocities are then known modulo the waveform's limits, unless something else is set."""
    rec = recording(30)
    limit = rec.radar.waveform.max_velocity

    def detector(frame: Frame) -> Detections:
        fast = wrapped(np.array(1.2 * limit), np.array(2.0 * limit))
        return detections([[2.0 + 1.2 * limit * frame.time, float(fast)]], frame.time)

    (one,) = track(rec, detector=detector, max_speed=2.0 * limit, **POINTS)
    assert abs(one.velocity[-1] - 1.2 * limit) < 1e-5  # exact points at an even speed
    assert len(track(rec.frames(), detector=detector, max_speed=2.0 * limit, **POINTS)) == 1
    # Taken as they are, they contradict the ranges.
    assert len(track(rec, detector=detector, velocity_ambiguity=None, max_speed=2.0 * limit, **POINTS)) == 0


def test_tracks_are_assigned_to_the_bodies_that_they_follow() -> None:
    number = 40
    values = np.stack([moving(2.0, 0.3, number), moving(4.0, -0.3, number), moving(7.0, 0.0, number)], axis=1)
    tracks = track(stream(values, seed=6), **POINTS)
    none = np.full((number, 3), NAN)
    rows = np.stack([values[:, 1, 0], values[:, 0, 0], none[:, 0]], axis=1)
    truth = Truth(("far", "near", "hidden"), rows, none, none, none)
    assert assign_to_truth(tracks, truth) == {0: "near", 1: "far", 2: None}
    assert assign_to_truth(tracks, truth, max_distance=9.0)[2] == "far"


def test_tracks_with_angles_are_assigned_by_their_place() -> None:
    left, right = 0.4, -0.4
    tracks = track(stream(np.broadcast_to([[3.0, 0.0, left], [3.0, 0.0, right]], (30, 2, 3))))
    shape = (30, 2)
    angles = np.broadcast_to([right, left], shape)
    truth = Truth(("right", "left"), np.full(shape, 3.0), np.zeros(shape), angles, np.zeros(shape))
    named = assign_to_truth(tracks, truth)
    assert {named[one.id]: bool(one.azimuth[-1] > 0.0) for one in tracks} == {"left": True, "right": False}


def test_tracks_are_a_sequence_with_states_by_frame() -> None:
    tracks = track(stream(moving(2.0, 0.3, 20)[:, None]), **POINTS)
    assert len(tracks) == len(tracks[:5]) == 1
    assert tracks[0] is tracks[-1] is next(iter(tracks))
    assert repr(tracks) == "Tracks(20 frames; 0: frames 0 to 19)"
    (state,) = tracks.at(-1)
    assert state.time == tracks.time[-1]
    assert state.range == tracks[0].range[-1]
    assert state.velocity == tracks[0].velocity[-1]
    assert np.isnan([state.azimuth, state.elevation, *state.position, *state.motion]).all()
    assert len(tracks[0]) == 20
    with pytest.raises(ValueError, match="frame: expected an index below 20, got 20"):
        tracks.at(20)


def test_nothing_to_track_is_no_tracks() -> None:
    assert len(track([])) == 0
    assert repr(track([])) == "Tracks(0 frames; no tracks)"
    assert len(track(recording(0), detector=lambda frame: detections([[1.0, 0.0]], frame.time))) == 0
    empty = track([detections(np.zeros((0, 2)), time) for time in (0.0, 1.0)])
    assert len(empty) == 0
    assert empty.at(1) == []


def test_detections_that_are_refused_leave_the_tracks_as_they_were() -> None:
    frames = stream(moving(2.0, 0.3, 20)[:, None])
    spoiled, whole = Tracker(**POINTS), Tracker(**POINTS)
    for frame in frames[:10]:
        spoiled.update(frame)
        whole.update(frame)
    with pytest.raises(ValueError, match=r"detections: expected those of a later time than 0\.225 s, got 0\.2 s"):
        spoiled.update(frames[8])
    for variance in (-1.0, np.inf):
        with pytest.raises(ValueError, match="detections: expected finite variances from 0 on, got "):
            spoiled.update(replace(frames[10], covariance=np.full((1, 4, 4), variance)))
    with pytest.raises(TypeError, match="detections: expected Detections, got list"):
        spoiled.update([1.0])  # type: ignore[arg-type]
    assert spoiled.update(frames[10])[0].range == whole.update(frames[10])[0].range


def test_detections_without_errors_are_followed_exactly() -> None:
    """Variances of zero, and no extent: the filter believes them, and stays finite."""
    values = moving(2.0, 0.5, 40)[:, None]
    values[20:, 0, 0] += 0.01
    frames = [detections(rows, k / RATE, errors=np.zeros(4)) for k, rows in enumerate(values)]
    tracks = track(frames, acceleration_density=5.0, gate=1.0 - 1e-12, **POINTS)
    assert all(np.isfinite(one.covariance[:, :2, :2]).all() for one in tracks)
    np.testing.assert_allclose(tracks[0].range[:20], values[:20, 0, 0], atol=1e-9)


def test_detections_without_covariance_have_the_usual_errors() -> None:
    plain = [Detections([2.0], [0.1], [NAN], [NAN], [9.0], time=k / RATE) for k in range(10)]  # type: ignore[arg-type]
    (one,) = track(plain, **POINTS)
    np.testing.assert_allclose(one.deviation[0, :2], TrackerSettings().deviations[:2])  # type: ignore[index]
    # Errors whose correlation is not known are independent.
    halves = np.full((1, 4, 4), NAN)
    halves[0, :2, :2], halves[0, 2:, 2:] = np.diag([0.01, 0.04]), np.diag([0.0025, 0.0025])
    (sure,) = Tracker(**POINTS).update(Detections([2.0], [0.1], [0.2], [0.3], [9.0], halves))  # type: ignore[arg-type]
    np.testing.assert_allclose(np.diag(sure.covariance)[2:], np.diag(halves[0])[2:], rtol=1e-12)
    assert np.isfinite(sure.covariance).all()
    wild = Detections([2.0, np.inf, 3.0], [0.1, 0.0, -np.inf], [NAN] * 3, [NAN] * 3, [9.0, NAN, np.inf], time=1.0)  # type: ignore[arg-type]
    assert [state.range for state in Tracker().update(wild)] == pytest.approx([2.0, 3.0])


def test_keywords_of_the_tracker_are_the_fields_of_its_settings() -> None:
    assert list(TrackerKeywords.__annotations__) == [field.name for field in fields(TrackerSettings)]


@pytest.mark.parametrize(("deviation", "number"), [(0.4, 1), (0.6, 0)])
def test_directions_that_are_hardly_known_begin_no_track(deviation: float, number: int) -> None:
    values = np.tile([3.0, 0.0, 0.1], (6, 1, 1))
    errors = np.array([0.02, 0.1, deviation])
    assert len(track([detections(rows, k / RATE, errors) for k, rows in enumerate(values)], **POINTS)) == number
