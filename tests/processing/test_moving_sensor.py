"""Tracks in the world, of a sensor that moves: its motion is known, detections are synthetic and exact."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.motion.protocol import Motion

RATE = 40.0
NAN = np.nan
Array = NDArray[np.float64]

TURNING = rc.Linear(
    rc.Pose.from_rpy([0.5, -0.2, 0.8], [0.1, -0.1, 0.4]),
    velocity=[0.2, -0.3, 0.1],
    angular_velocity=[0.1, 0.2, 0.6],
)
"""A sensor on an arm."""

RANGES = rc.Detections(*np.array([[2.0], [0.0], [NAN], [NAN], [20.0]]), time=1.0)
"""A detection without angles."""

PLANE = rc.Detections(*np.array([[2.0], [0.0], [0.1], [NAN], [20.0]]))
"""A detection without an elevation."""

TILTED = rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.3, 0.0, 0.0])

POINTS: dict[str, Any] = {"cluster_distance": None, "cluster_velocity": None, "max_speed": 2.0}


def seen(points: Array, velocities: Array, motion: Motion, time: float, num_angles: int = 2) -> rc.Detections:
    """Detections of points (n, 3) in the world that move at (n, 3) [m/s]: plain geometry, point by point."""
    pose, rate = motion.at(time), motion.rate_at(time)[:, 3]
    rows = []
    for point, velocity in zip(points, velocities, strict=True):
        x, y, z = pose.rotation.T @ (point - pose.position)
        distance = np.linalg.norm([x, y, z])
        range_rate = (point - pose.position) @ (velocity - rate) / distance
        elevation = np.arcsin(z / distance) if num_angles == 2 else NAN
        rows.append([distance, range_rate, np.arctan2(y, x), elevation])
    values = np.array(rows).reshape(-1, 4)
    covariance = np.tile(np.diag([1e-4, 1e-4, 1e-4, 1e-4]), (len(values), 1, 1))
    if num_angles == 1:
        covariance[:, 3], covariance[:, :, 3] = NAN, NAN
    return rc.Detections(*values.T, snr_db=np.full(len(values), 20.0), covariance=covariance, time=time)


def of_points(points: Any, velocities: Any, motion: Motion, number: int, num_angles: int = 2) -> list[rc.Detections]:
    start, rates = np.atleast_2d(points).astype(float), np.atleast_2d(velocities).astype(float)
    times = np.arange(number) / RATE
    return [seen(start + rates * time, rates, motion, time, num_angles) for time in times]


def test_tracks_are_where_targets_are_in_the_world() -> None:
    points, velocities = [[3.0, 0.5, 0.4], [2.5, -0.8, 1.4]], [[0.0, 0.0, 0.0], [-0.4, 0.5, 0.1]]
    frames = of_points(points, velocities, TURNING, 60)
    tracks = rc.track(frames, motion=TURNING, **POINTS)
    assert len(tracks) == 2
    for one in tracks:
        k = int(np.argmin(np.linalg.norm(one.position[0] - points, axis=1)))
        there = np.array(points[k]) + np.outer(one.time, velocities[k])
        np.testing.assert_allclose(one.position, there, rtol=0, atol=0.02)
        np.testing.assert_allclose(one.motion[-20:], np.tile(velocities[k], (20, 1)), rtol=0, atol=0.1)
    # Ranges and range rates of tracks equal the detections.
    fixed = min(tracks, key=lambda one: float(np.abs(one.motion[-1]).sum()))
    np.testing.assert_allclose(fixed.range[-1], frames[-1].range[0], rtol=0, atol=0.01)
    np.testing.assert_allclose(fixed.velocity[-1], frames[-1].velocity[0], rtol=0, atol=0.02)
    # In the frame of the sensor the post would be off by the way of the sensor.
    blind = rc.track(frames, **POINTS)
    assert min(np.linalg.norm(one.position[-1] - points[0]) for one in blind) > 0.4


def test_smoothed_tracks_are_in_the_world_too() -> None:
    frames = of_points([3.0, 0.5, 0.4], [0.0, 0.0, 0.0], TURNING, 60)
    (one,) = rc.track(frames, motion=TURNING, smooth=True, **POINTS)
    np.testing.assert_allclose(one.position, np.tile([3.0, 0.5, 0.4], (60, 1)), rtol=0, atol=0.01)
    np.testing.assert_allclose(one.motion, 0.0, rtol=0, atol=0.05)


def test_sensor_in_the_plane_may_turn_about_its_upright_axis() -> None:
    upright = rc.Linear(rc.Pose([1.0, 0.0, 0.7]), velocity=[0.3, 0.2, 0.0], angular_velocity=[0.0, 0.0, 0.5])
    frames = of_points([3.0, 1.0, 0.7], [0.0, -0.3, 0.0], upright, 60, num_angles=1)
    (one,) = rc.track(frames, motion=upright, **POINTS)
    assert one.state.shape == (60, 4)
    np.testing.assert_allclose(one.position[-1], [3.0, 1.0 - 0.3 * one.time[-1], 0.7], rtol=0, atol=0.02)
    np.testing.assert_allclose(one.motion[-1], [0.0, -0.3, 0.0], rtol=0, atol=0.1)


def test_walls_are_no_people_when_the_sensor_moves_and_a_walker_is() -> None:
    wall = np.array([[4.0, y, z] for y in (-1.0, 0.0, 1.0) for z in (0.5, 1.5)])
    moving = rc.Linear(rc.Pose([0.0, 0.0, 1.0]), velocity=[0.5, 0.0, 0.0])
    frames = []
    for k in range(80):
        trunk = np.array([[2.5, -1.0 + 0.8 * k / RATE, 1.1]])
        points = np.concatenate([wall, trunk])
        frames.append(seen(points, np.array([[0.0, 0.0, 0.0]] * 6 + [[0.0, 0.8, 0.0]]), moving, k / RATE))
    (one,) = rc.track(frames, motion=moving, targets="people")
    np.testing.assert_allclose(one.position[-1], [2.5, -1.0 + 0.8 * one.time[-1], 1.1], rtol=0, atol=0.1)
    assert len(rc.track(frames, targets="people")) > 1  # as everything seems to come nearer


def test_walls_stand_still_when_the_sensor_is_faster_than_the_velocities_that_it_tells() -> None:
    wall = np.array([[6.0, y, z] for y in (-1.0, 0.0, 1.0) for z in (0.5, 1.5)])
    fast = rc.Linear(rc.Pose([0.0, 0.0, 1.0]), velocity=[2.5, 0.0, 0.0])
    frames = [replace(one, velocity=one.velocity + 4.0) for one in of_points(wall, 0.0 * wall, fast, 20)]
    assert all((np.abs(one.velocity) < 2.0).all() for one in frames)  # modulo 4 m/s
    assert len(rc.track(frames, motion=fast, targets="people", velocity_ambiguity=4.0)) == 0


def test_detections_of_a_person_may_lack_the_elevation() -> None:
    moving = rc.Linear(rc.Pose([0.0, 0.0, 1.0]), velocity=[0.5, 0.0, 0.0])
    frames = of_points([3.0, -1.0, 1.2], [0.0, 0.8, 0.0], moving, 40)
    frames[1:] = [replace(one, elevation=np.full(1, NAN)) for one in frames[1:]]
    (one,) = rc.track(frames, motion=moving, targets="people")
    assert one.is_detected.all()


def test_a_first_detection_at_the_horizon_has_the_dimensions_of_the_array() -> None:
    (first, *frames) = of_points([3.0, 0.5, 1.2], [0.0, 0.0, 0.0], TURNING, 10)
    first = replace(first, covariance=np.diag([1e-4, 1e-4, 10.0, 10.0])[None])  # the angles may be any
    (one,) = rc.track([first, *frames], motion=TURNING, **POINTS)
    assert one.state.shape == (9, 6)


def test_places_are_stale_while_the_motion_of_the_sensor_is_not_updated() -> None:
    motion = rc.Live()
    motion.update(0.0, rc.Pose(), velocity=[0.1, 0.0, 0.0], angular_velocity=[0.0, 0.0, 0.0])
    tracker = rc.Tracker(motion, **POINTS)
    point = np.array([[3.0, 0.0, 0.0]])
    states = [tracker.update(seen(point, 0.0 * point, motion, time))[0] for time in (0.05, 0.1, 0.125, 0.15)]
    assert [state.is_stale for state in states] == [False, False, True, True]
    assert [round(state.sensor_age, 3) for state in states] == [0.05, 0.1, 0.125, 0.15]
    (track,) = rc.track([seen(point, 0.0 * point, motion, time) for time in (0.05, 0.1, 0.2)], motion=motion, **POINTS)
    np.testing.assert_allclose(track.sensor_age, [0.05, 0.1, 0.2])


class Broken:
    """A motion of a program that fails now and then."""

    def __init__(self, pose: Array, rate: Array) -> None:
        self.poses_at = lambda times: np.array([pose])
        self.at = lambda time: rc.Pose()
        self.rate_at = lambda time: rate


REFUSALS: list[tuple[Any, type[Exception], str]] = [
    (lambda: rc.Tracker("arm"), TypeError, "motion: expected Pose, Linear"),  # type: ignore[arg-type]
    (lambda: rc.track(of_points([3, 0, 0], [0, 0, 0], rc.Pose(), 2), motion=3.0), TypeError, "motion: expected Pose"),  # type: ignore[arg-type]
    (lambda: rc.Tracker(Broken(np.eye(3, 4), np.full((3, 4), NAN))).update(PLANE), ValueError, "rate_at: expected fin"),
    (lambda: rc.Tracker(Broken(np.eye(3, 4), np.eye(4))).update(PLANE), ValueError, r"rate_at: expected shape \(3, 4"),
    (
        lambda: rc.Tracker(Broken(np.eye(3, 4) * NAN, np.zeros((3, 4)))).update(PLANE),
        ValueError,
        "poses_at: expected f",
    ),
    (
        lambda: rc.Tracker(TURNING).update(RANGES),
        ValueError,
        "motion: expected detections with azimuths",
    ),
    (
        lambda: rc.Tracker(rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.3, 0.0, 0.0])).update(PLANE),
        ValueError,
        "motion: expected an upright sensor for tracks in the plane, got one that is tilted by 17 degrees",
    ),
]


@pytest.mark.parametrize(("call", "error", "message"), REFUSALS)
def test_refusals(call: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


def test_poses_of_the_sensor_are_read_only() -> None:
    for motion in (None, TURNING):
        (state,) = rc.Tracker(motion).update(seen(np.array([[3.0, 0.0, 0.0]]), np.zeros((1, 3)), rc.Pose(), 0.0))
        for values in (state.sensor_pose, state.sensor_velocity):
            with pytest.raises(ValueError, match="read-only"):
                values[0] = 1.0


def test_refused_detections_leave_a_tracker_as_it_was() -> None:
    tracker = rc.Tracker(TURNING)
    with pytest.raises(ValueError, match="azimuths"):
        tracker.update(RANGES)
    assert (tracker.time, tracker.num_dimensions) == (-np.inf, None)
