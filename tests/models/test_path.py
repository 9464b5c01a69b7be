"""Paths on the floor: unit speed, heading and curvature that fit the positions, corners cut as promised."""

import numpy as np
import pytest

from radarcore.models.people.path import FloorPath

WINDING = [[0, 0], [3, 0], [3, 3], [1, 5], [-4, 5], [-5, 4.9]]


def test_path_without_turns_is_the_line_through_its_waypoints():
    path = FloorPath([[1, 2], [2, 2], [4, 2]])
    assert path.length == 3.0
    distance = np.array([-2.0, 0.0, 1.5, 3.0, 10.0])
    np.testing.assert_array_equal(path.points_at(distance), [1 + 2j + distance, 0.0 * distance, 0.0 * distance])


def test_path_begins_and_ends_at_its_first_and_last_waypoint():
    path = FloorPath(WINDING)
    positions, _, _ = path.points_at([0.0, path.length])
    np.testing.assert_allclose(positions, [0.0, -5 + 4.9j], atol=1e-12)
    # Shorter than the polygon, longer than its corners cut square.
    polygon = np.linalg.norm(np.diff(WINDING, axis=0), axis=1).sum()
    assert 0.9 * polygon < path.length < polygon


def test_path_turns_as_its_heading_and_curvature_say():
    path = FloorPath(WINDING, turn_radius=0.3)
    distance = np.linspace(-1.0, path.length + 1.0, 100_001)
    step = distance[1] - distance[0]
    position, heading, curvature = path.points_at(distance)
    middle = 0.5 * (heading[1:] + heading[:-1])
    # Largest change of curvature in a step, in the turn by the smallest angle, 1 / (radius^2 angle), times the
    # slope in the middle of the smoothstep.
    change = 630 / 256 * step / (0.3**2 * np.arctan(0.1))
    np.testing.assert_allclose(np.diff(position) / step, np.exp(1j * middle), atol=step * change)
    np.testing.assert_allclose(np.diff(heading) / step, 0.5 * (curvature[1:] + curvature[:-1]), atol=0.5 * change)
    assert np.abs(np.diff(curvature)).max() <= (1 + 1e-6) * change  # no jump
    assert np.abs(curvature).max() == pytest.approx(1 / 0.3, rel=1e-3)


def test_turns_begin_middle_and_end_without_a_jump_of_any_of_four_derivatives_of_the_curvature():
    path = FloorPath([[0, 0], [2, 0], [2, 2]], turn_radius=0.5)
    half = 0.25 * np.pi
    begin = 0.5 * path.length - 2.0 * half
    distance = np.linspace(begin - 0.5, begin + 4.0 * half + 0.5, 20_001)
    step = distance[1] - distance[0]
    _, _, values = path.points_at(distance)
    for order in range(1, 5):
        values = np.gradient(values, step)[2:-2]
        # A jump is as large between any two samples, a continuous derivative changes in proportion to the step.
        assert np.abs(np.diff(values)).max() < 0.02 * np.abs(values).max(), order


def test_right_angle_takes_1_8_radii_of_each_leg():
    path = FloorPath([[0, 0], [2, 0], [2, 2]], turn_radius=0.5)
    distance = np.linspace(0.0, path.length, 10_001)
    _, _, curvature = path.points_at(distance)
    assert distance[curvature > 0.0][0] == pytest.approx(2 - 1.81 * 0.5, abs=2e-3)


def test_full_round_ends_with_its_heading_a_whole_turn_later():
    path = FloorPath([[0, 0], [2, 0], [2, 2], [0, 2], [0, -2]])
    assert path.points_at([path.length])[1] == pytest.approx(1.5 * np.pi, abs=1e-12)
