"""Motions at the times of frames: as at one time after another, and no oftener asked for than needed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from arms import matrix
from radarcore.models import Human, JointTrajectory, RobotArm
from radarcore.models.robots.arm import RADAR_AT_TOOL0
from radarcore.motion.group import Motions
from radarcore.motion.protocol import FunctionMotion, Motion, poses_at

ROUNDING = 1e-12
"""Of places a few metres away, after chains of ten products [m]."""

TIMES = np.array([1.3, -0.4, 0.0, 2.0, 5.5, 0.7, 2.0])
"""In no order, one twice; some before the first and after the last time of trajectories [s]."""


def swaying(time: float) -> rc.Pose:
    return rc.Pose.from_rpy([0.2 * np.sin(time), time, 0.0], [0.1 * time, -0.2, np.cos(time)])


class OneByOne:
    """A motion that knows one time at a time."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion

    def at(self, time: float) -> rc.Pose:
        return self._motion.at(time)

    def rate_at(self, time: float) -> NDArray[np.float64]:
        return self._motion.rate_at(time)


LINEAR = rc.Linear(rc.Pose.from_rpy([1.0, -2.0, 0.5], [0.3, 0.2, 0.1]), [0.3, -0.2, 0.1], [0.1, 0.4, -0.7])
TRAJECTORY = rc.Trajectory(
    [0.0, 0.7, 1.5, 2.0], [swaying(time) for time in (0.0, 0.7, 1.5, 2.0)], extrapolate="continue"
)
WALKER = Human(path=[[5.6, 2.4], [3.3, 1.3], [3.3, -0.9]], start_time=-0.2, phase=0.3)


def moving_arm(base: Any = LINEAR) -> Any:
    angles = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 6))
    return RobotArm.ur10().moving(JointTrajectory([0.0, 0.7, 1.5, 2.0], angles), base)


def swinging_arm() -> Any:
    return RobotArm.ur10().moving(lambda time: 0.3 * np.sin(time + np.arange(6.0)))


MOTIONS: dict[str, Callable[[], Motion]] = {
    "pose": lambda: LINEAR.pose,
    "linear": lambda: LINEAR,
    "linear that does not turn": lambda: rc.Linear(LINEAR.pose, [1.0, 0.0, 0.0]),
    "trajectory": lambda: TRAJECTORY,
    "function": lambda: FunctionMotion(swaying),
    "attached": lambda: rc.Attached(LINEAR, TRAJECTORY),
    "attached to what is attached": lambda: rc.Attached(rc.Attached(TRAJECTORY, swaying), rc.Attached(LINEAR)),
    "link of an arm": lambda: moving_arm().link_motion("forearm_link"),
    "link of an arm moved by a function": lambda: swinging_arm().link_motion("tool0"),
    "link of an arm at rest on what moves": lambda: RobotArm.ur10().moving(np.ones(6), TRAJECTORY).link_motion("tool0"),
    "sensor on an arm": lambda: rc.Attached(moving_arm().link_motion("tool0"), RADAR_AT_TOOL0),
    "trunk of a person": lambda: WALKER.segment_motion("trunk"),
    "hand of a person": lambda: WALKER.segment_motion("right_hand"),
    "motion of one's own": lambda: OneByOne(TRAJECTORY),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_poses_at_many_times_are_those_at_one_after_another(name: str) -> None:
    together = poses_at(MOTIONS[name](), TIMES)
    alone = [matrix(MOTIONS[name]().at(time)) for time in TIMES.tolist()]
    assert together.shape == (len(TIMES), 3, 4)
    np.testing.assert_allclose(together, alone, rtol=0.0, atol=ROUNDING)
    # One motion that is asked for different times in turn does not mix them up.
    motion = MOTIONS[name]()
    for times in (TIMES, TIMES[2:3], TIMES[::-1], TIMES):
        np.testing.assert_allclose(poses_at(motion, times), poses_at(MOTIONS[name](), times), rtol=0.0, atol=ROUNDING)


def test_poses_at_many_times_are_those_on_paper() -> None:
    # A quarter turn per second about z, and 2 m/s along x.
    motion = rc.Linear(rc.Pose([0.0, 1.0, 0.0]), [2.0, 0.0, 0.0], [0.0, 0.0, 0.5 * np.pi])
    x, y, z = np.eye(3)
    expected = [np.column_stack([*axes, [2.0 * time, 1.0, 0.0]]) for time, axes in enumerate([(x, y, z), (y, -x, z)])]
    np.testing.assert_allclose(motion.poses_at([0.0, 1.0]), expected, atol=ROUNDING)


class Wheel:
    """A motion that knows all times at once, and counts how often it is asked."""

    def __init__(self, shape: tuple[int, ...] = (3, 4)) -> None:
        self.asked, self._shape = 0, shape

    def at(self, time: float) -> rc.Pose:
        raise AssertionError(f"asked for the single time {time}")

    def rate_at(self, time: float) -> NDArray[np.float64]:
        return LINEAR.rate_at(time)

    def poses_at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        self.asked += 1
        return LINEAR.poses_at(times)[:, : self._shape[0], : self._shape[1]]


def test_motion_of_ones_own_may_know_all_times_at_once() -> None:
    wheel = Wheel()
    mounted = rc.Attached(wheel, TRAJECTORY)
    np.testing.assert_allclose(mounted.poses_at(TIMES), rc.Attached(LINEAR, TRAJECTORY).poses_at(TIMES), atol=ROUNDING)
    assert wheel.asked == 1
    with pytest.raises(ValueError, match=r"poses_at: expected shape \(7, 3, 4\), got \(7, 3, 3\)"):
        poses_at(Wheel((3, 3)), TIMES)


def test_motions_together_are_those_of_each_alone() -> None:
    motions = [make() for make in MOTIONS.values()]
    together = Motions(motions)
    for times in (TIMES, TIMES[:1], TIMES[::-1]):
        poses, rates = together.poses_at(times), together.rates_at(times)
        assert poses.shape == rates.shape == (len(times), len(motions), 3, 4)
        for number, motion in enumerate(motions):
            alone = poses_at(motion, times)
            np.testing.assert_allclose(poses[:, number], alone, rtol=0.0, atol=ROUNDING)
            rate = [motion.rate_at(time) for time in times.tolist()]
            np.testing.assert_allclose(rates[:, number], rate, rtol=0.0, atol=1e-9)


def test_motions_at_rest_have_equal_bits_at_all_times() -> None:
    arm = RobotArm.ur10().moving(np.ones(6), rc.Pose([1.0, 2.0, 3.0]))
    resting = [LINEAR.pose, rc.Linear(LINEAR.pose, np.zeros(3)), rc.Attached(LINEAR.pose, rc.Pose([1.0, 0.0, 0.0]))]
    together = Motions([*resting, LINEAR, *(body.motion for body in arm.bodies())])
    poses = together.poses_at(np.concatenate([TIMES, [1e6]]))
    moves = (poses != poses[:1]).any(axis=(0, 2, 3))
    assert moves.tolist() == [False] * 3 + [True] + [False] * len(arm.bodies())


def radar() -> rc.Radar:
    return rc.Radar(
        rc.Waveform.from_sweep(
            start_frequency=60e9,
            stop_frequency=61e9,
            sample_rate=2e6,
            num_samples=32,
            num_chirps=16,
            chirp_interval=300e-6,
        ),
        rx=[[0.0, 0.0, 0.0], [0.0, 0.0025, 0.0]],
    )


def simulator(bodies: list[Any], radar_motion: Any = None, **options: Any) -> rc.Simulator:
    return rc.Simulator(
        rc.Scene(bodies), radar(), radar_motion=radar_motion, resolution=48, field_of_view_deg=(80.0, 60.0), **options
    )


def test_no_function_is_asked_twice_for_a_time_of_a_frame() -> None:
    asked: list[tuple[str, float]] = []

    def counted(name: str, pose: Callable[[float], rc.Pose]) -> Callable[[float], rc.Pose]:
        def motion(time: float) -> rc.Pose:
            asked.append((name, time))
            return pose(time)

        return motion

    ball = rc.shapes.sphere(0.2, subdivisions=2)

    def breathing(time: float) -> NDArray[np.float64]:
        asked.append(("shape", time))
        return ball.vertices * (1.0 + 0.1 * np.sin(time))

    bodies = [
        rc.Body(
            ball, motion=counted("ball", lambda time: rc.Pose([2.0 - 0.3 * time, 0.0, 0.0])), deformation=breathing
        ),
        rc.Body(rc.shapes.plate(0.5, 0.5), motion=counted("plate", lambda time: rc.Pose([3.0, 0.4 * time**2, 0.0]))),
    ]
    sensor = counted("sensor", lambda time: rc.Pose([0.0, 0.0, 0.1 * time]))
    sim = simulator(bodies, sensor, sampling="adaptive")
    sim.frame(0.5)  # before the first, antennas are looked for in bodies
    for _ in range(2):
        asked.clear()
        sim.frame(0.5)
        placed = [call for call in asked if call[0] != "shape"]
        # At 17 times; shapes at about half of them.
        assert len(placed) == len(set(placed)) == 3 * 17
        shapes = [time for name, time in asked if name == "shape"]
        assert len(shapes) == len(set(shapes)) == 9


def test_what_functions_of_time_depend_on_may_change_from_frame_to_frame() -> None:
    distance = 2.0
    sim = simulator([rc.Body(rc.shapes.plate(0.5, 0.5), motion=lambda _: rc.Pose([distance, 0.0, 0.0]))])
    for distance in (2.0, 1.5):
        truth = sim.frame(0.0).truth
        assert truth is not None
        assert truth.range[0] == pytest.approx(distance, rel=3e-5)  # the nearest pixel is not quite on the axis
        distance += 1.0
        assert np.nanmin(sim.depth_image(0.5 * sim.radar.waveform.duration).distance) == pytest.approx(
            distance, rel=1e-3
        )


def test_nearest_point_is_the_first_ray_of_the_shortest_distance() -> None:
    # Seen from the axis, four pixels about the middle of the plate are equally near; the upper left one comes first.
    plate = rc.Body(rc.shapes.plate(0.5, 0.5), motion=rc.Pose([2.0, 0.0, 0.0]))
    behind = rc.Body(rc.shapes.plate(0.5, 0.5), motion=rc.Pose([-2.0, 0.0, 0.0]))
    truth = simulator([behind, plate, plate], sampling="footprint").frame().truth
    assert truth is not None
    assert np.isnan(truth.range[[0, 2]]).all()  # out of sight, and in the same place as what is seen
    half_pixel = np.tan(np.deg2rad(40.0)) / 48.0
    assert truth.azimuth[1] == pytest.approx(np.arctan(half_pixel), rel=1e-6)
    assert truth.elevation[1] > 0.0
