"""Live motions: before, between and after updates against answers on paper, and in simulations."""

from __future__ import annotations

import pickle
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.models import RobotArm
from radarcore.motion.group import Motions

ROUNDING = 1e-12
"""Of places a few metres away and rates of a few m/s, after some products."""

START = rc.Pose.from_rpy([1.0, -2.0, 0.5], [0.3, 0.2, 0.1])
VELOCITY, TURNING = np.array([0.3, -0.2, 0.1]), np.array([0.1, 0.4, -0.7])
PLATE = rc.shapes.plate(0.2, 0.2)
RADAR = rc.bgt60tr13c(num_chirps=8, num_samples=64)


def turned(axis: Any, angle: float) -> rc.Pose:
    unit = np.array(axis) / np.linalg.norm(axis)
    return rc.Pose.from_quaternion([0.0, 0.0, 0.0], wxyz=[np.cos(angle / 2), *(np.sin(angle / 2) * unit)])


def test_pose_goes_on_at_the_velocities_of_the_newest_update() -> None:
    live, linear = rc.Live(), rc.Linear(START, VELOCITY, TURNING)
    live.update(4.0, rc.Pose())
    live.update(5.0, START, VELOCITY, TURNING)
    elapsed = np.array([0.0, 0.01, 0.5])
    np.testing.assert_allclose(live.poses_at(5.0 + elapsed), linear.poses_at(elapsed), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(live.rate_at(5.5), linear.rate_at(0.5), rtol=0, atol=ROUNDING)
    assert live.at(5.0) == START
    assert live.newest == 5.0


def cubic(time: float) -> tuple[rc.Pose, NDArray[np.float64], NDArray[np.float64]]:
    """A cubic along a line and a turn by a cubic about a fixed axis: pose, velocity, angular velocity."""
    line, axis = np.array([1.0, -2.0, 0.5]), np.array([2.0, 1.0, -2.0]) / 3.0
    where, slope = time - 2.0 * time**2 + time**3, 1.0 - 4.0 * time + 3.0 * time**2
    pose = turned(axis, 1.5 * where)
    return rc.Pose(where * line, pose.rotation @ START.rotation), slope * line, 1.5 * slope * axis


def test_motions_along_cubics_are_exact_between_updates_and_so_are_their_rates() -> None:
    live = rc.Live()
    for time in (0.0, 0.3, 0.9):
        live.update(time, *cubic(time))
    for time in (0.1, 0.3, 0.45, 0.8):
        pose, velocity, turning = cubic(time)
        np.testing.assert_allclose(live.at(time).position, pose.position, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(live.at(time).rotation, pose.rotation, rtol=0, atol=ROUNDING)
        rate = np.column_stack([np.cross(turning, pose.rotation, axisb=0).T, velocity])
        np.testing.assert_allclose(live.rate_at(time), rate, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("seed", range(2))
def test_tumbling_motion_has_the_given_poses_and_rates_and_is_smooth(seed: int) -> None:
    rng, live = np.random.default_rng(seed), rc.Live()
    times = [0.0, 0.05, 0.08]
    poses = [turned(rng.standard_normal(3), angle) for angle in (0.2, 0.9, 1.3)]
    rates = rng.standard_normal((3, 2, 3))
    for time, pose, (velocity, turning) in zip(times, poses, 5.0 * rates, strict=True):
        live.update(time, pose, velocity, turning)
    for time, pose, (velocity, turning) in zip(times, poses, 5.0 * rates, strict=True):
        expected = np.column_stack([np.cross(turning, pose.rotation, axisb=0).T, velocity])
        # From both sides: change of a continuous rate in a nanosecond, at accelerations of 1e4 / s^2.
        for side in (-1e-9, 0.0, 1e-9):
            np.testing.assert_allclose(live.rate_at(time + side), expected, rtol=0, atol=1e-4), f"seed {seed}"
            np.testing.assert_allclose(live.at(time + side).rotation, pose.rotation, rtol=0, atol=1e-7)
    # Rates are the slopes of poses, by differences of fourth order.
    for time in (0.013, 0.06, 0.09):
        near, far = ((live.poses_at([time + h]) - live.poses_at([time - h]))[0] / (2 * h) for h in (1e-4, 2e-4))
        np.testing.assert_allclose(live.rate_at(time), (4.0 * near - far) / 3.0, rtol=0, atol=2e-6), f"seed {seed}"


def test_past_rates_that_are_not_given_are_those_of_a_parabola() -> None:
    live = rc.Live()
    live.update(0.0, rc.Pose())
    assert not live.rate_at(0.0).any()  # nothing is known yet
    for time in (0.1, 0.3, 0.4):
        live.update(time, rc.Pose([3.0 * time**2, 0.0, 0.0], turned([0, 0, 1], time**2).rotation))
    # The newest by the last two updates, those between on the parabola.
    np.testing.assert_allclose(live.rate_at(0.4)[0, 3], 3.0 * (0.4 + 0.3), rtol=0, atol=ROUNDING)
    for time in (0.1, 0.15, 0.2, 0.3):
        np.testing.assert_allclose(live.at(time).position[0], 3.0 * time**2, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(live.rate_at(time)[0, 3], 6.0 * time, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(live.at(time).rotation, turned([0, 0, 1], time**2).rotation, rtol=0, atol=ROUNDING)


def test_update_at_the_same_time_replaces_the_newest() -> None:
    live = rc.Live()
    for time, x in ((0.0, 0.0), (0.1, 1.0), (0.2, 7.0), (0.2, 2.0), (0.3, 3.0)):
        live.update(time, rc.Pose([x, 0.0, 0.0]))
    np.testing.assert_allclose([live.at(time).position[0] for time in (0.05, 0.15, 0.25, 0.35)], [0.5, 1.5, 2.5, 3.5])


def group_of_two() -> rc.LiveGroup:
    group = rc.LiveGroup(2)
    maps = np.tile(np.eye(4), (2, 1, 1))
    for time in (0.0, 0.1):
        maps[:, 0, 3] = 1.0 + time, 2.0 - 3.0 * time
        group.update(time, maps, velocities=[[0.5, 0.0, 0.0], [np.nan] * 3], angular_velocities=np.zeros((2, 3)))
    return group


def test_rows_of_nan_are_rates_that_are_not_given() -> None:
    poses = group_of_two().link_poses_at([0.1, 0.2])
    np.testing.assert_allclose(poses[..., 0, 3], [[1.1, 1.7], [1.15, 1.4]], rtol=0, atol=ROUNDING)


def test_poses_of_a_group_come_in_any_form() -> None:
    poses = [START, START @ turned([0, 1, 1], 0.4)]
    square = np.array([np.vstack([np.column_stack([p.rotation, p.position]), [0, 0, 0, 1]]) for p in poses])
    for given in (poses, square, square[:, :3], square[:, :3] + 1e-8 * np.eye(3, 4)):
        group = rc.LiveGroup(2)
        group.update(0.0, given)
        maps = group.link_poses_at([0.0])[0]
        np.testing.assert_allclose(maps, square[:, :3], rtol=0, atol=2e-8)
        rotations = maps[:, :, :3]
        np.testing.assert_allclose(rotations @ rotations.swapaxes(1, 2), [np.eye(3)] * 2, rtol=0, atol=ROUNDING)


def test_live_motions_evaluated_together_are_those_alone() -> None:
    lives = [rc.Live() for _ in range(3)]
    for k, live in enumerate(lives):
        live.update(0.1 * k, START, VELOCITY, k * TURNING)
    group = group_of_two()
    motions = [lives[0], group[1], lives[2], rc.Attached(lives[1], group[0]), lives[1], group[0]]
    together = Motions(motions)
    for times in (np.array([0.2, 0.3]), np.array([0.15, 0.25])):  # behind all updates, and before the last of them
        for _ in range(2):
            poses = np.stack([motion.poses_at(times) for motion in motions], axis=1)
            rates = np.stack([[motion.rate_at(time) for time in times.tolist()] for motion in motions], axis=1)
            np.testing.assert_allclose(together.poses_at(times), poses, rtol=0, atol=ROUNDING)
            np.testing.assert_allclose(together.rates_at(times), rates, rtol=0, atol=ROUNDING)
            lives[0].update(0.15, START, -VELOCITY)


def test_first_updates_are_forgotten_after_256() -> None:
    live = rc.Live()
    for step in range(400):
        live.update(0.01 * step, rc.Pose([step, 0.0, 0.0]))
    assert live.at(1.445).position[0] == pytest.approx(144.5, abs=ROUNDING)
    with pytest.raises(ValueError, match=r"time: expected 1\.44 s, the first update of this Live motion that is kept"):
        live.at(1.3)


def test_long_after_the_newest_update_there_is_one_warning() -> None:
    live, still = rc.Live(), rc.Live()
    live.update(1.0, START, VELOCITY)
    still.update(1.0, START, np.zeros(3))
    assert still.at(100.0) == START
    with pytest.warns(UserWarning, match="asked for 2 s after its newest update, at 1 s: it continues"):
        live.at(3.0)
    live.at(4.0)


def updated(time: float, **values: Any) -> rc.Live:
    live = rc.Live()
    live.update(1.0, rc.Pose())
    live.update(time, **({"pose": rc.Pose()} | values))
    return live


MAPS = np.tile(np.eye(4), (2, 1, 1))


def test_no_times_are_no_poses() -> None:
    live = updated(2.0)
    live.update(2.5, START)
    assert live.poses_at([]).shape == live.rates_at([]).shape == (0, 3, 4)
    assert Motions([live, rc.Linear(START, velocity=[1.0, 0.0, 0.0])]).poses_at(np.empty(0)).shape == (0, 2, 3, 4)


def test_time_may_start_again_after_clear() -> None:
    live = updated(2.0)
    live.clear()
    assert live.newest == -np.inf
    live.update(0.0, START)
    assert live.at(0.0) == START


def test_simulator_starts_at_the_newest_update_of_anything_that_is_live() -> None:
    body, carrier, base, sensor = (rc.Live() for _ in range(4))
    group = group_of_two()
    arm = RobotArm.ur10().moving(np.zeros(6), base=base)
    motions = [body, rc.Attached(carrier, rc.Pose()), arm.link_motion("tool0"), group[0]]
    scene = rc.Scene(rc.Body(PLATE, motion=motion) for motion in motions)
    simulator = rc.Simulator(scene, RADAR, resolution=16, radar_motion=sensor)
    with pytest.raises(ValueError, match="Live: expected an update before"):
        simulator.frame()
    still, lives = np.zeros((2, 3)), (body, carrier, base, sensor)
    places = [rc.Pose([2.0, 0.0, 0.0]), rc.Pose([1.0, 0.3, 0.0]), rc.Pose([2.5, 3.0, 0.0]), rc.Pose()]
    for time in (0.0, 0.5):
        for number, (live, place) in enumerate(zip(lives, places, strict=True)):
            live.update(time + 0.1 * number, place, *still)
            if time == 0.5:
                assert simulator.frame().time == live.newest == 0.5 + 0.1 * number
    group.update(0.9, [rc.Pose([4.0, 0.0, 0.0]), rc.Pose()], velocities=still, angular_velocities=still)
    assert simulator.frame().time == simulator.depth_image().time == 0.9
    assert rc.Simulator(rc.Scene([rc.PointTarget([1, 0, 0])]), RADAR).frame().time == 0.0


@pytest.mark.filterwarnings("ignore:.* planned frames, its writer was interrupted")  # as it still writes
def test_recording_takes_updates_between_frames(tmp_path: Path) -> None:
    live, finished = rc.Live(), []

    def program(time: float) -> rc.Pose:
        """Another body, asked for at the times of every frame: updates the live one as a frame begins."""
        if live.newest < (start := 0.1 * np.floor(10.0 * time + 1e-6)) - 1e-6:
            finished.append(len(rc.Recording.load(path)) if live.newest > 0.0 else round(10.0 * start))
            live.update(start, rc.Pose([1.0 + start, 0.0, 0.0]), np.zeros(3))
        return rc.Pose([3.0, 0.5, 0.0])

    path = tmp_path / "recording"
    scene = rc.Scene([rc.Body(PLATE, motion=live, name="live"), rc.Body(PLATE, motion=program)])
    simulator = rc.Simulator(scene, RADAR, resolution=16, threads=2)
    recording = simulator.record(0.0, 0.4, rate=10.0, path=path, progress=False)
    assert finished == [0, 1, 2, 3]  # every frame is placed when the one before is written
    assert recording.truth is not None
    np.testing.assert_allclose(recording.truth.range[:, 0], [1.0, 1.1, 1.2, 1.3], rtol=0, atol=1e-5)


def test_another_thread_may_update_while_poses_are_asked_for() -> None:
    group, stop = rc.LiveGroup(2), Event()
    group.update(0.0, MAPS, velocities=np.ones((2, 3)))

    def program() -> None:
        step = 0
        while not stop.wait(1e-3):
            step += 1
            poses = MAPS + 0.0
            poses[:, :3, 3] = 1e-3 * step
            group.update(1e-3 * step, poses, velocities=np.ones((2, 3)))

    thread = Thread(target=program)
    thread.start()
    try:
        for _ in range(200):
            newest = group.newest
            times = newest + np.array([-0.002, -0.0005, 0.0, 0.01]) * (newest > 0.01)
            # All move at 1 m/s along each axis, whatever the updates are by now.
            places = group.link_poses_at(times)[..., 3]
            np.testing.assert_allclose(places, np.broadcast_to(times[:, None, None], (4, 2, 3)), rtol=0, atol=1e-9)
    finally:
        stop.set()
        thread.join()
    assert group.newest > 0.0


def test_pickled_scene_keeps_its_updates_and_its_group() -> None:
    group = group_of_two()
    scene = rc.Scene(rc.Body(PLATE, motion=motion) for motion in group.motions)
    first, second = (body.motion for body in pickle.loads(pickle.dumps(scene)).bodies)
    np.testing.assert_array_equal(first.group.link_poses_at([0.05, 0.2]), group.link_poses_at([0.05, 0.2]))
    first.group.update(0.3, MAPS)
    assert second.newest == 0.3
    assert group.newest == 0.1


def test_text_says_what_is_known() -> None:
    assert repr(rc.Live()) == "<Live: no update yet>"
    assert repr(group_of_two()) == "<LiveGroup of 2 bodies: 2 updates, the newest at 0.1 s>"
