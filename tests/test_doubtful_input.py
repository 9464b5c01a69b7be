"""Numbers in other units than they are meant in: degrees for radians and the reverse, centimetres for metres."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from math import pi
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore import check
from radarcore.adapters import images
from radarcore.models import Human, JointTrajectory, RobotArm
from radarcore.models.robots.joint import Joint

RADAR = rc.Radar(rc.Waveform(start_frequency=60e9, slope=2e13, sample_rate=2e6, num_samples=32))
PLATE = rc.Body(rc.shapes.plate(0.3, 0.3), motion=rc.Pose([2.0, 0.0, 0.0]), name="plate")
DEGREES = [0.0, -90.0, 90.0, 0.0, 90.0, 0.0]
VIEW = "field_of_view_deg: expected degrees, got a view of"

Call = Callable[[], object]


TABLE = {"start_frequency": 60e9, "slope": 2e13, "sample_rate": 2e6, "num_samples": 32}
FRAME = rc.Frame(np.zeros((3, 64, 128), np.float32), 0.0, rc.bgt60tr13c())
SPHERE, QUARTER = rc.shapes.sphere(0.1), 0.5 * pi

REFUSED: tuple[tuple[Call, str], ...] = (
    (lambda: Human(height=175), r"height: expected at most 3 m, got 175; centimetres\?"),
    (lambda: Human(height=5.9), r"height: expected at most 3 m, got 5.9; centimetres\?"),
    (lambda: Human(height=1.75, mass=7.0), r"mass: expected 18.4 to 796 kg for a height of 1.75 m, got 7"),
    (lambda: Human(height=1.75, mass=7e4), r"mass: expected 18.4 to 796 kg for a height of 1.75 m, got 70000"),
    (
        lambda: Human(breathing=15),
        r"breathing: expected at most 2 breaths per second \[Hz\], got 15; breaths per minute\?",
    ),
    (lambda: rc.Material.dielectric(-4), "permittivity: expected eps' of at least 1 .* got -4"),
    (lambda: rc.Material.dielectric(0.4 - 0.01j), "permittivity: expected eps' of at least 1 .* got "),
    (lambda: rc.Material.dielectric(2.5, roughness=50.0), r"roughness: expected at most 1 m, got 50; micrometres\?"),
    (lambda: rc.materials["wood"].with_surface(roughness=50.0), r"roughness: .* 1 m, got 50; micrometres\?"),
    (
        lambda: images.from_coppeliasim(bytes(64), (4, 4), angle=60.0, near=0.1, far=9.0),
        r"angle: expected an angle below pi \[rad\], got 60.0; degrees\?",
    ),
    (lambda: rc.GaussianPattern(3.0, 400.0, 40.0), "azimuth_deg: expected a number from 0.001 to 360 .*, got 400"),
    (lambda: rc.rcs(SPHERE, 60.0, azimuth_deg=180.0), "frequency: expected 1e8 to 3e12 .* got 60"),
    (lambda: rc.detect(FRAME, guard=200), r"guard: expected fewer cells than the map of \(64, 6.\) has, got 200"),
)

WARNED: tuple[tuple[Call, str], ...] = (
    (lambda: rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.0, 0.0, 45.0]), r"rpy: expected radians, got 45; degrees\?"),
    (lambda: rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.0, -22.5, 0.0]), r"rpy: expected radians, got -22\.5; degrees\?"),
    (lambda: RobotArm.ur10().link_pose("tool0", DEGREES), "joint_angles: expected radians, got -90; degrees"),
    (lambda: RobotArm.ur10().moving({"elbow_joint": 90.0}), "joint_angles: expected radians, got 90; degrees"),
    (lambda: JointTrajectory([0.0, 1.0], [[0.0], [30.0]]), "angles: expected radians, got 30; degrees"),
    (lambda: elbow(180.0), "limits of 'elbow': expected radians, got -180; degrees"),
    (lambda: elbow(1e308), r"limits of 'elbow': expected radians, got -1e\+308; degrees"),
    (lambda: rc.Simulator(rc.Scene([PLATE]), RADAR, field_of_view_deg=(pi / 3, pi / 4)), f"{VIEW} 1.0472 and 0.785398"),
    (lambda: rc.Camera.from_field_of_view((1.0, 0.8), 8, 8), f"{VIEW} 1 and 0.8; radians"),
    (lambda: rc.frame_from_depth(np.full((8, 8), 2.0), 0.5, RADAR, camera=(1.0, 0.8)), f"{VIEW} 1 and 0.8; radians"),
    (lambda: rc.Waveform(**TABLE, num_chirps=4, chirp_interval=60.0), "interval: expected at most 2 s, got 60 s"),
    (lambda: rc.GaussianPattern(3.0, 1.047, 0.785), "beamwidth.*: expected degrees, got 1.047; radians"),
    (lambda: rc.rcs(SPHERE, 60e9, azimuth_deg=pi), "azimuth_deg: expected degrees, got 3.14159"),
    (
        lambda: rc.TabulatedPattern.from_degrees([-QUARTER, 0.0, QUARTER], [-30.0, 30.0], np.zeros((3, 2))),
        "azimuth_deg: expected degrees, got 1.5708; radians",
    ),
    (lambda: rc.Receiver(rx_phase_deg=[0.0, -1.309]), "rx_phase_deg: expected degrees, got 1.309; radians"),
    (lambda: rc.Mesh(np.eye(3), [[0, 1, 2]], crease_angle_deg=0.785), "crease_angle_deg: expected degrees"),
)


def elbow(limit: float) -> Joint:
    return Joint("elbow", "a", "b", axis=[0, 0, 1], limits=(-limit, limit))


@pytest.mark.parametrize(("make", "message"), REFUSED)
def test_impossible_numbers_are_refused(make: Call, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(("make", "message"), WARNED)
def test_numbers_in_other_units_raise_one_warning_at_the_line_that_has_them(make: Call, message: str) -> None:
    with pytest.warns(UserWarning, match=message) as caught:
        make()
    assert [warning.filename for warning in caught] == [__file__]


def test_unusual_people_are_people() -> None:
    assert Human(height=2.5).height == 2.5
    for height, mass in ((0.5, 3.5), (1.75, 40.0), (1.85, 635.0)):
        assert Human(height=height, mass=mass, speed=0.5).mass == mass


def test_conductors_and_a_vacuum_are_dielectrics() -> None:
    assert rc.Material.dielectric(1.0).reflectance == 0.0
    copper = rc.Material.dielectric(-2.6e4 - 1.7e7j)  # Drude's law at 60 GHz
    assert 0.999 < copper.reflectance < 1.0


MS = 1e3
"""Milliseconds per second."""


def joints(times: list[float]) -> object:
    return JointTrajectory(times, np.outer(times, [0.5e-3, -0.2e-3]))


def poses(times: list[float]) -> list[rc.Pose]:
    """Poses at 1.4 m/s and 1 rad/s; times in milliseconds."""
    return [rc.Pose.from_rpy([1.4e-3 * time, 0.0, 0.0], [0.0, 0.0, 1e-3 * time]) for time in times]


def live(times: list[float]) -> rc.Live:
    body = rc.Live()
    for time, pose in zip(times, poses(times), strict=True):
        body.update(time, pose, velocity=[1.4, 0.0, 0.0])
    return body


def live_group(times: list[float]) -> rc.LiveGroup:
    group = rc.LiveGroup(2)
    for time, pose in zip(times, poses(times), strict=True):
        group.update(time, [rc.Pose(), pose])
    return group


@pytest.mark.parametrize("rate", [100.0, 30.0])
@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda times: rc.Trajectory(times, poses(times)), "times, poses"),
        (joints, "times, angles"),
        (
            lambda times: rc.Deformation(times, [PLATE.mesh.vertices + 1.4e-3 * time for time in times]),
            "times, vertices",
        ),
        (live, "time"),
        (live_group, "time"),
    ],
    ids=["Trajectory", "JointTrajectory", "Deformation", "Live", "LiveGroup"],
)
def test_times_in_milliseconds_raise_one_warning(make: Callable[[list[float]], object], name: str, rate: float) -> None:
    times = [MS * k / rate for k in range(12)]
    message = rf"^{name}: expected times in seconds, got steps of {MS / rate:.4g} s .* faster than .*milliseconds\?"
    with pytest.warns(UserWarning, match=message) as caught:
        make(times)
    assert [warning.filename for warning in caught] == [__file__]


@pytest.mark.parametrize(
    ("make", "times"),
    [(live, [0.0, 10.0]), (lambda times: rc.Trajectory(times, poses(times)), [0.0, 2000.0])],
    ids=["Live", "Trajectory"],
)
def test_two_times_in_milliseconds_raise_a_warning(make: Callable[[list[float]], object], times: list[float]) -> None:
    with pytest.warns(UserWarning, match=f"got steps of {times[1]:g} s in which .* 1.4 mm/s .*milliseconds"):
        make(times)


def test_motions_that_are_slow_or_have_long_steps_are_in_seconds() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        breath = [rc.Pose([1.0 + 5e-3 * (k % 2), 0.0, 0.0]) for k in range(6)]
        rc.Trajectory(5.0 * np.arange(6), breath)  # six times a minute
        rc.Trajectory([0.0, 60.0, 120.0], [rc.Pose([x, 0.0, 0.0]) for x in (0.0, 5.0, 0.0)])  # a walk to and fro
        rc.Trajectory([0.0, 60.0], [rc.Pose([x, 0.0, 0.0]) for x in (0.0, 0.1)])  # a slow stage
        rc.Trajectory([0.0, 60.0, 120.0], [rc.Pose([x, 0.0, 0.0]) for x in (0.0, 1e-4, 0.0)])  # noise of a place
        live([0.0, 1.0, 2.0])
        seldom = rc.Live()
        for time in (0.0, 60.0, 120.0, 180.0):
            seldom.update(time, rc.Pose([1.0, 0.0, 0.0]))  # at rest


def far_apart(interval: float) -> list[rc.Pose]:
    return [rc.Pose([1e9 * interval * k, 0.0, 0.0]) for k in range(3)]


def test_speeds_above_light_are_refused_for_every_motion() -> None:
    times = [0.0, 1e-3, 2e-3]
    message = r"expected less than 3e\+08 m/s.*, got -?1e\+09"
    with pytest.raises(ValueError, match=f"times, poses: {message}"):
        rc.Trajectory(times, far_apart(1e-3))
    with pytest.raises(ValueError, match=f"times, vertices: {message}"):
        rc.Deformation(times, [PLATE.mesh.vertices + pose.position for pose in far_apart(1e-3)])
    body = rc.Live()
    body.update(0.0, rc.Pose())
    with pytest.raises(ValueError, match=f"poses: {message}"):
        body.update(1e-3, far_apart(1e-3)[1])
    assert body.newest == 0.0  # a refused update changes nothing
    body.update(1e-3, rc.Pose([1e-3, 0.0, 0.0]))
    with pytest.raises(ValueError, match=r"time: expected times up to 1e\+12 s, got 1.7e\+12"):
        body.update(1.7e12, rc.Pose())  # milliseconds since 1970
    turned = [[0.0], [1.0], [0.0]]
    with pytest.raises(ValueError, match=r"times, angles: expected less than 3e\+08 m/s or rad/s, got"):
        JointTrajectory([0.0, 1e-9, 2e-9], turned)


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


@pytest.mark.parametrize("view", [(2.0, 2.0), (0.1, 0.1), (1.0, 120.0), (0.916713, 0.916713)])
def test_narrow_fields_of_view_are_fields_of_view(view: tuple[float, float]) -> None:
    rc.Simulator(rc.Scene([PLATE]), RADAR, field_of_view_deg=view)  # warnings are errors here


@pytest.mark.parametrize("value", [[1.0 + 1.0j, 0.0, 0.0], ["1", "0", "0"], np.array([1, 0, 0], dtype="datetime64[s]")])
def test_arrays_take_real_numbers_alone(value: Any) -> None:
    """NumPy drops imaginary parts with a warning, and reads text and dates as numbers without one."""
    readers: dict[str, Callable[[Any], object]] = {
        "position": rc.Pose,
        "directions": lambda given: rc.rcs(rc.shapes.sphere(0.1), 60e9, given),
        "delay": lambda given: rc.beat_signal(given, [1.0, 1.0, 1.0], RADAR.waveform),
        "power": lambda given: rc.cfar(given, guard=0, training=1, false_alarm_rate=0.1),
    }
    for name, reader in readers.items():
        with pytest.raises(TypeError, match=rf"{name}: expected (real )?numbers.*, got "):
            reader(value)


def test_angles_in_degrees_raise_no_warning() -> None:
    rng = np.random.default_rng(3)
    angles = np.concatenate([np.linspace(-180.0, 180.0, 721), rng.uniform(-6.3, 6.3, 2000), np.arange(0.0, 7.0, 0.05)])
    for angle in angles.tolist():
        check.degrees("angle_deg", angle)  # warnings are errors here
    check.degrees("rpy_deg", [0.0, 0.785, 45.0])
    check.degrees("rpy_deg", [0.0, 0.0, 0.0])
