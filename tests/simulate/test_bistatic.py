"""Transmitters and receivers with a spacing of 10 cm: every pair has its own spherical waves, amplitude and phase.

H is the received phasor of a channel at one frequency for 1 W, isotropic antennas and a perfect conductor. The slow
truth integrates physical optics, docs/theory.md eq. (2) with F = 1 and the phase of propagation, over the surface; the
bounds are from test_closed_forms.py.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc

C = 299_792_458.0
TX = [[0.0, 0.05, 0.0], [0.01, 0.0, -0.05]]
RX = [[0.0, -0.05, 0.0], [0.0, 0.05, 0.0], [-0.02, 0.0, 0.05]]
PLATE_DB, PLATE_PHASE = 0.6, 0.1
SPHERE_DB, SPHERE_PHASE = 0.25, 0.05

Array = NDArray[np.float64]


sphere = cache(rc.shapes.sphere)


def simulator(mesh: rc.Mesh, pose: rc.Pose, frequency: float = 60e9, **options: Any) -> rc.Simulator:
    wf = rc.Waveform(start_frequency=frequency, slope=1.0, sample_rate=1e6, num_samples=1)
    material = options.pop("material", rc.materials["perfect_conductor"])
    return rc.Simulator(
        rc.Scene([rc.Body(mesh, material=material, motion=pose)]),
        rc.Radar(wf, tx=options.pop("tx", TX), rx=options.pop("rx", RX)),
        **{"sampling": "footprint", "resolution": 512, "tolerance": 1e-9, **options},
    )


def transfer_functions(sim: rc.Simulator) -> NDArray[np.complex128]:
    """H of every channel: the conjugate of the one sample of a ramp without slope to speak of."""
    return np.conj(sim.frame().cube[:, 0, 0])


def integral(points: Array, normals: Array, areas: Array, frequency: float, tx: Any = TX, rx: Any = RX) -> Any:
    """Physical optics of small patches (patch, 3) of a conductor that the centre of the array sees, per channel."""
    k = 2.0 * np.pi * frequency / C
    seen = []
    for t, r in product(np.asarray(tx), np.asarray(rx)):
        offset_t, offset_r = points - t, points - r
        r_t, r_r = np.linalg.norm(offset_t, axis=1), np.linalg.norm(offset_r, axis=1)
        cos_t = np.maximum(-(normals * offset_t).sum(1) / r_t, 0.0)
        cos_r = np.maximum(-(normals * offset_r).sum(1) / r_r, 0.0)
        amplitude = -1j / (4.0 * np.pi) * (cos_t + cos_r) / (2.0 * r_t * r_r) * areas
        seen.append((amplitude * np.exp(-1j * k * (r_t + r_r))).sum())
    return np.array(seen)


def center(tx: Any = TX, rx: Any = RX) -> Array:
    """Centre of the array, from which rays start."""
    middle: Array = 0.5 * (np.mean(tx, axis=0) + np.mean(rx, axis=0))
    return middle


def sphere_patches(radius: float, middle: Any) -> tuple[Array, Array, Array]:
    """Patches of a sphere that the centre of the array sees."""
    offset = np.asarray(middle) - center()
    distance = np.linalg.norm(offset)
    # Gauss in 40 pieces of the cosine from the tangent circle to the nearest point, trapezoids round the axis.
    x, weight = np.polynomial.legendre.leggauss(16)
    low = radius / distance
    cosine = low + (1.0 - low) * (np.arange(40)[:, None] + 0.5 * (x + 1.0)).ravel() / 40.0
    angle = 2.0 * np.pi * np.arange(96) / 96.0
    axis = -offset / distance
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, axis)
    sine = np.sqrt(1.0 - cosine**2)[:, None, None]
    round_axis = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up
    normals = (cosine[:, None, None] * axis + sine * round_axis).reshape(-1, 3)
    areas = np.repeat(radius**2 * 0.5 * (1.0 - low) * np.tile(weight, 40) / 40.0 * 2.0 * np.pi / 96.0, 96)
    return np.asarray(middle) + radius * normals, normals, areas


def plate_patches(width: float, height: float, pose: rc.Pose) -> tuple[Array, Array, Array]:
    """A plate that faces the sensor."""
    x, weight = np.polynomial.legendre.leggauss(160)
    y, z = np.meshgrid(0.5 * width * x, 0.5 * height * x, indexing="ij")
    local = np.stack([np.zeros_like(y), y, z], -1).reshape(-1, 3)
    normals = np.broadcast_to(pose.rotation @ [-1.0, 0.0, 0.0], local.shape)
    areas = (0.25 * width * height * weight[:, None] * weight).ravel()
    return local @ pose.rotation.T + pose.position, normals, areas


def assert_close(got: Any, expected: Any, db_bound: float, phase_bound: float) -> None:
    error_db, error_phase = 20.0 * np.log10(np.abs(got / expected)), np.angle(got / expected)
    assert (np.abs(error_db) <= db_bound).all(), f"{error_db} dB, {error_phase} rad"
    assert (np.abs(error_phase) <= phase_bound).all(), f"{error_db} dB, {error_phase} rad"


def test_integral_for_one_antenna_has_the_values_on_paper() -> None:
    # Sphere of 10 cm at 1 m and squares from one place, of the validation table.
    here = [[0.0, 0.0, 0.0]]
    patches = sphere_patches(0.1, center() + np.array([1.0, 0.0, 0.0]))
    at_center = integral(*patches, 60e9, [center()], [center()])
    assert at_center[0] == pytest.approx(-1.364140741e-07 + 2.207852026e-05j, rel=1e-4)
    plate = integral(*plate_patches(0.1, 0.1, rc.Pose([1.0, 0.0, 0.0])), 60e9, here, here)
    assert plate[0] == pytest.approx(1.401928381e-04 + 2.806126868e-04j, rel=1e-8)


@pytest.mark.parametrize("frequency", [57e9, 64e9])
@pytest.mark.parametrize(("radius", "place"), [(0.05, (0.6, 0.0, 0.0)), (0.1, (1.0, 0.05, -0.08))])
def test_every_pair_sees_the_sphere_from_its_own_places(radius: float, place: Any, frequency: float) -> None:
    sim = simulator(sphere(radius), rc.Pose(place), frequency, field_of_view_deg=(30.0, 30.0))
    expected = integral(*sphere_patches(radius, np.array(place)), frequency)
    assert_close(transfer_functions(sim), expected, SPHERE_DB, SPHERE_PHASE)
    # The bound distinguishes the pairs.
    assert np.ptp(np.angle(expected / expected[0])) > 5.0 * SPHERE_PHASE


PLATES = {
    "facing, 1 m": (rc.Pose([1.0, 0.0, 0.0]), 20.0),
    "facing, 0.5 m": (rc.Pose([0.5, 0.0, 0.0]), 25.0),
    "aside, turned": (rc.Pose.from_rpy([1.0, 0.1, 0.02], [0.0, np.deg2rad(2.0), np.deg2rad(4.0)]), 30.0),
}


@pytest.mark.parametrize("name", PLATES)
def test_every_pair_sees_the_plate_from_its_own_places(name: str) -> None:
    pose, field_of_view_deg = PLATES[name]
    window = (field_of_view_deg, field_of_view_deg)
    sim = simulator(rc.shapes.plate(0.1, 0.1), pose, field_of_view_deg=window)
    expected = integral(*plate_patches(0.1, 0.1, pose), 60e9)
    assert_close(transfer_functions(sim), expected, PLATE_DB, PLATE_PHASE)


def test_mirror_between_two_antennas_is_at_the_length_of_the_bent_way() -> None:
    # A mirror at 0.5 m, antennas with a spacing of 20 cm: lambda / (4 pi L) with L to the mirror image.
    baseline, distance, wavelength = 0.2, 0.5, C / 60e9
    tx, rx = [[0.0, 0.5 * baseline, 0.0]], [[0.0, -0.5 * baseline, 0.0]]
    length = np.hypot(2.0 * distance, baseline)
    mirror = wavelength / (4.0 * np.pi * length)
    sums = []
    for side in np.linspace(0.30, 0.40, 11):
        sim = simulator(
            rc.shapes.plate(side, side),
            rc.Pose([distance, 0.0, 0.0]),
            tx=tx,
            rx=rx,
            field_of_view_deg=(50, 50),
            resolution=384,
        )
        sums.append(transfer_functions(sim)[0])
    phase = np.exp(-2j * np.pi / wavelength * length)
    # Waves of the edges turn by several turns over these sides and cancel in the mean.
    mean = np.mean(sums) / (-mirror * phase)
    assert abs(mean) == pytest.approx(1.0, abs=0.02)
    assert np.angle(mean) == pytest.approx(0.0, abs=0.02)


def test_delays_of_every_pair_are_exact_distances_from_one_cast() -> None:
    matt = rc.Material.lambertian(1.0)
    pose = rc.Pose([0.7, 0.1, -0.05])
    options: dict[str, Any] = {"sampling": "point", "resolution": 64, "field_of_view_deg": (40.0, 40.0)}
    sim = simulator(sphere(0.1), pose, material=matt, **options)
    image, paths = sim.depth_image(), sim.paths()
    hit = image.body >= 0
    points = image.surface_distance[hit][:, None] * image.directions[hit] + sim.radar.array_center
    assert paths.delay.shape == (6, len(points))
    assert len(points) > 100
    pairs = product(np.array(TX), np.array(RX))
    expected = [np.linalg.norm(points - t, axis=1) + np.linalg.norm(points - r, axis=1) for t, r in pairs]
    # Every hit is a path, in any order.
    order, of_paths = np.argsort(expected[0]), np.argsort(paths.delay[0])
    for channel, lengths in enumerate(expected):
        np.testing.assert_allclose(paths.delay[channel, of_paths] * C, lengths[order], rtol=0, atol=1e-14)
    assert sim.frame().stats["rays_cast"] <= 64 * 64
