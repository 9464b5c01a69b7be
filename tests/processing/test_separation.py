"""Separation of people from a robot: distances in plain geometry, required ones by the terms of the standard."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.processing.tracking.separation import Separation, separation

HAND = rc.Body(
    rc.shapes.sphere(0.1), motion=rc.Linear(rc.Pose([0.5, 0.0, 1.0]), velocity=[0.25, 0.0, 0.0]), name="hand"
)


def person(
    place: tuple[float, float] = (2.0, 0.0),
    motion: tuple[float, float] = (0.0, 0.0),
    deviation: float = 0.05,
    nearest: float = np.nan,
    **changes: Any,
) -> rc.processing.TrackState:
    values: dict[str, Any] = {"state": np.array([*place, *motion])}
    values |= {"state_covariance": np.diag([deviation**2] * 2 + [0.01] * 2)}
    values |= {"id": 7, "time": 0.0, "seen": 0.0, "is_detected": True, "is_confirmed": True}
    values |= {"is_static": False, "is_observable": True}
    values |= {"num_hits": 9, "nearest": nearest, "nearest_deviation": 0.02, "sensor_age": 0.0}
    values |= {"sensor_pose": np.eye(3, 4), "sensor_velocity": np.zeros(3)}
    return rc.processing.TrackState(**(values | changes))


def test_required_distance_has_the_six_terms() -> None:
    [one] = separation([person()], [HAND], reaction_time=0.1, stopping_time=0.3, intrusion=0.2, robot_uncertainty=0.02)
    assert (one.track, one.body, one.age) == (7, "hand", 0.0)
    assert one.distance == pytest.approx(2.0 - 0.3 - 0.6, abs=1e-3)  # the sphere has facets
    sh, sr, ss, c, zd, zr = 1.6 * (0.1 + 0.3), 0.25 * 0.1, 0.25 * 0.3, 0.2, 3.0 * 0.05, 0.02
    assert one.required == pytest.approx(sh + sr + ss + c + zd + zr, rel=1e-12)
    assert one.deviation == pytest.approx(0.05, rel=1e-6)
    assert one.is_safe == (one.margin >= 0.0) == (one.distance >= one.required)


def test_age_counts_as_reaction_time_and_people_go_on() -> None:
    walker = person(motion=(-2.0, 0.0))
    [now] = separation([walker], [HAND])
    [later] = separation([walker], [HAND], time=0.1)
    assert later.age == pytest.approx(0.1)
    assert later.distance - now.distance == pytest.approx(-0.1 * (2.0 + 0.25), abs=1e-9)
    assert later.required - now.required == pytest.approx(0.1 * (2.0 + 0.25), abs=1e-9)  # faster than 1.6 m/s


def test_robot_that_leaves_adds_nothing() -> None:
    leaving = rc.Body(HAND.mesh, motion=rc.Linear(rc.Pose([0.5, 0.0, 1.0]), velocity=[-0.5, 0.0, 0.0]), name="hand")
    [one] = separation([person()], [leaving], intrusion=0.0, robot_uncertainty=0.0, coverage=0.0)
    assert one.required == pytest.approx(1.6 * 0.4, rel=1e-12)
    [known] = separation([person()], [HAND], stopping_distance=0.5, intrusion=0.0, robot_uncertainty=0.0, coverage=0.0)
    assert known.required == pytest.approx(1.6 * 0.4 + 0.25 * 0.1 + 0.5, rel=1e-12)


def test_places_where_a_person_would_be_unseen_count_as_one_who_stands_there() -> None:
    places = [[3.0, 0.0, 1.0], [0.5, 1.5, 1.0]]
    [one] = separation([], [HAND], time=0.0, unobserved=places)
    assert (one.track, one.is_observable, one.age, one.deviation) == (None, False, 0.0, 0.0)
    assert one.distance == pytest.approx(1.5 - 0.3 - 0.1, abs=1e-3)  # of the disc from the sphere at (0.5, 0)
    assert one.required == pytest.approx(1.6 * 0.4 + 0.1 + 0.01, abs=1e-6)  # the hand moves across
    np.testing.assert_allclose(one.person_point, [0.5, 1.2], atol=1e-3)
    both = separation([person((1.5, 0.0))], [HAND], unobserved=places)
    assert [near.track for near in both] == [7, None]
    assert [near.is_observable for near in both] == [True, False]
    assert separation([], [HAND], unobserved=np.zeros((0, 3))) == []
    with pytest.raises(ValueError, match="time: expected one for unobserved places without tracks, got None"):
        separation([], [HAND], unobserved=places)
    with pytest.raises(ValueError, match="unobserved: expected"):
        separation([], [HAND], time=0.0, unobserved=[[0.0, 1.0]])


def test_an_arm_that_is_held_out_is_the_nearest_point() -> None:
    [one] = separation([person(nearest=1.4)], [HAND])
    assert one.distance == pytest.approx(1.4 - 0.6, abs=1e-3)
    np.testing.assert_allclose(one.person_point, [1.4, 0.0], atol=1e-9)
    np.testing.assert_allclose(one.robot_point, [0.6, 0.0], atol=1e-3)


def test_most_critical_person_and_the_nearest_link_come_first() -> None:
    elbow = rc.Body(rc.shapes.box([0.2, 0.2, 0.2]), motion=rc.Pose([0.0, 1.0, 0.5]), name="elbow")
    found = separation([person((3.0, 0.0)), person((0.0, 2.0), id=8)], [HAND, elbow])
    assert [(one.track, one.body) for one in found] == [(8, "elbow"), (7, "hand")]
    assert found[0].distance == pytest.approx(2.0 - 0.3 - 1.1, abs=1e-9)
    assert separation([person(is_confirmed=False)], [HAND]) == []
    assert separation([], [HAND]) == []


def test_people_within_the_outline_of_a_link_have_no_distance() -> None:
    table = rc.Body(rc.shapes.plate(2.0, 2.0), motion=rc.Pose.from_rpy([2.0, 0.0, 0.7], [0.0, -np.pi / 2, 0.0]))
    [one] = separation([person()], [table])
    assert one.distance == 0.0
    wall = rc.Body(rc.shapes.plate(2.0, 2.0), motion=rc.Pose([1.0, 0.0, 1.0]))  # upright: a line from above
    [one] = separation([person()], [wall])
    assert one.distance == pytest.approx(0.7, abs=1e-9)


def test_distances_are_those_of_dense_points_of_an_arm() -> None:
    moving = rc.models.RobotArm.ur10().moving([0.3, -1.2, 1.4, 0.5, 1.57, 0.0])
    links = moving.bodies()
    outline: list[NDArray[np.float64]] = []
    rng = np.random.default_rng(1)
    for link in links:  # random points of its triangles
        pose = link.motion.at(0.0)
        corners = (link.mesh.vertices @ pose.rotation.T + pose.position)[link.mesh.triangles][:, :, :2]
        weights = rng.dirichlet([1.0] * 3, size=(len(corners), 60))
        outline += list(np.einsum("tnk,tkx->tnx", weights, corners).reshape(-1, 2))
    points = np.array(outline)
    for place in [(1.5, 0.8), (-0.6, 1.0), (0.4, -1.3)]:
        [one] = separation([person(place)], links, body_radius=0.0)
        dense = np.linalg.norm(points - place, axis=1).min()
        assert dense - 0.08 < one.distance <= dense + 1e-9  # hulls of links reach beyond bent links


def test_people_in_an_outline_or_at_the_sensor_keep_all_terms() -> None:
    [one] = separation([person((0.5, 0.0))], [HAND])  # in the middle of the hand, which moves at 0.25 m/s
    assert one.distance == 0.0
    assert one.deviation == pytest.approx(0.05, rel=1e-6)
    [here] = separation([person((0.0, 0.0), nearest=0.5)], [HAND])  # no direction from the sensor
    assert here.distance == pytest.approx(0.4 - 0.3, abs=1e-3)


def test_links_without_a_surface_have_no_distance() -> None:
    empty = rc.Body(rc.Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int)))
    assert separation([person()], [empty, HAND])[0].body == "hand"


def test_covariance_along_the_line_counts_in_the_axes_of_a_turned_sensor() -> None:
    sensor = np.concatenate(
        [rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2]).rotation, np.zeros((3, 1))], axis=1
    )
    covariance = np.diag([0.3**2, 0.01**2, 0.01, 0.01])  # ahead of the sensor, and beside it
    [one] = separation([person((0.0, -2.0), sensor_pose=sensor, state_covariance=covariance)], [HAND])
    assert one.deviation == pytest.approx(0.01, rel=1e-3)  # ahead of the sensor is beside the line
    np.testing.assert_allclose(one.person_point, [1.7, 0.0], atol=1e-3)


REFUSALS: list[tuple[Any, type[Exception], str]] = [
    (lambda: separation([person()], [HAND], reaction_time=-1.0), ValueError, "reaction_time: expected"),
    (lambda: separation([person()], [HAND], intrusion=-0.1), ValueError, "intrusion: expected"),
    (lambda: separation([person()], [HAND], time=-0.1), ValueError, "time: expected 0 s, the time of the tracks, or"),
    (lambda: separation([person()], [HAND], stopping_distance=""), TypeError, "stopping_distance: expected"),  # type: ignore[arg-type]
    (lambda: separation([], []), ValueError, "robot: expected links with surfaces, got none"),
    (lambda: separation([], HAND), TypeError, "robot: expected a sequence of Body, got Body"),  # type: ignore[arg-type]
    (lambda: separation([3], [HAND]), TypeError, "tracks: expected TrackState"),  # type: ignore[list-item]
    (lambda: separation([], [rc.PointTarget([1, 0, 0])]), TypeError, "robot: expected Body"),  # type: ignore[list-item]
    (
        lambda: separation([person(state=np.array([2.0, 0.0]), state_covariance=np.eye(2))], [HAND]),
        ValueError,
        "tracks: expected places, got ranges alone",
    ),
]


@pytest.mark.parametrize(("call", "error", "message"), REFUSALS)
def test_refusals(call: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


def test_result_says_whether_it_is_safe() -> None:
    one = Separation(0, "hand", 0.8, 0.05, 0.0, 0.8, np.zeros(2), np.zeros(2))
    assert (one.margin, one.is_safe) == (0.0, True)
