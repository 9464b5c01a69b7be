"""Depth images: planes on paper, the order of an image, and soups of triangles against brute force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc

RADAR = rc.Radar(rc.Waveform(start_frequency=60e9, slope=1e12, sample_rate=1e6, num_samples=8))

PLANE = 1e-13
"""Relative: a few roundings of f64."""


def depth_image(bodies: list[Any], *, time: float = 0.0, **options: Any) -> rc.DepthImage:
    settings: dict[str, Any] = {"resolution": 33, "field_of_view_deg": (60.0, 60.0)} | options
    return rc.Simulator(rc.Scene(bodies), RADAR, **settings).depth_image(time)


def wall(x: float = 3.0, size: float = 20.0, **options: Any) -> rc.Body:
    return rc.Body(rc.shapes.plate(size, size), motion=rc.Pose([x, 0.0, 0.0]), **options)


def random_pose(rng: np.random.Generator, spread: float) -> rc.Pose:
    return rc.Pose.from_quaternion(rng.uniform(-spread, spread, 3), wxyz=rng.standard_normal(4))


def image_plane(rows: int, columns: int, field_of_view_deg: tuple[float, float]) -> tuple[Any, Any]:
    """Coordinates u = y/x and v = z/x of the pixel centres, (rows, columns) each."""
    half_width, half_height = np.tan(0.5 * np.deg2rad(field_of_view_deg))
    u = half_width * (1.0 - (2.0 * np.arange(columns) + 1.0) / columns)
    v = half_height * (1.0 - (2.0 * np.arange(rows) + 1.0) / rows)
    return np.meshgrid(u, v)


@pytest.mark.parametrize(
    ("resolution", "field_of_view_deg"),
    [(33, (60.0, 60.0)), ((20, 50), (100.0, 40.0)), ((7, 1), (1.0, 120.0)), (1, (60.0, 60.0))],
)
def test_wall_at_three_metres_is_three_times_the_slant_away(resolution: Any, field_of_view_deg: Any) -> None:
    image = depth_image([wall()], resolution=resolution, field_of_view_deg=field_of_view_deg)
    rows, columns = np.broadcast_to(resolution, 2)
    u, v = image_plane(rows, columns, field_of_view_deg)
    slant = np.sqrt(1.0 + u**2 + v**2)
    assert image.distance.shape == (rows, columns)
    np.testing.assert_allclose(image.distance, 3.0 * slant, rtol=PLANE)
    np.testing.assert_allclose(image.cos_incidence, 1.0 / slant, rtol=PLANE)
    np.testing.assert_allclose(image.directions, np.stack([np.ones_like(u), u, v], -1) / slant[..., None], rtol=PLANE)
    np.testing.assert_allclose(image.points[:, 0], 3.0, rtol=PLANE)
    assert image.field_of_view_deg == field_of_view_deg


def test_normals_face_the_sensor_and_make_the_cosine() -> None:
    image = depth_image([rc.Body(rc.shapes.sphere(0.5, subdivisions=3), motion=rc.Pose([2.0, 0.2, 0.1]))])
    is_hit = image.body == 0
    cosines = -(image.normals * image.directions).sum(axis=-1)
    np.testing.assert_allclose(cosines[is_hit], image.cos_incidence[is_hit], rtol=0, atol=1e-14)
    assert (image.normals[~is_hit] == 0.0).all()
    assert (image.surface_distance[~is_hit] == np.inf).all()


def test_surface_distance_is_that_of_the_sphere_and_not_of_its_facets() -> None:
    image = depth_image([rc.Body(rc.shapes.sphere(0.5, subdivisions=3), motion=rc.Pose([2.0, 0.0, 0.0]))])
    ball = np.array([2.0, 0.0, 0.0])
    is_seen = image.cos_incidence > 0.5
    sagitta = 0.5 * 0.5 * 0.1**2  # edges of 1280 triangles are 0.14 radii long
    for distance, error in ((image.distance, sagitta), (image.surface_distance, 0.1 * sagitta)):
        points = distance[is_seen, None] * image.directions[is_seen]
        assert np.abs(np.linalg.norm(points - ball, axis=1) - 0.5).max() < error
    facets = image.distance[is_seen, None] * image.directions[is_seen]
    assert np.abs(np.linalg.norm(facets - ball, axis=1) - 0.5).max() > 0.2 * sagitta


def test_body_up_on_the_left_appears_at_the_top_left() -> None:
    ball = rc.shapes.sphere(0.1)
    image = depth_image([rc.Body(ball, motion=rc.Pose([2.0, 0.8, 0.6]))])
    rows, columns = np.nonzero(image.body == 0)
    assert len(rows) > 0
    assert rows.max() < 16
    assert columns.max() < 16
    assert columns.mean() < rows.mean()  # farther to the left than up
    assert (image.points[:, 1:] > 0.0).all()


def test_misses_are_inf_and_minus_one_and_zero() -> None:
    image = depth_image([rc.PointTarget([2.0, 0.0, 0.0]), wall(-3.0), wall(3.0, size=1.0)])
    is_miss = image.body == -1
    assert 0 < is_miss.sum() < is_miss.size
    assert (image.distance[is_miss] == np.inf).all()
    assert np.isfinite(image.distance[~is_miss]).all()
    assert (image.cos_incidence[is_miss] == 0.0).all()
    assert (image.reflectance[is_miss] == 0.0).all()
    assert len(image.points) == (~is_miss).sum()


@pytest.mark.parametrize("bodies", [[], [rc.PointTarget([1.0, 0.0, 0.0])], [rc.Body(rc.Mesh([], []))]])
def test_scene_without_triangles_has_no_hits(bodies: list[Any]) -> None:
    image = depth_image(bodies)
    assert (image.body == -1).all()
    assert (image.distance == np.inf).all()
    assert image.points.shape == (0, 3)


def test_body_numbers_are_those_of_the_scene_with_points_and_empty_meshes_in_between() -> None:
    material = rc.Material(0.3j, 0.5)
    image = depth_image(
        [
            rc.PointTarget([1.0, 0.0, 0.0]),
            wall(3.0, material=rc.materials["concrete"]),
            rc.Body(rc.Mesh([], [])),
            rc.PointTarget([1.0, 0.1, 0.0]),
            rc.Body(rc.shapes.box(0.5), motion=rc.Pose([2.0, 0.1, 0.0]), material=material),
        ]
    )
    assert set(image.body.ravel().tolist()) == {1, 4}
    assert image.body[16, 16] == 4
    assert image.reflectance[image.body == 4] == pytest.approx(0.09 + 0.5, rel=PLANE)
    reflection, _ = rc.materials["concrete"].response(
        RADAR.waveform.center_frequency, image.cos_incidence[image.body == 1]
    )
    assert image.reflectance[image.body == 1] == pytest.approx(np.abs(reflection) ** 2, rel=PLANE)


def test_bodies_and_sensor_are_where_they_are_at_the_time_of_the_image() -> None:
    receding = rc.Body(
        rc.shapes.plate(20.0, 20.0), motion=rc.Linear(rc.Pose([3.0, 0.0, 0.0]), velocity=[2.0, 0.0, 0.0])
    )
    chasing = rc.Linear(rc.Pose(), velocity=[0.5, 0.0, 0.0])
    for time in (-1.0, 0.0, 0.5):
        image = depth_image([receding], time=time, radar_motion=chasing)
        assert image.distance[16, 16] == pytest.approx(3.0 + 1.5 * time, rel=PLANE)
    # A quarter of a turn to the left in one second: the wall in front appears on the right, then not at all.
    turning = rc.Linear(rc.Pose(), angular_velocity=[0.0, 0.0, 0.5 * np.pi])
    image = depth_image([wall(3.0, size=1.0)], time=0.2, radar_motion=turning)
    assert np.nonzero(image.body == 0)[1].min() > 16
    assert (depth_image([wall(3.0, size=1.0)], time=1.0, radar_motion=turning).body == -1).all()


@pytest.mark.parametrize("seed", range(2))
def test_no_ray_leaves_a_closed_mesh(seed: int) -> None:
    rng = np.random.default_rng(seed)
    closed = [rc.shapes.sphere(1.0, subdivisions=3), rc.shapes.box(2.0), rc.shapes.capsule(0.5, 3.0)]
    for mesh in closed:
        # Anywhere inside, looking anywhere; and from the middle along the axes, through edges and corners.
        for sensor in (random_pose(rng, 0.25), rc.Pose(), rc.Pose.from_rpy([0, 0, 0], [0, 0, np.pi / 4])):
            image = depth_image([rc.Body(mesh)], radar_motion=sensor, resolution=65, field_of_view_deg=(150.0, 150.0))
            assert (image.body == 0).all(), f"seed {seed}"
            assert image.distance.max() <= 4.0  # no closed mesh here is longer than 2 sqrt(3) m
            assert (image.cos_incidence >= 0.0).all()


def test_box_from_its_middle_has_its_walls_at_half_its_edges() -> None:
    image = depth_image([rc.Body(rc.shapes.box((4.0, 3.0, 2.0)))], field_of_view_deg=(120.0, 120.0))
    points = np.abs(image.points)
    assert len(points) == 33 * 33
    np.testing.assert_allclose((points / [2.0, 1.5, 1.0]).max(axis=1), 1.0, rtol=PLANE)


def test_sensor_inside_a_body_sees_it_from_inside_and_nothing_else() -> None:
    image = depth_image([rc.Body(rc.shapes.sphere(0.3)), wall(3.0)])
    assert (image.body == 0).all()
    assert image.distance == pytest.approx(0.3, abs=5e-5)  # the sagitta of its facets


def test_image_is_the_same_a_kilometre_from_the_origin() -> None:
    box = rc.shapes.box((0.3, 0.4, 0.5))
    here = rc.Pose.from_rpy([2.0, 0.1, -0.2], [0.3, 0.2, 0.1])
    near = depth_image([rc.Body(box, motion=here)])
    offset = np.array([1000.0, -700.0, 300.0])

    # Far from the world's origin, and far from the body's own.
    far_world = depth_image([rc.Body(box, motion=rc.Pose(offset) @ here)], radar_motion=rc.Pose(offset))
    far_vertices = depth_image([rc.Body(rc.Mesh(box.vertices + offset, box.triangles), motion=here @ rc.Pose(-offset))])
    for far in (far_world, far_vertices):
        np.testing.assert_array_equal(far.body, near.body)
        is_hit = near.body == 0
        # Coordinates of 1 km are known to 1e-13 m; oblique faces and the turn make a few of those.
        np.testing.assert_allclose(far.distance[is_hit], near.distance[is_hit], rtol=0, atol=5e-12)


def test_a_tenth_of_a_millimetre_before_a_kilometre_of_wall() -> None:
    speck = rc.Body(rc.shapes.plate(1e-4, 1e-4), motion=rc.Pose([0.05, 0.0, 0.0]))
    image = depth_image([wall(900.0, size=1000.0), speck], field_of_view_deg=(0.2, 0.2))
    u, v = image_plane(33, 33, (0.2, 0.2))
    is_speck = (np.abs(u) < 1e-3) & (np.abs(v) < 1e-3)
    assert is_speck.sum() == 19 * 19  # 2e-3 of 3.49e-3 in 33 columns
    np.testing.assert_array_equal(image.body, is_speck.astype(np.int32))
    np.testing.assert_allclose(image.distance, np.where(is_speck, 0.05, 900.0) * np.sqrt(1 + u**2 + v**2), rtol=PLANE)


def test_image_does_not_depend_on_the_number_of_threads() -> None:
    bodies = [rc.Body(rc.shapes.sphere(0.5), motion=rc.Pose([3.0, 0.0, 0.0])), wall(4.0)]
    one, two, five = (depth_image(bodies, threads=threads) for threads in (1, 2, 5))
    for name in ("distance", "cos_incidence", "reflectance", "body", "directions"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
        np.testing.assert_array_equal(getattr(one, name), getattr(five, name))
