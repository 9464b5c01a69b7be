"""Refusals of poses, motions and deformations. Errors of `check` itself are in tests/test_check.py."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import radarcore as rc

ZERO = [0.0, 0.0, 0.0]
POSE = rc.Pose()
PLATE = rc.shapes.plate(0.2, 0.2)
MAPS = np.tile(np.eye(4), (2, 1, 1))


def rotation(matrix: Any) -> rc.Pose:
    return rc.Pose(ZERO, matrix)


def trajectory(times: Any, poses: Any, **options: Any) -> rc.Trajectory:
    return rc.Trajectory(times, poses, **options)


def live(time: float, **values: Any) -> rc.Live:
    motion = rc.Live()
    motion.update(1.0, POSE)
    motion.update(time, **({"pose": POSE} | values))
    return motion


def group(poses: Any, **rates: Any) -> None:
    rc.LiveGroup(2).update(0.0, poses, **rates)


def deforming(deformation: Any) -> rc.Body:
    return rc.Body(PLATE, motion=rc.Pose([1.0, 0.0, 0.0]), deformation=deformation)


def huge_deformation() -> None:
    scene = rc.Scene([deforming(lambda _: np.full((4, 3), 1e200))])
    rc.Simulator(scene, rc.bgt60tr13c(), resolution=8).depth_image(0.25)


NO_ROTATION = "rotation: expected a rotation"
FAR = r"expected coordinates within 1e\+15 m"

REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    # Poses
    (lambda: rotation(np.diag([1.0, 1.0, -1.0])), ValueError, f"{NO_ROTATION}.*determinant -1"),
    (lambda: rotation(1.001 * np.eye(3)), ValueError, f"{NO_ROTATION}.*deviation 0.002"),
    (lambda: rotation(np.eye(3) + 1e-5 * np.eye(3, k=1)), ValueError, f"{NO_ROTATION}.*1e-05"),
    (lambda: rotation(np.zeros((3, 3))), ValueError, f"{NO_ROTATION}.*determinant 0"),
    (lambda: rotation(1e200 * np.eye(3)), ValueError, r"rotation: expected entries of a rotation.*got 1e\+200"),
    (lambda: rc.Pose([0.0, 1e200, 0.0]), ValueError, f"position: {FAR}, got 1e.200"),
    (lambda: rc.PointTarget([1e200, 0.0, 0.0]), ValueError, f"position: {FAR}"),
    (lambda: rc.Pose.from_rpy(ZERO, [0.0, 1e200, 0.0]), ValueError, r"rpy: expected angles within 1e\+06 rad, got 1e"),
    (lambda: rc.Pose.look_at(ZERO, [1e200, 0.0, 0.0]), ValueError, f"target: {FAR}"),
    (lambda: rc.Pose.look_at(ZERO, ZERO), ValueError, "target: expected a point other than the position"),
    (lambda: rc.Pose.look_at(ZERO, [0.0, 0.0, 2.0]), ValueError, "up: expected a direction that is not along"),
    (lambda: rc.Pose.look_at(ZERO, [1.0, 0.0, 0.0], ZERO), ValueError, "up: expected a direction"),
    (lambda: rc.Pose.from_quaternion(ZERO), TypeError, "expected one of wxyz= and xyzw=, got none"),
    (lambda: rc.Pose.from_quaternion(ZERO, wxyz=[0] * 4), ValueError, r"wxyz: expected \(w, x, y, z\) of any length"),
    (lambda: rc.Pose.from_quaternion(ZERO, xyzw=[0] * 4), ValueError, r"xyzw: expected \(x, y, z, w\) of any length"),
    (lambda: rc.Pose.from_matrix(np.eye(4) + np.eye(4, k=-3)), ValueError, "expected a last row of 0, 0, 0, 1, got 1"),
    # Motions
    (lambda: rc.Linear(POSE, [0.0, -4e8, 0.0]), ValueError, r"velocity: expected less than 3e\+08 m/s, got -4e\+08"),
    (lambda: rc.Linear(POSE, ZERO, [0.0, 1e300, 0.1]), ValueError, r"expected less than 1e\+07 rad/s, got 1e\+300"),
    (lambda: rc.PointTarget(ZERO, 1.0, [4e8, 0.0, 0.0]), ValueError, r"velocity: expected less than 3e\+08 m/s, got 4"),
    (lambda: trajectory([1.0, 0.5], [POSE] * 2), ValueError, "got 1 and then 0.5"),
    (lambda: trajectory([0.0, 1.0], [POSE]), ValueError, "poses: expected 2, one per time, got 1"),
    (lambda: trajectory([0.0, 1.0], [POSE, 3]), TypeError, "poses: expected Pose, got int at index 1"),
    (lambda: trajectory([0.0, 1.0], [POSE] * 2, max_gap=0.5), ValueError, "max_gap: expected at least 1 s, the short"),
    (lambda: trajectory([0.0, 1.0], [POSE] * 2, within_gaps="bridge"), ValueError, "within_gaps: expected"),
    (lambda: rc.Attached(lambda t: t).at(0.5), TypeError, "expected a function that returns Pose, got float at 0.5 s"),  # type: ignore[arg-type,return-value]
    (lambda: rc.Attached("arm"), TypeError, "parent: expected Pose, Linear, Trajectory, Attached, Live or a function"),  # type: ignore[arg-type]
    (lambda: rc.Attached(POSE, 3), TypeError, "motion: expected Pose, Linear"),  # type: ignore[arg-type]
    # Live motions
    (lambda: rc.Live().at(0.0), ValueError, "Live: expected an update before any pose is asked for, got none"),
    (lambda: live(2.0).at(0.8), ValueError, "time: expected 1 s, the first update .* or later, got 0.8 s"),
    (lambda: live(0.5), ValueError, r"time: expected 1 s, .* or later, got 0.5 s; clear\(\) forgets"),
    (lambda: live(2.0, velocity=[3e8, 0, 0]), ValueError, "velocities: expected less than 3e.08 m/s"),
    (lambda: rc.LiveGroup(2)[2], ValueError, "number: expected an index below 2, got 2"),
    (lambda: group([POSE, 3]), TypeError, "poses: expected Pose, got int"),
    (lambda: group(2.0 * MAPS), ValueError, "poses: expected rotation matrices .* got another at index 0"),
    (lambda: group(MAPS * [[1], [1], [-1], [1]]), ValueError, "rotation matrices .* at index 0"),
    (lambda: group(1e200 * MAPS), ValueError, "poses: expected rotation matrices"),
    (lambda: group(MAPS, angular_velocities=1e8 * np.eye(2, 3)), ValueError, "less than 1e.07 rad/s, got 1e.08"),
    # Deformations
    (lambda: deforming(rc.Deformation([0, 1], np.zeros((2, 3, 3)))), ValueError, "expected 4 vertices as the mesh has"),
    (lambda: deforming(PLATE.vertices), TypeError, "deformation: expected Deformation or a function of time, got ndar"),
    (huge_deformation, ValueError, "vertices: expected coordinates below 1e15 m"),
]


@pytest.mark.parametrize(("call", "error", "message"), REFUSED)
def test_refusals_say_what_was_expected(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()
