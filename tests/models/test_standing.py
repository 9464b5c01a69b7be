"""A person who stands: published amplitudes of breathing and sway, feet that rest, and what a radar measures."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from arms import needs_robots
from radarcore.models import Human
from radarcore.models.people.human import SEGMENTS
from radarcore.models.people.segments import spheroids
from radarcore.motion.group import Inverse

PATH = [[1.2, 0.1], [0.0, 0.1]]
PELVIS, TRUNK = SEGMENTS.index("pelvis"), SEGMENTS.index("trunk")
FEET = [k for k, name in enumerate(SEGMENTS) if name.endswith("foot")]
TIMES = np.linspace(-3.0, 60.0, 505)
# Mass of a segment over the body's, Dempster: head and neck together have 0.081.
MASSES = {"pelvis": 0.142, "trunk": 0.355, "neck": 0.0162, "head": 0.0648, "thigh": 0.1, "shank": 0.0465}
MASSES |= {"foot": 0.0145, "upper_arm": 0.028, "forearm": 0.016, "hand": 0.006}


def standing(**options: float | None) -> Human:
    return Human(speed=0.0, path=PATH, **options)


def centre_of_pressure(human: Human, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centre of pressure on the floor, (n, 2) [m]: by the moments of weights and inertial forces of all segments.

    The moments of inertia of the segments about their own centres are left out: 1 % of the trunk's about the ankles.
    """
    step = 1e-3
    poses = human.link_poses_at(times)
    curves = (human.link_rates_at(times + step) - human.link_rates_at(times - step)) / (2.0 * step)
    weight, moment = np.zeros((len(times), 1)), np.zeros((len(times), 2))
    for k, segment in enumerate(SEGMENTS):
        kind = segment.removeprefix("left_").removeprefix("right_")
        center = np.append(spheroids(human.height, human.mass)[kind].center, 1.0)
        place, acceleration = poses[:, k] @ center, curves[:, k] @ center
        load = MASSES[kind] * (9.81 + acceleration[:, 2:])
        weight += load
        moment += place[:, :2] * load - MASSES[kind] * place[:, 2:] * acceleration[:, :2]
    return np.asarray(moment / weight)


def test_centre_of_pressure_moves_as_much_as_was_measured() -> None:
    # Wuehr et al. 2014, eyes open in the laboratory: 5.0 mm forward, 3.3 mm to the sides. The person looks along -x.
    # A spacing of 0.02 Hz averages out to 2 % in 2000 s, and one natural frequency stands for two.
    rms = centre_of_pressure(standing(), np.arange(0.0, 2000.0, 0.1)).std(axis=0)
    np.testing.assert_allclose(rms, [5.0e-3, 3.3e-3], rtol=0.04)


def test_sway_is_faster_than_drift_and_slower_than_1_hz() -> None:
    times = np.arange(0.0, 400.0, 0.2)
    places = standing().link_poses_at(times)[:, PELVIS, :2, 3]
    power = np.square(np.abs(np.fft.rfft((places - places.mean(axis=0)) * np.hanning(len(times))[:, None], axis=0)))
    frequencies = np.fft.rfftfreq(len(times), 0.2)
    inside = power[(frequencies > 0.09) & (frequencies < 1.0)].sum(axis=0)
    assert (inside > 0.999 * power.sum(axis=0)).all()


@pytest.mark.parametrize("breathing", [0.25, 0.7])
def test_chest_moves_by_4_mm_at_the_rate_of_breathing(breathing: float) -> None:
    # In the axes of the pelvis; both have their origin midway between the hips.
    human = Human(speed=0.0, path=[[1.2, 0.1], [0.0, 1.0]], breathing=breathing)
    poses = human.link_poses_at(TIMES)
    offset = poses[:, TRUNK, :, 3] - poses[:, PELVIS, :, 3]
    chest = np.einsum("nij,ni->nj", poses[:, PELVIS, :, :3], offset)
    np.testing.assert_allclose(chest[:, 1:], 0.0, atol=1e-15)
    waves = np.stack([np.cos(2.0 * np.pi * breathing * TIMES), np.sin(2.0 * np.pi * breathing * TIMES)], axis=1)
    amplitudes = np.linalg.lstsq(waves, chest[:, 0], rcond=None)[0]
    assert 2.0 * np.hypot(*amplitudes) == pytest.approx(4e-3)
    np.testing.assert_allclose(chest[:, 0], waves @ amplitudes, rtol=0.0, atol=1e-12)


def test_chest_alone_breathes() -> None:
    slow, fast = (standing(breathing=rate).link_poses_at(TIMES) for rate in (0.2, 0.4))
    others = np.delete(np.arange(len(SEGMENTS)), TRUNK)
    assert np.array_equal(slow[:, others], fast[:, others])
    assert np.abs(slow[:, TRUNK] - fast[:, TRUNK]).max() > 3e-3


@pytest.mark.parametrize("height", [1.0, 1.75])
def test_feet_rest_and_carry_the_legs(height: float) -> None:
    human, statue = standing(height=height), standing(height=height, breathing=None)
    poses, rest = human.link_poses_at(TIMES), statue.link_poses_at(TIMES)
    np.testing.assert_allclose(poses[:, FEET], rest[:, FEET], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(human.link_rates_at(TIMES)[:, FEET], 0.0, atol=1e-14)
    # Everything else moves, the head by the most.
    moved = np.linalg.norm((poses - rest)[..., 3], axis=-1).max(axis=0)
    others = np.delete(moved, FEET)
    assert 0.003 < others.min() < others.max() == moved[SEGMENTS.index("head")] < 0.04
    # The legs are as long as they were.
    for upper, lower in (("thigh", "shank"), ("shank", "foot"), ("thigh", "foot")):
        for side in ("left", "right"):
            ends = [SEGMENTS.index(f"{side}_{name}") for name in (upper, lower)]
            length, expected = (np.linalg.norm(np.diff(x[..., 3][:, ends], axis=1), axis=-1) for x in (poses, rest))
            np.testing.assert_allclose(length, expected, rtol=1e-12)


def test_rates_of_all_segments_are_differences_of_poses() -> None:
    human = standing(breathing=0.4)
    step = 1e-3
    before, after = human.link_poses_at(TIMES - step), human.link_poses_at(TIMES + step)
    # Central differences are off by step^2 / 6 of the third derivative, up to 0.04 m/s^3.
    np.testing.assert_allclose(human.link_rates_at(TIMES), (after - before) / (2.0 * step), rtol=0.0, atol=1e-7)


def test_people_sway_each_in_their_own_way_and_always_the_same() -> None:
    one, again, other, elsewhere = (
        Human(speed=0.0, path=path, phase=phase).link_poses_at(TIMES)[:, PELVIS, :2, 3]
        for path, phase in ((PATH, 0.0), ([[1.2, 0.1], [-2.0, 0.1]], -0.0), (PATH, 0.5), ([[2.2, 0.1], [0, 0.1]], 0.0))
    )
    assert np.array_equal(one, again)
    for others in (other, elsewhere):
        for axis in range(2):
            assert abs(np.corrcoef(one[:, axis], others[:, axis])[0, 1]) < 0.5


def test_start_time_shifts_sway_and_breath() -> None:
    early, late = standing(start_time=0.0), standing(start_time=7.0)
    np.testing.assert_allclose(late.link_poses_at(TIMES + 7.0), early.link_poses_at(TIMES), rtol=0.0, atol=1e-12)


def test_statue_is_a_pose_and_a_walking_person_is_not_changed() -> None:
    assert all(isinstance(body.motion, rc.Pose) for body in standing(breathing=None).bodies(subdivisions=1))
    assert not rc.Scene(standing().bodies(subdivisions=1)).is_static
    walking, breathless = (Human(path=PATH, breathing=breathing) for breathing in (0.25, None))
    assert np.array_equal(walking.link_poses_at(TIMES), breathless.link_poses_at(TIMES))
    assert np.array_equal(walking.link_rates_at(TIMES), breathless.link_rates_at(TIMES))


@needs_robots
def test_real_meshes_breathe_and_sway_on_feet_that_rest() -> None:
    bodies, statue = (
        {body.name: body.motion for body in standing(breathing=breathing).mesh_bodies()} for breathing in (0.25, None)
    )
    spheroids = standing()
    for time in (0.0, 1.3, 7.7):
        for name, motion in bodies.items():
            np.testing.assert_allclose(
                motion.at(time).rotation, spheroids.segment_motion(name.partition("/")[2]).at(time).rotation, atol=1e-15
            )
        for side in ("left", "right"):
            foot, at_rest = bodies[f"human/{side}_foot"].at(time), statue[f"human/{side}_foot"].at(time)
            np.testing.assert_allclose(foot.position, at_rest.position, rtol=0.0, atol=1e-14)


def signs_of(bodies: list[rc.Body], duration: float) -> rc.processing.VitalSigns:
    simulator = rc.Simulator(
        rc.Scene(bodies),
        rc.bgt60tr13c(num_chirps=1),
        radar_motion=rc.Pose([0.0, 0.0, 1.2]),
        field_of_view_deg=(60.0, 60.0),
        resolution=96,
    )
    return rc.processing.vital_signs(simulator.record(0.0, duration, 10.0, progress=False))


def test_radar_finds_the_breath_of_a_person_whose_pelvis_rests_and_not_of_one_who_stands() -> None:
    bodies = standing(breathing=0.3).bodies(subdivisions=3)
    pelvis = bodies[PELVIS].motion
    held = [
        rc.Body(body.mesh, material=body.material, motion=rc.Attached(pelvis.at(0.0), relative), name=body.name)
        for body in bodies
        if not str(body.name).endswith(("thigh", "shank", "foot"))
        for relative in [rc.Attached(Inverse(pelvis), body.motion)]
    ]
    seated = signs_of(held, 15.0)
    assert seated.breathing_rate == pytest.approx(0.3, rel=0.02)
    assert seated.amplitude == pytest.approx(4e-3, rel=0.1)
    stands = signs_of(bodies, 15.0)
    assert np.isnan(stands.breathing_rate)
    assert "the phase jumps" in stands.breathing_reason
