"""Poses and trajectories of arms for several tests."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.models import robots
from radarcore.models.robots.joint import JointTrajectory

CHECK_POSE = np.array([0.0, -1.2, 1.6, -0.4, 1.5708, 0.0])

needs_robots = pytest.mark.skipif(
    not robots.is_available(), reason="needs the extra `robots`: pip install radarcore[robots]"
)

ROUNDING = 1e-14
"""Of products of a dozen matrices of order one, in f64."""


def matrix(pose: rc.Pose) -> NDArray[np.float64]:
    """``[rotation | position]``, (3, 4)."""
    return np.column_stack([pose.rotation, pose.position])


def some_trajectory(num_joints: int = 6, seed: int = 3) -> JointTrajectory:
    random = np.random.default_rng(seed)
    return JointTrajectory([0.5, 0.9, 1.6, 2.0], random.uniform(-2.0, 2.0, (4, num_joints)))
