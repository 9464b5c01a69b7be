"""Paths of several reflections against answers known on paper: images in walls, a ball above a floor."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from bounce_scenes import (
    BALL,
    CHANNELS,
    CLOSE,
    CONDUCTOR,
    FREQUENCY,
    METAL,
    RADIUS,
    SENSOR,
    VIEW,
    VIEWS,
    WAVELENGTH,
    C,
    ball,
    body,
    bounce_paths,
    image_of,
    phasors,
    reflected_by_ball,
    simulator,
    sphere,
    tone,
    touched,
    wall,
)
from reference import Patches, double_scattering_reference


@cache
def ghost_paths(view: str) -> rc.Paths:
    """Paths of two reflections, by ball and wall, as seen in `VIEWS`."""
    return bounce_paths(simulator([ball(), wall()], CHANNELS, **VIEWS[view]))


def ghost_length(center: NDArray[np.float64] = BALL) -> float:
    """Length of the way from the sensor over the ball to the image of the sensor [m]."""
    point = touched(SENSOR, image_of(SENSOR), center)
    return float(np.linalg.norm(point - SENSOR) + np.linalg.norm(point - image_of(SENSOR)))


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


@pytest.mark.parametrize(("tx_width", "rx_width"), [(np.inf, 30.0), (30.0, np.inf), (30.0, 50.0)])
def test_both_ends_of_a_ghost_have_the_gain_of_their_own_directions(tx_width: float, rx_width: float) -> None:
    """Straight ahead to the ball, 36 degrees aside to its image: 17 dB less in a beam of 30 degrees."""
    point = touched(SENSOR, image_of(SENSOR))
    isotropic = 20.0 * np.log10(abs(reflected_by_ball(SENSOR, image_of(SENSOR))))
    tx, rx = (
        rc.GaussianPattern(0.0, width, width) if np.isfinite(width) else rc.IsotropicPattern()
        for width in (tx_width, rx_width)
    )
    radar = rc.Radar(tone(), tx_patterns=[tx], rx_patterns=[rx])
    ends = point, image_of(point)
    for last, view in ((0, "wide"), (1, "wide"), (1, "close")):
        paths = bounce_paths(simulator([ball(), wall()], radar, **VIEWS[view]))
        received = np.where(paths.body == last, phasors(paths), 0.0).sum()
        # A wave that leaves for the image comes back from the ball, and the other way round.
        azimuths = np.rad2deg([np.arctan2(ends[i][1], ends[i][0]) for i in (1 - last, last)])
        gains = -40.0 * np.log10(2.0) * (azimuths / [tx_width, rx_width]) ** 2
        assert 20.0 * np.log10(abs(received)) == pytest.approx(isotropic + gains.sum(), abs=0.4)


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
    assert peak.range == pytest.approx(0.5 * ghost_length(), abs=0.02 * waveform.range_resolution)
    assert peak.velocity == pytest.approx(0.5 * rate, abs=0.01 * waveform.velocity_resolution)
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


def test_paths_that_have_not_converged_are_warned_of_once() -> None:
    """A person in a room of mirrors in a wide, coarse view: many edges, and few tubes for them."""
    sides = {
        (6.0, 0.1, 3.0): [(2.0, -2.0, 0.0), (2.0, 2.0, 0.0)],
        (0.1, 4.0, 3.0): [(4.0, 0.0, 0.0)],
        (6.0, 4.0, 0.1): [(2.0, 0.0, -1.2)],
    }
    walls = [body(rc.shapes.box(size), place) for size, places in sides.items() for place in places]
    person = rc.models.Human(height=1.75, speed=0.85, path=[[3.0, 0.8], [1.3, 0.3]]).bodies(name="person")
    view: dict[str, Any] = {"field_of_view_deg": (120.0, 120.0), "resolution": 128, "max_bounces": 3}
    sim = rc.Simulator(rc.Scene([*walls, *person]), rc.Radar(tone()), **view)
    with pytest.warns(UserWarning, match="paths of several reflections have not converged: ray tubes ran out"):
        sim.frame()
    sim.frame()  # without a warning
