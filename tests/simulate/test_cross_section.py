"""Far-field cross-sections against those on paper."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc

FREQUENCY = 60e9
WAVELENGTH = 299_792_458.0 / FREQUENCY
FRONT = [-1.0, 0.0, 0.0]


def dbsm(mesh: rc.Mesh, directions: Any = FRONT, **options: Any) -> Any:
    return 10.0 * np.log10(rc.rcs(mesh, FREQUENCY, directions, **options))


def horizontal(azimuth: Any) -> np.ndarray:
    """Unit vectors towards azimuths off the front [rad]."""
    azimuth = np.atleast_1d(azimuth)
    return np.stack([-np.cos(azimuth), np.sin(azimuth), 0.0 * azimuth], axis=1)


REFLECTORS = {
    # Mesh, reflections, cross-section for a wave along x [dBsm]; the rims of trihedrals are staircases.
    "plate": (lambda: rc.shapes.plate(0.1, 0.1), 1, 17.0187, 0.01),
    "sphere": (lambda: rc.shapes.sphere(0.1), 1, -15.0285, 0.2),
    "dihedral": (lambda: rc.shapes.dihedral(0.1), 2, 20.0290, 0.05),
    "triangular trihedral": (lambda: rc.shapes.trihedral(0.1), 3, 12.2475, 0.3),
    "square trihedral": (lambda: rc.shapes.trihedral(0.1, shape="square"), 3, 21.7899, 0.3),
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
    assert dbsm(rc.shapes.cylinder(radius, length)) == pytest.approx(expected, abs=0.2)


def test_tilted_plate_has_the_lobes_of_its_side() -> None:
    side, tilt = 0.1, np.deg2rad([0.0, 0.5, 1.0, 2.1, 3.6])
    x = 2.0 * np.pi / WAVELENGTH * side * np.sin(tilt)
    expected = 4.0 * np.pi * side**4 / WAVELENGTH**2 * (np.cos(tilt) * np.sinc(x / np.pi)) ** 2
    got = rc.rcs(rc.shapes.plate(side, side), FREQUENCY, horizontal(tilt))
    np.testing.assert_allclose(10 * np.log10(got), 10 * np.log10(expected), atol=0.1)


def test_plate_mirrors_into_another_direction_and_back() -> None:
    side, angle = 0.1, np.deg2rad(40.0)
    plate, there, back = rc.shapes.plate(side, side), horizontal(angle), horizontal(-angle)
    expected = 10.0 * np.log10(4.0 * np.pi * (side**2 * np.cos(angle) / WAVELENGTH) ** 2)
    for polarization in (None, "vertical", "horizontal"):
        for directions, receiver in ((there, back), (back, there)):
            got = dbsm(plate, directions, receiver=receiver, polarization=polarization)
            assert got == pytest.approx(expected, abs=0.01)
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
    np.testing.assert_allclose(both, expected, atol=1.0)
    facing = dbsm(rc.shapes.dihedral(0.1), horizontal(0.25 * np.pi), max_bounces=2)
    assert facing == pytest.approx(17.0187, abs=0.1)


def test_directions_come_one_by_one_or_many_and_threads_do_not_matter() -> None:
    mesh, azimuth = rc.shapes.trihedral(0.05), np.deg2rad([0.0, 5.0, 11.0])
    together = rc.rcs(mesh, FREQUENCY, horizontal(azimuth), max_bounces=3, threads=3)
    for direction, expected in zip(horizontal(azimuth), together, strict=True):
        assert rc.rcs(mesh, FREQUENCY, direction, max_bounces=3, threads=1).tolist() == [expected]
    assert rc.rcs(mesh, FREQUENCY, np.zeros((0, 3))).shape == (0,)
    edge_on = rc.rcs(rc.shapes.plate(0.1, 0.1), FREQUENCY, [0.0, 1.0, 0.0])
    assert edge_on.tolist() == [0.0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"directions": [[2.0, 0.0, 0.0]]}, "directions: expected unit vectors, got one of length 2"),
        ({"directions": [1.0, 0.0]}, "directions: expected shape"),
        ({"directions": [FRONT] * 2, "receiver": [FRONT] * 3}, "directions: expected shape"),
        ({"frequency": -1.0}, "frequency: expected a positive number"),
        ({"polarization": "slant"}, "polarization: expected 'vertical', 'horizontal' or a unit vector, got 'slant'"),
        ({"max_bounces": 0}, "max_bounces: expected at least 1, got 0"),
    ],
)
def test_silly_questions_are_refused(options: dict[str, Any], message: str) -> None:
    settings: dict[str, Any] = {"frequency": FREQUENCY, "directions": FRONT} | options
    with pytest.raises(ValueError, match=message):
        rc.rcs(rc.shapes.plate(0.1, 0.1), settings.pop("frequency"), settings.pop("directions"), **settings)
