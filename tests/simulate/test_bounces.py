"""Paths of several reflections against answers known on paper: corner reflectors, images in walls, reciprocity."""

from __future__ import annotations

import warnings
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

import radarcore as rc
from proof.corners import NEAR, near_db
from reference import Patches, double_scattering_reference

C = 299_792_458.0
FREQUENCY = 60e9
WAVELENGTH = C / FREQUENCY
CONDUCTOR, METAL = rc.materials["perfect_conductor"], rc.materials["metal"]
POLARIZATIONS = (None, "vertical", "horizontal")


def tone(frequency: float = FREQUENCY) -> rc.Waveform:
    """A ramp without slope to speak of: one sample is the transfer function at one frequency."""
    return rc.Waveform(start_frequency=frequency, slope=1.0, sample_rate=1e6, num_samples=1)


def body(mesh: rc.Mesh, position: Any, *, rpy: Any = (0.0, 0.0, 0.0), material: rc.Material = CONDUCTOR) -> rc.Body:
    return rc.Body(mesh, material=material, motion=rc.Pose.from_rpy(position, rpy))


def simulator(bodies: list[rc.Body], radar: rc.Radar | None = None, **options: Any) -> rc.Simulator:
    view = {"field_of_view_deg": (60.0, 60.0)}
    settings: dict[str, Any] = {"resolution": 256, "max_bounces": 3, "tolerance": 1e-9} | view | options
    return rc.Simulator(rc.Scene(bodies), radar or rc.Radar(tone()), **{"sampling": "footprint", **settings})


def transfer_function(sim: rc.Simulator) -> complex:
    """H, the conjugate of the one sample of a tone."""
    return complex(np.conj(sim.frame().cube[0, 0, 0]))


def cross_section_db(h: complex, distance: float) -> float:
    """Apparent cross-section [dBsm] of what is at a distance, for 1 W and isotropic antennas."""
    sigma = 4.0 * np.pi * (abs(h) * distance**2 * 4.0 * np.pi / WAVELENGTH) ** 2
    return float(10.0 * np.log10(sigma))


def reflector_db(
    mesh: rc.Mesh, distance: float, *, size: float, roll: float = 0.0, polarization: str | None = None, **options: Any
) -> float:
    """Apparent cross-section of a reflector at a distance, in an image not much wider than its `size` [m]."""
    angle = 2.2 * np.rad2deg(np.arctan2(0.5 * size, distance - 0.1))
    radar = rc.Radar(tone(), polarization=polarization)
    target = body(mesh, [distance, 0.0, 0.0], rpy=[roll, 0.0, 0.0])
    sim = simulator([target], radar, field_of_view_deg=(angle, angle), **options)
    return cross_section_db(transfer_function(sim), distance)


def bounce_paths(sim: rc.Simulator, time: float = 0.0) -> rc.Paths:
    """Those of several reflections alone."""
    single = rc.Simulator(
        sim.scene,
        sim.radar,
        sampling=sim.sampling,
        resolution=sim.resolution,
        field_of_view_deg=sim.field_of_view_deg,
    ).paths(time)
    paths, first = sim.paths(time), single.delay.shape[1]
    np.testing.assert_array_equal(paths.delay[:, :first], single.delay)
    return rc.Paths(*(values[:, first:] for values in vars(paths).values()))


def phasors(paths: rc.Paths, frequency: float = FREQUENCY) -> NDArray[np.complex128]:
    """Contribution of every path to the transfer function, (channel, path)."""
    return paths.amplitude * np.exp(-2j * np.pi * frequency * paths.delay)


# --- corner reflectors ---------------------------------------------------------------------------------------------


# Where the far field is that of the reflector, with no more than 128 x 128 pixels.
FAR: dict[str, dict[str, Any]] = {
    "footprint": {"sampling": "footprint", "resolution": 128},
    "adaptive": {"sampling": "adaptive", "resolution": 128},
}


@pytest.mark.parametrize("polarization", POLARIZATIONS)
@pytest.mark.parametrize("sampling", FAR)
def test_dihedral_has_its_far_field_cross_section(sampling: str, polarization: str | None) -> None:
    settings: dict[str, Any] = FAR[sampling] | {"size": 0.1415, "polarization": polarization}
    got = reflector_db(rc.shapes.dihedral(0.1), 100.0, **settings)
    assert got == pytest.approx(20.0290, abs=0.3)
    one = reflector_db(rc.shapes.dihedral(0.1), 100.0, max_bounces=1, **settings)
    assert one < -10.0, "its plates alone return nothing"


@pytest.mark.parametrize("polarization", POLARIZATIONS)
@pytest.mark.parametrize("sampling", FAR)
@pytest.mark.parametrize(("shape", "expected", "size"), [("triangular", 12.2475, 0.17), ("square", 21.7899, 0.19)])
def test_trihedral_has_its_far_field_cross_section(
    shape: str, expected: float, size: float, sampling: str, polarization: str | None
) -> None:
    mesh = rc.shapes.trihedral(0.1, shape=shape)
    settings: dict[str, Any] = FAR[sampling] | {"size": size, "polarization": polarization}
    assert reflector_db(mesh, 100.0, **settings) == pytest.approx(expected, abs=0.3)
    assert reflector_db(mesh, 100.0, max_bounces=2, **settings) < expected - 20.0


@pytest.mark.parametrize("resolution", [3, 8, 9, 32, 33, 128, 129])
@pytest.mark.parametrize("order", [2, 3])
def test_pixels_that_look_along_a_fold_or_into_an_apex_return_as_much_as_others(order: int, resolution: int) -> None:
    # An image within the corner: half its width and height are seen of what returns everything, and no rims.
    mesh = rc.shapes.dihedral(0.1) if order == 2 else rc.shapes.trihedral(0.1, shape="square")
    angle, side = np.rad2deg(0.05 / 100.0), 0.05
    sim = simulator(
        [body(mesh, [100.0, 0.0, 0.0])], field_of_view_deg=(angle, angle), resolution=resolution, max_bounces=3
    )
    got = cross_section_db(complex(phasors(bounce_paths(sim)).sum()), 100.0)
    aperture = 10.0 * np.log10(4.0 * np.pi * side**4 / WAVELENGTH**2)
    assert got == pytest.approx(aperture, abs=0.05)  # a column of 129 is 0.07 dB, one of 3 is 3.5 dB


# The nearest in both, each of the others in one: paths of several reflections are the same in both.
@pytest.mark.parametrize(
    ("distance", "sampling"),
    [(distance, ("footprint", "adaptive")[number % 2]) for number, distance in enumerate(NEAR)]
    + [(NEAR[0], "adaptive")],
)
def test_trihedral_near_the_radar_looks_smaller(distance: float, sampling: str) -> None:
    got = reflector_db(rc.shapes.trihedral(0.1), distance, size=0.18, resolution=512, sampling=sampling)
    assert got - 12.2475 == pytest.approx(near_db(distance), abs=0.4)


def test_dihedral_at_45_degrees_turns_the_polarisation() -> None:
    aligned, turned = (
        reflector_db(rc.shapes.dihedral(0.1), 100.0, size=0.19, roll=roll, polarization="vertical")
        for roll in (0.0, np.pi / 4)
    )
    assert aligned == pytest.approx(20.0290, abs=0.5)
    assert turned < aligned - 35.0


def test_dihedral_of_a_dielectric_returns_what_both_reflections_leave() -> None:
    concrete = rc.materials["concrete"]
    # 45 degrees at both plates; the fold is vertical, across the plane of incidence.
    te, tm = (abs(concrete.response(FREQUENCY, np.sqrt(0.5), polarization=p)[0]) for p in ("te", "tm"))
    for polarization, expected in (("vertical", te**2), ("horizontal", tm**2), (None, 0.5 * (te**2 + tm**2))):
        level = {}
        for material in (CONDUCTOR, concrete):
            radar = rc.Radar(tone(), polarization=polarization)
            target = body(rc.shapes.dihedral(0.1), [100.0, 0.0, 0.0], material=material)
            sim = simulator([target], radar, field_of_view_deg=(0.09, 0.09), resolution=128)
            level[material] = abs(phasors(bounce_paths(sim)).sum())
        assert level[concrete] / level[CONDUCTOR] == pytest.approx(expected, rel=3e-3)


def test_no_path_of_two_reflections_returns_more_than_that_of_a_conductor() -> None:
    def levels(material: rc.Material, polarization: str | None) -> NDArray[np.float64]:
        # Angles of incidence of 45 degrees and a turn, less at one plate and more at the other.
        target = body(rc.shapes.dihedral(0.1), [100.0, 0.0, 0.0], rpy=[0.2, 0.0, 0.3], material=material)
        radar = rc.Radar(tone(), polarization=polarization)
        options: dict[str, Any] = {"field_of_view_deg": (0.1, 0.1), "resolution": 32, "max_bounces": 2}
        return np.abs(simulator([target], radar, sampling="footprint", **options).paths().amplitude)

    # Without a polarisation a conductor reflects all; polarised antennas lose what is turned.
    most = levels(CONDUCTOR, None)
    for polarization in POLARIZATIONS:
        for name in sorted(set(rc.materials) - {"perfect_conductor"}):
            material = rc.materials[name]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # some are not known at 60 GHz
                for surface in (material, material.with_surface(thickness=2.3e-3)):
                    assert (levels(surface, polarization) < most).all(), (name, polarization)


# --- images in walls -----------------------------------------------------------------------------------------------

RADIUS, BALL = 0.1, np.array([2.0, 0.0, 0.0])
WALL_Y = -0.7
SENSOR = np.zeros(3)
IN_THE_WALL = np.array([1.0, -1.0, 1.0])
"""A direction times this is that of its image."""
VIEW: dict[str, Any] = {"resolution": (96, 1280), "field_of_view_deg": (94.0, 12.0), "max_bounces": 2}
"""Wide enough for where the wall mirrors the ball."""
CLOSE: dict[str, Any] = VIEW | {"resolution": 512, "field_of_view_deg": (6.2, 6.2)}
"""The ball alone: what it scatters onto the wall spreads so much that it takes narrow rays."""
VIEWS = {"wide": VIEW, "close": CLOSE}
CHANNELS = rc.Radar(tone(), rx=[[0.0, 0.0, 0.0], [0.0, 0.00125, 0.0]])


def wall(material: rc.Material = CONDUCTOR) -> rc.Body:
    """To the right of the boresight, along it."""
    return body(rc.shapes.plate(4.0, 2.0), [1.6, WALL_Y, 0.0], rpy=[0.0, 0.0, -0.5 * np.pi], material=material)


@cache
def sphere(radius: float) -> rc.Mesh:
    """A sphere, made once."""
    return rc.shapes.sphere(radius)


def ball(motion: Any = None, **options: Any) -> rc.Body:
    motion = rc.Pose(BALL) if motion is None else motion
    return rc.Body(sphere(RADIUS), material=CONDUCTOR, motion=motion, **options)


@cache
def ghost_paths(view: str) -> rc.Paths:
    """Paths of two reflections, by ball and wall, as seen in `VIEWS`."""
    return bounce_paths(simulator([ball(), wall()], CHANNELS, **VIEWS[view]))


def image_of(position: Any) -> NDArray[np.float64]:
    """Its image in the wall."""
    return np.asarray(position) * IN_THE_WALL + np.array([0.0, 2.0 * WALL_Y, 0.0])


def touched(start: Any, end: Any, center: NDArray[np.float64] = BALL) -> NDArray[np.float64]:
    """Point of the ball on the shortest path from one place over the ball to another."""

    def place(angles: NDArray[np.float64]) -> NDArray[np.float64]:
        azimuth, elevation = angles
        up, across = np.sin(elevation), np.cos(elevation)
        return center - RADIUS * np.array([across * np.cos(azimuth), across * np.sin(azimuth), up])

    def length(angles: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(place(angles) - start) + np.linalg.norm(place(angles) - end))

    return place(minimize(length, [0.4, 0.0], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-15}).x)


def ghost_length(center: NDArray[np.float64] = BALL) -> float:
    """Length of the way from the sensor over the ball to the image of the sensor [m]."""
    point = touched(SENSOR, image_of(SENSOR), center)
    return float(np.linalg.norm(point - SENSOR) + np.linalg.norm(point - image_of(SENSOR)))


def reflected_by_ball(start: Any, end: Any) -> complex:
    """Wave from an antenna at one place that the ball reflects to another, by geometrical optics."""
    point = touched(start, end)
    there, back = np.linalg.norm(point - start), np.linalg.norm(point - end)
    cosine = (BALL - point) @ (point - start) / (RADIUS * there)
    # Principal radii of the reflected front, in and across the plane of incidence.
    radii = [1.0 / (1.0 / there + 2.0 / (RADIUS * cosine)), 1.0 / (1.0 / there + 2.0 * cosine / RADIUS)]
    level = WAVELENGTH / (4.0 * np.pi) / there * np.sqrt(np.prod([r / (r + back) for r in radii]))
    return complex(level * np.exp(-2j * np.pi * (there + back) / WAVELENGTH))


def test_ghost_of_a_ball_beside_a_wall_has_the_range_of_its_path() -> None:
    waveform = rc.Waveform.from_sweep(start_frequency=60e9, stop_frequency=62e9, sample_rate=2e6, num_samples=128)
    frames = [
        simulator([ball(), wall()], rc.Radar(waveform), **VIEW | {"max_bounces": max_bounces}).frame()
        for max_bounces in (1, 2)
    ]
    assert frames[1].stats["bounce_paths"] > 100
    added = frames[1].cube - frames[0].cube
    for cube, expected in ((frames[0].cube, BALL[0] - RADIUS), (added, 0.5 * ghost_length())):
        profile = np.abs(rc.range_profile(cube, waveform, num_bins=2048)[0, 0])
        peak = waveform.range_axis(2048)[profile.argmax()]
        assert peak == pytest.approx(expected, abs=0.2 * waveform.range_resolution)


def test_ghost_has_the_level_and_the_angles_of_geometrical_optics() -> None:
    point, expected = touched(SENSOR, image_of(SENSOR)), reflected_by_ball(SENSOR, image_of(SENSOR))
    # Over the wall to the ball, and the other way round, which an image of the ball alone shows as well.
    for last, view, arrives_from in ((0, "wide", point), (1, "wide", image_of(point)), (1, "close", image_of(point))):
        paths = ghost_paths(view)
        received = np.where(paths.body == last, phasors(paths), 0.0).sum(axis=1)
        assert 20.0 * np.log10(abs(received[0] / expected)) == pytest.approx(0.0, abs=0.4)
        assert np.angle(received[0] / expected) == pytest.approx(0.0, abs=0.1)
        # The second receiver, to the left, is nearer to what comes from the left.
        sine = np.angle(received[1] / received[0]) / (2.0 * np.pi / WAVELENGTH * 0.00125)
        assert sine == pytest.approx(arrives_from[1] / np.linalg.norm(arrives_from), abs=0.01)


def person_and_wall() -> tuple[list[rc.Body], rc.Body]:
    person = rc.models.Human(speed=0.0, path=[[2.2, 0.3], [0.0, 0.3]])
    upright = rc.shapes.plate(4.0, 2.0)
    return person.bodies(), body(upright, [1.6, -0.7, 1.1], rpy=[0.0, 0.0, -0.5 * np.pi], material=METAL)


def robot_and_table() -> tuple[list[rc.Body], rc.Body]:
    joints = np.deg2rad([180.0, -60.0, 100.0, -130.0, -90.0, 0.0])
    arm = rc.models.RobotArm.ur10().moving(joints, base=rc.Pose([1.9, 0.0, 0.0]))
    level = rc.shapes.plate(3.0, 2.0)
    return arm.bodies(), body(level, [1.4, 0.0, 0.0], rpy=[0.0, 0.5 * np.pi, 0.0], material=METAL)


# Bodies and what mirrors them, place of the sensor, axis across the mirror and its place on it, pixels, field of view,
# and from which sides of the mirror ghosts are looked for: images of narrow limbs take finer pixels.
PAIRS: dict[str, Any] = {
    "person and wall": (person_and_wall, [0.0, 0.0, 1.1], 1, -0.7, (104, 520), (94.0, 40.0), ("direct",)),
    "robot and table": (robot_and_table, [0.0, 0.0, 0.55], 2, 0.0, (520, 104), (40.0, 94.0), ("direct", "image")),
}


@pytest.mark.filterwarnings("ignore:.*lies in the beam")  # the feet of the person
@pytest.mark.parametrize("name", PAIRS)
def test_ghost_has_the_range_and_the_angle_of_the_shortest_way_over_both(name: str) -> None:
    make, place, axis, plane, resolution, field_of_view_deg, sides = PAIRS[name]
    bodies, mirror = make()
    sensor = np.array(place)
    waveform = rc.Waveform.from_sweep(start_frequency=60e9, stop_frequency=62e9, sample_rate=2e6, num_samples=128)
    line = np.zeros((16, 3))
    line[:, axis] = (np.arange(16) - 7.5) * 0.5 * waveform.wavelength

    # What the mirror adds, by range and angle.
    one, two = (
        simulator(
            [*bodies, mirror],
            rc.Radar(waveform, tx=[[0.0, 0.0, 0.0]], rx=line),
            radar_motion=rc.Pose(sensor),
            sampling="footprint",
            resolution=resolution,
            field_of_view_deg=field_of_view_deg,
            max_bounces=max_bounces,
            tolerance=1e-4,
        )
        .frame()
        .cube
        for max_bounces in (1, 2)
    )
    profile = rc.range_profile(two - one, waveform, num_bins=1024)[:, 0]
    sine = np.sin(np.deg2rad(np.arange(-70.0, 70.0, 0.5)))
    turns = np.outer(sine, line[:, axis]) / waveform.wavelength
    power = np.abs((np.hanning(18)[1:-1] * np.exp(2j * np.pi * turns)) @ profile) ** 2  # (angle, range)

    # The shortest ways from the sensor over each body and the mirror back, and where they touch the body.
    across = np.eye(3)[axis]
    mirrored = sensor - 2.0 * (sensor[axis] - plane) * across
    ways, sines = [], {"direct": [], "image": []}
    for part in bodies:
        points = part.motion.at(0.0).apply(part.mesh.vertices)
        offsets = [points - end for end in (sensor, mirrored)]
        lengths = [np.linalg.norm(offset, axis=1) for offset in offsets]
        nearest = int((lengths[0] + lengths[1]).argmin())
        ways.append(0.5 * (lengths[0] + lengths[1])[nearest])
        # Mirrored, the image sees the sensor as the sensor sees the image.
        sines["direct"].append(offsets[0][nearest, axis] / lengths[0][nearest])
        sines["image"].append(-offsets[1][nearest, axis] / lengths[1][nearest])

    # The strongest echo from either side is the ghost of one of the bodies.
    between = np.median(np.concatenate([sines["direct"], sines["image"]]))
    for side in sides:
        is_side = sine < between if side == "image" else sine > between
        angle, bin_ = np.unravel_index(np.where(is_side[:, None], power, 0.0).argmax(), power.shape)
        range_error = (waveform.range_axis(1024)[bin_] - np.array(ways)) / waveform.range_resolution
        sine_error = sine[angle] - np.array(sines[side])
        assert (np.hypot(range_error / 0.2, sine_error / 0.06) < 1.0).any()


def test_every_pair_of_antennas_far_apart_has_its_own_ghost() -> None:
    transmitters = np.array([[0.0, 0.06, 0.01], [0.01, -0.05, 0.0]])
    receivers = np.array([[0.0, 0.03, 0.0], [0.0, -0.02, -0.03]])
    radar = rc.Radar(tone(), tx=transmitters, rx=receivers)
    # Ways over the points of another transmitter would be up to a radian too long.
    wide, close = (
        bounce_paths(simulator([ball(), wall()], radar, **view))
        for view in (VIEW | {"resolution": (160, 2000)}, CLOSE | {"resolution": 384})
    )
    for last, paths in ((0, wide), (1, wide), (1, close)):
        received = np.where(paths.body == last, phasors(paths), 0.0).sum(axis=1)
        for channel, (tx, rx) in enumerate(product(transmitters, receivers)):
            ends = (image_of(tx), rx) if last == 0 else (tx, image_of(rx))
            ratio = received[channel] / reflected_by_ball(*ends)
            assert 20.0 * np.log10(abs(ratio)) == pytest.approx(0.0, abs=0.5)
            assert np.angle(ratio) == pytest.approx(0.0, abs=0.06)


def test_ghost_of_a_moving_ball_has_the_doppler_of_its_path() -> None:
    velocity = np.array([-0.8, 1.1, 0.0])
    waveform = rc.Waveform(
        start_frequency=60e9, slope=20e12, sample_rate=2e6, num_samples=128, num_chirps=64, chirp_interval=300e-6
    )
    middle = 0.5 * waveform.duration
    moving = ball(rc.Linear(rc.Pose(BALL - middle * velocity), velocity=velocity))
    sim = simulator([moving, wall()], rc.Radar(waveform), **VIEW | {"tolerance": 1e-4})
    step = 1e-3
    rate = (ghost_length(BALL + step * velocity) - ghost_length(BALL - step * velocity)) / (2.0 * step)
    peak = rc.strongest_peak(sim.frame().cube, waveform, min_range=np.linalg.norm(BALL) + 0.1)
    assert peak.range == pytest.approx(0.5 * ghost_length(), abs=0.2 * waveform.range_resolution)
    assert peak.velocity == pytest.approx(0.5 * rate, abs=0.1 * waveform.velocity_resolution)
    assert abs(0.5 * rate - velocity @ BALL / np.linalg.norm(BALL)) > waveform.velocity_resolution


def test_a_deformation_that_moves_all_vertices_is_a_motion() -> None:
    velocity, mesh = np.array([-0.8, 1.1, 0.3]), sphere(RADIUS)
    rigid = ball(rc.Linear(rc.Pose(BALL), velocity=velocity))
    shifted = rc.Body(
        mesh, material=CONDUCTOR, motion=rc.Pose(BALL), deformation=lambda t: mesh.vertices + t * velocity
    )
    first, second = (bounce_paths(simulator([b, wall()], CHANNELS, **VIEW), 0.01) for b in (rigid, shifted))
    assert first.delay.shape[1] > 100
    np.testing.assert_allclose(second.delay, first.delay, rtol=1e-11)
    np.testing.assert_allclose(second.delay_rate, first.delay_rate, rtol=1e-5, atol=1e-14)
    np.testing.assert_allclose(second.amplitude, first.amplitude, rtol=1e-5, atol=1e-9 * abs(first.amplitude).max())


def test_what_stands_in_the_way_hides_the_ghost() -> None:
    # A black screen between the wall and the ball.
    black = rc.Material(0.0)
    screen = body(rc.shapes.plate(1.2, 1.0), [1.1, -0.35, 0.0], rpy=[0.0, 0.0, -0.5 * np.pi], material=black)
    # One outside of what the image shows, between the sensor and the place where the wall mirrors the ball.
    near = body(rc.shapes.plate(0.12, 0.12), [0.15, -0.126, 0.0], rpy=[0.0, 0.0, -0.7], material=black)
    for view, hides in (("wide", screen), ("close", screen), ("close", near)):
        hidden = bounce_paths(simulator([ball(), wall(), hides], **VIEWS[view]))
        strength = [abs(phasors(paths)[0].sum()) for paths in (ghost_paths(view), hidden)]
        assert strength[0] > 1e-7
        assert strength[1] < 0.03 * strength[0]


# --- a curved second surface ---------------------------------------------------------------------------------------


def test_ball_above_a_floor_agrees_with_the_integral_over_both_surfaces() -> None:
    frequency, radius, height = 15e9, 0.15, 0.25
    center = np.array([1.0, 0.0, 0.0])
    spot = np.array([0.46, 0.0, -height])  # where the floor mirrors the way to the ball
    step = 0.45 * C / frequency  # patches of 0.33 wavelengths differ by 0.01 dB and 5 mrad

    def window(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Falls from 1 to 0 over the outer 60 %: what a rim diffracts is not what this is about."""
        return np.cos(0.5 * np.pi * np.clip((np.abs(x) - 0.4) / 0.6, 0.0, 1.0)) ** 2

    x, y = np.meshgrid(np.arange(-0.4, 0.4, step), np.arange(-0.4, 0.4, step))
    points = np.stack([x.ravel() + spot[0], y.ravel(), np.full(x.size, -height)], axis=1)
    weights = step**2 * window(x.ravel() / 0.4) * window(y.ravel() / 0.4)
    floor_patches = Patches(points, np.tile([0.0, 0.0, 1.0], (x.size, 1)), weights)
    normal = np.array([-1.0, 0.0, -0.23]) / np.hypot(1.0, 0.23)  # towards the middle of both ways
    up = np.array([-normal[2], 0.0, normal[0]])
    # One half of the sphere stands for both.
    tilt, turn = np.meshgrid(np.arange(0.5, 26) / 26 * 1.2, np.arange(0.5, 36) / 36 * np.pi)
    tilt, turn = tilt.ravel(), turn.ravel()
    normals = (
        np.cos(tilt)[:, None] * normal
        + (np.sin(tilt) * np.cos(turn))[:, None] * up
        + (np.sin(tilt) * np.sin(turn))[:, None] * np.array([0.0, 1.0, 0.0])
    )
    areas = radius**2 * np.sin(tilt) * (1.2 / 26) * (2.0 * np.pi / 36) * window(tilt / 1.2)
    expected = double_scattering_reference(
        floor_patches, Patches(center + radius * normals, normals, areas), [0.0, 0.0, 0.0], frequency
    )

    floor = body(rc.shapes.plate(2.0, 2.0), [1.05, 0.0, -height], rpy=[0.0, 0.5 * np.pi, 0.0])
    ball_above = body(sphere(radius), center)
    wide: dict[str, Any] = {"resolution": (640, 320), "field_of_view_deg": (60.0, 90.0)}
    close: dict[str, Any] = {"resolution": 384, "field_of_view_deg": (18.0, 18.0)}
    for view in (close, wide):
        paths = bounce_paths(simulator([floor, ball_above], rc.Radar(tone(frequency)), max_bounces=2, **view))
        ratio = phasors(paths, frequency).sum() / expected
        assert 20.0 * np.log10(abs(ratio)) == pytest.approx(0.0, abs=0.5)
        assert np.angle(ratio) == pytest.approx(0.0, abs=0.1)


def test_rims_of_the_first_plate_of_a_near_dihedral_diffract_what_is_not_simulated() -> None:
    number = 40  # 2 patches per wavelength; with 80 the integrals differ by 0.02 dB
    across, along = 0.1 * np.stack(np.meshgrid(np.arange(0.5, number), np.arange(0.5, number) - number / 2)) / number
    for distance, expected in ((1.0, 2.0), (2.0, -0.8), (4.0, 0.1)):
        sides = []
        for side in (1.0, -1.0):
            depth = np.sqrt(0.5) * across.ravel()
            points = np.stack([distance - depth, side * depth, along.ravel()], axis=1)
            normals = np.tile([-np.sqrt(0.5), -side * np.sqrt(0.5), 0.0], (points.shape[0], 1))
            sides.append(Patches(points, normals, np.full(points.shape[0], (0.1 / number) ** 2)))
        # The upper half of the second plate stands for both.
        upper = Patches(*(values[sides[1].points[:, 2] > 0.0] for values in vars(sides[1]).values()))
        integral = 2.0 * double_scattering_reference(sides[0], upper, [0.0, 0.0, 0.0], FREQUENCY)
        view = 13.0 / distance
        paths = bounce_paths(
            simulator([body(rc.shapes.dihedral(0.1), [distance, 0.0, 0.0])], field_of_view_deg=(view, view))
        )
        assert 20.0 * np.log10(abs(phasors(paths).sum() / integral)) == pytest.approx(expected, abs=0.2)


# --- identities ----------------------------------------------------------------------------------------------------


def room() -> list[rc.Body]:
    concrete = rc.materials["concrete"]
    return [
        body(rc.shapes.dihedral(0.4), [1.5, 0.2, 0.1], rpy=[0.3, 0.1, 0.2]),
        body(sphere(0.12), [1.1, -0.2, 0.0], material=concrete),
        body(rc.shapes.plate(2.0, 2.0), [1.5, -0.6, 0.0], rpy=[0.0, 0.0, -1.4], material=concrete),
    ]


CORNERS: dict[str, tuple[rc.Mesh, float, list[float]]] = {
    "dihedral at 0.5 m": (rc.shapes.dihedral(0.1), 0.5, [0.1, 0.05, 0.15]),
    "dihedral at 1 m": (rc.shapes.dihedral(0.1), 1.0, [0.1, 0.02, 0.15]),
    "dihedral at 4 m": (rc.shapes.dihedral(0.1), 4.0, [0.1, 0.02, 0.15]),
    "trihedral": (rc.shapes.trihedral(0.1), 1.0, [0.05, 0.04, 0.1]),
    "square trihedral": (rc.shapes.trihedral(0.1, shape="square"), 5.0, [0.3, -0.1, 0.2]),
}


# One corner of each order in all polarisations, the others in one.
@pytest.mark.parametrize(
    ("name", "polarization"),
    [
        *product(["dihedral at 0.5 m", "trihedral"], POLARIZATIONS),
        ("dihedral at 1 m", "vertical"),
        ("dihedral at 4 m", "horizontal"),
        ("square trihedral", None),
    ],
)
def test_transmitter_and_receiver_may_change_places(name: str, polarization: str | None) -> None:
    mesh, distance, rpy = CORNERS[name]
    places, angle = ([[0.0, 0.004, 0.001]], [[0.0, -0.003, -0.002]]), 13.0 / distance
    there, back = (
        transfer_function(
            simulator(
                [body(mesh, [distance, 0.0, 0.0], rpy=rpy)],
                rc.Radar(tone(), tx=tx, rx=rx, polarization=polarization),
                sampling="adaptive",
                resolution=128,
                field_of_view_deg=(angle, angle),
            )
        )
        for tx, rx in (places, places[::-1])
    )
    assert abs(there) * distance**2 > 1e-5
    assert abs(there - back) < 1e-9 * abs(there)


@pytest.mark.parametrize("sampling", ["footprint", "adaptive"])
def test_so_may_arrays_with_their_patterns(sampling: str) -> None:
    beams = [rc.GaussianPattern(10.0, beamwidth, 40.0) for beamwidth in (30.0, 50.0, 70.0)]
    ends: list[tuple[Any, Any]] = [
        ([[0.0, 0.06, 0.01], [0.01, -0.05, 0.0]], beams[:2]),
        ([[0.0, 0.03, 0.0], [0.0, 0.01, -0.03], [0.0, 0.0, 0.02]], beams[::-1]),
    ]
    there, back = (
        simulator(
            room(),
            rc.Radar(tone(), tx=tx[0], rx=rx[0], tx_patterns=tx[1], rx_patterns=rx[1]),
            sampling=sampling,
            resolution=96,
        )
        .frame()
        .cube
        for tx, rx in (ends, ends[::-1])
    )
    swapped = back.reshape(3, 2).T.reshape(there.shape)
    np.testing.assert_allclose(there, swapped, rtol=0, atol=1e-9 * np.abs(there).max())


def test_one_reflection_is_what_it_was_and_a_ball_alone_has_no_more() -> None:
    settings: dict[str, Any] = {"sampling": "footprint", "resolution": 64, "field_of_view_deg": (60.0, 60.0)}
    default = rc.Simulator(rc.Scene(room()), rc.Radar(tone()), tolerance=1e-9, **settings)
    single = simulator(room(), resolution=64, max_bounces=1)
    np.testing.assert_array_equal(default.frame().cube, single.frame().cube)
    assert single.frame().stats["bounce_paths"] == 0
    one, many = (simulator([ball()], resolution=128, max_bounces=n).frame() for n in (1, 4))
    np.testing.assert_array_equal(one.cube, many.cube)
    assert many.stats["bounce_rays"] > 50
    assert many.stats["bounce_paths"] == 0


def test_results_do_not_depend_on_the_number_of_threads() -> None:
    sims = [simulator(room(), CHANNELS, resolution=96, threads=threads) for threads in (1, 3)]
    first, second = (sim.frame() for sim in sims)
    assert first.stats["bounce_paths"] > 100
    np.testing.assert_array_equal(first.cube, second.cube)


def test_paths_of_bodies_that_stand_still_are_taken_once() -> None:
    waveform = rc.Waveform(
        start_frequency=60e9, slope=20e12, sample_rate=2e6, num_samples=64, num_chirps=16, chirp_interval=300e-6
    )
    walking = ball(rc.Linear(rc.Pose([0.9, 0.15, 0.0]), velocity=[0.5, 0.0, 0.0]))
    bodies = [*room(), walking]
    frame = simulator(bodies, rc.Radar(waveform), resolution=128, tolerance=1e-5).frame()
    assert 0 < frame.stats["still_paths"] < frame.stats["paths"]
    # The same with nothing known to stand still.
    riding = [rc.Body(b.mesh, material=b.material, motion=rc.Linear(b.motion.at(0.0))) for b in room()]
    all_moving = simulator([*riding, walking], rc.Radar(waveform), resolution=128, tolerance=1e-5).frame()
    error = np.abs(frame.cube - all_moving.cube).max() / np.abs(frame.cube).max()
    assert error < 1e-4


# --- limits --------------------------------------------------------------------------------------------------------


def test_rays_end_at_the_floor_and_the_answer_stays_within_the_tolerance() -> None:
    # Rough walls leave little of what they mirror.
    rough = rc.materials["concrete"].with_surface(roughness=2e-3)
    mesh = rc.shapes.dihedral(0.4)
    bodies = [
        body(mesh, [1.5, 0.0, 0.0]),
        body(rc.shapes.plate(2.0, 2.0), [1.5, -0.6, 0.0], rpy=[0.0, 0.0, -1.2], material=rough),
    ]

    def frame(floor: float) -> rc.Frame:
        return simulator(bodies, resolution=128, max_bounces=4, bounce_floor_db=floor).frame()

    whole, most, little = frame(np.inf), frame(80.0), frame(10.0)
    assert whole.stats["bounces_stopped"] == 0
    assert most.stats["bounces_stopped"] > 0
    assert little.stats["bounces_stopped"] > most.stats["bounces_stopped"]
    assert most.stats["bounce_rays"] < whole.stats["bounce_rays"]
    assert np.abs(whole.cube - most.cube).max() <= 1e-4 * np.abs(whole.cube).max()


def test_matt_bodies_send_nothing_on() -> None:
    matt = rc.Material.lambertian(0.5)
    stats = simulator([body(rc.shapes.dihedral(0.4), [1.5, 0.0, 0.0], material=matt)], resolution=64).frame().stats
    assert (stats["bounce_paths"], stats["bounce_rays"]) == (0, 0)
    assert stats["bounces_stopped"] == stats["rays_hit"]


def test_rays_weak_where_they_are_launched_end_as_well() -> None:
    beam = rc.GaussianPattern(10.0, beamwidth_azimuth_deg=10.0, beamwidth_elevation_deg=10.0)
    frames = [
        simulator(room(), rc.Radar(tone(), pattern=pattern), resolution=64, bounce_floor_db=40.0).frame()
        for pattern in (None, beam)
    ]
    assert frames[0].stats["bounces_stopped"] == 0
    assert frames[1].stats["bounces_stopped"] > 100


@pytest.mark.parametrize("number", [0, -1, 65, 1.5, "two"])
def test_number_of_reflections_is_a_small_integer(number: Any) -> None:
    with pytest.raises((ValueError, TypeError), match="max_bounces"):
        simulator([], max_bounces=number)


@pytest.mark.parametrize("floor", [0.0, -3.0, np.nan, "low"])
def test_floor_is_a_positive_number_of_decibels(floor: Any) -> None:
    with pytest.raises((ValueError, TypeError), match="bounce_floor_db"):
        simulator([], bounce_floor_db=floor)


def test_recordings_and_other_radars_keep_the_settings() -> None:
    sim = simulator([ball()], resolution=16, field_of_view_deg=(20.0, 20.0), max_bounces=2, bounce_floor_db=50.0)
    source = sim.record(0.0, 0.01, progress=False).source
    assert (source["max_bounces"], source["bounce_floor_db"]) == (2, 50.0)
    other = sim.with_radar(CHANNELS)
    assert (other.max_bounces, other.bounce_floor_db) == (2, 50.0)


def test_adaptive_sampling_has_the_same_paths_of_several_reflections() -> None:
    target = body(rc.shapes.dihedral(0.1), [2.0, 0.0, 0.0])
    options: dict[str, Any] = {"field_of_view_deg": (5.0, 5.0), "max_bounces": 2}
    pixels = rc.Simulator(rc.Scene([target]), rc.Radar(tone()), sampling="footprint", **options).paths()
    cells = rc.Simulator(rc.Scene([target]), rc.Radar(tone()), sampling="adaptive", **options).paths()
    number = (
        rc.Simulator(rc.Scene([target]), rc.Radar(tone()), sampling="footprint", **options)
        .frame()
        .stats["bounce_paths"]
    )
    assert number > 1000
    np.testing.assert_array_equal(cells.delay[:, -number:], pixels.delay[:, -number:])
    np.testing.assert_array_equal(cells.amplitude[:, -number:], pixels.amplitude[:, -number:])
