"""Physical optics and Lambert's law against answers known on paper (docs: theory, validation cases).

H is the received phasor at one frequency for 1 W, isotropic antennas at one place and a perfect conductor. The
footprint of a pixel is exact up to the staircase of the rim and the curvature within a pixel. Bounds in an image of 60
degrees follow the accuracy table for 512 x 512 rays; most windows here are narrower, and so are plates' bounds. The
default setting, which takes a fraction of these rays, has rows of its own.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.special import exp1

import radarcore as rc
from proof.bounds import single_bounds
from proof.measure import FULL
from proof.targets import cases, measured_by_default

C = 299_792_458.0
CONDUCTOR = rc.materials["perfect_conductor"]


def transfer_function(
    bodies: list[rc.Body],
    frequency: float = 60e9,
    *,
    field_of_view_deg: float = 20.0,
    resolution: int = 512,
    **options: Any,
) -> complex:
    """H at one frequency: the conjugate of the one sample of a ramp without slope to speak of."""
    wf = rc.Waveform(start_frequency=frequency, slope=1.0, sample_rate=1e6, num_samples=1)
    window = (field_of_view_deg, field_of_view_deg)
    sim = rc.Simulator(
        rc.Scene(bodies),
        rc.Radar(wf),
        resolution=resolution,
        field_of_view_deg=window,
        tolerance=1e-9,
        **{"sampling": "footprint"} | options,
    )
    return complex(np.conj(sim.frame().cube[0, 0, 0]))


def body(mesh: rc.Mesh, x: float, *, yaw_deg: float = 0.0, material: rc.Material = CONDUCTOR) -> rc.Body:
    return rc.Body(mesh, material=material, motion=rc.Pose.from_rpy([x, 0.0, 0.0], [0.0, 0.0, np.deg2rad(yaw_deg)]))


def flat_shaded(mesh: rc.Mesh) -> rc.Mesh:
    return rc.Mesh(mesh.vertices, mesh.triangles, shading="flat")


def db(ratio: Any) -> float:
    return float(20.0 * np.log10(np.abs(ratio)))


def assert_close(got: complex, expected: complex, db_bound: float, phase_bound: float) -> None:
    error_db, error_phase = db(got / expected), float(np.angle(got / expected))
    assert abs(error_db) <= db_bound, f"{error_db:+.3f} dB, {error_phase:+.4f} rad"
    assert abs(error_phase) <= phase_bound, f"{error_db:+.3f} dB, {error_phase:+.4f} rad"


def exponential_integral_2(z: complex) -> complex:
    """E2; scipy's expn takes real arguments only."""
    return complex(np.exp(-z) - z * exp1(z))


def disc_on_axis(radius: float, distance: float, frequency: float) -> complex:
    k, rim = 2 * np.pi * frequency / C, np.hypot(distance, radius)
    e2 = exponential_integral_2
    integral = 2 * np.pi * (e2(2j * k * distance) - distance / rim * e2(2j * k * rim))
    return -1j / (4 * np.pi) * integral


def sphere(radius: float, centre: float, frequency: float) -> complex:
    k, near, tangent = 2 * np.pi * frequency / C, centre - radius, np.sqrt(centre**2 - radius**2)
    e2 = exponential_integral_2
    ends = e2(2j * k * near) / near - e2(2j * k * tangent) / tangent
    phasors = (np.exp(-2j * k * near) - np.exp(-2j * k * tangent)) / (2j * k)
    return complex(-1j / (4 * np.pi) * np.pi / centre * (tangent**2 * ends - phasors))


FREQUENCIES = np.linspace(57e9, 64e9, 5).tolist()

PLATES = {
    "disc b=0.05": (lambda: rc.shapes.disc(0.05), 0.0, 6.656596809e-05 + 3.914973094e-04j),
    "disc b=0.02": (lambda: rc.shapes.disc(0.02), 0.0, -9.029956901e-05 + 4.038668771e-05j),
    "square 0.1 m": (lambda: rc.shapes.plate(0.1, 0.1), 0.0, 1.401928381e-04 + 2.806126868e-04j),
    "square 0.2 m": (lambda: rc.shapes.plate(0.2, 0.2), 0.0, -1.042389726e-05 + 1.567952559e-04j),
    "square 0.2 m, 5 degrees": (lambda: rc.shapes.plate(0.2, 0.2), 5.0, 4.603129585e-05 - 1.141052424e-04j),
}

PLATE_DB, PLATE_PHASE = 0.6 / 3, 0.1 / 3  # the staircase of the rim, with pixels a third of the size in 60 degrees
SPHERE_DB, SPHERE_PHASE = 0.25, 0.05 / 2  # the curvature within a pixel, in up to 25 degrees


@pytest.mark.parametrize("name", PLATES)
def test_plate_at_one_metre_has_its_closed_form(name: str) -> None:
    mesh, yaw_deg, expected = PLATES[name]
    assert_close(transfer_function([body(mesh(), 1.0, yaw_deg=yaw_deg)]), expected, PLATE_DB, PLATE_PHASE)


def test_number_on_paper_of_disc_and_sphere_is_their_closed_form() -> None:
    assert disc_on_axis(0.05, 1.0, 60e9) == pytest.approx(6.656596809e-05 + 3.914973094e-04j, rel=1e-9)
    assert sphere(0.1, 1.0, 60e9) == pytest.approx(-1.364140741e-07 + 2.207852026e-05j, rel=1e-9)
    assert sphere(0.2, 1.0, 60e9) == pytest.approx(-8.913847473e-06 + 4.891186567e-05j, rel=1e-9)


@cache
def ball(radius: float) -> rc.Body:
    """A conducting sphere at 1 m; its mesh takes longer than a frame of it."""
    return body(rc.shapes.sphere(radius), 1.0)


@pytest.mark.parametrize("frequency", FREQUENCIES[::2])
@pytest.mark.parametrize("radius", [0.05, 0.1, 0.2])
def test_smooth_sphere_has_its_closed_form_over_the_band(radius: float, frequency: float) -> None:
    got = transfer_function([ball(radius)], frequency, field_of_view_deg=15 + 50 * radius)
    assert_close(got, sphere(radius, 1.0, frequency), SPHERE_DB, SPHERE_PHASE)


@pytest.mark.parametrize("sampling", ["adaptive", "footprint"])
def test_error_of_a_smooth_sphere_falls_with_the_pixels(sampling: str) -> None:
    # Its first Fresnel zone is 22 mm wide: four pixels of 64 in 20 degrees, or 33 of 512.
    target = [body(rc.shapes.sphere(0.05), 1.0)]
    coarse, fine = (
        abs(transfer_function(target, sampling=sampling, resolution=n) / sphere(0.05, 1.0, 60e9) - 1.0)
        for n in (64, 512)
    )
    assert fine < 0.3 * coarse


def test_plate_looks_the_same_smooth_and_flat_and_from_behind() -> None:
    plate = rc.shapes.plate(0.1, 0.1)
    smooth = transfer_function([body(plate, 1.0)], resolution=128)
    assert transfer_function([body(flat_shaded(plate), 1.0)], resolution=128) == smooth
    behind = rc.Mesh(plate.vertices, plate.triangles[:, ::-1])
    assert transfer_function([body(behind, 1.0)], resolution=128) == pytest.approx(smooth, rel=1e-12)


def test_echo_scales_with_the_reflection_coefficient() -> None:
    mesh = rc.shapes.plate(0.1, 0.1)
    conductor = transfer_function([body(mesh, 1.0)], resolution=128)
    material = rc.Material(0.3 - 0.4j)
    got = transfer_function([body(mesh, 1.0, material=material)], resolution=128)
    assert got == pytest.approx(-material.reflection * conductor, rel=1e-6)
    # Half-spaces: the plate is seen at up to 4 degrees, where (r_TE - r_TM) / 2 is 0.2 % below its normal value.
    for name, level_db in (("concrete", -8.12), ("skin", -4.23)):
        material = rc.materials[name]
        got = transfer_function([body(mesh, 1.0, material=material)], resolution=128)
        assert got == pytest.approx(-material.reflection * conductor, rel=3e-3)
        assert db(got / conductor) == pytest.approx(level_db, abs=0.03)


def lambertian_disc(radius: float, distance: float) -> float:
    """Mean power of a disc of albedo 1 on axis at 60 GHz [W]."""
    return (C / 60e9 / (4 * np.pi)) ** 2 * distance**2 / 2 * (distance**-4 - (distance**2 + radius**2) ** -2)


def lambertian_sphere(radius: float, centre: float) -> float:
    """Mean power of a sphere of albedo 1 at 60 GHz [W]: rings of 2 pi radius rho d rho / centre, seen at distance rho.

    Their cosine is (t^2 - rho^2) / (2 radius rho), with the tangent's length t.
    """
    near, tangent = centre - radius, np.sqrt(centre**2 - radius**2)

    def integral(rho: float) -> float:
        return float(np.log(rho) + tangent**2 / rho**2 - tangent**4 / (4 * rho**4))

    return (C / 60e9 / (4 * np.pi)) ** 2 * (integral(tangent) - integral(near)) / (2 * radius * centre)


def test_number_on_paper_of_matt_bodies_is_their_closed_form() -> None:
    assert lambertian_disc(0.1, 1.0) == pytest.approx(1.557552e-09, rel=1e-6)
    assert lambertian_disc(0.3, 2.0) == pytest.approx(8.601488e-10, rel=1e-6)
    assert lambertian_sphere(0.3, 2.0) == pytest.approx(7.656712e-10, rel=1e-6)


TONE = rc.Radar(rc.Waveform(start_frequency=60e9, slope=1.0, sample_rate=1e6, num_samples=1))


@pytest.mark.filterwarnings("ignore:field_of_view_deg. expected degrees", "ignore:distance. quantised")
@pytest.mark.parametrize(
    ("mesh", "x", "expected", "field_of_view_deg", "pixels"),
    [
        (rc.shapes.disc(0.1), 1.0, lambertian_disc(0.1, 1.0), 13.0, 16),
        (rc.shapes.disc(0.3), 2.0, lambertian_disc(0.3, 2.0), 19.0, 32),
        (rc.shapes.sphere(0.15, subdivisions=5), 1.0, lambertian_sphere(0.15, 1.0), 18.0, 64),
        (rc.shapes.disc(0.01), 1.0, lambertian_disc(0.01, 1.0), 1.25, 32),
        (rc.shapes.disc(0.003), 1.0, lambertian_disc(0.003, 1.0), 0.36, 120),
    ],
)
def test_mean_power_of_a_matt_body_is_lamberts_however_fine_the_pixels(
    mesh: rc.Mesh, x: float, expected: float, field_of_view_deg: float, pixels: int
) -> None:
    """Scenes choose the number of points of matt bodies, see test_speckle.py; depth images have the given pixels."""
    window = (field_of_view_deg, field_of_view_deg)
    scene = rc.Scene([body(mesh, x, material=rc.Material.lambertian(1.0))])
    image = rc.Simulator(scene, TONE, field_of_view_deg=window, resolution=pixels).depth_image()
    surface = {"camera": window, "normals": image.normals, "body": image.body, "albedo": 1.0}
    num_seeds = 60
    frames = [rc.frame_from_depth(image.surface_distance, 0.0, TONE, seed=k, **surface) for k in range(num_seeds)]
    powers = [abs(frame.cube[0, 0, 0]) ** 2 / expected for frame in frames]
    # Speckle: powers are exponential with mean and deviation 1, so the mean of n of them deviates by 1 / sqrt(n).
    # Their deviation has one of sqrt(8 / n) (fourth central moment 9), halved by the root.
    assert np.mean(powers) == pytest.approx(1.0, abs=4.0 / np.sqrt(num_seeds))
    assert np.std(powers) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / num_seeds))


def test_power_of_a_matt_body_scales_with_its_albedo_and_speckle_stays() -> None:
    mesh, options = rc.shapes.disc(0.05), {"field_of_view_deg": 7.0}
    white = transfer_function([body(mesh, 1.0, material=rc.Material.lambertian(1.0))], **options)
    grey = transfer_function([body(mesh, 1.0, material=rc.Material.lambertian(0.25))], **options)
    assert grey == pytest.approx(0.5 * white, rel=1e-12)


# Largest errors of level [dB] and phase [rad] at any of 64 frequencies and six turns by parts of a cell: 1.2 to 1.5
# times the measured ones.
DEFAULT = {
    "disc, radius 5 cm, at 1 m": (1e-5, 0.0012),
    "disc, radius 2 cm, at 1 m": (5e-5, 0.0012),
    "square, 10 cm, at 1 m": (0.008, 0.0028),
    "square, 20 cm, at 1 m": (0.022, 0.004),
    "square, 20 cm, at 1 m, tilted 5 degrees": (0.026, 0.0025),
    "square, 10 cm, at 10 m, image of 60 degrees": (0.018, 0.0009),
    "square, 10 cm, at 10 m, image of 6 degrees": (0.018, 0.0009),
    "square, 10 cm, at 100 m, image of 0.6 degrees": (0.16, 0.015),
    "plane wider than the image, at 1 m": (1e-12, 1.4e-6),
    "sphere, radius 20 cm, centre at 1 m": (0.8, 0.08),
    "sphere, radius 10 cm, centre at 1 m": (1.2, 0.18),
    "sphere, radius 5 cm, centre at 1 m": (0.9, 0.13),
    "cylinder, radius 5 cm, length 30 cm, axis at 1 m": (1.2, 0.09),
}


@pytest.mark.filterwarnings("ignore:field_of_view_deg. expected degrees")
@pytest.mark.parametrize("name", DEFAULT)
def test_default_setting_has_the_closed_form_at_every_frequency_and_turn(name: str) -> None:
    (case,) = (case for case in cases() if case.name == name)
    row = measured_by_default(case, FULL)
    most_db, most_phase = DEFAULT[name]
    assert row.largest_level <= most_db
    assert row.largest_phase <= most_phase
    # And the bounds of the page.
    assert [bound.what for bound in single_bounds([row]) if not bound.is_held] == []


def test_default_setting_has_a_row_for_every_target_of_the_page() -> None:
    assert {case.name for case in cases() if isinstance(case.target, rc.Body)} == set(DEFAULT)


def test_cells_follow_a_plate_that_turns_within_a_frame() -> None:
    # Cast at the middle of the frame, 2 degrees before the plate stands as in the closed form.
    turn, duration = np.deg2rad(2.0), 0.02
    wf = rc.Waveform(
        start_frequency=60e9, slope=1.0, sample_rate=1e6, num_samples=1, num_chirps=2, chirp_interval=duration
    )
    start = rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.0, 0.0, np.deg2rad(5.0)])
    motion = rc.Linear(start, angular_velocity=[0.0, 0.0, turn / (0.5 * duration)])
    plate = rc.Body(rc.shapes.plate(0.2, 0.2), material=CONDUCTOR, motion=motion)
    paths = rc.Simulator(rc.Scene([plate]), rc.Radar(wf), sampling="adaptive").paths(0.0)
    got = (paths.amplitude[0] * np.exp(-2j * np.pi * 60e9 * paths.delay[0])).sum()
    assert_close(got, 4.603129585e-05 - 1.141052424e-04j, 0.3, 0.06)
