"""Poses and motions: the algebra on paper, and rates against differences of places."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import radarcore as rc

EPS = np.finfo(float).eps
"""Step of central differences [s]: eps^(1/3), where truncation and rounding are about equal."""


def turn(axes: str, *angles: float) -> NDArray[Any]:
    """Rotation about fixed axes, one after the other."""
    return Rotation.from_euler(axes, angles).as_matrix()


def random_pose(rng: np.random.Generator) -> rc.Pose:
    return rc.Pose.from_quaternion(rng.uniform(-2.0, 2.0, 3), wxyz=rng.standard_normal(4))


def close(a: Any, b: Any, scale: float = 1.0) -> bool:
    """Equal up to a few roundings of numbers of size `scale`: products of 3x3 matrices are sums of three."""
    return bool(np.abs(np.asarray(a) - np.asarray(b)).max() <= 16.0 * EPS * scale)


def same_pose(a: rc.Pose, b: rc.Pose, scale: float = 4.0) -> bool:
    return close(a.rotation, b.rotation) and close(a.position, b.position, scale)


def test_pose_turns_then_moves() -> None:
    pose = rc.Pose([1.0, 2.0, 3.0], turn("z", np.pi / 2))
    assert close(pose.apply([1.0, 0.0, 0.0]), [1.0, 3.0, 3.0], 4.0)
    assert close(pose.apply(np.ones((2, 5, 3))), np.broadcast_to([0.0, 3.0, 4.0], (2, 5, 3)), 4.0)
    assert rc.Pose() == rc.Pose([0.0, 0.0, 0.0], np.eye(3))
    assert rc.Pose().apply([4.0, 5.0, 6.0]).tolist() == [4.0, 5.0, 6.0]


@pytest.mark.parametrize("seed", range(3))
def test_poses_form_a_group(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, c = (random_pose(rng) for _ in range(3))
    x = rng.uniform(-2.0, 2.0, (7, 3))
    assert close((a @ b).apply(x), a.apply(b.apply(x)), 8.0), f"seed {seed}"
    assert same_pose((a @ b) @ c, a @ (b @ c), 16.0), f"seed {seed}"
    assert same_pose(a @ a.inverse(), rc.Pose()), f"seed {seed}"
    assert same_pose(a.inverse() @ a, rc.Pose()), f"seed {seed}"
    assert same_pose((a @ b).inverse(), b.inverse() @ a.inverse(), 16.0), f"seed {seed}"
    assert same_pose(a.inverse().inverse(), a), f"seed {seed}"
    with pytest.raises(TypeError, match="unsupported operand"):
        a @ [1.0, 0.0, 0.0]  # type: ignore[operator]


@pytest.mark.parametrize(
    ("target", "x", "y", "z"),
    [
        ([5.0, 2.0, 3.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
        ([1.0, 9.0, 3.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ([-4.0, 2.0, 3.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]),
        # 45 degrees down: z leans forward.
        ([2.0, 2.0, 2.0], [0.5**0.5, 0.0, -(0.5**0.5)], [0.0, 1.0, 0.0], [0.5**0.5, 0.0, 0.5**0.5]),
    ],
)
def test_look_at_has_x_to_the_target_y_to_the_left_and_z_up(target: Any, x: Any, y: Any, z: Any) -> None:
    pose = rc.Pose.look_at([1.0, 2.0, 3.0], target)
    assert pose.position.tolist() == [1.0, 2.0, 3.0]
    assert close(pose.rotation, np.column_stack([x, y, z]))


def test_look_at_takes_another_up() -> None:
    down = rc.Pose.look_at([0.0, 0.0, 2.0], [0.0, 0.0, 0.0], up=[1.0, 0.0, 0.0])
    assert close(down.rotation, np.column_stack([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    tilted = rc.Pose.look_at([0.0, 0.0, 0.0], [3.0, 4.0, 0.0], up=[0.0, 1.0, 5.0])
    assert close(tilted.rotation[:, 0], [0.6, 0.8, 0.0])
    assert tilted.rotation[:, 2] @ [0.0, 1.0, 5.0] > 0.0
    assert abs(tilted.rotation[:, 1] @ [0.0, 1.0, 5.0]) <= 16 * EPS * 5.0  # z has all that is across the sight


@pytest.mark.parametrize("length", [1.0, -1.0, 1e-3, 40.0])
def test_quaternions_of_any_length_and_named_order_agree_with_scipy(length: float) -> None:
    for axes, angle in (("x", -2.5), ("y", 0.0), ("z", 1e-9), ("xyz", [0.7, -1.0, np.pi])):
        rotation = Rotation.from_euler(axes, angle)
        x, y, z, w = (length * rotation.as_quat()).tolist()
        for pose in (
            rc.Pose.from_quaternion([1.0, 2.0, 3.0], wxyz=[w, x, y, z]),
            rc.Pose.from_quaternion([1.0, 2.0, 3.0], xyzw=[x, y, z, w]),
        ):
            assert same_pose(pose, rc.Pose([1.0, 2.0, 3.0], rotation.as_matrix())), (axes, length)


def test_pose_from_a_homogeneous_matrix() -> None:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn("z", 0.3), [1.0, 2.0, 3.0]
    for given in (matrix, matrix[:3], matrix.tolist()):
        assert rc.Pose.from_matrix(given) == rc.Pose([1.0, 2.0, 3.0], turn("z", 0.3))


def test_roll_pitch_and_yaw_turn_about_fixed_axes_as_in_urdf() -> None:
    for r, p, y in [(0.3, -0.5, 1.1), (1.2, 0.0, 0.0), (0.0, np.pi / 2, 0.0), (0.0, 0.0, -2.0), (-3.0, 1.5, 2.9)]:
        pose = rc.Pose.from_rpy([1.0, 2.0, 3.0], [r, p, y])
        assert close(pose.rotation, turn("xyz", r, p, y)), (r, p, y)
        assert pose.position.tolist() == [1.0, 2.0, 3.0]
    # Yaw turns left, pitch looks down, roll leans right.
    assert close(rc.Pose.from_rpy([0.0] * 3, [0.0, 0.0, np.pi / 2]).apply([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0])
    assert close(rc.Pose.from_rpy([0.0] * 3, [0.0, np.pi / 2, 0.0]).apply([1.0, 0.0, 0.0]), [0.0, 0.0, -1.0])
    assert close(rc.Pose.from_rpy([0.0] * 3, [np.pi / 2, 0.0, 0.0]).apply([0.0, 0.0, 1.0]), [0.0, -1.0, 0.0])


def test_pose_is_the_same_at_all_times() -> None:
    pose = rc.Pose([1.0, 2.0, 3.0], turn("z", 0.3))
    assert pose.at(17.0) == pose
    assert pose.rate_at(17.0).tolist() == np.zeros((3, 4)).tolist()


def test_rotation_that_is_slightly_off_is_made_one() -> None:
    noisy = turn("z", 0.3) + 1e-7 * np.random.default_rng(0).uniform(-1.0, 1.0, (3, 3))
    pose = rc.Pose(rotation=noisy)
    assert close(pose.rotation @ pose.rotation.T, np.eye(3))
    assert np.abs(pose.rotation - noisy).max() <= 2e-7  # the nearest rotation is no farther than turn("z", 0.3)


def test_poses_are_equal_when_their_numbers_are_and_cannot_be_changed() -> None:
    position, rotation = np.array([1.0, 2.0, 3.0]), turn("z", 0.3)
    pose = rc.Pose(position, rotation)
    assert pose == rc.Pose([1.0, 2.0, 3.0], turn("z", 0.3))
    assert hash(pose) == hash(rc.Pose([1.0, 2.0, 3.0], turn("z", 0.3)))
    assert pose != rc.Pose([1.0, 2.0, 3.1], turn("z", 0.3))
    assert pose != rc.Pose([1.0, 2.0, 3.0], turn("z", 0.4))
    assert pose != "pose"
    position[0] = rotation[0, 0] = 7.0
    assert pose == rc.Pose([1.0, 2.0, 3.0], turn("z", 0.3))
    for values in (pose.position, pose.rotation):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_linear_motion_goes_straight_and_turns_evenly(axis: str) -> None:
    start = rc.Pose([1.0, 2.0, 3.0], turn("xz", -0.2, 0.4))
    angular_velocity = 3.0 * np.eye(3)["xyz".index(axis)]
    motion = rc.Linear(start, velocity=[0.5, -1.0, 2.0], angular_velocity=angular_velocity)
    for time in (-1.3, 0.0, 1e-6, 0.8, 10.0):
        pose = motion.at(time)
        # World axes: the turn comes from the left. 30 rad are reduced modulo a turn with an error of 30 eps.
        assert close(pose.rotation, turn(axis, 3.0 * time) @ start.rotation, 4.0), time
        assert close(pose.position, [1.0 + 0.5 * time, 2.0 - time, 3.0 + 2.0 * time], 32.0), time
    assert motion.at(0.0) == start


ZERO = [0.0, 0.0, 0.0]


def test_directions_of_any_length_give_the_pose_of_their_direction() -> None:
    for length in (1e-200, 1.0, 1e200):
        turned = rc.Pose.from_quaternion(ZERO, wxyz=[length, 0.0, 0.0, length])
        np.testing.assert_allclose(turned.rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
        np.testing.assert_allclose(
            rc.Pose.look_at(ZERO, [0, 1, 0], [0, 0, length]).rotation, turned.rotation, atol=1e-15
        )
