"""Frames in which bodies turn: when rays are cast again, and what that is good for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.geometry.pose import relative_poses, relative_rates
from radarcore.simulate import retrace

CONDUCTOR = rc.materials["perfect_conductor"]
WAVEFORM = rc.Waveform.from_sweep(
    start_frequency=60e9, stop_frequency=61e9, sample_rate=2e6, num_samples=64, num_chirps=64, chirp_interval=400e-6
)
DURATION = WAVEFORM.duration


def turn_rate(motion: Any, sensor: Any, size: float = 0.2) -> float:
    """Of a box in motion, at time 0 [rad/s]."""
    scene = rc.Scene([rc.Body(rc.shapes.box((size, size, size)), motion=motion)])
    world, world_rates = motion.at(0.0), motion.rate_at(0.0)
    at = np.column_stack([world.rotation, world.position])[None, None]
    seen_from = np.column_stack([sensor.at(0.0).rotation, sensor.at(0.0).position])[None]
    poses = relative_poses(at, seen_from)
    rates = relative_rates(poses, world_rates[None, None], seen_from, sensor.rate_at(0.0)[None])
    return float(retrace.turn_rates(poses[0], rates[0], retrace.corners(scene))[0])


def test_bodies_turn_as_the_sensor_sees_them() -> None:
    still = rc.Linear(rc.Pose(), velocity=[0.0, 0.0, 0.0])
    # About its own axis: by nearly its own rate, a corner 2 m away by what the corner's way adds.
    spinning = rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[0.0, 0.0, 0.0], angular_velocity=[0.0, 0.0, 3.0])
    assert turn_rate(spinning, still) == pytest.approx(3.0, rel=0.1)
    # Passing by: speed over distance.
    passing = rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[0.0, 1.0, 0.0])
    assert turn_rate(passing, still, size=1e-3) == pytest.approx(0.5, rel=1e-3)
    coming = rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[-1.0, 0.0, 0.0])
    assert turn_rate(coming, still, size=1e-3) < 1e-3
    # A sensor that looks about sees nothing else of a body that rests.
    looking_about = rc.Linear(rc.Pose(), velocity=[0.0, 0.0, 0.0], angular_velocity=[0.0, 0.0, 5.0])
    resting = rc.Linear(rc.Pose([2.0, 0.3, 0.1]), velocity=[0.0, 0.0, 0.0])
    assert turn_rate(resting, looking_about) < 1e-12


@pytest.mark.parametrize(("turn_deg", "expected"), [(0.0, 1), (9.9, 1), (10.1, 3), (49.0, 5), (51.0, 7), (1e9, 64)])
def test_a_frame_is_cut_into_an_odd_number_of_parts(turn_deg: float, expected: int) -> None:
    parts = retrace.blocks(WAVEFORM, np.deg2rad(turn_deg) / DURATION, np.deg2rad(5.0))
    assert len(parts) == expected
    chirps = [chirp for part in parts for chirp in range(part.start, part.stop)]
    assert chirps == list(range(64))
    if len(parts) < 64:
        middle = parts[len(parts) // 2]
        assert abs(middle.start + middle.stop - 64) <= 1


def test_parts_of_a_frame_last_equally_long_whenever_its_chirps_are() -> None:
    times = np.array([0.0, 0.1, 0.2, 9.0, 9.1, 9.2]) * 1e-3
    waveform = WAVEFORM.replace(num_chirps=6, chirp_times=times)
    parts = retrace.blocks(waveform, 100.0, np.deg2rad(10.0))
    assert [(part.start, part.stop) for part in parts] == [(0, 3), (3, 6)]


def test_a_sensor_near_a_wide_floor_passes_over_its_nearest_point() -> None:
    passing = rc.Linear(rc.Pose(), velocity=[5.0, 0.0, 0.0])
    floor = rc.Pose([0.0, 0.0, -5.5])  # a box of 10 m, its upper side 0.5 m below
    still = rc.Linear(floor, velocity=[0.0, 0.0, 0.0])
    assert turn_rate(still, passing, size=10.0) == pytest.approx(10.0)


def test_paths_are_those_that_the_first_part_of_a_frame_follows() -> None:
    late = WAVEFORM.replace(chirp_times=5e-3 + WAVEFORM.chirp_times)
    body = plate(0.2)
    simulator = rc.Simulator(rc.Scene([body]), rc.Radar(late), sampling="footprint", field_of_view_deg=(12.0, 12.0))
    times: list[float] = []
    cast = simulator._cast_rays
    simulator._cast_rays = lambda time: (times.append(time), cast(time))[1]  # type: ignore[method-assign]
    simulator.paths(0.0)
    assert simulator.frame(0.0).stats["casts"] > 1
    assert times[0] == times[1] > 5e-3


def plate(turns: float) -> rc.Body:
    """10 cm, upright at 2 m, edge on in the middle of the frame; it turns by so many turns in a frame."""
    rate = 2.0 * np.pi * turns / DURATION
    start = rc.Pose.from_rpy([2.0, 0.0, 0.0], [0.0, 0.0, 0.5 * np.pi - 0.5 * rate * DURATION])
    motion = rc.Linear(start, velocity=[0.0, 0.0, 0.0], angular_velocity=[0.0, 0.0, rate])
    return rc.Body(rc.shapes.plate(0.1, 0.1), material=CONDUCTOR, motion=motion)


@pytest.mark.parametrize("sampling", ["adaptive", "footprint"])
def test_a_plate_that_turns_round_flashes_when_it_faces_the_sensor(sampling: str) -> None:
    options: dict[str, Any] = {"sampling": sampling, "field_of_view_deg": (12.0, 12.0)}
    radar = rc.Radar(WAVEFORM)
    turning = rc.Scene([plate(0.5)])  # faces the sensor in the middle of its first and of its last chirp
    facing = rc.Body(rc.shapes.plate(0.1, 0.1), material=CONDUCTOR, motion=rc.Pose([2.0, 0.0, 0.0]))
    expected = np.abs(rc.Simulator(rc.Scene([facing]), radar, **options).frame().cube[0, 0]).mean()
    again = rc.Simulator(turning, radar, retrace_deg=5.0, **options).frame()
    once = rc.Simulator(turning, radar, retrace_deg=np.inf, **options).frame()
    assert again.stats["casts"] == 19
    assert once.stats["casts"] == 1
    level = np.abs(again.cube[0]).mean(axis=-1)
    assert 20.0 * np.log10(level[0] / expected) == pytest.approx(0.0, abs=0.5)
    assert np.abs(once.cube[0]).mean(axis=-1)[0] < 0.1 * expected
    # Most of the time it looks elsewhere.
    assert np.median(level) < 0.1 * expected


def test_parts_of_a_frame_are_frames_of_their_own() -> None:
    radar, scene = rc.Radar(WAVEFORM), rc.Scene([plate(0.1), rc.PointTarget([1.0, 0.0, 0.0])])
    options: dict[str, Any] = {"sampling": "footprint", "field_of_view_deg": (12.0, 12.0), "tolerance": 1e-7}
    frame = rc.Simulator(scene, radar, retrace_deg=5.0, **options).frame(0.5)
    assert frame.stats["casts"] == 5
    assert frame.stats["rays_cast"] > 0
    for chirps in (slice(0, 13), slice(26, 39)):
        part = rc.Radar(WAVEFORM.replace(num_chirps=chirps.stop - chirps.start))
        start = 0.5 + float(WAVEFORM.chirp_times[chirps.start])
        alone = rc.Simulator(scene, part, **options, retrace_deg=np.inf).frame(start)
        np.testing.assert_allclose(frame.cube[:, chirps], alone.cube, atol=1e-9 * np.abs(alone.cube).max())
    truth = rc.Simulator(scene, radar, **options, retrace_deg=np.inf).frame(0.5).truth
    assert frame.truth is not None
    assert truth is not None
    np.testing.assert_allclose(frame.truth.velocity[1:], truth.velocity[1:], atol=1e-12)


def test_an_angle_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="retrace_deg: expected a positive number"):
        rc.Simulator(rc.Scene([plate(0.1)]), rc.Radar(WAVEFORM), retrace_deg=0.0)
