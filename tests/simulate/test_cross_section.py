"""Far-field cross-sections against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc

FREQUENCY = 60e9
WAVELENGTH = 299_792_458.0 / FREQUENCY
FRONT = [-1.0, 0.0, 0.0]


PLATE = 10.0 * np.log10(4.0 * np.pi * 0.1**4 / WAVELENGTH**2)
"""Square of 10 cm that faces the wave [dBsm]."""

EXACT = 1e-9
"""Faces are integrated in closed form: only rounding is left [dB]."""


def dbsm(mesh: rc.Mesh | rc.Body, directions: Any = FRONT, **options: Any) -> Any:
    return 10.0 * np.log10(rc.rcs(mesh, FREQUENCY, directions, **options))


def horizontal(azimuth: Any) -> np.ndarray:
    """Unit vectors towards azimuths off the front [rad]."""
    azimuth = np.atleast_1d(azimuth)
    return np.stack([-np.cos(azimuth), np.sin(azimuth), 0.0 * azimuth], axis=1)


REFLECTORS = {
    # Mesh, reflections, cross-section for a wave along x [dBsm]; the echoes of the plates of a dihedral are not in it.
    "plate": (lambda: rc.shapes.plate(0.1, 0.1), 1, PLATE, EXACT),
    # Geometrical optics; physical optics differs by 0.006 dB, with its edge of the shadow, and the taper has no edge.
    "sphere": (lambda: rc.shapes.sphere(0.1), 1, -15.0285, 0.02),
    "dihedral": (lambda: rc.shapes.dihedral(0.1), 2, 20.0290, 0.1),
    "triangular trihedral": (lambda: rc.shapes.trihedral(0.1), 3, 12.2475, 0.3),
    "square trihedral": (lambda: rc.shapes.trihedral(0.1, shape="square"), 3, 21.7899, 0.003),
}


@pytest.mark.parametrize("polarization", [None, "vertical", "horizontal", [0.0, 0.6, 0.8]])
@pytest.mark.parametrize("name", REFLECTORS)
def test_reflector_has_its_cross_section(name: str, polarization: Any) -> None:
    mesh, max_bounces, expected, bound = REFLECTORS[name]
    if name == "dihedral" and not isinstance(polarization, str | None):
        # Fields along and across the fold come back with opposite signs; the plates' own echoes do not cancel.
        expected, bound = expected + 20.0 * np.log10(0.8**2 - 0.6**2), 0.3
    got = dbsm(mesh(), max_bounces=max_bounces, polarization=polarization)
    assert got == pytest.approx(expected, abs=bound)


def test_cylinder_broadside_has_its_cross_section() -> None:
    radius, length = 0.05, 0.1
    expected = 10.0 * np.log10(2.0 * np.pi * radius * length**2 / WAVELENGTH)
    assert dbsm(rc.shapes.cylinder(radius, length)) == pytest.approx(expected, abs=0.01)  # 0.004 dB to physical optics


def test_tilted_plate_has_the_lobes_of_its_side() -> None:
    side, tilt = 0.1, np.deg2rad([0.0, 0.5, 1.0, 2.1, 3.6])
    x = 2.0 * np.pi / WAVELENGTH * side * np.sin(tilt)
    expected = 4.0 * np.pi * side**4 / WAVELENGTH**2 * (np.cos(tilt) * np.sinc(x / np.pi)) ** 2
    got = rc.rcs(rc.shapes.plate(side, side), FREQUENCY, horizontal(tilt))
    np.testing.assert_allclose(10 * np.log10(got), 10 * np.log10(expected), atol=EXACT)


def test_plate_mirrors_into_another_direction_and_back() -> None:
    side, angle = 0.1, np.deg2rad(40.0)
    plate, there, back = rc.shapes.plate(side, side), horizontal(angle), horizontal(-angle)
    expected = 10.0 * np.log10(4.0 * np.pi * (side**2 * np.cos(angle) / WAVELENGTH) ** 2)
    for polarization in (None, "vertical", "horizontal"):
        for directions, receiver in ((there, back), (back, there)):
            got = dbsm(plate, directions, receiver=receiver, polarization=polarization)
            assert got == pytest.approx(expected, abs=EXACT)
    assert dbsm(plate, there) < expected - 30.0


@pytest.mark.parametrize("angle_deg", [20.0, 60.0, 90.0])
def test_sphere_is_as_large_into_other_directions(angle_deg: float) -> None:
    # Geometrical optics; physical optics differs by the order of 1 / (2 k a cos(angle / 2)^3).
    got = dbsm(rc.shapes.sphere(0.1), receiver=horizontal(np.deg2rad(angle_deg))[0])
    assert got == pytest.approx(-15.0285, abs=0.4)


def test_turned_dihedral_returns_nothing_of_its_polarisation() -> None:
    # About the axis of the wave by 45 degrees is the same as fields that are turned the other way.
    mesh, slanting = rc.shapes.dihedral(0.1), [0.0, np.sqrt(0.5), np.sqrt(0.5)]
    assert dbsm(mesh, max_bounces=2, polarization=slanting) < 20.029 - 35.0


def test_dihedral_keeps_its_cross_section_over_azimuth_and_its_plates_take_over_beyond() -> None:
    azimuth = np.deg2rad([0.0, 10.0, 20.0])
    both = dbsm(rc.shapes.dihedral(0.1), horizontal(azimuth), max_bounces=2)
    # The aperture of the two bounces falls with 2 a sin(45 degrees - azimuth) b.
    expected = 20.0290 + 20.0 * np.log10(np.sin(0.25 * np.pi - azimuth) / np.sin(0.25 * np.pi))
    np.testing.assert_allclose(both, expected, atol=0.2)
    facing = dbsm(rc.shapes.dihedral(0.1), horizontal(0.25 * np.pi), max_bounces=2)
    assert facing == pytest.approx(PLATE, abs=EXACT)  # the other plate is seen edge-on


def test_directions_come_one_by_one_or_many_and_threads_do_not_matter() -> None:
    mesh, azimuth = rc.shapes.trihedral(0.05), np.deg2rad([0.0, 5.0, 11.0])
    together = rc.rcs(mesh, FREQUENCY, horizontal(azimuth), max_bounces=3, threads=3)
    for direction, expected in zip(horizontal(azimuth), together, strict=True):
        assert rc.rcs(mesh, FREQUENCY, direction, max_bounces=3, threads=1).tolist() == [expected]
    assert rc.rcs(mesh, FREQUENCY, np.zeros((0, 3))).shape == (0,)
    edge_on = rc.rcs(rc.shapes.plate(0.1, 0.1), FREQUENCY, [0.0, 1.0, 0.0])
    assert edge_on.tolist() == [0.0]


def box_cross_section(size: tuple[float, float, float], azimuth: np.ndarray) -> np.ndarray:
    """Physical optics of a box at 77 GHz and no elevation: both faces that are seen, in closed form."""
    k = 2.0 * np.pi * 77e9 / 299_792_458.0
    length, width, height = size
    towards_x, towards_y = np.abs(np.cos(azimuth)), np.abs(np.sin(azimuth))
    field = 0.0
    for depth, across, facing, along in ((length, width, towards_x, towards_y), (width, length, towards_y, towards_x)):
        field += facing * across * height * np.sinc(k * across * along / np.pi) * np.exp(1j * k * depth * facing)
    return 4.0 * np.pi * abs(field * k / (2.0 * np.pi)) ** 2


@pytest.mark.parametrize("size", [(0.3, 0.3, 0.3), (2.0, 1.0, 0.5), (5.0, 5.0, 5.0)])
def test_large_boxes_have_the_cross_sections_of_their_faces(size: tuple[float, float, float]) -> None:
    for azimuth_deg in np.arange(1.0, 81.0, 23.7):
        # Lobes are as narrow as 0.03 degrees.
        around = azimuth_deg + np.linspace(-0.2, 0.2, 9)
        got = rc.rcs(rc.shapes.box(size), 77e9, azimuth_deg=around)
        expected = box_cross_section(size, np.deg2rad(around))
        np.testing.assert_allclose(got, expected, atol=EXACT * expected.max())


def test_large_corner_has_the_cross_section_of_its_aperture() -> None:
    # A leg of 1 m at 77 GHz: 257 wavelengths.
    expected = 4.0 * np.pi / 3.0 * (77e9 / 299_792_458.0) ** 2
    got = rc.rcs(rc.shapes.trihedral(1.0), 77e9, FRONT, max_bounces=3)
    assert 10.0 * np.log10(got / expected) == pytest.approx(0.0, abs=0.05)


def test_shadow_takes_its_part_of_a_face() -> None:
    # A plate behind another one of half its height, both facing the radar: the visible part has the height of the rest.
    behind, front = rc.shapes.plate(0.4, 0.4), rc.shapes.plate(0.4, 0.2)
    scene = rc.Scene(
        [
            rc.Body(behind, motion=rc.Pose(position=(0.3, 0.0, 0.0)), name="behind"),
            rc.Body(front, motion=rc.Pose(position=(-0.3, 0.0, 0.1)), name="front"),
        ]
    )
    area = 0.4 * 0.2 * (1.0 + np.exp(-4j * np.pi * 0.6 / WAVELENGTH))
    expected = 10.0 * np.log10(4.0 * np.pi * abs(area) ** 2 / WAVELENGTH**2)
    assert 10.0 * np.log10(rc.rcs(scene, FREQUENCY, FRONT)) == pytest.approx(expected, abs=0.05)


def test_doubled_triangles_count_once() -> None:
    plate = rc.shapes.plate(0.1, 0.1)
    twice = rc.Mesh(
        np.vstack([plate.vertices] * 2), np.vstack([plate.triangles, plate.triangles + len(plate.vertices)])
    )
    assert dbsm(twice) == pytest.approx(PLATE, abs=EXACT)


def test_bodies_have_their_materials_and_matt_ones_scatter() -> None:
    plate, matt = rc.shapes.plate(0.1, 0.1), rc.Material.lambertian(0.4)
    glass = rc.Body(plate, material=rc.Material.dielectric(2.25))
    assert rc.rcs(glass, FREQUENCY, FRONT) == pytest.approx(0.04 * rc.rcs(plate, FREQUENCY, FRONT), rel=1e-6)
    # Lambert's law: 4 rho A cos^2.
    for tilt_deg in (0.0, 30.0, 60.0):
        expected = 4.0 * 0.4 * 0.01 * np.cos(np.deg2rad(tilt_deg)) ** 2
        got = rc.rcs(rc.Body(plate, material=matt), FREQUENCY, azimuth_deg=180.0 - tilt_deg)
        assert got == pytest.approx(expected, rel=1e-6)


def test_angles_and_frequencies_give_arrays_of_their_shapes() -> None:
    box = rc.shapes.box((0.2, 0.1, 0.05))
    azimuth, elevation = np.array([[0.0], [20.0], [50.0]]), np.array([-10.0, 0.0])
    frequencies = [24e9, 60e9]
    got = rc.rcs(box, frequencies, azimuth_deg=azimuth, elevation_deg=elevation)
    assert got.shape == (3, 2, 2)
    a, e = np.deg2rad(50.0), np.deg2rad(-10.0)
    direction = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
    assert got[2, 0, 1] == pytest.approx(rc.rcs(box, 60e9, direction)[0], rel=1e-9)
    assert rc.rcs(box, frequencies, direction).shape == (1, 2)
    assert rc.rcs(box, 60e9, azimuth_deg=0.0).shape == (1,)


@pytest.mark.parametrize("direction", [FRONT, [-0.98, 0.1, 0.17], [0.6, 0.48, -0.64], [0, 0, 1], [0, 0, -1]])
def test_polarisation_is_that_of_a_radar_that_looks_upright_at_the_object(direction: list[float]) -> None:
    towards = np.array(direction) / np.linalg.norm(direction)
    # From above and below, the radar has its y axis along y.
    radar = rc.Pose.look_at(
        towards, [0.0, 0.0, 0.0], up=[1.0, 0.0, 0.0] if direction[2] in (-1, 1) else [0.0, 0.0, 1.0]
    )
    body = rc.Body(rc.shapes.box((0.05, 0.07, 0.09)), material=rc.materials["glass"])
    for word, axis in (("vertical", 2), ("horizontal", 1)):
        expected = dbsm(body, towards, polarization=radar.rotation[:, axis])
        assert dbsm(body, towards, polarization=word) == pytest.approx(expected, abs=1e-6)


def test_words_of_polarisation_mean_the_same_to_a_radar() -> None:
    # Both plates reflect a vertical field as r_TE, a horizontal one as r_TM: a difference of 14 dB.
    corner = rc.Body(rc.shapes.dihedral(0.1), material=rc.materials["glass"], motion=rc.Pose([6.0, 0.0, 0.0]))
    waveform = rc.Waveform.from_sweep(start_frequency=59e9, stop_frequency=61e9, sample_rate=2e6, num_samples=256)
    levels = []
    for word in ("vertical", "horizontal"):
        radar = rc.Radar(waveform, polarization=word)
        frame = rc.Simulator(rc.Scene([corner]), radar, field_of_view_deg=(2.0, 2.0), max_bounces=2).frame(0.0)
        simulated = 10.0 * np.log10(np.square(np.abs(frame.cube)).sum())
        levels.append((simulated, dbsm(corner, max_bounces=2, polarization=word)[0]))
    (vertical, upright), (horizontal, level) = levels
    assert upright - level > 10.0
    assert vertical - horizontal == pytest.approx(upright - level, abs=0.5)
