"""Rays that are not cast change nothing: rays of empty, unmoved and unseen tiles."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

import radarcore as rc

RADAR = rc.Radar(
    rc.Waveform(
        start_frequency=60e9, slope=20e12, sample_rate=2e6, num_samples=64, num_chirps=8, chirp_interval=200e-6
    ),
    tx=[[0, 0, 0]],
    rx=[[0, 0, 0], [0, 0.0025, 0]],
)


def ten_bodies(velocity: float = 1.0) -> rc.Scene:
    """Nine spheres that rest in a row before a far one that moves."""
    ball = rc.shapes.sphere(0.1)
    bodies = [
        rc.Body(ball, motion=rc.Pose([3.0, 0.3 * (i - 4), 0.2 * (i % 3) - 0.2]), name=f"ball {i}") for i in range(9)
    ]
    mover = rc.Linear(rc.Pose([2.0, -0.3, 0.5]), velocity=[0.0, velocity, 0.0])
    return rc.Scene([*bodies, rc.Body(rc.shapes.sphere(0.08), motion=mover, name="mover")])


PIXELS: dict[str, Any] = {"sampling": "footprint", "resolution": 128, "field_of_view_deg": (60.0, 60.0)}


def simulator(scene: rc.Scene | None = None, **options: Any) -> rc.Simulator:
    return rc.Simulator(scene or ten_bodies(), RADAR, **(PIXELS | options))


def whole(sim: rc.Simulator) -> rc.Simulator:
    """The simulator, which leaves out nothing from now on."""
    vars(sim)["_engines"] = sim._new_engines(reuse_tiles=False, skip_empty=False)
    return sim


def test_only_tiles_that_the_moving_body_touches_are_cast_again() -> None:
    sim, fresh = simulator(), whole(simulator())
    sim.depth_image(0.0)
    assert sim.frame(0.0).stats["tiles_reused"] == 0
    for time in (0.05, 0.1, 0.4):
        frame, expected = sim.frame(time), fresh.frame(time)
        np.testing.assert_array_equal(frame.cube, expected.cube)
        assert frame.truth is not None
        assert expected.truth is not None
        np.testing.assert_array_equal(frame.truth.range, expected.truth.range)
        # The box of a ball of 8 cm at 2 m, before and after: at most 2 x 4 x 4 tiles of the 16 x 16.
        assert frame.stats["rays_cast"] <= 2 * 16 * 64
        assert frame.stats["tiles_reused"] >= 256 - 2 * 16 - frame.stats["tiles_skipped"]
        assert expected.stats["rays_cast"] == 128 * 128
        image = sim.depth_image(time)
        for name in ("distance", "cos_incidence", "body", "normals"):
            np.testing.assert_array_equal(getattr(image, name), getattr(fresh.depth_image(time), name))


@pytest.mark.parametrize("sampling", ["footprint", "adaptive"])
def test_what_is_reused_from_frame_to_frame_is_the_same_to_the_last_bit(sampling: str) -> None:
    # Matt, rough and mirror-like bodies, one that moves between others, one that changes its shape, and corners.
    ball = rc.shapes.sphere(0.08)
    bodies = [
        rc.Body(
            rc.shapes.dihedral(0.3),
            material=rc.materials["concrete"],
            motion=rc.Pose.from_rpy([2.5, 0.5, 0], [0, 0, 0.1]),
        ),
        rc.Body(rc.shapes.plate(0.5, 0.5), material=rc.Material.lambertian(0.5), motion=rc.Pose([2.5, -0.6, 0.1])),
        rc.Body(
            rc.shapes.box(0.2), material=rc.materials["wood"].with_surface(roughness=3e-4), motion=rc.Pose([2, 0, 0])
        ),
        rc.Body(ball, motion=rc.Linear(rc.Pose([1.5, -0.4, 0.0]), velocity=[0.0, 2.0, 0.1])),
        rc.Body(
            ball, motion=rc.Pose([1.5, 0.3, -0.4]), deformation=lambda t: ball.vertices * (1.0 + 0.01 * np.sin(9.0 * t))
        ),
    ]
    options: dict[str, Any] = {"sampling": sampling, "rcs_floor": 1e-3, "max_bounces": 3, "method": "direct"}
    sim = simulator(rc.Scene(bodies), **options)
    for time in (0.0, 0.025, 0.3):
        frame, fresh = sim.frame(time), simulator(rc.Scene(bodies), **options).frame(time)
        assert fresh.stats["bounce_paths"] > 0
        assert fresh.stats["tiles_reused"] == 0
        assert (frame.stats["tiles_reused"] > 0) == (time > 0.0)
        np.testing.assert_array_equal(frame.cube, fresh.cube)
        # The other way to leave nothing out.
        np.testing.assert_array_equal(frame.cube, whole(simulator(rc.Scene(bodies), **options)).frame(time).cube)


def test_nothing_is_cast_while_nothing_moves() -> None:
    sim = simulator(ten_bodies(velocity=0.0))
    first, second = sim.frame(0.0), sim.frame(1.0)
    assert first.stats["rays_cast"] > 0
    assert second.stats["rays_cast"] == 0
    np.testing.assert_array_equal(first.cube, second.cube)


def test_a_moving_sensor_sees_everything_anew() -> None:
    motion = rc.Linear(rc.Pose(), velocity=[0.1, 0.0, 0.0])
    sim, fresh = simulator(radar_motion=motion), whole(simulator(radar_motion=motion))
    for time in (0.0, 0.1):
        frame = sim.frame(time)
        assert frame.stats["tiles_reused"] == 0
        np.testing.assert_array_equal(frame.cube, fresh.frame(time).cube)


def test_the_gain_floor_leaves_out_nothing_that_some_pair_of_antennas_sees() -> None:
    # Antennas with a spacing of 10 cm and different directions, at walls at that distance and farther.
    slopes = -np.abs(np.linspace(-120.0, 40.0, 9))[:, None] * np.ones(3)
    table = rc.TabulatedPattern.from_degrees(np.linspace(-40.0, 40.0, 9), [-40.0, 0.0, 40.0], slopes)
    narrow = rc.GaussianPattern(20.0, beamwidth_azimuth_deg=8.0, beamwidth_elevation_deg=10.0)
    radar = rc.Radar(
        RADAR.waveform,
        tx=[[0.0, 0.05, 0.0], [0.0, -0.05, 0.0]],
        rx=[[0.0, 0.05, 0.02], [0.01, -0.05, 0.0]],
        tx_patterns=[narrow, table],
        rx_patterns=[table, narrow],
    )
    shares = []
    for distance in (0.1, 0.3, 2.0):
        wall = rc.Body(rc.shapes.plate(8.0, 8.0), material=rc.Material(-0.5, 0.5), motion=rc.Pose([distance, 0, 0]))
        whole, most = (
            rc.Simulator(rc.Scene([wall]), radar, gain_floor_db=floor, method="direct", **PIXELS)
            for floor in (np.inf, 80.0)
        )
        expected, frame = whole.frame(), most.frame()
        shares.append(frame.stats["rays_cast"] / expected.stats["rays_cast"])
        # In every channel no path is missing that is well above the floor, and the rest adds up to little.
        all_of_them, kept = np.abs(whole.paths().amplitude), np.abs(most.paths().amplitude)
        for channel in range(4):
            largest = all_of_them[channel].max()
            assert (kept[channel] > 1e-3 * largest).sum() == (all_of_them[channel] > 1e-3 * largest).sum() > 0
            error = np.abs(frame.cube[channel] - expected.cube[channel]).max()
            assert error < 1e-4 * np.abs(expected.cube[channel]).max()
    assert 1.0 >= shares[0] > shares[1] > shares[2]
    assert shares[2] < 0.8


@pytest.mark.parametrize(("loss_db", "is_seen"), [(72.0, True), (88.0, False)])
def test_by_default_rays_are_cast_down_to_80_db_below_the_peak(loss_db: float, is_seen: bool) -> None:
    # A Gaussian beam of width w loses 2 * 10 lg(e) * 4 ln 2 * (angle / w)^2 dB there and back.
    width_deg = 12.0
    angle = np.deg2rad(width_deg) * np.sqrt(loss_db / (80.0 * np.log10(np.e) * np.log(2.0)))
    radar = rc.Radar(RADAR.waveform, pattern=rc.GaussianPattern(20.0, width_deg, width_deg))
    ball = rc.Body(rc.shapes.sphere(0.01), motion=rc.Pose([2.0 * np.cos(angle), 2.0 * np.sin(angle), 0.0]))
    options: dict[str, Any] = {
        "sampling": "footprint",
        "resolution": 512,
        "field_of_view_deg": (60.0, 60.0),
        "method": "direct",
    }
    everything = rc.Simulator(rc.Scene([ball]), radar, gain_floor_db=np.inf, **options).frame().cube
    with nullcontext() if is_seen else pytest.warns(UserWarning, match="no body is seen"):
        cube = rc.Simulator(rc.Scene([ball]), radar, **options).frame().cube
    assert np.abs(everything).max() > 0.0
    np.testing.assert_array_equal(cube, everything if is_seen else np.zeros_like(cube))


def test_tiles_are_taken_over_behind_a_beam_too() -> None:
    # A ball comes nearer: the antennas beside the centre see more and more of the image at its distance.
    beam = rc.GaussianPattern(20.0, beamwidth_azimuth_deg=12.0, beamwidth_elevation_deg=14.0)
    radar = rc.Radar(RADAR.waveform, tx=[[0.0, 0.05, 0.0]], rx=[[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]], pattern=beam)
    ball = rc.Linear(rc.Pose([2.5, 0.3, 0.0]), velocity=[-2.0, 0.0, 0.0])
    scene = rc.Scene([*ten_bodies(0.0).bodies, rc.Body(rc.shapes.sphere(0.1), motion=ball)])
    sim, fresh = (rc.Simulator(scene, radar, **PIXELS) for _ in range(2))
    vars(fresh)["_engines"] = fresh._new_engines(reuse_tiles=False)
    reused = []
    for time in np.arange(0.0, 1.15, 0.05):
        frame = sim.frame(time)
        np.testing.assert_array_equal(frame.cube, fresh.frame(time).cube)
        reused.append(frame.stats["tiles_reused"] > 0)
    # All but in the first, and where the distance of the nearest passes a power of two: 2, 1 and 0.5 m.
    assert sum(reused) == len(reused) - 4


def test_points_hide_behind_bodies() -> None:
    sim = simulator()
    front, behind, beside = [2.5, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.2, 0.2]
    surface = sim.depth_image().points + RADAR.array_center
    assert sim.is_hidden([front, behind, beside]).tolist() == [False, True, False]
    assert not sim.is_hidden(surface).any(), "visible points are not hidden"
    assert sim.is_hidden(np.zeros((0, 3))).shape == (0,)
    with pytest.raises(ValueError, match=r"points: expected shape \(n, 3\), got \(3,\)"):
        sim.is_hidden([1.0, 2.0, 3.0])


def test_a_scene_tells_its_memory() -> None:
    mesh = rc.shapes.sphere(0.5)
    one, two = rc.Scene([rc.Body(mesh)]), rc.Scene([rc.Body(mesh), rc.Body(mesh)])
    assert one.memory == two.memory, "the mesh is shared"
    assert rc.Scene([rc.Body(mesh), rc.Body(rc.shapes.sphere(0.5))]).memory == 2 * one.memory
    assert rc.Scene([]).memory == 0
    flat = rc.Mesh(mesh.vertices, mesh.triangles, shading="flat")
    per_triangle = (rc.Scene([rc.Body(flat)]).memory - mesh.vertices.nbytes) / len(mesh.triangles)
    assert 48 < per_triangle < 110  # corners in single precision alone are 36, their numbers 12


def test_an_image_can_be_kept(tmp_path: Any) -> None:
    import pickle

    image = simulator().depth_image()
    path = tmp_path / "image.pickle"
    path.write_bytes(pickle.dumps(image))
    again = pickle.loads(path.read_bytes())
    for name in ("distance", "cos_incidence", "reflectance", "body", "directions", "surface_distance", "normals"):
        np.testing.assert_array_equal(getattr(again, name), getattr(image, name))
