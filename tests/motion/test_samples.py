"""Motions through samples at the same times, and skins that follow them."""

from __future__ import annotations

import numpy as np
import pytest

import radarcore as rc
from radarcore.geometry.rotation import rotations_about
from radarcore.motion.deformation import DeformationFunction
from radarcore.motion.samples import Samples
from radarcore.motion.skin import Skin

TIMES = np.array([0.0, 0.5, 2.0])


def samples(*, is_cubic: bool) -> Samples:
    """Two motions: one along x and about z, as a function of time that is known, one at rest."""
    group = Samples(TIMES, is_cubic)
    turns = rotations_about(np.outer(TIMES, [0.0, 0.0, 1.2]))
    group.add(np.concatenate([turns, np.outer(TIMES, [3.0, 0.0, 0.0])[:, :, None]], axis=2))
    group.add(np.tile(np.eye(3, 4), (3, 1, 1)))
    return group


@pytest.mark.parametrize("is_cubic", [False, True])
def test_samples_of_a_constant_twist_are_that_twist(is_cubic: bool) -> None:
    twist = rc.Linear(rc.Pose(), velocity=[3.0, 0.0, 0.0], angular_velocity=[0.0, 0.0, 1.2])
    group = samples(is_cubic=is_cubic)
    times = np.array([0.0, 0.2, 0.5, 1.9, 2.0])
    poses, rates = group.link_poses_and_rates_at(times)
    np.testing.assert_allclose(poses[:, 0], twist.poses_at(times), atol=1e-12)
    np.testing.assert_allclose(rates[:, 0], [twist.rate_at(time) for time in times], atol=1e-12)
    assert not rates[:, 1].any()


def test_samples_rest_beyond_their_ends() -> None:
    poses, rates = samples(is_cubic=False).link_poses_and_rates_at([-1.0, 3.0])
    np.testing.assert_allclose(poses[:, 0, 0, 3], [0.0, 6.0], atol=1e-12)
    assert not rates.any()


def test_a_skin_blends_the_places_and_the_velocities_of_its_joints() -> None:
    moved, still = samples(is_cubic=False).add(np.tile(np.eye(3, 4), (3, 1, 1))), rc.Pose([0.0, 0.0, 1.0])
    twist = rc.Linear(rc.Pose(), velocity=[1.0, 0.0, 0.0], angular_velocity=[0.0, 0.0, 2.0])
    points = np.array([[0.0, 0.5, 0.0], [1.0, 0.0, 0.0]])
    joints, weights = np.array([[0, 1], [1, 2]]), np.array([[0.25, 0.75], [1.0, 0.0]])
    skin = Skin([twist, still, moved], np.tile(np.eye(4), (3, 1, 1)), points, joints, weights)
    pose, rate = twist.at(0.3), twist.rate_at(0.3)
    first = 0.25 * pose.apply(points[0]) + 0.75 * still.apply(points[0])
    np.testing.assert_allclose(skin.at(0.3), [first, still.apply(points[1])], atol=1e-15)
    np.testing.assert_allclose(skin.rate_at(0.3)[0], 0.25 * (rate[:, :3] @ points[0] + rate[:, 3]), atol=1e-15)
    deformation = DeformationFunction(skin.at, 2, skin.rate_at)
    np.testing.assert_array_equal(deformation.rate_at(0.3), skin.rate_at(0.3))
    with pytest.raises(ValueError, match="deformation: expected 4 vertices as the mesh has, got 2"):
        rc.Body(rc.shapes.plate(1.0, 1.0), deformation=deformation)
