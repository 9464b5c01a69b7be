"""Numbers in other units than they are meant in: degrees for radians and the reverse, centimetres for metres."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from math import pi

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters import images
from radarcore.models import Human, JointTrajectory, RobotArm
from radarcore.models.robots.joint import Joint

RADAR = rc.Radar(rc.Waveform(start_frequency=60e9, slope=2e13, sample_rate=2e6, num_samples=32))
PLATE = rc.Body(rc.shapes.plate(0.3, 0.3), motion=rc.Pose([2.0, 0.0, 0.0]), name="plate")
DEGREES = [0.0, -90.0, 90.0, 0.0, 90.0, 0.0]

Call = Callable[[], object]


@pytest.mark.parametrize("height", [175, 5.9])
def test_height_of_a_person_in_other_units_is_refused(height: float) -> None:
    with pytest.raises(ValueError, match=rf"height: expected at most 3 m, got {height:g}; centimetres\?"):
        Human(height=height)
    assert Human(height=2.5).height == 2.5


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.0, 0.0, 45.0]), r"rpy: expected radians, got 45; degrees\?"),
        (lambda: rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.0, -22.5, 0.0]), r"rpy: expected radians, got -22\.5; degrees\?"),
        (lambda: RobotArm.ur10().link_pose("tool0", DEGREES), "joint_angles: expected radians, got -90; degrees"),
        (lambda: RobotArm.ur10().moving({"elbow_joint": 90.0}), "joint_angles: expected radians, got 90; degrees"),
        (lambda: JointTrajectory([0.0, 1.0], [[0.0], [30.0]]), "angles: expected radians, got 30; degrees"),
        (
            lambda: Joint("elbow", "a", "b", axis=[0, 0, 1], limits=(-180.0, 180.0)),
            "limits of 'elbow': expected radians, got -180; degrees",
        ),
        (
            lambda: Joint("elbow", "a", "b", axis=[0, 0, 1], limits=(-1e308, 1e308)),
            r"limits of 'elbow': expected radians, got -1e\+308; degrees",
        ),
    ],
    ids=["yaw", "pitch", "arm", "arm by name", "trajectory", "limits", "huge"],
)
def test_angles_in_degrees_are_said_at_the_line_that_has_them(make: Call, message: str) -> None:
    with pytest.warns(UserWarning, match=message) as caught:
        make()
    assert [warning.filename for warning in caught] == [__file__]


def test_turns_lengths_and_angles_of_what_keeps_turning_are_no_degrees() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rc.Pose.from_rpy([0.0, 0.0, 0.0], [2.0 * pi, 6.0, -4.5 * pi])
        spinner = rc.Body(
            PLATE.mesh, motion=lambda time: rc.Pose.from_rpy([2.0, 0.0, 0.0], [20.0 * time + 7.1, 0.0, 0.0])
        )
        rc.Simulator(rc.Scene([spinner]), RADAR, resolution=32, sampling="point").frame(1.0)
        rail = Joint("rail", "a", "b", axis=[1, 0, 0], kind="prismatic", limits=(0.0, 30.0))
        arm = RobotArm([rail], {"a": None, "b": None})
        arm.link_pose("b", [12.0])
        JointTrajectory([0.0, 60.0], [[0.0], [12.0]], arm=arm)


@pytest.mark.parametrize(
    "make", [lambda: images.from_coppeliasim(bytes(64), (4, 4), angle=60.0, near=0.1, far=9.0)], ids=["coppeliasim"]
)
def test_angle_of_a_camera_in_degrees_is_refused(make: Call) -> None:
    with pytest.raises(ValueError, match=r"angle: expected an angle below pi \[rad\], got 60.0; degrees\?"):
        make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rc.Simulator(rc.Scene([PLATE]), RADAR, field_of_view_deg=(pi / 3, pi / 4)), "1.0472 and 0.785398"),
        (lambda: rc.Camera.from_field_of_view((1.0, 0.8), 8, 8), "1 and 0.8"),
        (lambda: rc.frame_from_depth(np.full((8, 8), 2.0), 0.5, RADAR, camera=(1.0, 0.8)), "1 and 0.8"),
    ],
    ids=["simulator", "camera", "depth image"],
)
def test_field_of_view_in_radians_is_said(make: Call, message: str) -> None:
    with pytest.warns(UserWarning, match=rf"field_of_view_deg: expected degrees, got a view of {message}; radians\?"):
        make()


def test_vertical_angle_of_a_rendered_image_in_radians_is_said() -> None:
    with pytest.warns(UserWarning, match=r"fovy_deg: expected degrees, got a view of 0\.8; radians\?"):
        images.from_mujoco_renderer(np.full((4, 4), 2.0), fovy_deg=0.8, far=9.0)


@pytest.mark.parametrize("view", [(2.0, 2.0), (0.1, 0.1), (1.0, 120.0), (0.916713, 0.916713)])
def test_narrow_fields_of_view_are_fields_of_view(view: tuple[float, float]) -> None:
    rc.Simulator(rc.Scene([PLATE]), RADAR, field_of_view_deg=view)  # warnings are errors here
