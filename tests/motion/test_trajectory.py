"""Splines, functions of time and attachments: exact rates, continuous velocities, and frames that follow them."""

from __future__ import annotations

import numpy as np
import pytest

import radarcore as rc
from reference import point_echo_reference


def wandering(seed: int, extrapolate: str | None = None) -> rc.Trajectory:
    rng = np.random.default_rng(seed)
    poses = [rc.Pose.from_rpy(rng.normal(size=3), 0.5 * rng.normal(size=3)) for _ in range(9)]
    return rc.Trajectory(np.linspace(0.0, 2.0, 9), poses, extrapolate=extrapolate)


def test_trajectory_passes_its_poses_and_has_no_step_of_velocity_there() -> None:
    motion = wandering(3)
    for time, pose in zip(motion.times[1:-1], motion.poses[1:-1], strict=True):
        np.testing.assert_allclose(motion.at(time).rotation, pose.rotation, atol=1e-12)
        np.testing.assert_allclose(motion.at(time).position, pose.position, atol=1e-12)
        # Accelerations below 1e3 /s^2 over 2e-9 s.
        np.testing.assert_allclose(motion.rate_at(time - 1e-9), motion.rate_at(time + 1e-9), atol=1e-5)


@pytest.mark.filterwarnings("ignore:.* beyond max_velocity")
def test_frames_follow_the_true_path_of_a_sensor_that_swings() -> None:
    # 4 m/s^2 and more: a rate frozen at the start of the 25 ms frame would be off by 1 mm, or a quarter of a turn.
    waveform = rc.Waveform(
        start_frequency=60e9, slope=2e13, sample_rate=2e6, num_samples=16, num_chirps=32, chirp_interval=800e-6
    )
    sensor = rc.Attached(wandering(5), rc.Pose([0.1, 0.0, 0.2]))
    target = np.array([3.0, 1.0, -0.5])
    simulator = rc.Simulator(
        rc.Scene([rc.PointTarget(target)]), rc.Radar(waveform), radar_motion=sensor, resolution=4, tolerance=1e-9
    )
    start = 0.9
    frame = simulator.frame(start)
    times = start + waveform.chirp_times[:, None] + waveform.sample_times
    positions = [sensor.at(time).inverse().apply(target) for time in times.ravel()]
    expected = point_echo_reference(np.reshape(positions, (*times.shape, 3)), 1.0, simulator.radar)
    np.testing.assert_allclose(frame.cube, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
