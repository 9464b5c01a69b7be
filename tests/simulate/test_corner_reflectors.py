"""Corner reflectors against answers known on paper."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from bounce_scenes import (
    CONDUCTOR,
    FREQUENCY,
    POLARIZATIONS,
    WAVELENGTH,
    body,
    bounce_paths,
    cross_section_db,
    phasors,
    reflector_db,
    simulator,
    tone,
)
from proof.corners import NEAR, integral_near_db, near_db

# In the far field of the reflector, with at most 128 x 128 pixels.
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


@pytest.mark.parametrize("resolution", [3, 8, 33])
@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("sampling", FAR)
def test_pixels_that_look_along_a_fold_or_into_an_apex_return_as_much_as_others(
    sampling: str, order: int, resolution: int
) -> None:
    # An image within the corner: half its width and height are seen of what returns everything, and no rims.
    mesh = rc.shapes.dihedral(0.1) if order == 2 else rc.shapes.trihedral(0.1, shape="square")
    angle, side = np.rad2deg(0.05 / 100.0), 0.05
    sim = simulator(
        [body(mesh, [100.0, 0.0, 0.0])],
        field_of_view_deg=(angle, angle),
        resolution=resolution,
        max_bounces=3,
        sampling=sampling,
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


def test_near_trihedral_is_as_uncertain_as_the_page_says() -> None:
    """Three reflections from coarser points: 0.1 dB from all; frames have the number of mirror images, see above."""
    difference = integral_near_db(0.5, 1.75e-3, reflections=3) - near_db(0.5)
    assert difference == pytest.approx(4.6, abs=0.2)
    assert integral_near_db(100.0, 1.75e-3, reflections=3) == pytest.approx(0.0, abs=0.5)


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
