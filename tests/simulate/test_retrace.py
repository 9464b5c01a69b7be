"""Frames in which bodies turn: when rays are cast again, and what that is good for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc

CONDUCTOR = rc.materials["perfect_conductor"]
WAVEFORM = rc.Waveform.from_sweep(
    start_frequency=60e9, stop_frequency=61e9, sample_rate=2e6, num_samples=64, num_chirps=64, chirp_interval=400e-6
)
DURATION = WAVEFORM.duration


# Rays are few, as only casts are counted, and bodies quick.
pytestmark = pytest.mark.filterwarnings("ignore:no body is seen", "ignore:.* beyond max_velocity")


def casts(
    motion: Any, sensor: Any = None, size: float = 1e-3, waveform: rc.Waveform = WAVEFORM, most: float = 5.0
) -> int:
    """Casts of a frame of a box in motion that does not echo."""
    scene = rc.Scene([rc.Body(rc.shapes.box((size, size, size)), material=rc.Material(0.0), motion=motion)])
    sim = rc.Simulator(
        scene,
        rc.Radar(waveform),
        radar_motion=rc.Pose() if sensor is None else sensor,
        sampling="footprint",
        resolution=8,
        retrace_deg=most,
    )
    return int(sim.frame().stats["casts"])


def moving(position: Any, velocity: Any, turns: Any = (0.0, 0.0, 0.0)) -> rc.Linear:
    """Motion that is at a position in the middle of the frame and turns about its own origin."""
    start = np.asarray(position) - 0.5 * DURATION * np.asarray(velocity)
    return rc.Linear(rc.Pose(start), velocity=velocity, angular_velocity=turns)


def test_bodies_turn_as_the_sensor_sees_them() -> None:
    turn = np.deg2rad(20.0) / DURATION  # two parts' worth, to either side
    # About its own axis, passing by, and coming nearer.
    assert casts(moving([2.0, 0.0, 0.0], np.zeros(3), [0.0, 0.0, 0.99 * turn])) == 3
    assert casts(moving([2.0, 0.0, 0.0], [0.0, 1.98 * turn, 0.0])) == 3
    assert casts(moving([2.0, 0.0, 0.0], [-1.0, 0.0, 0.0])) == 1
    # A sensor that looks about sees nothing else of a body that rests.
    looking_about = rc.Linear(rc.Pose(), velocity=[0.0, 0.0, 0.0], angular_velocity=[0.0, 0.0, turn])
    assert casts(rc.Pose([2.0, 0.3, 0.1]), looking_about) == 1


@pytest.mark.parametrize(("turn_deg", "expected"), [(0.0, 1), (9.9, 1), (10.1, 3), (49.0, 5), (51.0, 7), (700.0, 64)])
def test_a_frame_is_cut_into_an_odd_number_of_parts(turn_deg: float, expected: int) -> None:
    turning = moving([2.0, 0.0, 0.0], np.zeros(3), [0.0, 0.0, np.deg2rad(turn_deg) / DURATION])
    assert casts(turning) == expected


def test_swings_count_although_nothing_turns_in_the_middle_of_the_frame() -> None:
    def swing(time: float) -> rc.Pose:
        angle = np.deg2rad(40.0) * (1.0 - np.cos(np.pi * (time / DURATION - 0.5)))
        return rc.Pose.from_rpy([2.0, 0.0, 0.0], [0.0, 0.0, angle])

    assert casts(swing, most=1.0) >= 33


def test_a_sensor_near_a_wide_floor_passes_over_its_nearest_point() -> None:
    # A box of 10 m, its upper side 0.5 m below.
    speed = 0.5 * np.deg2rad(29.0) / DURATION
    assert casts(rc.Pose([0.0, 0.0, -5.5]), moving(np.zeros(3), [speed, 0.0, 0.0]), size=10.0) == 3


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
