"""Refusals of simulations. Errors of `check` itself are in tests/test_check.py, the core's in tests/boundary."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.models import JointTrajectory, RobotArm

WAVEFORM = rc.Waveform(start_frequency=60e9, slope=2e13, sample_rate=2e6, num_samples=32, num_chirps=8)
RADAR = rc.Radar(WAVEFORM)
DDM = rc.Radar(WAVEFORM, tx=[[0.0, 0.0, 0.0], [0.0, 4e-3, 0.0]], schedule=rc.Schedule.ddm())
PAIR = rc.Radar([WAVEFORM, WAVEFORM.delayed(0.01)])
PLATE = rc.shapes.plate(0.1, 0.1)
BALL = rc.Body(rc.shapes.sphere(0.1), motion=rc.Pose([1.0, 0.0, 0.0]))
ARM = RobotArm.ur10()
FRONT = [-1.0, 0.0, 0.0]
NODAL = np.full((4, 2, 3), 1e-9)
ROWS = np.full((2, 3), 1e-9)


def simulator(bodies: Any = (), **options: Any) -> rc.Simulator:
    return rc.Simulator(rc.Scene(bodies), RADAR, **({"resolution": 8} | options))


def beat(delay: Any = ROWS, amplitude: Any = 1.0, waveform: Any = WAVEFORM, **options: Any) -> object:
    return rc.beat_signal(delay, amplitude, waveform, **options)


def rcs(directions: Any = FRONT, **options: Any) -> object:
    return rc.rcs(PLATE, 60e9, directions, **options)


def interferer(radar: rc.Radar = RADAR, **options: Any) -> rc.Interferer:
    return rc.Interferer(radar, rc.Pose([3.0, 0.0, 0.0]), **options)


def no_pose(time: float) -> Any:
    return np.eye(4)


def fewer_joints(time: float) -> Any:
    return np.zeros(6 if time < 1.0 else 5)


NOT_A_POSE = r"pose: expected a function that returns Pose, got ndarray at 0 s; rc.Pose"
MATRIX = r"got \w+( at index 0)?; rc.Pose.from_matrix\(...\) makes a pose of it"
ANGLES = "field_of_view_deg: expected angles between 0 and 180 degrees"

REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    # Settings of a simulator
    (lambda: rc.Simulator([], RADAR), TypeError, "scene: expected Scene, got list"),  # type: ignore[arg-type]
    (lambda: rc.Simulator(rc.Scene(), WAVEFORM), TypeError, "radar: expected Radar, got Waveform"),  # type: ignore[arg-type]
    (lambda: simulator(resolution=2**20), ValueError, "resolution: expected at most 268435456 rays"),
    (
        lambda: simulator([BALL], resolution=(1, 20_000), field_of_view_deg=(60, 60)).frame(),
        ValueError,
        "resolution: expected at most 16384 cells along either",
    ),
    (lambda: simulator(field_of_view_deg=(0, 60)), ValueError, ANGLES),
    (lambda: simulator(field_of_view_deg=(60, 180)), ValueError, ANGLES),
    (lambda: simulator(sampling="fine"), ValueError, "sampling: expected one of 'adaptive', 'fast', 'footprint', 'p"),
    (lambda: simulator(tolerance=1e-15), ValueError, "tolerance: expected a number from 1e-12 to 0.1, got 1e-15"),
    (lambda: simulator(seed=2**64), ValueError, "seed: expected at most 18446744073709551615, got 184"),
    (lambda: simulator(ray_budget=2**70), ValueError, "ray_budget: expected less than"),
    (lambda: simulator(resolution=64, ray_budget=100), ValueError, "ray_budget: expected at least the .* rays"),
    (lambda: simulator(ray_budget=1e5), TypeError, "ray_budget: expected an integer, got 100000.0"),
    (lambda: simulator(rcs_floor=0.0), ValueError, "rcs_floor: expected a positive number"),
    (lambda: simulator(retrace_deg=0.0), ValueError, "retrace_deg: expected a positive number"),
    (lambda: simulator(max_bounces=65), ValueError, "max_bounces"),
    *((lambda floor=floor: simulator(gain_floor_db=floor), ValueError, "gain_floor_db") for floor in (0.0, np.nan)),
    *((lambda floor=floor: simulator(bounce_floor_db=floor), ValueError, "bounce_floor_db") for floor in (0.0, np.nan)),
    (lambda: simulator(radar_motion=np.eye(4)), TypeError, r"radar_motion: expected Pose, Linear, .* got ndarray"),
    # Times
    *(
        (lambda name=name: getattr(simulator(), name)(np.nan), ValueError, "time: expected a ")
        for name in ("frame", "paths", "depth_image")
    ),
    (lambda: simulator().record(1.0, 1.0, 40.0), ValueError, "stop: expected a time after start 1 s, got 1 s"),
    # Before the first frame is asked for
    (lambda: simulator().frames(1.0, 0.5, 40.0), ValueError, "stop: expected a time after start 1 s, got 0.5 s"),
    (lambda: simulator().frames(0.0, 1.0, 0.0), ValueError, r"rate: expected a positive number \[Hz\], got 0"),
    # Parts of a scene
    (lambda: rc.Scene([rc.PointTarget(FRONT), "ball"]), TypeError, "PointTarget and Interferer, got str at index 1"),  # type: ignore[list-item]
    (lambda: rc.Scene(rc.PointTarget(FRONT)), TypeError, "bodies: expected a list of .*, got PointTarget"),  # type: ignore[arg-type]
    (lambda: rc.Body("part.obj"), TypeError, "mesh: expected Mesh, got str"),  # type: ignore[arg-type]
    (lambda: rc.Body(PLATE, motion=FRONT), TypeError, r"got list; rc.Pose\(...\) makes a pose of it"),  # type: ignore[arg-type]
    (lambda: rc.Body(PLATE, motion=np.eye(4)), TypeError, MATRIX),  # type: ignore[arg-type]
    (lambda: rc.Attached(np.eye(4)[:3].tolist(), rc.Pose()), TypeError, MATRIX),  # type: ignore[arg-type]
    (lambda: rc.Linear(np.eye(4)), TypeError, MATRIX),  # type: ignore[arg-type]
    (lambda: rc.Trajectory([0.0, 1.0], [np.eye(4), np.eye(4)]), TypeError, MATRIX),  # type: ignore[list-item]
    (lambda: rc.materials["perfect_conducter"], KeyError, "did you mean 'perfect_conductor'"),
    # Functions of time
    (lambda: simulator([rc.Body(PLATE, motion=no_pose)]).frame(), TypeError, NOT_A_POSE),
    (lambda: simulator([rc.Body(PLATE)], radar_motion=no_pose).frame(), TypeError, NOT_A_POSE),
    (lambda: simulator([rc.Body(PLATE, motion=rc.Attached(rc.Pose(), no_pose))]).frame(), TypeError, NOT_A_POSE),
    (lambda: ARM.moving(fewer_joints).link_poses_at([0.5, 1.5]), ValueError, r"shape \(6,\), got \(5,\)"),
    (lambda: ARM.moving(JointTrajectory([0.0, 1.0], np.zeros((2, 5)))), ValueError, r"shape \(6,\), got \(5,\)"),
    # Interferers
    (lambda: interferer(PAIR), ValueError, "radar: expected an interferer of one waveform, got 2"),
    (lambda: interferer(DDM), ValueError, "radar: expected no schedule, or one of kind 'tdm', got 'ddm'"),
    (lambda: interferer(rate=1e6), ValueError, r"rate: expected at most .* frames of .* ms per second \[Hz\], got 1e"),
    (lambda: interferer(drift_ppm=1e5), ValueError, "drift_ppm: expected a number from -10000 to 10000"),
    # Sums over paths
    (lambda: beat(np.zeros((1, 1, 1, 1))), ValueError, r"delay: expected \(path,\).*got \(1, 1, 1, 1\)"),
    (lambda: beat(amplitude=np.zeros((1, 1, 1, 1))), ValueError, r"amplitude: expected \(path,\).*got \(1, 1, 1, 1\)"),
    (lambda: beat(amplitude=np.ones(4)), ValueError, r"amplitude: expected shape .*2, 3\).*got \(4,\)"),
    (lambda: beat(NODAL, np.ones((3, 3, 3))), ValueError, r"amplitude: expected shape \(3, 2, 3\).*got"),
    (lambda: beat(delay_rate=np.zeros((2, 2))), ValueError, r"delay_rate: expected shape \(2, 3\).*got \(2, 2\)"),
    (lambda: beat(NODAL, delay_rate=ROWS), ValueError, r"delay_rate: expected none .* nodes \(4, 2, 3\)"),
    (lambda: beat(ROWS + 0j), TypeError, "delay: expected numbers, got ndarray of complex128"),
    (lambda: beat("near"), TypeError, "delay: expected numbers, got str"),
    (lambda: beat([[1e-9, 2e-9], [1e-9]]), TypeError, "delay: expected numbers, got list"),
    (lambda: beat(amplitude="loud"), TypeError, "amplitude: expected numbers, got str"),
    (lambda: beat(waveform={"slope": 1.0}), TypeError, "waveform: expected Waveform, got dict"),
    (lambda: beat(threads=10**6), ValueError, "threads: expected .*1024, got 1000000"),
    # Cross-sections
    (lambda: rcs([[2.0, 0.0, 0.0]]), ValueError, "directions: expected unit vectors, got one of length 2"),
    (lambda: rcs([FRONT] * 2, receiver=[FRONT] * 3), ValueError, "directions: expected shape"),
    (lambda: rcs(polarization="slant"), ValueError, "polarization: expected 'vertical', 'horizontal' or a unit vector"),
    (
        lambda: rcs(None),
        ValueError,
        "directions: expected either unit vectors or azimuth_deg and elevation_deg, got none",
    ),
    (lambda: rcs(azimuth_deg=0.0), ValueError, "directions: expected either unit vectors or azimuth_deg .* got both"),
    (
        lambda: rcs(None, azimuth_deg=[0, 1], elevation_deg=[0, 1, 2]),
        ValueError,
        r"a shape that fits \(2,\) of",
    ),
]


@pytest.mark.parametrize(("call", "error", "message"), REFUSED)
def test_refusals_say_what_was_expected(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()
