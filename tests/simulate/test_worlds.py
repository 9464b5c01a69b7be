"""Many worlds at once: to the bit the frames of each world by itself."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from radarcore.simulate.placement import core_placement
from radarcore.simulate.simulator import Simulator

RNG = np.random.default_rng(5)
WORLDS = 5
RECEIVERS = {
    "plain": rc.Receiver(noise_figure_db=12.0, output="real"),
    "iq": rc.Receiver(noise_figure_db=12.0),
    "adc": rc.Receiver(noise_figure_db=12.0, output="real", full_scale=1e-4, adc_bits=12),
    "none": None,
}


def scene(box: rc.Linear | rc.Pose | None = None, point: tuple[list[float], list[float]] | None = None) -> rc.Scene:
    """A floor that stays, a box and a point that move."""
    position, velocity = point or ([2.0, 0.5, 0.0], [0.0, 0.0, 0.0])
    return rc.Scene(
        [
            rc.Body(
                rc.shapes.plate(4.0, 4.0),
                motion=rc.Pose.from_rpy([2.0, 0.0, -0.6], [0.0, -np.pi / 2.0, 0.0]),
                name="floor",
            ),
            rc.PointTarget(position, velocity=velocity, rcs=0.05, name="point"),
            rc.Body(rc.shapes.box((0.2, 0.3, 0.4)), motion=box or rc.Pose([3.0, 0.0, 0.0]), name="box"),
        ]
    )


def simulator(of: rc.Scene, **options: object) -> Simulator:
    radar = options.pop("radar", rc.bgt60tr13c(num_chirps=16))
    return Simulator(of, radar, sampling="fast", **options)


def random_motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses (world, 2, 4, 4) of point and box, velocities and angular velocities."""
    poses = np.tile(np.eye(4), (WORLDS, 2, 1, 1))
    for world in range(WORLDS):
        poses[world, 1, :3, :3] = rc.Pose.from_rpy([0, 0, 0], RNG.uniform(-3.0, 3.0, 3)).rotation
    poses[:, 0, :3, 3] = RNG.uniform([1.0, -0.4, -0.3], [2.0, 0.4, 0.3], (WORLDS, 3))
    poses[:, 1, :3, 3] = RNG.uniform([2.0, -0.6, -0.3], [3.0, 0.6, 0.3], (WORLDS, 3))
    return poses, RNG.normal(size=(WORLDS, 2, 3)), RNG.normal(size=(WORLDS, 2, 3)) * [[[0.0], [1.0]]]


@pytest.mark.parametrize("kind", RECEIVERS)
@pytest.mark.parametrize("threads", [1, 2])
def test_every_world_is_its_frame_to_the_bit(kind, threads):
    radar = replace(rc.bgt60tr13c(num_chirps=16), receiver=RECEIVERS[kind])
    many = simulator(scene(), radar=radar, threads=threads, seed=7)
    for _ in range(2):  # with and without the frame before
        poses, velocities, turns = random_motion()
        found = many.worlds(poses, velocities=velocities, angular_velocities=turns, bodies=["point", "box"])
        for world in range(WORLDS):
            motion = rc.Linear(
                rc.Pose(poses[world, 1, :3, 3], poses[world, 1, :3, :3]), velocities[world, 1], turns[world, 1]
            )
            alone = scene(motion, (poses[world, 0, :3, 3].tolist(), velocities[world, 0].tolist()))
            frame = simulator(alone, radar=radar, seed=7 + world).frame(0.0)
            np.testing.assert_array_equal(found.cube[world], frame.cube)
            for name in ("range", "velocity", "azimuth", "elevation"):
                np.testing.assert_array_equal(getattr(found.truth, name)[world], getattr(frame.truth, name))
        assert found.truth.names == ("floor", "point", "box")


def test_radar_is_the_last_of_the_poses_and_transmitters_take_turns():
    radar = rc.Radar(
        rc.Waveform.from_sweep(
            start_frequency=76e9,
            stop_frequency=77e9,
            sample_rate=4e6,
            num_samples=64,
            num_chirps=8,
            chirp_interval=100e-6,
        ),
        tx=[[0.0, 0.0, 0.0], [0.0, 8e-3, 0.0]],
        rx=[[0.0, 0.0, 0.0], [0.0, 2e-3, 0.0]],
        schedule=rc.Schedule.tdm(),
    )
    poses = np.tile(np.eye(4), (2, 2, 1, 1))
    poses[:, 0, 0, 3] = [2.0, 3.0]  # the ball
    poses[:, 1, 0, 3] = [0.0, 0.5]  # the radar
    rates = np.zeros((2, 2, 3))
    rates[1, 1, 0] = 1.0
    ball = rc.Body(rc.shapes.sphere(0.1), name="ball")
    found = simulator(rc.Scene([ball]), radar=radar).worlds(poses, velocities=rates)
    np.testing.assert_allclose(found.truth.range[:, 0], [1.9, 2.4], atol=2e-3)
    np.testing.assert_allclose(found.truth.velocity[:, 0], [0.0, -1.0], atol=1e-3)
    moved = rc.Scene([rc.Body(rc.shapes.sphere(0.1), motion=rc.Pose([3.0, 0.0, 0.0]), name="ball")])
    mount = rc.Linear(rc.Pose([0.5, 0.0, 0.0]), [1.0, 0.0, 0.0])
    frame = simulator(moved, radar=radar, radar_motion=mount, seed=1).frame(0.0)
    np.testing.assert_array_equal(found.cube[1], frame.cube)
    # Maps of all worlds in one call.
    spectra = rc.range_doppler(found.cube, radar.sequences()[0].waveform)
    np.testing.assert_array_equal(spectra[1], rc.range_doppler(frame))


def poses_at(*distances: float, bodies: int = 1) -> np.ndarray:
    poses = np.tile(np.eye(4), (len(distances), bodies, 1, 1))
    poses[:, 0, 0, 3] = distances
    return poses


BALL = rc.Scene([rc.Body(rc.shapes.sphere(0.1), name="ball")])
WAVES = rc.Deformation([0.0, 1.0], np.tile(BALL.bodies[0].mesh.vertices, (2, 1, 1)))
WAVING = rc.Scene([rc.Body(rc.shapes.sphere(0.1), name="ball", deformation=WAVES)])


@pytest.mark.parametrize(
    ("of", "poses", "options", "message"),
    [
        (WAVING, poses_at(1.0), {}, "without deforming bodies"),
        (BALL, np.eye(4), {}, r"poses: expected shape \(world, 1, 4, 4\), or one more for the radar, got \(4, 4\)"),
        (BALL, poses_at(bodies=1)[:0], {}, r"poses: expected shape .* got \(0, 1, 4, 4\)"),
        (BALL, poses_at(1.0, bodies=3), {}, r"poses: expected shape .* got \(1, 3, 4, 4\)"),
        (BALL, 2.0 * poses_at(1.0), {}, "poses"),
        (BALL, poses_at(1.0), {"bodies": ["bal"]}, "bodies: expected names of the scene's bodies, got 'bal'"),
        (BALL, poses_at(1.0), {"velocities": np.zeros((1, 2, 3))}, r"velocities: expected shape \(1, 1, 3\)"),
        (BALL, poses_at(1.0), {"velocities": np.full((1, 1, 3), np.nan)}, "velocities"),
        (BALL, poses_at(1.0, 0.05), {}, "poses: expected the antennas outside of every body .* 'ball'"),
    ],
)
def test_what_does_not_fit_is_refused(of, poses, options, message):
    with pytest.raises(ValueError, match=message):
        simulator(of).worlds(poses, **options)


def test_fast_worlds_are_warned_of_once_by_name():
    many = simulator(BALL)
    with pytest.warns(UserWarning, match="'ball' has a radial speed of 30 m/s"):
        many.worlds(poses_at(1.0, 2.0), velocities=[[[0.0, 0.0, 0.0]], [[30.0, 0.0, 0.0]]])


def test_core_refuses_rows_that_are_not_there():
    engine = simulator(BALL)._engines[0]
    poses = np.tile(np.eye(4)[:3], (3, 2, 1, 1))
    own, moved = core_placement(poses, np.zeros((3, 0, 3))), np.ascontiguousarray(poses[:, None, :1])
    with pytest.raises(ValueError, match=r"rows: expected at most 1, got \[2\]"):
        engine.worlds(own, moved, [2])
    with pytest.raises(ValueError, match=r"moved: expected shape \(3, n, 2, 3, 4\), got \(3, 1, 1, 3, 4\)"):
        engine.worlds(own, moved, [0, 1])


def test_tools_find_the_ball_by_radar_alone():
    pytest.importorskip("gymnasium", reason="needs gymnasium: pip install -r requirements/test.txt")
    example = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "reach.py"))
    worlds = example["Reach"](4)
    observations, _ = worlds.reset(seed=3)
    np.testing.assert_array_equal(observations, worlds.reset(seed=3)[0])
    reached, first = np.zeros(4, bool), worlds.ball.copy()
    for _ in range(example["MOST_STEPS"]):
        assert worlds.observation_space.contains(observations)
        before = reached.copy()
        observations, rewards, terminated, truncated, _ = worlds.step(example["follow"](observations, worlds.radar))
        assert not truncated.any()
        reached |= terminated
        if before.any():
            break
    # The next step after an episode begins another, without a reward.
    assert (rewards[before] == 0.0).all()
    assert (worlds.ball[before] != first[before]).any()
