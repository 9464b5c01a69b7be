"""Poses and motions: the algebra on paper, and rates against differences of places."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import radarcore as rc

C = 299_792_458.0  # [m/s]
EPS = np.finfo(float).eps
STEP = 1e-5
"""Step of central differences [s]: eps^(1/3), where truncation and rounding are about equal."""


def rx(angle: float) -> NDArray[Any]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def ry(angle: float) -> NDArray[Any]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rz(angle: float) -> NDArray[Any]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def random_pose(rng: np.random.Generator) -> rc.Pose:
    return rc.Pose.from_quaternion(rng.uniform(-2.0, 2.0, 3), wxyz=rng.standard_normal(4))


def close(a: Any, b: Any, scale: float = 1.0) -> bool:
    """Equal up to a few roundings of numbers of size `scale`: products of 3x3 matrices are sums of three."""
    return bool(np.abs(np.asarray(a) - np.asarray(b)).max() <= 16.0 * EPS * scale)


def same_pose(a: rc.Pose, b: rc.Pose, scale: float = 4.0) -> bool:
    return close(a.rotation, b.rotation) and close(a.position, b.position, scale)


def test_pose_turns_then_moves() -> None:
    pose = rc.Pose([1.0, 2.0, 3.0], rz(np.pi / 2))
    assert close(pose.apply([1.0, 0.0, 0.0]), [1.0, 3.0, 3.0], 4.0)
    assert close(pose.apply(np.ones((2, 5, 3))), np.broadcast_to([0.0, 3.0, 4.0], (2, 5, 3)), 4.0)
    assert rc.Pose() == rc.Pose([0.0, 0.0, 0.0], np.eye(3))
    assert rc.Pose().apply([4.0, 5.0, 6.0]).tolist() == [4.0, 5.0, 6.0]


@pytest.mark.parametrize("seed", range(5))
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


@pytest.mark.parametrize(("axis", "turn"), [(0, rx), (1, ry), (2, rz)])
def test_quaternion_is_w_x_y_z_of_any_length(axis: int, turn: Any) -> None:
    for angle in (-2.5, 0.0, 1e-9, 0.7, np.pi):
        quaternion = np.zeros(4)
        quaternion[0], quaternion[1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
        for length in (1.0, -1.0, 1e-3, 40.0):
            pose = rc.Pose.from_quaternion([1.0, 2.0, 3.0], wxyz=length * quaternion)
            assert close(pose.rotation, turn(angle)), (angle, length)
            assert pose.position.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("seed", range(5))
def test_quaternion_of_any_axis_agrees_with_scipy(seed: int) -> None:
    w, x, y, z = quaternion = np.random.default_rng(seed).standard_normal(4)
    expected = Rotation.from_quat([x, y, z, w]).as_matrix()
    assert close(rc.Pose.from_quaternion([0.0, 0.0, 0.0], wxyz=quaternion).rotation, expected), f"seed {seed}"


@pytest.mark.parametrize("seed", range(5))
def test_order_of_a_quaternion_is_named(seed: int) -> None:
    w, x, y, z = np.random.default_rng(seed).standard_normal(4).tolist()
    by_name = rc.Pose.from_quaternion([1.0, 2.0, 3.0], wxyz=[w, x, y, z])
    assert same_pose(rc.Pose.from_quaternion([1.0, 2.0, 3.0], xyzw=[x, y, z, w]), by_name)


@pytest.mark.parametrize(
    ("given", "named", "message"),
    [
        ([], {}, "expected one of wxyz= and xyzw=, got none"),
    ],
)
def test_quaternion_without_the_name_of_its_order_is_refused(given: list[Any], named: Any, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        rc.Pose.from_quaternion([1.0, 2.0, 3.0], *given, **named)


def test_pose_from_a_homogeneous_matrix() -> None:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rz(0.3), [1.0, 2.0, 3.0]
    for given in (matrix, matrix[:3], matrix.tolist()):
        assert rc.Pose.from_matrix(given) == rc.Pose([1.0, 2.0, 3.0], rz(0.3))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rc.Pose.from_quaternion([0, 0, 0], wxyz=[0, 0, 0, 0]), r"wxyz: expected \(w, x, y, z\) of any length"),
        (lambda: rc.Pose.from_quaternion([0, 0, 0], xyzw=[0, 0, 0, 0]), r"xyzw: expected \(x, y, z, w\) of any length"),
        (
            lambda: rc.Pose.from_matrix(np.eye(4).T + np.eye(4, k=-3)),
            "expected a last row of 0, 0, 0, 1, got 1, 0, 0, 1",
        ),
        (lambda: rc.Pose.from_matrix(np.diag([1, 1, 2, 1])), "rotation: expected a rotation matrix"),
    ],
)
def test_silly_matrices_and_quaternions_are_errors_that_name_them(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_roll_pitch_and_yaw_turn_about_fixed_axes_as_in_urdf() -> None:
    for r, p, y in [(0.3, -0.5, 1.1), (1.2, 0.0, 0.0), (0.0, np.pi / 2, 0.0), (0.0, 0.0, -2.0), (-3.0, 1.5, 2.9)]:
        pose = rc.Pose.from_rpy([1.0, 2.0, 3.0], [r, p, y])
        assert close(pose.rotation, rz(y) @ ry(p) @ rx(r)), (r, p, y)
        assert pose.position.tolist() == [1.0, 2.0, 3.0]
    # Yaw turns left, pitch looks down, roll leans right.
    assert close(rc.Pose.from_rpy([0.0] * 3, [0.0, 0.0, np.pi / 2]).apply([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0])
    assert close(rc.Pose.from_rpy([0.0] * 3, [0.0, np.pi / 2, 0.0]).apply([1.0, 0.0, 0.0]), [0.0, 0.0, -1.0])
    assert close(rc.Pose.from_rpy([0.0] * 3, [np.pi / 2, 0.0, 0.0]).apply([0.0, 0.0, 1.0]), [0.0, -1.0, 0.0])


def test_pose_is_the_same_at_all_times() -> None:
    pose = rc.Pose([1.0, 2.0, 3.0], rz(0.3))
    assert pose.at(17.0) == pose
    assert pose.rate_at(17.0).tolist() == np.zeros((3, 4)).tolist()


def test_rotation_that_is_slightly_off_is_made_one() -> None:
    noisy = rz(0.3) + 1e-7 * np.random.default_rng(0).uniform(-1.0, 1.0, (3, 3))
    pose = rc.Pose(rotation=noisy)
    assert close(pose.rotation @ pose.rotation.T, np.eye(3))
    assert np.abs(pose.rotation - noisy).max() <= 2e-7  # the nearest rotation is no farther than that of rz(0.3)


def test_poses_are_equal_when_their_numbers_are_and_cannot_be_changed() -> None:
    position, rotation = np.array([1.0, 2.0, 3.0]), rz(0.3)
    pose = rc.Pose(position, rotation)
    assert pose == rc.Pose([1.0, 2.0, 3.0], rz(0.3))
    assert hash(pose) == hash(rc.Pose([1.0, 2.0, 3.0], rz(0.3)))
    assert pose != rc.Pose([1.0, 2.0, 3.1], rz(0.3))
    assert pose != rc.Pose([1.0, 2.0, 3.0], rz(0.4))
    assert pose != "pose"
    position[0] = rotation[0, 0] = 7.0
    assert pose == rc.Pose([1.0, 2.0, 3.0], rz(0.3))
    for values in (pose.position, pose.rotation):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


@pytest.mark.parametrize(("axis", "turn"), [(0, rx), (1, ry), (2, rz)])
def test_linear_motion_goes_straight_and_turns_evenly(axis: int, turn: Any) -> None:
    start = rc.Pose([1.0, 2.0, 3.0], rz(0.4) @ rx(-0.2))
    angular_velocity = 3.0 * np.eye(3)[axis]
    motion = rc.Linear(start, velocity=[0.5, -1.0, 2.0], angular_velocity=angular_velocity)
    for time in (-1.3, 0.0, 1e-6, 0.8, 10.0):
        pose = motion.at(time)
        # World axes: the turn comes from the left. 30 rad are reduced modulo a turn with an error of 30 eps.
        assert close(pose.rotation, turn(3.0 * time) @ start.rotation, 4.0), time
        assert close(pose.position, [1.0 + 0.5 * time, 2.0 - time, 3.0 + 2.0 * time], 32.0), time
    assert motion.at(0.0) == start


@pytest.mark.parametrize("seed", range(5))
def test_delay_rate_is_the_derivative_of_the_delay_for_moving_sensor_and_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    targets = [rc.PointTarget(rng.uniform(3.0, 5.0, 3), velocity=rng.uniform(-3.0, 3.0, 3)) for _ in range(4)]
    radar = rc.Radar(
        rc.Waveform(start_frequency=60e9, slope=1e13, sample_rate=2e6, num_samples=8),
        tx=rng.uniform(-0.1, 0.1, (2, 3)),
        rx=rng.uniform(-0.1, 0.1, (3, 3)),
    )
    sensor = rc.Linear(rc.Pose(), velocity=rng.uniform(-1.0, 1.0, 3), angular_velocity=rng.uniform(-1.0, 1.0, 3))
    sim = rc.Simulator(rc.Scene(targets), radar, radar_motion=sensor, resolution=2)
    before, now, after = (sim.paths(time).delay for time in (-STEP, 0.0, STEP))
    rate = sim.paths(0.0).delay_rate
    assert rate.shape == now.shape == (6, 4)
    # |d^3 R / dt^3| of a distance R > 4 m at relative speed u < 7 m/s (4 sqrt(3)) is below 1.5 u^3 / R^2 = 35 m/s^3;
    # antennas 0.2 m off axis that turn at 1.8 rad/s add less than as much again, in both ways.
    bound = (STEP**2 / 6.0 * 2.0 * 70.0 + 16.0 * EPS * 20.0 / STEP) / C
    assert np.abs((after - before) / (2.0 * STEP) - rate).max() <= bound, f"seed {seed}"


NAN = float("nan")
ZERO = [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("make", "arguments", "error", "message"),
    [
        (rc.Pose, (ZERO, np.diag([1.0, 1.0, -1.0])), ValueError, "rotation: expected a rotation.*determinant -1"),
        (rc.Pose, (ZERO, 1.001 * np.eye(3)), ValueError, "rotation: expected a rotation.*deviation 0.002"),
        (rc.Pose, (ZERO, np.eye(3) + 1e-5 * np.eye(3, k=1)), ValueError, "rotation: expected a rotation.*1e-05"),
        (rc.Pose, (ZERO, np.zeros((3, 3))), ValueError, "rotation: expected a rotation.*determinant 0"),
        (rc.Pose, (ZERO, 1e200 * np.eye(3)), ValueError, "rotation: expected entries of a rotation.*got 1e\\+200"),
        (rc.Pose, ([0.0, 1e200, 0.0],), ValueError, r"position: expected coordinates within 1e\+15 m, got 1e\+200"),
        (
            rc.Pose.from_rpy,
            (ZERO, [0.0, 1e200, 0.0]),
            ValueError,
            r"rpy: expected angles within 1e\+06 rad, got 1e\+200",
        ),
        (rc.Pose.look_at, (ZERO, [1e200, 0.0, 0.0]), ValueError, r"target: expected coordinates within 1e\+15 m"),
        (rc.PointTarget, ([1e200, 0.0, 0.0],), ValueError, r"position: expected coordinates within 1e\+15 m"),
        (rc.Pose.look_at, (ZERO, ZERO), ValueError, "target: expected a point other than the position"),
        (rc.Pose.look_at, (ZERO, [0.0, 0.0, 2.0]), ValueError, "up: expected a direction that is not along"),
        (rc.Pose.look_at, (ZERO, [1.0, 0.0, 0.0], ZERO), ValueError, "up: expected a direction"),
        (rc.Linear, (np.eye(4),), TypeError, "pose: expected Pose, got ndarray"),
        (rc.Linear, (rc.Pose(), [0.0, -4e8, 0.0]), ValueError, r"velocity: expected less than 3e\+08 m/s, got -4e\+08"),
        (rc.Linear, (rc.Pose(), ZERO, [0.0, 1e300, 0.1]), ValueError, r"expected less than 1e\+07 rad/s, got 1e\+300"),
        (
            rc.PointTarget,
            (ZERO, 1.0, [4e8, 0.0, 0.0]),
            ValueError,
            r"velocity: expected less than 3e\+08 m/s, got 4e\+08",
        ),
    ],
)
def test_what_is_no_motion_is_refused_with_its_name(
    make: Any, arguments: tuple[Any, ...], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        make(*arguments)


def test_bodies_and_simulators_refuse_what_does_not_move_like_a_motion() -> None:
    plate = rc.shapes.plate(0.2, 0.1)
    with pytest.raises(TypeError, match=r"motion: expected Pose, Linear, .* got ndarray"):
        rc.Body(plate, motion=np.eye(4))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"radar_motion: expected Pose, Linear, .* got tuple"):
        rc.Simulator(rc.Scene(), rc.bgt60tr13c(), radar_motion=(1.0, 0.0, 0.0))  # type: ignore[arg-type]


def test_directions_of_any_length_give_the_pose_of_their_direction() -> None:
    for length in (1e-200, 1.0, 1e200):
        turned = rc.Pose.from_quaternion(ZERO, wxyz=[length, 0.0, 0.0, length])
        np.testing.assert_allclose(turned.rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
        np.testing.assert_allclose(
            rc.Pose.look_at(ZERO, [0, 1, 0], [0, 0, length]).rotation, turned.rotation, atol=1e-15
        )
