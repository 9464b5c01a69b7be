"""Adaptive sampling by default: closed forms, thin and small bodies, budgets, what is taken over."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_closed_forms import CONDUCTOR, body, sphere

import radarcore as rc

C = 299_792_458.0
BAND = np.linspace(57e9, 64e9, 15)


def simulator(bodies: list[rc.Body], pattern: rc.GaussianPattern | None = None, **options: Any) -> rc.Simulator:
    """One chirp over the band, antennas at one place, isotropic by default, 1 W."""
    waveform = rc.Waveform(start_frequency=57e9, slope=14e12, sample_rate=1e6, num_samples=501)
    return rc.Simulator(rc.Scene(bodies), rc.Radar(waveform, pattern=pattern), **({"tolerance": 1e-6} | options))


def spectrum(sim: rc.Simulator) -> NDArray[np.complex128]:
    """H over the band, path by path."""
    paths = sim.paths()
    weights = (sim.radar.waveform.center_frequency / BAND[:, None]) ** paths.order[0]
    turns = np.exp(-2j * np.pi * BAND[:, None] * paths.delay[0])
    spectrum: NDArray[np.complex128] = (weights * turns) @ paths.amplitude[0]
    return spectrum


def db(ratio: Any) -> Any:
    return 20.0 * np.log10(np.abs(ratio))


def rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


@pytest.mark.parametrize("radius", [0.02, 0.05, 0.1, 0.2])
def test_sphere_has_its_closed_form_over_the_band(radius: float) -> None:
    ratio = spectrum(simulator([body(rc.shapes.sphere(radius), 1.0)])) / [sphere(radius, 1.0, f) for f in BAND]
    assert rms(db(ratio)) <= 0.6
    assert rms(np.angle(ratio)) <= 0.1


@pytest.mark.parametrize("distance", [10.0, 30.0, 100.0])
def test_far_square_has_its_far_field_in_a_wide_view(distance: float) -> None:
    # At 100 m its side is a ninth of a cell of the base grid, which is halved nine times at most.
    ratio = spectrum(simulator([body(rc.shapes.plate(0.1, 0.1), distance)], field_of_view_deg=(60.0, 60.0)))
    wavelength = C / BAND
    far_field = wavelength / (4.0 * np.pi) ** 1.5 * np.sqrt(4.0 * np.pi) * 0.1**2 / wavelength / distance**2
    assert rms(db(ratio / far_field)) <= 0.3


def test_fast_sampling_is_that_of_a_tenfold_floor_and_casts_fewer_rays() -> None:
    # The plate is so bright that no floor is lowered.
    pose = rc.Pose.from_rpy([2.0, 0.8, 0.0], [0.0, 0.0, np.arctan2(0.8, 2.0)])
    bodies = [body(rc.shapes.sphere(0.3), 1.5), rc.Body(rc.shapes.plate(0.4, 0.4), motion=pose)]
    fast, fine = simulator(bodies, sampling="fast").frame(), simulator(bodies).frame()
    assert fast.stats["rays_cast"] < 0.9 * fine.stats["rays_cast"]
    np.testing.assert_array_equal(fast.cube, simulator(bodies, rcs_floor=0.1).frame().cube)


def boxes(size: tuple[float, float, float], places: list[list[float]], pose: rc.Pose) -> rc.Body:
    """Boxes of one size in one mesh, none of which hides another."""
    box = rc.shapes.box(size)
    vertices = np.concatenate([box.vertices + place for place in np.asarray(places)])
    triangles = np.concatenate([box.triangles + k * len(box.vertices) for k in range(len(places))])
    return rc.Body(rc.Mesh(vertices, triangles), material=CONDUCTOR, motion=pose)


def integral(target: rc.Body) -> NDArray[np.complex128]:
    """H of physical optics over the band, summed over the triangles that face the radar."""
    pose = target.motion
    assert isinstance(pose, rc.Pose)
    sums = np.zeros(len(BAND), dtype=np.complex128)
    corners = target.mesh.vertices[target.mesh.triangles] @ pose.rotation.T + pose.position
    for triangle in corners:
        opposite = np.linalg.norm(np.roll(triangle, -1, axis=0) - np.roll(triangle, 1, axis=0), axis=1)
        # The side between b and c is the shortest one.
        a, b, c = np.roll(triangle, -int(opposite.argmin()), axis=0)
        normal = np.cross(b - a, c - a)
        if a @ normal >= 0.0:  # faces away, as all of its plane
            continue
        # Gauss's points of a square of which one side is drawn together at a: phases turn by 450 rad/m or less.
        (s, of_s), (t, of_t) = (half_gauss(16 + int(150.0 * length)) for length in (opposite.max(), opposite.min()))
        points = a + s[:, None, None] * ((1.0 - t)[:, None] * (b - a) + t[:, None] * (c - a))
        weight = np.linalg.norm(normal) * (s * of_s)[:, None] * of_t
        distance = np.linalg.norm(points, axis=-1)
        cosine = -(points @ normal) / distance / np.linalg.norm(normal)
        strength = np.maximum(cosine, 0.0) * weight / (4.0 * np.pi * distance**2)
        # Equal steps of frequency are equal turns.
        field = strength * np.exp(-4j * np.pi / C * BAND[0] * distance)
        turn = np.exp(-4j * np.pi / C * (BAND[1] - BAND[0]) * distance)
        for k in range(len(BAND)):
            sums[k] += field.sum()
            field *= turn
    return -1j * sums


def half_gauss(order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points and weights of Gauss and Legendre from 0 to 1."""
    points, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 + 0.5 * points, 0.5 * weights


FENCE = boxes((0.004, 0.004, 0.5), [[0.0, 0.05 * k, 0.0] for k in range(-5, 6)], rc.Pose([2.0, 0.0, 0.0]))
ROD = boxes((0.002, 0.002, 0.3), [[0.0, 0.0, 0.0]], rc.Pose([2.0, 0.013, 0.0]))
PROPELLER = boxes(
    (0.001, 0.05, 0.008), [[0.0, 0.03, 0.0], [0.0, -0.03, 0.0]], rc.Pose.from_rpy([2.0, 0.1, 0.05], [0.4, 0.0, 0.0])
)


@pytest.mark.parametrize("target", [FENCE, ROD, PROPELLER], ids=["fence", "rod", "propeller"])
def test_thin_bodies_hold_one_decibel(target: rc.Body) -> None:
    assert abs(db(rms(spectrum(simulator([target]))) / rms(integral(target)))) <= 1.0


@pytest.mark.parametrize("roll_deg", [0.0, 33.0, 45.0])
def test_tilted_strip_is_seen_all_along(roll_deg: float) -> None:
    pose = rc.Pose.from_rpy([3.0, 0.0, 0.0], [np.deg2rad(roll_deg), 0.0, 0.0])
    strip = rc.Body(rc.shapes.plate(1.0, 0.016), material=CONDUCTOR, motion=pose)
    assert abs(db(rms(spectrum(simulator([strip]))) / rms(integral(strip)))) <= 0.1


def test_small_body_far_away_is_found_between_the_rays_of_the_base_grid() -> None:
    for y in (0.0, 0.05, 0.1):
        ball = rc.Body(rc.shapes.sphere(0.025), material=CONDUCTOR, motion=rc.Pose([6.0, y, 0.03]))
        distance = np.linalg.norm([6.0, y, 0.03])
        ratio = rms(spectrum(simulator([ball]))) / rms([sphere(0.025, distance, f) for f in BAND])
        assert abs(db(ratio)) <= 1.0


def test_budget_is_kept_and_said_once() -> None:
    ball = body(rc.shapes.sphere(0.2), 1.0)
    sim = simulator([ball], rcs_floor=1e-7, ray_budget=30_000, field_of_view_deg=(60.0, 60.0))
    with pytest.warns(UserWarning, match="adaptive sampling ended at its finest cells or its ray_budget") as warned:
        frames = [sim.frame(0.0), sim.frame(0.1)]
    assert len(warned) == 1
    assert frames[0].stats["cells_not_split"] > 0
    exact = np.array([sphere(0.2, 1.0, f) for f in BAND])
    assert rms(spectrum(sim) / exact - 1.0) < 0.1
    assert simulator([ball]).frame().stats["cells_not_split"] == 0


def test_budget_is_kept_where_thin_bars_alone_would_exceed_it() -> None:
    fence = boxes((0.002, 0.002, 2.0), [[0.0, 0.01 * k, 0.0] for k in range(-100, 100)], rc.Pose([2.5, 0.0, 0.0]))
    sim = simulator([fence], ray_budget=20_000, field_of_view_deg=(60.0, 60.0))
    with pytest.warns(UserWarning, match="adaptive sampling ended at its finest cells or its ray_budget"):
        stats = sim.frame().stats
    assert stats["cells_not_split"] > 0
    assert stats["rays_cast"] <= 2 * 20_000  # with those of the cells that were tried


def test_results_depend_neither_on_threads_nor_on_what_is_known() -> None:
    def moving(**options: Any) -> rc.Simulator:
        rough = rc.Material.lambertian(0.3)
        bodies = [
            rc.Body(rc.shapes.plate(3.0, 3.0), material=rough, motion=rc.Pose([3.0, 0.0, 0.0])),
            rc.Body(rc.shapes.sphere(0.1), motion=rc.Pose([2.0, -0.5, 0.2])),
            rc.Body(rc.shapes.sphere(0.1), motion=rc.Linear(rc.Pose([1.5, 0.2, 0.0]), velocity=[0.0, 1.0, 0.0])),
        ]
        return simulator(bodies, **options)

    one, three = moving(threads=1), moving(threads=3)
    fresh = moving()
    vars(fresh)["_engines"] = fresh._new_engines(reuse_tiles=False, skip_empty=False)
    first = one.frame(0.0)
    # Where nothing moves only rays to the points of the diffuse plate are cast.
    diffuse = one.frame(0.0).stats["rays_cast"]
    assert 1000 < diffuse < first.stats["rays_cast"]
    for time in (0.02, 0.03):
        frame = one.frame(time)
        np.testing.assert_array_equal(frame.cube, fresh.frame(time).cube)
        np.testing.assert_array_equal(frame.cube, three.frame(time).cube)
        assert frame.stats["tiles_reused"] > 0
        assert frame.stats["rays_cast"] - diffuse < 0.5 * (first.stats["rays_cast"] - diffuse)
    still = one.frame(0.03)
    assert still.stats["rays_cast"] == diffuse
    np.testing.assert_array_equal(still.cube, frame.cube)


@pytest.mark.filterwarnings("ignore:tx, rx. expected antennas within")
def test_antennas_far_apart_have_slopes_of_their_own() -> None:
    # A plate mirrors one of two antennas 49 cm apart to the other.
    waveform = rc.Waveform(start_frequency=60e9, slope=1.0, sample_rate=1e6, num_samples=1)
    radar = rc.Radar(waveform, tx=[[0.0, 0.245, 0.0]], rx=[[0.0, -0.245, 0.0], [0.0, 0.245, 0.0]])
    paths = rc.Simulator(rc.Scene([body(rc.shapes.plate(0.1, 0.1), 1.0)]), radar, rcs_floor=1e-5).paths()
    wavenumber, pitch = 2.0 * np.pi * 60e9 / C, 1e-4
    y = pitch * (np.arange(1000) - 499.5)
    for channel, receiver in enumerate((-0.245, 0.245)):
        got = (paths.amplitude[channel] * np.exp(-2j * np.pi * 60e9 * paths.delay[channel])).sum()
        # The integral of physical optics over the plate.
        there, back = (np.sqrt(1.0 + np.add.outer((y - place) ** 2, y**2)) for place in (0.245, receiver))
        strength = 0.5 * (1.0 / there + 1.0 / back) / (there * back) * pitch**2 / (4.0 * np.pi)
        expected = (strength * np.exp(-1j * wavenumber * (there + back))).sum()
        assert np.abs(db(got / expected)) <= 0.3
