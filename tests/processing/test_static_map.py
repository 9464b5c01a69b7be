"""Known static surfaces: distances in plain geometry, classes of detections, people who stand still."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.processing import StaticMap

Array = NDArray[np.float64]

WALL = rc.Body(rc.shapes.plate(6.0, 3.0), motion=rc.Pose([5.0, 0.0, 0.0]), name="wall")
"""In the plane x = 5 m."""


TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""About z by a quarter turn."""


def seen(
    places: list[list[float]], time: float = 0.0, *, speed: Array | float = 0.0, deviation: float = 0.02
) -> rc.Detections:
    """Detections of places (x, y) in the plane, with range rates [m/s] and one deviation of the azimuth [rad]."""
    x, y = np.array(places, dtype=np.float64).reshape(-1, 2).T
    covariance = np.full((len(x), 4, 4), np.nan)
    covariance[:, :3, :3] = np.diag(np.square([0.02, 0.05, deviation]))
    nothing, level = np.full(len(x), np.nan), np.full(len(x), 30.0)
    return rc.Detections(
        np.hypot(x, y), np.broadcast_to(speed, len(x)), np.arctan2(y, x), nothing, level, covariance, time
    )


def test_points_of_bodies_are_near_all_of_their_surface() -> None:
    box = rc.Body(rc.shapes.box([1.0, 2.0, 0.5]), motion=rc.Pose([3.0, 1.0, 0.25]))
    known = StaticMap.of([WALL, box])
    rng = np.random.default_rng(0)
    on_wall = np.stack([np.full(200, 5.0), rng.uniform(-3.0, 3.0, 200), rng.uniform(-1.5, 1.5, 200)], axis=1)
    assert known.distances(on_wall).max() < 0.1
    assert known.distances(on_wall - [0.7, 0.0, 0.0]) == pytest.approx(0.7, abs=0.01)
    assert known.distances([[2.5, 1.0, 0.25], [2.0, 1.0, 0.25], [3.0, 1.0, 0.25]]) == pytest.approx(
        [0.0, 0.5, 0.25], abs=0.05
    )
    assert StaticMap(np.zeros((0, 3))).distances([[0.0, 0.0, 0.0]]) == np.inf


def test_classes() -> None:
    known = StaticMap.of([WALL])
    places = [[5.0, 1.0], [4.8, 1.0], [4.5, 1.0], [2.0, 0.0]]
    assert known.classify(seen(places)).tolist() == ["known", "known", "unknown", "unknown"]
    assert known.classify(seen(places, speed=-0.3)).tolist() == ["moving"] * 4
    # 1 m beside the wall along an arc, by 0.2 rad; twice the deviation reaches the wall, but not over all of the range.
    wide = rc.Body(rc.shapes.plate(1.0, 3.0), motion=rc.Pose([5.0, 0.0, 0.0]))
    assert StaticMap.of([wide]).classify(seen([[4.7, 1.7]], deviation=0.02)).tolist() == ["unknown"]
    assert StaticMap.of([wide]).classify(seen([[4.7, 1.7]], deviation=0.2)).tolist() == ["known"]
    assert StaticMap.of([wide]).classify(seen([[4.2, 1.5]], deviation=0.2)).tolist() == ["unknown"]


def test_moving_sensor_classifies_in_the_world() -> None:
    cart = rc.Linear(rc.Pose([1.0, 0.0, 0.0]), velocity=[0.5, 0.0, 0.0])
    known = StaticMap.of([WALL])
    ahead = seen([[3.5, 0.0]], time=1.0, speed=-0.5)  # the sensor is at 1.5 m
    assert known.classify(ahead, cart).tolist() == ["known"]
    assert known.classify(ahead).tolist() == ["moving"]
    assert known.classify(seen([[2.5, 0.0]], time=1.0, speed=-0.5), cart).tolist() == ["unknown"]
    assert known.classify(seen([[3.5, 0.0]], time=1.0), cart).tolist() == ["moving"]
    # A direction that is wrong by 0.4 rad explains 0.19 m/s at a speed of 0.5 m/s across.
    aside = rc.Linear(rc.Pose(), velocity=[0.0, 0.5, 0.0])
    for deviation, expected in ((0.2, "known"), (0.02, "moving")):
        assert known.classify(seen([[5.0, 0.0]], speed=-0.19, deviation=deviation), aside).tolist() == [expected]


def test_wall_beyond_the_velocity_ambiguity_begins_no_track() -> None:
    cart = rc.Linear(rc.Pose(), velocity=[0.8, 0.0, 0.0])
    tracker = rc.Tracker(cart, StaticMap.of([WALL]), targets="people", velocity_ambiguity=1.0)
    assert tracker.update(seen([[5.0, 0.0]], speed=0.2)) == []  # -0.8 m/s and a period


def test_learnt_map_knows_what_stood_there() -> None:
    cart = rc.Linear(rc.Pose(), velocity=[0.0, 0.5, 0.0])
    frames = [seen([[3.0, 0.0], [5.0, 1.0 - 0.5 * k / 40]], k / 40) for k in range(20)]  # the first one moves along
    known = StaticMap.learnt(frames, cart)
    assert known.distances([[3.0, 0.2, 0.0], [5.0, 1.0, 0.0]]) == pytest.approx(0.0, abs=0.05)
    assert known.distances([[4.0, 0.0, 0.0]]) == pytest.approx(1.0, abs=0.05)
    with pytest.warns(UserWarning, match="expected nobody, got moving detections in 3 of 20 frames"):
        StaticMap.learnt([seen([[3.0, 0.0]], k / 40, speed=1.0 * (k < 3)) for k in range(20)])


def followed(frames: list[rc.Detections], known: StaticMap | None) -> list[list[rc.processing.TrackState]]:
    tracker = rc.Tracker(static_map=known, targets="people")
    return [[state for state in tracker.update(found) if state.is_confirmed] for found in frames]


def test_standing_person_is_an_unknown_object_and_a_wall_is_none() -> None:
    frames = [seen([[2.0, 0.5], [5.0, 0.0]], k / 40) for k in range(40)]
    states = followed(frames, StaticMap.of([WALL]))
    assert [len(each) for each in states[:4]] == [0] * 4
    (one,) = states[-1]
    assert all(len(each) == 1 for each in states[7:])
    assert one.position == pytest.approx([2.0, 0.5, 0.0], abs=0.02)
    assert one.is_static
    assert one.is_observable
    assert not any(followed(frames, None))
    walking = followed([seen([[4.0 - k / 40, 0.0]], k / 40, speed=-1.0) for k in range(40)], StaticMap.of([WALL]))
    assert not walking[-1][0].is_static
    both = [seen([[2.0, 0.5], [4.0 - k / 40, -1.0]], k / 40, speed=np.array([0.0, -0.95])) for k in range(40)]
    assert sorted(state.is_static for state in followed(both, StaticMap.of([WALL]))[-1]) == [False, True]


def test_track_takes_static_echoes_that_may_be_of_a_wall_but_are_at_its_place() -> None:
    known = StaticMap.of([rc.Body(rc.shapes.plate(1.0, 3.0), motion=rc.Pose([5.0, 0.0, 0.0]))])
    place, away = np.array([4.7, 1.7]), np.array([4.7, 1.7]) / 5.0
    ways = np.minimum(np.arange(100) / 40 - 1.0, 0.0)
    frames = [
        seen([(place + way * away).tolist()], k / 40, speed=float(way < 0.0), deviation=0.2)
        for k, way in enumerate(ways)
    ]
    assert known.classify(frames[-1]).tolist() == ["known"]
    (one,) = followed(frames, known)[-1]
    assert one.is_detected
    assert one.is_static


def test_objects_at_the_range_of_a_known_echo_may_be_hidden() -> None:
    found = [seen([[2.0, 0.0], [5.0 * np.cos(0.3), 5.0 * np.sin(0.3)]], k / 40) for k in range(20)]
    known = StaticMap([[2.0 * np.cos(0.5), 2.0 * np.sin(0.5), 0.0]])
    hiding = [seen([[2.0, 0.0], [2.0 * np.cos(0.5), 2.0 * np.sin(0.5)]], k / 40) for k in range(20)]
    assert all(state.is_observable for state in followed(found, known)[-1])
    assert [state.is_observable for state in followed(hiding, known)[-1]] == [False]


def test_places_near_a_surface_behind_it_and_at_the_range_of_its_echo_are_unobserved() -> None:
    """A wall of 4 m at x = 3 m: a body of 0.3 m radius comes within 0.5 m of it from x = 2.2 m on."""
    known = StaticMap.of([rc.Body(rc.shapes.plate(4.0, 3.0), motion=rc.Pose([3.0, 0.0, 0.0]))])
    nothing, echo = seen([]), seen([[3.0, 0.0]])
    in_front = [[x, 0.0, 0.0] for x in (1.0, 2.1, 2.3, 2.9, 3.1, 3.9, 6.0)]
    assert known.are_observable(in_front, nothing).tolist() == [True, True, *[False] * 5]
    assert known.are_observable([[2.3, 0.0, 0.0]], nothing, body_radius=0.1).tolist() == [True]
    # The wall ends at y = 2 m: its shadow does at the bearing of atan(2 / 3).
    beside = [[4.5, 2.8, 0.0], [4.5, 3.3, 0.0], [-1.0, 0.0, 0.0]]
    assert known.are_observable(beside, nothing).tolist() == [False, True, False]  # the last is behind the sensor
    # An echo at 3 m takes the ranges of bodies from 2.4 to 3.6 m, in all directions.
    ranges = [[r * np.cos(1.2), r * np.sin(1.2), 0.0] for r in (2.3, 2.5, 3.5, 3.7)]
    assert known.are_observable(ranges, nothing).tolist() == [True] * 4
    assert known.are_observable(ranges, echo).tolist() == [True, False, False, True]
    assert known.are_observable(ranges, seen([[2.0, 0.0]])).tolist() == [True] * 4  # unknown: has a track
    # Turned by a quarter, it looks along y from (2, -3): the wall is beside the line of sight.
    aside = rc.Pose([2.0, -3.0, 0.0], TURNED)
    assert known.are_observable([[2.0, 0.0, 0.0], [2.6, 0.0, 0.0], [4.0, 0.0, 0.0]], nothing, aside).tolist() == [
        True,
        False,
        False,
    ]
    on_wall = rc.Pose([2.98, 0.0, 0.0], TURNED @ TURNED)  # the surface behind a sensor hides nothing
    assert known.are_observable([[1.0, 1.5, 0.0]], nothing, on_wall).tolist() == [True]


def test_track_in_a_shadow_is_not_observable_and_ends() -> None:
    """Somebody walks behind a plate, slowly, and gives no echoes there; unlike at a wall he may walk on unseen."""
    plate = rc.Body(rc.shapes.plate(1.0, 3.0), motion=rc.Pose([2.0, 0.0, 0.0]))
    ways = [-2.5 + 0.4 * k / 40 for k in range(200)]
    frames = [seen([[3.5, y]][: y < -0.9], k / 40, speed=0.4 * y / np.hypot(3.5, y)) for k, y in enumerate(ways)]
    states = followed(frames, StaticMap.of([plate]))
    hidden = sum(y < -0.9 for y in ways)
    assert states[hidden - 40][0].is_observable
    assert not states[hidden + 5][0].is_observable
    assert states[-1] == []


def approach(stop: float, num_missed: int) -> list[rc.Detections]:
    """Somebody who walks along x from 2 m, slows down until `stop` [m], gives no echoes, and walks back."""
    times = np.arange(400) / 40
    speeds = np.interp(times, [0.0, 1.0, 1.5], [1.0, 1.0, 0.1])
    x = 2.0 + np.cumsum(speeds) / 40
    way = [seen([[place, 0.0]], time, speed=v) for time, place, v in zip(times, x, speeds, strict=True) if place < stop]
    start = len(way) + num_missed
    nothing = [seen([], k / 40) for k in range(len(way), start)]
    return [*way, *nothing, *(seen([[stop - k / 80, 0.0]], (start + k) / 40, speed=-0.5) for k in range(20))]


@pytest.mark.parametrize(("where", "is_held"), [(3.7, True), (4.5, False)])
def test_person_who_stops_near_a_surface_keeps_the_track(where: float, is_held: bool) -> None:
    wall = rc.Body(rc.shapes.plate(6.0, 3.0), motion=rc.Pose([where, 0.0, 0.0]))
    stop, num_missed = 3.4, 200
    tracks = followed(approach(stop, num_missed), StaticMap.of([wall]))
    waiting = tracks[-30]
    if not is_held:
        assert not waiting
        return
    (one,) = waiting
    assert (one.is_detected, one.is_observable) == (False, False)
    assert one.position[0] == pytest.approx(stop, abs=0.15)
    assert np.linalg.norm(one.motion) < 1e-9
    assert [state.id for state in tracks[-1]] == [one.id]  # walks on
    assert tracks[-1][0].is_detected
    (near,) = rc.separation(waiting, [rc.Body(rc.shapes.sphere(0.1))], time=one.time + 0.1)
    assert near.age == pytest.approx(0.1)  # a person who moved would have been detected
    recorded = rc.track(approach(stop, num_missed), static_map=StaticMap.of([wall]), targets="people")
    assert recorded[0].time[-1] == tracks[-1][0].time


def walk(start: float, speed: float, num_frames: int) -> Array:
    """Places on a line along x at 40 Hz, and the speed (frame, 2)."""
    return np.array([[start + speed * k / 40, speed] for k in range(num_frames)])


def unseen(num_frames: int) -> Array:
    return np.full((num_frames, 2), np.nan)


STOP = np.concatenate([walk(2.0, 1.0, 50), walk(3.25, 0.2, 20)])
"""Somebody walks to 3.35 m and slows down."""
NEAR_WALL = StaticMap.of([rc.Body(rc.shapes.plate(6.0, 3.0), motion=rc.Pose([3.6, 0.0, 0.0]))])


def ids_of(*ways: Array) -> list[list[int]]:
    """Confirmed tracks in each frame of people on lines 0.9 m beside each other."""
    frames = []
    for k, row in enumerate(np.stack(ways, axis=1)):
        x, speed = row.T
        y = 0.9 * np.arange(len(ways))
        places = np.stack([x, y], axis=1)[np.isfinite(x)]
        frames.append(seen(places.tolist(), k / 40, speed=(speed * x / np.hypot(x, y))[np.isfinite(x)]))
    return [[state.id for state in states] for states in followed(frames, NEAR_WALL)]


def test_limbs_of_a_hidden_person_do_not_end_the_track() -> None:
    assert ids_of(np.concatenate([STOP, unseen(100), walk(3.3, -1.5, 3), unseen(100)]))[-1] == [0]


def test_track_ends_when_its_person_has_left_unseen() -> None:
    ids = ids_of(np.concatenate([STOP, unseen(40), walk(2.65, -1.0, 60)]))
    assert ids[110] == [0]
    assert ids[115] == [0, 1]  # 0.9 m away: it might be another one
    assert ids[-1] == [1]
    far = ids_of(np.concatenate([STOP, unseen(40), walk(2.2, -1.0, 60)]))
    assert far[-1] == [0, 1]
    assert ids_of(np.concatenate([STOP, unseen(40), walk(2.45, -2.0, 2), unseen(10)]))[-1] == [0]  # two false echoes
    before = np.concatenate([walk(3.1, 0.0, 30), walk(3.1, -1.0, 100)])  # stands there when the other comes, and leaves
    two = ids_of(np.concatenate([STOP, unseen(60)]), before)
    assert two[-1] == [0, 1]


def test_moving_sensor_holds_a_track_in_the_world_over_lost_frames() -> None:
    cart = rc.Linear(rc.Pose(), velocity=[0.0, 0.6, 0.0])
    tracker = rc.Tracker(cart, NEAR_WALL, targets="people", max_gap=0.5)
    for k, (x, speed) in enumerate(STOP):
        y = -0.6 * k / 40
        tracker.update(seen([[x, y]], k / 40, speed=(speed * x - 0.6 * y) / np.hypot(x, y)))
    for time in (1.8, 1.9, 3.0):
        (one,) = tracker.update(seen([], time))
    assert one.position == pytest.approx([3.35, 0.0, 0.0], abs=0.1)
    assert np.linalg.norm(one.motion) < 1e-9


def test_held_track_ends_where_it_would_be_seen() -> None:
    known = StaticMap([[2.0 * np.cos(0.5), 2.0 * np.sin(0.5), 0.0]])
    wall = [2.0 * np.cos(0.5), 2.0 * np.sin(0.5)]
    start = [seen([[2.0, 0.0], wall], k / 40) for k in range(20)]

    def ends(num_hiding: int, num_clear: int) -> list[rc.processing.TrackState]:
        hiding = [seen([wall], (20 + k) / 40) for k in range(num_hiding)]
        clear = [seen([], (20 + num_hiding + k) / 40) for k in range(num_clear)]
        return followed([*start, *hiding, *clear], known)[-1]

    (one,) = ends(200, 5)
    assert not one.is_detected
    assert one.is_observable
    assert one.time - one.seen == pytest.approx(5 / 40)
    assert not ends(200, 11)


def test_person_who_walks_out_of_view_along_a_wall_is_not_held() -> None:
    echo = [3.4, 0.3]  # of the wall, beside the path
    frames = [
        seen([echo, [1.0 + k / 40, 0.0]][: 1 + (k < 90)], k / 40, speed=np.array([0.0, 1.0])[: 1 + (k < 90)])
        for k in range(140)
    ]
    known = StaticMap.of([rc.Body(rc.shapes.plate(6.0, 3.0), motion=rc.Pose([3.0, 0.4, 0.0], TURNED))])
    states = followed(frames, known)
    assert not states[-1]
    (coasting,) = states[95]
    assert (coasting.is_observable, coasting.is_detected) == (False, False)
    (near,) = rc.separation([coasting], [rc.Body(rc.shapes.sphere(0.1))])
    assert near.age == pytest.approx(6 / 40)  # walks on unseen
    assert rc.track(frames, static_map=known, targets="people")[0].frame[-1] == 89


def test_places_without_elevation_are_at_the_height_of_the_sensor() -> None:
    floor = rc.Body(rc.shapes.box([9.0, 9.0, 0.1]), motion=rc.Pose([0.0, 0.0, -0.05]))
    tracker = rc.Tracker(rc.Pose([0.0, 0.0, 1.0]), StaticMap.of([floor]), targets="people")
    (one,) = [tracker.update(seen([[2.0, 0.0]], k / 10)) for k in range(8)][-1]
    assert one.is_confirmed
    assert one.is_observable


def test_detection_without_azimuth_is_known_at_the_range_of_a_surface() -> None:
    nothing = np.full(2, np.nan)
    found = rc.Detections([5.1, 3.0], [0.0, 0.0], nothing, nothing, [30.0, 30.0])
    assert StaticMap.of([WALL]).classify(found).tolist() == ["known", "unknown"]


def test_bodies_are_where_they_are_at_a_time() -> None:
    cart = rc.Body(rc.shapes.sphere(0.1), motion=rc.Linear(rc.Pose(), velocity=[0.5, 0.0, 0.0]))
    assert StaticMap.of([cart], time=2.0).points.mean(axis=0) == pytest.approx([1.0, 0.0, 0.0], abs=0.01)


def test_simulated_person_stands_in_a_room() -> None:
    arm = rc.models.RobotArm.ur10().moving(
        lambda t: np.deg2rad([15.0 * np.sin(1.5 * t), -112.0, 134.6, -22.6, 90.0, 0.0]), base=rc.Pose([0.0, 0.0, 0.7])
    )
    motion = rc.Attached(arm.link_motion("tool0"), rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0)
    plaster = rc.materials["plasterboard"]
    room = rc.Body(rc.shapes.box([7.0, 6.0, 2.8]), material=plaster, motion=rc.Pose([2.5, 0.0, 1.4]))
    person = rc.models.Human(speed=0.0, path=[[2.4, -0.4], [0.0, 0.0]])
    radar = rc.bgt60tr13c(max_velocity=6.0)
    found: dict[bool, list[list[rc.processing.TrackState]]] = {}
    for is_there in (False, True):
        simulator = rc.Simulator(rc.Scene([room, *person.bodies()] if is_there else [room]), radar, radar_motion=motion)
        tracker = rc.Tracker(
            motion, StaticMap.of([room]), targets="people", velocity_ambiguity=2.0 * radar.max_velocity
        )
        found[is_there] = [tracker.update(rc.detect(simulator.frame(k / 40))) for k in range(30)]
    assert not any(state.is_confirmed for states in found[False] for state in states)
    is_found = [
        any(state.is_confirmed and np.hypot(*(state.position[:2] - [2.4, -0.4])) < 0.4 for state in states)
        for states in found[True]
    ]
    assert np.mean(is_found[8:]) >= 0.95


@pytest.mark.parametrize("surface", ["wall", "plate"])
def test_person_who_stands_there_from_the_start_has_a_track_or_an_unobserved_place(surface: str) -> None:
    """0.1 to 0.5 m in front of a wall, or beside a metal plate at the same range."""
    motion = rc.Linear(rc.Pose([0.0, -0.15, 1.0]), velocity=[0.0, 0.25, 0.0])
    radar, rng, silent = rc.bgt60tr13c(max_velocity=6.0), np.random.default_rng(5), []
    for _ in range(6):
        distance, azimuth = rng.uniform(1.5, 3.0), rng.uniform(-0.4, 0.4)
        place = distance * np.array([np.cos(azimuth), np.sin(azimuth)])
        if surface == "wall":
            shape, pose = rc.shapes.box([0.1, 6.0, 2.8]), rc.Pose([place[0] + rng.uniform(0.3, 0.7), 0.0, 1.4])
        else:
            beside = azimuth - np.sign(azimuth) * 0.9 / distance
            c, s = np.cos(beside), np.sin(beside)
            turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            shape, pose = rc.shapes.box([0.05, 0.4, 0.8]), rc.Pose([distance * c, distance * s, 1.0], turned)
        body = rc.Body(shape, material=rc.materials["metal"], motion=pose)
        person = rc.models.Human(speed=0.0, path=[place, place + rng.standard_normal(2)])
        simulator = rc.Simulator(rc.Scene([body, *person.bodies()]), radar, radar_motion=motion)
        known = StaticMap.of([body])
        tracker = rc.Tracker(motion, known, targets="people", velocity_ambiguity=2.0 * radar.max_velocity)
        for k in range(24):
            found = rc.detect(simulator.frame(k / 20))
            states = [state for state in tracker.update(found) if state.is_confirmed]
            is_tracked = any(np.hypot(*(state.position[:2] - place)) < 0.5 for state in states)
            silent.append(not is_tracked and bool(known.are_observable([[*place, 1.0]], found, motion)[0]))
    assert np.mean(silent) <= 0.05


def test_refusals() -> None:
    known = StaticMap([[1.0, 0.0, 0.0]])
    with pytest.raises(ValueError, match="static_map: expected targets=\"people\", got 'points'"):
        rc.Tracker(static_map=known)
    with pytest.raises(TypeError, match="static_map: expected StaticMap, got list"):
        rc.Tracker(static_map=[WALL], targets="people")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="distance: expected"):
        StaticMap(np.zeros((0, 3)), distance=0.0)
    with pytest.raises(ValueError, match="points"):
        StaticMap([[1.0, 0.0]])
    with pytest.raises(TypeError, match="bodies: expected an iterable of Body, got Body"):
        StaticMap.of(WALL)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="static_map: expected detections with azimuths"):
        rc.Tracker(static_map=known, targets="people").update(rc.Detections([2.0], [0.0], [np.nan], [np.nan], [30.0]))
