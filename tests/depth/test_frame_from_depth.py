"""Frames from depth images: radarcore's own images give radarcore's own frames; everything else is a measured loss."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.depth import surfaces

WAVEFORM = rc.Waveform.from_sweep(
    start_frequency=60e9, stop_frequency=61e9, sample_rate=2e6, num_samples=128, num_chirps=32, chirp_interval=400e-6
)
RADAR = rc.Radar(WAVEFORM)
VIEW = (60.0, 60.0)
PIXELS = 128
CAMERA = rc.Camera.from_field_of_view(VIEW, PIXELS, PIXELS)
SLANT = CAMERA.slant(PIXELS, PIXELS)
CONDUCTOR = rc.materials["perfect_conductor"]
MIDDLE = 0.5 * WAVEFORM.duration

NEAR, FAR = 0.01, 10.0


def body(mesh: rc.Mesh, motion: Any) -> rc.Body:
    return rc.Body(mesh, material=CONDUCTOR, motion=motion)


def planar_bodies() -> list[rc.Body]:
    return [
        body(rc.shapes.plate(0.4, 0.3), rc.Pose([1.5, 0.4, 0.2])),
        body(rc.shapes.box(0.5), rc.Pose.from_rpy([2.0, -0.5, -0.3], [0.1, 0.6, 0.6])),
        body(rc.shapes.plate(6.0, 6.0), rc.Pose.from_rpy([4.0, 0.0, 0.0], [0.0, 0.02, 0.03])),
    ]


def curved_bodies() -> list[rc.Body]:
    return [
        body(rc.shapes.sphere(0.2), rc.Pose([1.8, -0.4, 0.5])),
        body(rc.shapes.cylinder(0.1, 0.6), rc.Pose([2.0, 0.5, -0.5])),
    ]


def simulator(bodies: list[Any], **options: Any) -> rc.Simulator:
    settings: dict[str, Any] = {"resolution": PIXELS, "field_of_view_deg": VIEW} | options
    return rc.Simulator(rc.Scene(bodies), RADAR, **{"sampling": "footprint", **settings})


def frame_of(distance: Any, reflectance: Any = 1.0, radar: rc.Radar = RADAR, **options: Any) -> rc.Frame:
    return rc.frame_from_depth(distance, reflectance, radar, **({"camera": VIEW} | options))


def error(frame: rc.Frame, reference: rc.Frame) -> float:
    """Relative l2 error of the samples."""
    return float(np.linalg.norm(frame.cube - reference.cube) / np.linalg.norm(reference.cube))


def z_buffer(planar: NDArray[np.float64], bits: int, near: float = NEAR) -> NDArray[np.float64]:
    """Planar depths after a z-buffer of so many bits; nothing is the far plane."""
    known = np.where(np.isfinite(planar), planar, FAR)
    steps = np.round((1.0 / near - 1.0 / known) / (1.0 / near - 1.0 / FAR) * 2**bits)
    depth: NDArray[np.float64] = FAR * near / (FAR - (FAR - near) * steps / 2**bits)
    return depth


@pytest.mark.parametrize("bodies", [planar_bodies(), planar_bodies() + curved_bodies()])
def test_own_depth_image_with_normals_gives_the_simulators_frame(bodies: list[rc.Body]) -> None:
    sim = simulator(bodies)
    image, reference = sim.depth_image(MIDDLE), sim.frame()
    frame = frame_of(image.surface_distance, normals=image.normals, body=image.body)
    assert error(frame, reference) < 1e-6  # the same paths, but for the rounding of 1/fx
    assert frame.stats["paths"] == reference.stats["paths"]
    assert frame.truth is not None
    np.testing.assert_allclose(frame.truth.range, image_ranges(image, len(bodies)), rtol=1e-12)
    np.testing.assert_allclose(frame.truth.velocity, 0.0)


def image_ranges(image: rc.DepthImage, num_bodies: int) -> list[float]:
    return [float(image.surface_distance[image.body == number].min()) for number in range(num_bodies)]


@pytest.mark.parametrize("planar", [False, True])
def test_depth_alone_gives_the_simulators_frame_of_plates_and_boxes(planar: bool) -> None:
    # Faces are at least two pixels wide here; a face of one pixel's width has no normal.
    sim = simulator(planar_bodies())
    image, reference = sim.depth_image(), sim.frame()
    depth = image.distance / SLANT if planar else image.distance
    frame = frame_of(depth, planar=planar)
    assert frame.stats["normals_missing"] < 10  # corners
    assert error(frame, reference) < 1e-3
    assert error(frame_of(depth.astype(np.float32), planar=planar), reference) < 2e-3  # 0.03 degrees of phase


def test_normals_from_depth_are_exact_on_planes_up_to_edges_and_creases() -> None:
    image = simulator(planar_bodies()).depth_image()
    found = surfaces.normals(image.distance, CAMERA, np.full(image.distance.shape, 1e-12))
    off = np.linalg.norm(found - image.normals, axis=-1)[image.body >= 0]
    assert (off < 1e-8).mean() > 0.999


def test_reflectance_scales_the_field_and_grey_images_count_as_fractions() -> None:
    distance = np.full((32, 32), 2.0)
    full = frame_of(distance, 1.0)
    np.testing.assert_allclose(frame_of(distance, 0.25).cube, 0.5 * full.cube, rtol=1e-5)
    grey = np.full((32, 32), 51, np.uint8)
    np.testing.assert_allclose(frame_of(distance, grey).cube, np.sqrt(0.2) * full.cube, rtol=1e-5)
    assert not frame_of(distance, 0.0).cube.any()
    assert frame_of(distance, 0.0, albedo=0.5).cube.any()


def approaching(speed: float) -> list[rc.Body]:
    """A plate that comes nearer before a resting wall."""
    moving = rc.Linear(rc.Pose([2.0, 0.1, 0.0]), velocity=[-speed, 0.0, 0.0])
    return [body(rc.shapes.plate(0.5, 0.5), moving), body(rc.shapes.plate(6.0, 6.0), rc.Pose([4.0, 0.0, 0.0]))]


def test_velocity_from_the_previous_image_is_the_bodys_within_a_bin() -> None:
    sim = simulator(approaching(1.5))
    before, image = sim.depth_image(-0.025), sim.depth_image(0.0)
    frame = frame_of(image.distance, previous=before.distance, interval=0.025, body=image.body)
    peak = rc.strongest_peak(frame.cube, WAVEFORM, max_velocity=-0.5)
    assert abs(peak.velocity + 1.5) < 0.02 * WAVEFORM.velocity_resolution
    assert abs(peak.range - 2.0) < 0.2 * WAVEFORM.range_resolution
    assert frame.truth is not None
    np.testing.assert_allclose(frame.truth.velocity, [-1.5, 0.0], atol=1e-3)


def test_twists_give_the_simulators_frame_of_moving_bodies() -> None:
    # Turning about a point p: v = p x w at the camera; falling, and spinning about the line it flies along.
    pivot, spin = np.array([2.0, 0.3, 0.1]), np.array([0.5, -1.0, 2.0])
    away, roll = np.array([1.2, 0.0, 0.0]), np.array([4.0, 0.0, 0.0])
    place = np.array([2.4, -0.5, -0.2])
    bodies = [
        body(rc.shapes.box(0.3), rc.Linear(rc.Pose(pivot), angular_velocity=spin)),
        body(rc.shapes.box(0.3), rc.Linear(rc.Pose(place), velocity=away, angular_velocity=roll)),
        body(rc.shapes.plate(6.0, 6.0), rc.Pose([4.0, 0.0, 0.0])),
    ]
    twists = [[*np.cross(pivot, spin), *spin], [*(away + np.cross(place, roll)), *roll], [0.0] * 6]
    sim = simulator(bodies, tolerance=1e-7)
    image, reference = sim.depth_image(0.1 + MIDDLE), sim.frame(0.1)
    frame = frame_of(
        image.surface_distance,
        normals=image.normals,
        body=image.body,
        twists=twists,
        time=0.1,
        image_time=0.1 + MIDDLE,
        tolerance=1e-7,
    )
    assert error(frame, reference) < 1e-6
    assert frame.truth is not None
    assert reference.truth is not None
    np.testing.assert_allclose(frame.truth.velocity, reference.truth.velocity, rtol=1e-9, atol=1e-12)


def test_fast_twist_gives_the_simulators_frame() -> None:
    # Two turns in the frame about a line beside the line of sight: 17 times do not do.
    pivot, spin = np.array([2.0, 0.5, 0.0]), np.array([4.0 * np.pi / WAVEFORM.duration, 0.0, 0.0])
    motion = rc.Attached(rc.Linear(rc.Pose(pivot), angular_velocity=spin), rc.Pose([0.0, -0.8, 0.0]))
    sim = simulator([body(rc.shapes.plate(0.3, 0.3), motion)], tolerance=1e-7, retrace_deg=np.inf)
    image, reference = sim.depth_image(MIDDLE), sim.frame(0.0)
    frame = frame_of(
        image.surface_distance,
        normals=image.normals,
        body=image.body,
        twists=[[*np.cross(pivot, spin), *spin]],
        image_time=MIDDLE,
        tolerance=1e-7,
    )
    assert error(frame, reference) < 1e-6


def crossing(speed: float, time: float) -> NDArray[np.float64]:
    """Distance image of a plate at 2 m that crosses to the left before a wall at 3 m: nothing changes its range."""
    motion = rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[0.0, speed, 0.0])
    bodies = [body(rc.shapes.plate(0.5, 0.5), motion), body(rc.shapes.plate(6.0, 6.0), rc.Pose([3.0, 0.0, 0.0]))]
    return simulator(bodies).depth_image(time).distance


@pytest.mark.parametrize("speed", [0.4, 2.0, 8.0])  # strips of half a pixel to 11 pixels
def test_silhouettes_left_in_are_velocities_that_nothing_has(speed: float, monkeypatch: pytest.MonkeyPatch) -> None:
    interval = 0.025
    image, before = crossing(speed, 0.0), crossing(speed, -interval)
    still = frame_of(image)

    def moving_power(frame: rc.Frame) -> float:
        """Power faster than two bins over all power."""
        power = np.abs(rc.range_doppler(frame.cube, WAVEFORM)[0]) ** 2
        is_fast = np.abs(WAVEFORM.velocity_axis()) > 2.5 * WAVEFORM.velocity_resolution
        return float(power[is_fast].sum() / power.sum())

    frame = frame_of(image, previous=before, interval=interval)
    num_strip = int((np.abs(image - before) > 0.5).sum())
    assert num_strip > 0
    assert num_strip <= frame.stats["silhouettes_excluded"] <= num_strip + 8
    assert moving_power(frame) < 2.0 * moving_power(still) + 1e-6

    # With them in, a gap of 1 m in 25 ms is 40 m/s (aliased), and the wall behind echoes there.
    monkeypatch.setattr(surfaces, "range_rate", lambda new, old, noise: new - old)
    false = frame_of(image, previous=before, interval=interval, max_speed=1e6)
    assert false.stats["silhouettes_excluded"] == 0
    assert moving_power(false) > 10.0 * moving_power(frame)


@pytest.mark.parametrize(
    ("mesh", "velocity", "most_missed"),
    [
        (rc.shapes.sphere(0.3), [-2.0, 0.0, 0.0], 0.0),
        (rc.shapes.box(0.5), [-1.0, 1.0, 0.5], 0.0),
        (rc.shapes.box((0.04, 0.04, 2.0)), [0.0, 3.0, 0.0], 0.01),  # crosses by more than its width
        (rc.shapes.box((0.5, 0.5, 1.2)), [0.0, 2.0, 0.0], 0.2),  # slides on the floor: gaps down to nothing
    ],
)
def test_silhouettes_are_the_pixels_that_change_bodies_and_no_others(
    mesh: rc.Mesh, velocity: list[float], most_missed: float
) -> None:
    bodies = [
        body(mesh, rc.Linear(rc.Pose([2.5, 0.1, 0.0]), velocity=velocity)),
        body(rc.shapes.plate(12.0, 12.0), rc.Pose.from_rpy([3.0, 0.0, -0.6], [0.0, 0.5 * np.pi, 0.0])),
        body(rc.shapes.plate(6.0, 6.0), rc.Pose([4.0, 0.0, 0.0])),
    ]
    sim = simulator(bodies)
    new, old = sim.depth_image(0.0), sim.depth_image(-0.025)
    change = surfaces.range_rate(new.distance, old.distance, np.full(new.distance.shape, 1e-12))
    is_other = (new.body != old.body) & (new.body >= 0)
    is_left_out = np.isnan(change) & (new.body >= 0)
    assert is_other.sum() > 20
    assert not (is_left_out & ~is_other).any()
    assert (is_other & ~is_left_out).sum() <= most_missed * is_other.sum()


def test_what_was_not_there_before_has_no_velocity() -> None:
    image = simulator([body(rc.shapes.plate(0.5, 0.5), rc.Pose([2.0, 0.0, 0.0]))]).depth_image().distance
    frame = frame_of(image, previous=np.full_like(image, np.inf), interval=0.025)
    assert frame.stats["silhouettes_excluded"] == np.isfinite(image).sum()
    assert not frame.cube.any()


@cache
def noisy_scene() -> tuple[NDArray[np.float64], rc.DepthImage, rc.Frame]:
    """Plates and curved bodies before a wall at 5 m that is turned, so that its depth runs through all steps."""
    wall = body(rc.shapes.plate(9.0, 9.0), rc.Pose.from_rpy([5.0, 0.0, 0.0], [0.0, 0.03, 0.02]))
    sim = simulator([*planar_bodies()[:2], *curved_bodies(), wall])
    image = sim.depth_image()
    return image.surface_distance / SLANT, image, sim.frame()


@pytest.mark.parametrize("near", [NEAR, 0.1])
def test_24_bit_z_buffer_costs_what_its_steps_say(near: float) -> None:
    planar, image, reference = noisy_scene()
    frame = frame_of(z_buffer(planar, 24, near), planar=True, far=FAR, normals=image.normals)
    step = planar[np.isfinite(planar)].max() ** 2 * (FAR - near) / (FAR * near * 2**24)  # at the deepest pixel
    expected = np.deg2rad(720.0 * step / np.sqrt(12.0) / WAVEFORM.wavelength)
    assert 0.02 * expected < error(frame, reference) < expected


def test_16_bit_millimetres_cost_half_a_radian_and_warn_of_motion_too() -> None:
    planar, image, reference = noisy_scene()
    millimetres = np.round(1e3 * np.where(np.isfinite(planar), planar, 0.0)).astype(np.uint16)
    options: dict[str, Any] = {"planar": True, "normals": image.normals}
    with pytest.warns(UserWarning, match="steps of 1e.03 um, 42 degrees of phase"):
        frame = frame_of(1e-3 * millimetres, **options)
    assert 0.1 < error(frame, reference) < 1.0
    assert frame.stats["quantisation_phase_deg"] == pytest.approx(42.0, abs=0.5)
    for depth, scale in ((1e-3 * millimetres, None), (millimetres, 1e-3)):
        with pytest.warns(UserWarning, match="quantised") as caught:
            scaled = frame_of(depth, previous=depth, interval=0.025, scale=scale, **options)
        assert [str(w.message).partition(":")[0] for w in caught] == ["distance", "previous"]
        np.testing.assert_array_equal(scaled.cube, frame.cube)  # nothing moves


@pytest.mark.filterwarnings("ignore:distance. quantised")
def test_distances_far_beyond_the_radar_are_hardly_metres_and_said_once() -> None:
    planar, image, _ = noisy_scene()
    with pytest.warns(UserWarning, match=r"distance: expected metres, got a median of .* scale=1e-3") as caught:
        frame_of(1e3 * planar, planar=True, normals=image.normals)
    assert [warning.filename for warning in caught] == [__file__]
    # A hall at 150 m is far, and within reach of a radar that sees to 100 m.
    waveform = rc.Waveform.from_sweep(start_frequency=60e9, stop_frequency=60.05e9, sample_rate=2e6, num_samples=64)
    frame_of(np.full((8, 8), 150.0), radar=rc.Radar(waveform))  # warnings are errors here


def test_unquantised_images_do_not_warn() -> None:
    for bodies in (planar_bodies(), curved_bodies(), approaching(1.0)):
        image = simulator(bodies).depth_image()
        for depth in (image.distance, image.distance.astype(np.float32)):
            frame = frame_of(depth)  # warnings are errors here
            assert frame.stats["quantisation_phase_deg"] < 0.1


@pytest.mark.parametrize("nothing", [np.inf, -np.inf, np.nan, 0.0, -1.0, 10.0, 10.0 * (1.0 - 1e-7), 11.0])
def test_what_reaches_the_far_plane_is_no_wall(nothing: float) -> None:
    depth = np.full((64, 64), nothing)
    assert not frame_of(depth, planar=True, far=10.0).cube.any()
    depth[20:40, 20:40] = 2.0
    only = np.where(depth == 2.0, 2.0, np.inf)
    frame = frame_of(depth, planar=True, far=10.0)
    np.testing.assert_array_equal(frame.cube, frame_of(only, planar=True).cube)
    assert frame.stats["rays_hit"] == 400


def test_fewer_points_stand_for_larger_patches() -> None:
    sim = simulator([body(rc.shapes.sphere(0.3), rc.Pose([1.5, 0.0, 0.0]))], resolution=384)
    image, reference = sim.depth_image(), sim.frame()
    options: dict[str, Any] = {"normals": image.normals}
    for max_points, step, bound in ((384**2, 1, 1e-6), (384**2 - 1, 2, 0.1), (16_500, 3, 0.15)):
        frame = frame_of(image.surface_distance, max_points=max_points, **options)
        assert frame.stats["rays_cast"] == (384 // step) ** 2
        assert error(frame, reference) < bound
    assert frame_of(image.surface_distance, max_points=1, **options).stats["rays_cast"] == 1


def test_cut_of_an_image_with_its_camera_off_centre_gives_what_is_in_it() -> None:
    sim = simulator([body(rc.shapes.sphere(0.2), rc.Pose([1.8, 0.4, 0.3]))])
    image, reference = sim.depth_image(), sim.frame()
    rows, columns = slice(3, 90), slice(1, 80)
    assert np.isfinite(image.distance[rows, columns]).sum() == np.isfinite(image.distance).sum()
    camera = rc.Camera(CAMERA.fx, CAMERA.fy, CAMERA.cx - 1, CAMERA.cy - 3)
    frame = frame_of(image.surface_distance[rows, columns], normals=image.normals[rows, columns], camera=camera)
    assert error(frame, reference) < 1e-6


def test_result_does_not_depend_on_threads_and_follows_the_receiver() -> None:
    image = simulator(planar_bodies()).depth_image()
    one, two = (frame_of(image.distance, threads=threads, albedo=0.0) for threads in (1, 2))
    np.testing.assert_array_equal(one.cube, two.cube)
    assert one.truth is None
    real = rc.Radar(WAVEFORM, receiver=rc.Receiver(output="real"))
    np.testing.assert_array_equal(frame_of(image.distance, radar=real).cube, one.cube.real)
    assert frame_of(image.distance, tolerance=1e-7).cube.dtype == np.complex128


FLAT = np.full((8, 8), 2.0)


INTEGERS = r"distance: expected floating-point numbers \[m\], or scale with integers \(1e-3 .*, got uint16"
BODY = np.zeros((8, 8), int)


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"distance": np.full(8, 2.0)}, ValueError, r"distance: expected shape \(rows, columns\), got \(8,\)"),
        ({"distance": np.zeros((0, 8))}, ValueError, "distance: expected shape"),
        ({"distance": FLAT + 0j}, TypeError, "distance: expected real numbers"),
        ({"distance": [[1.0], [1.0, 2.0]]}, TypeError, "distance: expected"),
        ({"distance": (1e3 * FLAT).astype(np.uint16)}, TypeError, INTEGERS),
        ({"previous": FLAT.astype(int), "interval": 0.1}, TypeError, "previous: expected floating-point numbers"),
        ({"distance": np.full((1, 8), 2.0)}, ValueError, "normals: expected normals with an image of 1 x 8"),
        ({"reflectance": 1.5}, ValueError, "reflectance: expected numbers from 0 to 1, got 1.5"),
        ({"reflectance": np.nan}, ValueError, "reflectance: expected numbers from 0 to 1"),
        ({"reflectance": np.ones((4, 8))}, ValueError, "reflectance: expected one number or shape"),
        ({"camera": (60.0, 180.0)}, ValueError, "field_of_view_deg: expected angles"),
        ({"previous": FLAT}, ValueError, "interval: expected previous and interval together, got previous alone"),
        ({"interval": 0.1}, ValueError, "interval: expected previous and interval together, got interval alone"),
        ({"previous": FLAT[:4], "interval": 0.1}, ValueError, r"previous: expected shape \(8, 8\), got \(4, 8\)"),
        ({"previous": FLAT, "interval": 0.1, "twists": np.zeros((1, 6))}, ValueError, "twists: expected either"),
        ({"body": np.zeros((8, 8))}, TypeError, "body: expected integers, got float64"),
        ({"twists": np.zeros((2, 6))}, ValueError, "body: expected the body of every pixel"),
        ({"body": BODY + 3, "twists": np.zeros((2, 6))}, ValueError, "body: expected numbers below 2"),
        ({"body": BODY, "twists": np.zeros((1, 3))}, ValueError, r"twists: expected shape \(1, 6\)"),
        ({"sampling": "adaptive"}, ValueError, "sampling: expected one of 'footprint', 'point'"),
    ],
)
def test_refusals_say_what_was_expected(options: dict[str, Any], kind: type[Exception], message: str) -> None:
    settings: dict[str, Any] = {"distance": FLAT, "reflectance": 1.0} | options
    with pytest.raises(kind, match=message):
        frame_of(settings.pop("distance"), settings.pop("reflectance"), **settings)
